"""Essential parameters: the F-test is that of nested least squares, and what is truly nothing is dropped."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import f as f_distribution

from identify.estimation.essential import RATIO, SIGNIFICANCE, essential_parameters

ROWS = 400


def estimated(
    truth: np.ndarray, seed: int, spread: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Correlated columns (ROWS, p) and y with unit noise; the solution and its textbook covariance."""
    rng = np.random.default_rng(seed)
    p = len(truth)
    w = rng.normal(size=(ROWS, p)) @ (np.eye(p) + 0.15 * rng.normal(size=(p, p))) * spread
    y = w @ truth + rng.normal(size=ROWS)
    inverse = np.linalg.inv(w.T @ w)
    x = inverse @ w.T @ y
    left = y - w @ x
    return w, y, x, inverse * (left @ left) / (ROWS - p)


TRUTH = np.array([30.0, 0.0, -8.0, 0.001, 5.0, 0.0])


def test_the_test_is_the_f_test_of_nested_least_squares() -> None:
    """Each probability and the reduced estimate are those of refitting without the columns dropped."""
    w, y, x, covariance = estimated(TRUTH, 1)
    found = essential_parameters(x, covariance, ROWS)
    assert len(found.dropped) >= 2
    full = np.sum((y - w @ x) ** 2)
    out: list[int] = []
    for index, chance in found.dropped:
        out.append(index)
        kept = [k for k in range(len(x)) if k not in out]
        reduced = np.linalg.lstsq(w[:, kept], y, rcond=None)[0]
        more = np.sum((y - w[:, kept] @ reduced) ** 2) - full
        statistic = more / len(out) / (full / (ROWS - len(x)))
        assert chance == pytest.approx(f_distribution.sf(statistic, len(out), ROWS - len(x)), rel=1e-7)
        assert chance >= SIGNIFICANCE
    np.testing.assert_allclose(found.parameters[kept], reduced, rtol=1e-9)
    inverse = np.linalg.inv(w[:, kept].T @ w[:, kept]) * full / (ROWS - len(x))
    np.testing.assert_allclose(found.covariance[np.ix_(kept, kept)], inverse, rtol=1e-8, atol=1e-14)
    assert not found.parameters[out].any()
    assert not found.covariance[out].any()
    assert found.kept == tuple(kept)


def test_what_is_nothing_is_dropped_and_what_counts_is_kept() -> None:
    kept = [essential_parameters(*estimated(TRUTH, seed)[2:], ROWS).kept for seed in range(40)]
    assert all({0, 2, 4} <= set(k) for k in kept)
    assert sum(set(k) == {0, 2, 4} for k in kept) > 25


def test_nothing_is_dropped_where_all_are_known_alike() -> None:
    _, _, x, covariance = estimated(np.array([3.0, -2.0, 4.0]), 2)
    found = essential_parameters(x, covariance, ROWS)
    assert (found.kept, found.dropped, found.refused) == ((0, 1, 2), (), None)
    assert found.ratio <= RATIO
    np.testing.assert_array_equal(found.parameters, x)


def test_a_parameter_that_is_there_is_not_let_go_by_the_test() -> None:
    """Known to 25 % and thus beyond doubt, beside one that is known 1,000 times better."""
    found = essential_parameters(np.array([1000.0, 4.0]), np.diag([1.0, 0.05]) ** 2 * np.array([1.0, 400.0]), 500.0)
    assert found.dropped == ()
    assert found.refused is not None
    index, chance = found.refused
    assert index == 1
    assert chance == pytest.approx(f_distribution.sf(16.0, 1, 498), rel=1e-9)
    assert found.ratio == pytest.approx(250.0)
