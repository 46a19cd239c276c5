"""What residuals tell of the noise: the covariance that follows, the textbook's beside it, and how white they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.estimation.spectra import Spectra, band_products, coloured_covariance

LAGS = 20
"""Lags of the autocorrelation, in rows."""

STRETCH = 512
"""Most rows that are transformed together."""


@dataclass(frozen=True)
class Noise:
    """The noise of the rows of a solution.

    covariance (p, p) of its parameters; textbook (p,): their standard deviations by σ²(WᵀW)⁻¹, as if rows were
    independent and weighted by their noise; variance (groups, bands) of the rows in each band of `spectra.EDGES`, in
    units of the rows; autocorrelation (groups, lags) of the residual at lags 1, 2 … of the rows; counted (groups,):
    number of rows that are not at rest; rate of the rows [Hz].
    """

    covariance: np.ndarray
    textbook: np.ndarray
    variance: np.ndarray
    autocorrelation: np.ndarray
    counted: np.ndarray
    rate: float


def coloured_noise(
    inverse: np.ndarray,
    weights: np.ndarray,
    spectra: Spectra,
    residual: np.ndarray,
    counted: np.ndarray,
    rate: float,
) -> Noise:
    """Noise of the solution of Σ_j weights_j² W_jᵀW_j, whose inverse (p, p) is; see `spectra.coloured_covariance`."""
    covariance, variance = coloured_covariance(inverse, weights, spectra, residual, counted)
    rows = counted.sum(axis=0)
    squares = ((residual * weights) ** 2).sum()
    textbook = np.sqrt(np.diag(inverse) * squares / max(rows.sum() - len(inverse), 1.0))
    return Noise(covariance, textbook, variance, autocorrelation(residual), rows, rate)


def noise_of_rows(inverse: np.ndarray, w: np.ndarray, residual: np.ndarray, rate: float) -> Noise:
    """Noise of the least-squares solution of a single group of rows, all in memory: w (rows, p), residual (rows,)."""
    parts = np.array_split(np.arange(len(w)), -(-len(w) // STRETCH))
    products = sum(band_products(w[part]) for part in parts)
    spectra = Spectra(np.asarray(products)[None], tuple(len(part) for part in parts))
    ones = np.ones((len(w), 1))
    return coloured_noise(inverse, np.ones(1), spectra, residual[:, None], ones, rate)


def autocorrelation(residual: np.ndarray) -> np.ndarray:
    """(groups, LAGS) autocorrelation of the residual (rows, groups) at lags of 1, 2 … rows; 0 where it is all zero."""
    power = np.maximum((residual**2).sum(axis=0), 1e-300)
    lags = range(1, LAGS + 1)
    return np.array([(residual[k:] * residual[: max(len(residual) - k, 0)]).sum(axis=0) / power for k in lags]).T
