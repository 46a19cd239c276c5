"""Tests of differences, against SciPy's distributions and against closed testing written out."""

from __future__ import annotations

from itertools import combinations
from math import inf

import numpy as np
import pytest
from scipy import stats

from identify.validation.significance import LEVEL, common_factor, holm, joint_test, sign_test, single_p


def covariance(m: int, seed: int = 0) -> np.ndarray:
    """A covariance (m, m) with strong correlations and scales of many sizes."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(m, m)) * 10.0 ** rng.integers(-4, 4, size=(m, 1))
    return root @ root.T


@pytest.mark.parametrize("freedom", [7.5, 300.0, inf])
def test_all_at_once_is_the_quadratic_form_and_its_distribution(freedom: float) -> None:
    c = covariance(5)
    d = np.linalg.cholesky(c) @ np.random.default_rng(1).normal(size=5)
    found = joint_test(d, c, freedom)
    assert found is not None
    scale = np.sqrt(np.diag(c))
    expected = (d / scale) @ np.linalg.solve(c / np.outer(scale, scale), d / scale)
    assert found.combinations == 5
    assert found.statistic == pytest.approx(expected, rel=1e-8)
    chance = stats.chi2.sf(expected, 5) if freedom == inf else stats.f.sf(expected / 5, 5, freedom)
    assert found.p == pytest.approx(chance, rel=1e-7)


def test_units_and_mixtures_of_parameters_change_nothing_and_what_has_no_variance_is_left_out() -> None:
    c, rng = covariance(4, 2), np.random.default_rng(3)
    d = np.linalg.cholesky(c) @ rng.normal(size=4)
    plain = joint_test(d, c)
    mixed = rng.normal(size=(4, 4))
    other = joint_test(mixed @ d, mixed @ c @ mixed.T)
    twice = np.vstack([np.eye(4), np.ones((1, 4)) / np.sqrt(np.diag(c)), np.zeros((1, 4))])
    repeated = joint_test(twice @ d, twice @ c @ twice.T)
    assert plain is not None
    assert other is not None
    assert repeated is not None
    assert other.statistic == pytest.approx(plain.statistic, rel=1e-5)
    assert (repeated.combinations, repeated.statistic) == (4, pytest.approx(plain.statistic, rel=1e-5))
    assert joint_test(np.ones(2), np.zeros((2, 2))) is None


def test_where_nothing_differs_chances_are_even() -> None:
    c, rng = covariance(6, 4), np.random.default_rng(5)
    root = np.linalg.cholesky(c)
    chances = [joint_test(root @ rng.normal(size=6), c).p for _ in range(800)]  # type: ignore[union-attr]
    assert stats.kstest(chances, "uniform").pvalue > 0.01


@pytest.mark.parametrize("freedom", [4.0, inf])
def test_single_chances(freedom: float) -> None:
    z = np.array([-3.1, -0.2, 0.0, 1.7, 12.0])
    law = stats.norm if freedom == inf else stats.t(freedom)
    np.testing.assert_allclose(single_p(z, freedom), 2 * law.sf(np.abs(z)), rtol=1e-10)


def test_holm_is_closed_testing_with_bonferroni() -> None:
    rng = np.random.default_rng(6)
    for m in range(7):
        p = rng.random(m) ** 3
        expected = [
            max(
                min(1.0, len(chosen) * min(p[list(chosen)]))
                for size in range(1, m + 1)
                for chosen in combinations(range(m), size)
                if i in chosen
            )
            for i in range(m)
        ]
        np.testing.assert_allclose(holm(p), expected, rtol=1e-14)


def test_a_family_names_a_wrong_one_as_seldom_as_it_says() -> None:
    rng = np.random.default_rng(7)
    root = np.linalg.cholesky(np.eye(20) + 0.6)
    z = rng.normal(size=(3000, 20)) @ root.T / np.sqrt(1.6)
    wrong = sum(bool((holm(single_p(row)) < LEVEL).any()) for row in z)
    assert wrong / 3000 <= LEVEL + 3 * np.sqrt(LEVEL / 3000)
    assert (holm(single_p(np.array([0.3, -1.1, 9.0]))) < LEVEL).tolist() == [False, False, True]


@pytest.mark.parametrize(("better", "worse"), [(0, 0), (6, 0), (5, 1), (13, 18), (31, 31)])
def test_the_sign_test_is_the_binomial_one(better: int, worse: int) -> None:
    expected = stats.binomtest(better, better + worse).pvalue if better + worse else 1.0
    assert sign_test(better, worse) == pytest.approx(expected, rel=1e-12)


def test_the_common_factor_is_that_of_the_many_not_of_the_few() -> None:
    z = np.random.default_rng(8).normal(size=4000)
    assert common_factor(z) == 1.0
    assert common_factor(0.3 * z) == 1.0
    z = 2.5 * z
    z[:1200] *= 100
    assert common_factor(z) == pytest.approx(2.5 * stats.norm.ppf(0.5 + 0.125 / 0.7) / stats.norm.ppf(0.625), rel=0.1)
    assert common_factor(np.empty(0)) == 1.0
