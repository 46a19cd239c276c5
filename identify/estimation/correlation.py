"""Which parameters a log can hardly tell apart: the most correlated pairs of estimates."""

from __future__ import annotations

import numpy as np


def correlations(covariance: np.ndarray) -> np.ndarray:
    """(p, p) correlation matrix of a covariance; 0 beside parameters without variance."""
    std = np.sqrt(np.diag(covariance))
    found = covariance / np.maximum(np.outer(std, std), 1e-300)
    return np.clip(found, -1.0, 1.0)


def correlated_pairs(covariance: np.ndarray, most: int) -> list[tuple[int, int, float]]:
    """The `most` pairs (i, j) of the largest correlation, i < j, with it, the largest first."""
    found = correlations(covariance)
    first, second = np.triu_indices(len(found), 1)
    order = np.argsort(-np.abs(found[first, second]), kind="stable")[:most]
    return [(int(first[k]), int(second[k]), float(found[first[k], second[k]])) for k in order]
