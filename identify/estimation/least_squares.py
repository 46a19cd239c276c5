"""Ordinary and weighted least squares, with standard deviations that count effective samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.errors import UnsupportedLogError
from identify.estimation.observation import Observation

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
    of them count as independent.
    """

    names: tuple[str, ...]
    parameters: np.ndarray
    covariance: np.ndarray
    condition_number: float
    sigma: np.ndarray
    inflation: np.ndarray
    rows: int
    effective_samples: float

    @property
    def std(self) -> np.ndarray:
        """(p,) standard deviations of the parameters."""
        return np.sqrt(np.diag(self.covariance))


def ordinary_least_squares(observation: Observation) -> Estimate:
    """OLS over all joints' rows together, in their own units; each joint still has a noise of its own."""
    return _solve(observation, np.ones(len(observation.matrix)))


def weighted_least_squares(observation: Observation, passes: int = 1) -> Estimate:
    """WLS: each joint's rows divided by the standard deviation of its residual in the pass before (Gautier 1997)."""
    weights = np.ones(len(observation.matrix))
    estimate = _solve(observation, weights)
    for _ in range(passes):
        estimate = _solve(observation, 1 / np.maximum(estimate.sigma, 1e-12))
    return estimate


def _solve(observation: Observation, weights: np.ndarray) -> Estimate:
    w = np.vstack([a * x for a, x in zip(observation.matrix, weights, strict=True)])
    y = np.concatenate([b * x for b, x in zip(observation.effort, weights, strict=True)])
    p = w.shape[1]
    inverse, condition, parameters = scaled_solution(w, y, observation.names)
    counts = np.maximum(observation.weight.sum(axis=0) - p / len(weights), 1.0)
    residuals = [b - a @ parameters for a, b in zip(observation.matrix, observation.effort, strict=True)]
    sigma = np.sqrt(np.array([r @ r for r in residuals]) / counts)
    inflation = np.array([rows_per_effective_sample(r, observation.rate) for r in residuals])
    # Sandwich: a joint's rows were weighted by x², have variance sigma² and count once in `inflation`.
    middle = np.zeros((p, p))
    for a, x, s, f in zip(observation.matrix, weights, sigma, inflation, strict=True):
        middle += x**4 * s**2 * f * (a.T @ a)
    covariance = inverse @ middle @ inverse
    return Estimate(
        names=observation.names,
        parameters=parameters,
        covariance=covariance,
        condition_number=condition,
        sigma=sigma,
        inflation=inflation,
        rows=len(y),
        effective_samples=float((observation.weight.sum(axis=0) / inflation).sum()),
    )


def scaled_solution(w: np.ndarray, y: np.ndarray, names: tuple[str, ...]) -> tuple[np.ndarray, float, np.ndarray]:
    """((WᵀW)⁻¹, condition number of the column-scaled W, least-squares solution) by SVD of the scaled columns.

    UnsupportedLogError names the parameters that the rows say nothing about.
    """
    scale = np.linalg.norm(w, axis=0)
    silent = [name for name, s in zip(names, scale, strict=True) if s <= 1e-9 * scale.max()]
    if silent:
        raise UnsupportedLogError(
            f"the motion says nothing about {', '.join(silent[:6])}{' …' if len(silent) > 6 else ''}: "
            "move every joint, faster and together with the others (`identify excite` designs such a motion)"
        )
    if len(w) <= w.shape[1]:
        raise UnsupportedLogError(f"{len(w)} equations are left for {w.shape[1]} parameters: record a longer motion")
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
