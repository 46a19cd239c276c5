"""The covariance of coloured noise: Parseval, white noise's textbook, and known spectra under slow and fast columns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from identify.estimation.noise import Noise, noise_of_rows
from identify.estimation.spectra import BANDS, Spectra, band_powers, band_products, bands, coloured_covariance


@pytest.mark.parametrize("rows", [1, 2, 7, 40, 401])
def test_bands_split_what_parseval_adds_up(rows: int) -> None:
    x = np.random.default_rng(rows).normal(size=(rows, 3)) + 2.0
    np.testing.assert_allclose(band_products(x).sum(axis=0), x.T @ x, rtol=1e-12)
    np.testing.assert_allclose(band_powers(x, (rows,)).sum(axis=0), (x**2).sum(axis=0), rtol=1e-12)
    assert bands(rows)[1].sum() == rows


def test_a_sine_is_in_the_band_of_its_frequency() -> None:
    t = np.arange(400)
    for share, band in ((0.02, 0), (0.07, 1), (0.15, 2), (0.3, 3), (0.5, 4), (0.9, 5)):
        powers = band_powers(np.sin(np.pi * share * t)[:, None], (400,))[:, 0]
        assert powers.argmax() == band
        assert powers[band] > 0.95 * powers.sum()


def test_no_rows_have_no_power() -> None:
    assert not band_products(np.zeros((0, 2))).any()
    assert band_powers(np.ones((3, 1)), (3, 0)).sum() == pytest.approx(3, rel=1e-12)


def solved(w: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, Noise]:
    inverse = np.linalg.inv(w.T @ w)
    theta = inverse @ w.T @ y
    return theta, noise_of_rows(inverse, w, y - w @ theta, 20.0)


def columns(rows: int) -> np.ndarray:
    """Slow and fast columns of unequal size, and a constant."""
    t = np.arange(rows)
    turns = (0.011, 0.023, 0.31, 0.43)
    return np.column_stack([np.ones(rows), *((k + 1) * np.cos(2 * np.pi * f * t + k) for k, f in enumerate(turns))])


def test_white_noise_gives_the_textbook() -> None:
    w, rng = columns(3000), np.random.default_rng(1)
    _, noise = solved(w, w @ np.arange(1.0, 6.0) + rng.normal(size=3000))
    np.testing.assert_allclose(np.sqrt(np.diag(noise.covariance)), noise.textbook, rtol=0.12)
    np.testing.assert_allclose(noise.textbook, np.sqrt(np.diag(np.linalg.inv(w.T @ w))), rtol=0.05)


@pytest.mark.parametrize("rho", [0.7, -0.6])
def test_stated_deviations_are_the_spread_under_coloured_noise(rho: float) -> None:
    """AR(1) noise: slow columns are told worse, or better, than by the textbook, and the fastest the other way round.
    The stated σ follows: within 15 %, as the spectrum is taken to be even within a band."""
    rows, rng = 600, np.random.default_rng(2)
    w = columns(rows)
    found = []
    for _ in range(500):
        raw = rng.normal(size=rows + 100)
        found.append(solved(w, w @ np.arange(1.0, 6.0) + lfilter([1.0], [1, -rho], raw)[100:]))
    seen = np.std([theta for theta, _ in found], axis=0)
    stated = np.sqrt(np.mean([np.diag(noise.covariance) for _, noise in found], axis=0))
    textbook = np.mean([noise.textbook for _, noise in found], axis=0)
    np.testing.assert_allclose(stated / seen, 1.0, atol=0.15)
    slow, fast = (textbook / seen)[:3], (textbook / seen)[4]
    assert (slow < 0.7).all() if rho > 0 else (slow > 1.3).all()
    assert fast > 1.3 if rho > 0 else fast < 0.75
    np.testing.assert_allclose(np.mean([n.autocorrelation[0, 0] for _, n in found]), rho, atol=0.03)


def test_what_the_fit_takes_from_a_band_is_made_up_for() -> None:
    """40 of 240 coefficients of white noise are fitted, all of them slow: its variance comes out as it is, 1."""
    rows, rng = 240, np.random.default_rng(3)
    t = np.arange(rows)
    w = np.concatenate([[f(2 * np.pi * k * t / rows) for f in (np.cos, np.sin)] for k in range(1, 21)]).T
    inverse = np.linalg.inv(w.T @ w)
    spectra = Spectra(band_products(w)[None], (rows,))
    variances = []
    for _ in range(200):
        y = rng.normal(size=rows)
        left = y - w @ (inverse @ (w.T @ y))
        variances.append(coloured_covariance(inverse, np.ones(1), spectra, left[:, None], np.ones((rows, 1)))[1][0])
    assert np.array(variances).shape == (200, BANDS)
    np.testing.assert_allclose(np.mean(variances, axis=0), 1.0, atol=0.08)
