"""Durbin-Watson and Ljung-Box against their definitions, and the words against noise of known colour."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from identify.estimation.correlation import correlated_pairs, correlations
from identify.estimation.noise import LAGS, Noise, autocorrelation
from identify.estimation.whiteness import Whiteness, whiteness


def found(residual: np.ndarray) -> list[Whiteness]:
    counted = np.full(residual.shape[1], float(len(residual)))
    nothing = np.zeros((residual.shape[1], 6))
    return whiteness(Noise(np.eye(1), np.ones(1), nothing, autocorrelation(residual), counted, 20.0))


def test_figures_are_their_definitions() -> None:
    x = lfilter([1.0], [1, -0.5], np.random.default_rng(1).normal(size=900))
    (row,) = found(x[:, None])
    differences = np.sum(np.diff(x) ** 2) / np.sum(x**2)
    assert row.durbin_watson == pytest.approx(differences, abs=0.01)  # but for the two ends
    rho = [np.sum(x[k:] * x[:-k]) / np.sum(x**2) for k in range(1, LAGS + 1)]
    q = 900 * 902 * sum(r**2 / (900 - k) for k, r in enumerate(rho, 1))
    assert row.ljung_box == pytest.approx(q, rel=1e-9)
    assert row.chance == pytest.approx(chi2.sf(q, LAGS), rel=1e-6)


def test_white_noise_is_called_white_about_as_often_as_the_test_says() -> None:
    rows = found(np.random.default_rng(2).normal(size=(600, 400)))
    assert 0.975 <= np.mean([row.told.startswith("white") for row in rows]) <= 1.0
    assert np.mean([row.chance < 0.1 for row in rows]) == pytest.approx(0.1, abs=0.04)


@pytest.mark.parametrize(("rho", "word"), [(0.6, "err alike"), (-0.5, "opposite ways"), (0.15, "slightly")])
def test_colour_is_told_in_words(rho: float, word: str) -> None:
    x = lfilter([1.0], [1, -rho], np.random.default_rng(3).normal(size=3000))
    assert word in found(x[:, None])[0].told


def test_a_joint_without_residuals_is_no_error() -> None:
    for rows in (50, 1, 0):
        (row,) = found(np.zeros((rows, 1)))
        assert (row.chance, row.neighbours) == (1.0, 0.0)


def test_correlated_pairs_come_in_their_order() -> None:
    factor = np.random.default_rng(4).normal(size=(5, 5))
    scale = np.array([1.0, 1e3, 1e-4, 2.0, 5.0])
    covariance = factor @ factor.T * np.outer(scale, scale)
    correlation = covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    np.testing.assert_allclose(correlations(covariance), correlation, rtol=1e-12)
    pairs = correlated_pairs(covariance, 4)
    sizes = [abs(x) for _, _, x in pairs]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] == pytest.approx(np.abs(correlation - np.eye(5)).max())
    assert all(i < j and correlation[i, j] == pytest.approx(x) for i, j, x in pairs)
