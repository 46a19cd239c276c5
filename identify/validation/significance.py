"""Is a difference more than chance: tests of several parameters at once, and of many one by one."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

LEVEL = 0.05
"""Chance that a family of tests names at least one change where there is none."""

QUARTILE, SPREAD = 0.31863936396437515, 1.79
"""|z| that a quarter of normal values with unit standard deviation stay under; relative standard deviation of that of m
values, times √m."""

_SINGULAR = 1e-10
"""Eigenvalue of a correlation matrix, of the largest one, below which a combination has no variance of its own."""


@dataclass(frozen=True)
class JointTest:
    """statistic: dᵀC⁻¹d of a difference d with covariance C; combinations: its degrees of freedom; p: chance of a
    statistic at least as large where nothing differs."""

    statistic: float
    combinations: int
    p: float


def joint_test(difference: np.ndarray, covariance: np.ndarray, freedom: float = inf) -> JointTest | None:
    """Test of all m entries of a difference (m,) with covariance (m, m) together; None where none has a variance.

    freedom: degrees of freedom behind the covariance; the statistic over m follows F(m, freedom), and χ² where that
    is infinite. Combinations whose variance is nought but rounding are left out.
    """
    from scipy.special import chdtrc, fdtrc

    scale = np.sqrt(np.diag(covariance))
    known = scale > 0
    if not known.any():
        return None
    z = difference[known] / scale[known]
    values, vectors = np.linalg.eigh(covariance[np.ix_(known, known)] / np.outer(scale[known], scale[known]))
    kept = values > _SINGULAR * values[-1]
    statistic = float(((vectors.T @ z)[kept] ** 2 / values[kept]).sum())
    count = int(kept.sum())
    p = chdtrc(count, statistic) if freedom == inf else fdtrc(count, freedom, statistic / count)
    return JointTest(statistic, count, float(p))


def single_p(z: np.ndarray, freedom: float = inf) -> np.ndarray:
    """(m,) chance of an |z| at least as large where nothing differs: normal, or Student's t with `freedom`."""
    from scipy.special import ndtr, stdtr

    z = np.abs(np.asarray(z, dtype=float))
    return 2 * (ndtr(-z) if freedom == inf else stdtr(freedom, -z))


def holm(p: np.ndarray) -> np.ndarray:
    """(m,) chances p, one a test, corrected for being m; no independence is needed (Holm 1979).

    Where nothing differs, any below LEVEL appear in at most that share of cases.
    """
    p = np.asarray(p, dtype=float)
    order = np.argsort(p, kind="stable")
    factors = np.arange(len(p), 0, -1)
    corrected = np.empty(len(p))
    corrected[order] = np.minimum(np.maximum.accumulate(p[order] * factors), 1.0) if len(p) else p
    return corrected


def common_factor(z: np.ndarray) -> float:
    """How many times farther apart than chance has it the quarter of differences z (m,) in σ is that differs least.

    1 where two standard deviations of chance explain it; else either σ is too small throughout, or more than three
    quarters of the parameters have changed: a robust form of Birge's ratio (1932).
    """
    ratio = float(np.quantile(np.abs(z), 0.25)) / QUARTILE if len(z) else 1.0
    return ratio if ratio > 1 + 2 * SPREAD / np.sqrt(max(len(z), 1)) else 1.0


def sign_test(better: int, worse: int) -> float:
    """Chance that as uneven a split of better + worse comes about where either is as likely (two-sided)."""
    from scipy.special import bdtr

    total = better + worse
    return min(1.0, 2 * float(bdtr(min(better, worse), total, 0.5))) if total else 1.0
