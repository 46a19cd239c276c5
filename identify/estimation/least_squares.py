"""Ordinary and weighted least squares, with standard deviations that count effective samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from identify.errors import UnsupportedLogError
from identify.estimation.noise import Noise, coloured_noise
from identify.estimation.reduction import Reduction

SINGULAR = 1e-10
"""Singular values of the column-scaled matrix below this share of the largest count as zero."""

LONGEST_LAG_S = 1.0
"""Autocorrelation of the residual is summed up to its first crossing of zero, at most up to this lag [s]."""


@dataclass(frozen=True)
class Estimate:
    """Parameters with their uncertainty.

    parameters, std (p,); covariance (p, p); condition_number of the column-scaled matrix that was solved;
    sigma (groups,) residual standard deviation of each group of rows (joints; one group for energy) in the unit of
    its rows; inflation (groups,): rows per effective sample; rows, effective_samples: how many equations, and how many
    of them count as independent; noise: what is known of the rows' noise, None where nothing is.
    """

    names: tuple[str, ...]
    parameters: np.ndarray
    covariance: np.ndarray
    condition_number: float
    sigma: np.ndarray
    inflation: np.ndarray
    rows: int
    effective_samples: float
    noise: Noise | None = None

    @property
    def std(self) -> np.ndarray:
        """(p,) standard deviations of the parameters."""
        return np.sqrt(np.diag(self.covariance))


Residual = Callable[[np.ndarray], np.ndarray]
"""The rows' residuals (rows, n) for parameters (p,)."""


def ordinary_least_squares(reduction: Reduction, residual: Residual) -> Estimate:
    """OLS over all joints' rows together, in their own units; each joint still has a noise of its own."""
    return estimate_of(reduction, np.ones(len(reduction.factors)), residual)


def weighted_least_squares(reduction: Reduction, residual: Residual, passes: int = 1) -> Estimate:
    """WLS: each joint's rows divided by the standard deviation of its residual in the pass before (Gautier 1997)."""
    return estimate_of(reduction, weights_by_noise(reduction, passes), residual)


def weights_by_noise(reduction: Reduction, passes: int = 1) -> np.ndarray:
    """(n,) one over each joint's standard deviation, from as many passes of least squares, the first unweighted."""
    weights = np.ones(len(reduction.factors))
    for _ in range(passes):
        parameters = solution(reduction, weights)[2]
        weights = 1 / np.maximum(_sigma(reduction, reduction.residual_power(parameters)), 1e-12)
    return weights


def solution(reduction: Reduction, weights: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """`scaled_solution` of the rows, joint j's times weights[j]."""
    return scaled_solution(*reduction.weighted(weights), reduction.names, reduction.equations)


def _sigma(reduction: Reduction, power: np.ndarray) -> np.ndarray:
    """(n,) standard deviations of residuals whose squares sum up to power (n,)."""
    counts = reduction.weight.sum(axis=0) - len(reduction.names) / len(power)
    return np.sqrt(power / np.maximum(counts, 1.0))


def estimate_of(reduction: Reduction, weights: np.ndarray, residual: Residual) -> Estimate:
    """The solution of the rows, joint j's times weights[j], and the covariance that its residuals speak for."""
    inverse, condition, parameters = solution(reduction, weights)
    left = residual(parameters)
    sigma = _sigma(reduction, (left**2).sum(axis=0))
    inflation = np.array([rows_per_effective_sample(r, reduction.rate) for r in np.ascontiguousarray(left.T)])
    assert reduction.spectra is not None
    noise = coloured_noise(inverse, weights, reduction.spectra, left, reduction.weight, reduction.rate)
    return Estimate(
        names=reduction.names,
        parameters=parameters,
        covariance=noise.covariance,
        condition_number=condition,
        sigma=sigma,
        inflation=inflation,
        rows=reduction.equations,
        effective_samples=float((reduction.weight.sum(axis=0) / inflation).sum()),
        noise=noise,
    )


def scaled_solution(
    w: np.ndarray, y: np.ndarray, names: tuple[str, ...], equations: int | None = None
) -> tuple[np.ndarray, float, np.ndarray]:
    """((WᵀW)⁻¹, condition number of the column-scaled W, least-squares solution) by SVD of the scaled columns.

    equations: how many rows W stands for, where it is a factor of them. UnsupportedLogError names the parameters that
    the rows say nothing about.
    """
    equations = len(w) if equations is None else equations
    if len(w) > 2 * w.shape[1]:
        factor = np.asarray(np.linalg.qr(np.column_stack([w, y]), mode="r"))
        w, y = factor[:, :-1], factor[:, -1]
    scale = np.linalg.norm(w, axis=0)
    silent = [name for name, s in zip(names, scale, strict=True) if s <= 1e-9 * scale.max()]
    if silent:
        raise UnsupportedLogError(
            f"the motion says nothing about {', '.join(silent[:6])}{' …' if len(silent) > 6 else ''}: "
            "move every joint, faster and together with the others (`identify excite` designs such a motion)"
        )
    if equations <= w.shape[1]:
        raise UnsupportedLogError(f"{equations} equations are left for {w.shape[1]} parameters: record a longer motion")
    u, s, vt = np.linalg.svd(w / scale, full_matrices=False)
    if s[-1] < SINGULAR * s[0]:
        worst = [names[i] for i in np.argsort(-np.abs(vt[-1]))[:4]]
        raise UnsupportedLogError(
            f"the motion can't tell {', '.join(worst)} apart: the observation matrix is singular; "
            "use a motion that excites all joints (`identify excite` designs one)"
        )
    half = vt.T / s / scale[:, None]
    return half @ half.T, float(s[0] / s[-1]), half @ (u.T @ y)


def rows_per_effective_sample(residual: np.ndarray, rate: float) -> float:
    """1 + 2 Σ of the residual's autocorrelation up to its first zero crossing: at least 1 (Bartlett 1946)."""
    power = residual @ residual
    if power == 0 or len(residual) < 3:
        return 1.0
    longest = min(len(residual) - 1, max(1, round(LONGEST_LAG_S * rate)))
    total = 0.0
    for lag in range(1, longest + 1):
        correlation = residual[lag:] @ residual[:-lag] / power
        if correlation <= 0:
            break
        total += correlation
    return 1.0 + 2.0 * total
