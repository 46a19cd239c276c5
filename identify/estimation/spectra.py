"""Covariance of least squares whose rows have coloured noise, by the noise's power in bands of frequency.

White noise tells a parameter as well from slow columns as from fast ones. Filtered rows, the noise of a position that
was differentiated twice, and what a model leaves out are not white. Each group of rows (a joint; the windows of the
energy model) is taken to have noise that is stationary where the joint moves, of even power S_b within a band b of
frequencies. Then WᵀΩW = Σ_b S_b G_b, with G_b = Σ_f W̃(f)ᴴW̃(f) over the band and Σ_b G_b = WᵀW (Parseval). It is the
sandwich covariance of Newey & West (1987) with the spectrum (Whittle 1953) in place of lags: never negative, and with
far fewer numbers to estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

EDGES = (0.05, 0.1, 0.2, 0.4, 0.7)
"""Where bands end, in shares of the highest frequency: narrow where models err and columns have their power."""

BANDS = len(EDGES) + 1

LEAST_FREE = 12.0
"""A band with fewer degrees of freedom left by the fit shares its neighbour's noise."""


@dataclass(frozen=True)
class Spectra:
    """Products of the columns in each band: products (groups, BANDS, p, p), whose sum over bands is WᵀW; stretches:
    numbers of consecutive rows that were transformed together, whose sum is that of all rows."""

    products: np.ndarray
    stretches: tuple[int, ...]


def bands(rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Of the transform of that many real rows: each frequency's band, and how many coefficients it stands for."""
    share = 2 * np.arange(rows // 2 + 1 if rows else 0) / max(rows, 1)
    count = np.full(len(share), 2.0)
    count[:1] = 1.0
    if rows % 2 == 0:
        count[-1:] = 1.0
    return np.searchsorted(EDGES, share), count


def transformed(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(2 f, c) real and imaginary parts of the transform of x (rows, c), scaled so that squares sum up to those of x;
    and the band (2 f,) of each."""
    band, count = bands(len(x))
    if not len(x):
        return np.zeros((0, x.shape[1])), band
    found = np.fft.rfft(x, axis=0, norm="ortho") * np.sqrt(count)[:, None]
    return np.concatenate([found.real, found.imag]), np.tile(band, 2)


def band_products(x: np.ndarray) -> np.ndarray:
    """(BANDS, c, c) products of the columns x (rows, c) of consecutive rows in each band."""
    values, band = transformed(x)
    return np.array([part.T @ part for part in (values[band == b] for b in range(BANDS))])


def band_powers(residual: np.ndarray, stretches: Sequence[int]) -> np.ndarray:
    """(BANDS, groups) sums of squares of the residual (rows, groups) in each band."""
    total = np.zeros((BANDS, residual.shape[1]))
    for part in np.split(residual, np.cumsum(stretches)[:-1]):
        values, band = transformed(part)
        for b in range(BANDS):
            total[b] += (values[band == b] ** 2).sum(axis=0)
    return total


def coloured_covariance(
    inverse: np.ndarray, weights: np.ndarray, spectra: Spectra, residual: np.ndarray, counted: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Covariance (p, p) of the least-squares solution, and the noise's variance in each band (groups, BANDS).

    inverse (p, p): of Σ_j weights_j² W_jᵀW_j. residual, counted (rows, groups): left by the solution, not weighted, and
    the share of each row that is not masked. A band's power is counted against the degrees of freedom that the fit
    leaves in it, which is what makes up for a fit that follows the noise where its columns are.
    """
    power = band_powers(residual, spectra.stretches).T
    size = np.zeros(BANDS)
    for rows in spectra.stretches:
        band, count = bands(rows)
        size += np.bincount(band, count, BANDS)
    taken = np.einsum("j,jbkl,kl->jb", weights**2, spectra.products, inverse, optimize=True)
    free = counted.mean(axis=0)[:, None] * size - taken
    variance = np.array([_even(p, f) for p, f in zip(power, free, strict=True)])
    middle = np.einsum("j,jb,jbkl->kl", weights**4, variance, spectra.products, optimize=True)
    # By its root, so that rounding makes no variance negative where parameters can hardly be told apart.
    scale = np.sqrt(np.maximum(np.diag(middle), 1e-300))
    values, vectors = np.linalg.eigh(middle / np.outer(scale, scale))
    root = (inverse * scale) @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    return root @ root.T, variance


def _even(power: np.ndarray, free: np.ndarray) -> np.ndarray:
    """(BANDS,) power over degrees of freedom, bands with too few of them joined to the next ones."""
    variance = np.empty(len(power))
    start = 0
    for stop in range(1, len(power) + 1):
        enough = free[start:stop].sum() >= LEAST_FREE and free[stop:].sum() >= LEAST_FREE
        if enough or stop == len(power):
            variance[start:stop] = power[start:stop].sum() / max(free[start:stop].sum(), 1.0)
            start = stop
    return variance
