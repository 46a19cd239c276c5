"""Iteratively reweighted least squares: rows that fit badly count for less (Huber 1964; Beaton & Tukey 1974)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from identify.estimation.estimators.problem import Problem
from identify.estimation.least_squares import Estimate, estimate_of, solution, weights_by_noise
from identify.estimation.reduction import reduced

HUBER, TUKEY = 1.345, 4.685
"""Residuals, in standard deviations, from which rows lose weight; or have none. 95 % efficient on Gaussian noise."""

NORMAL = 1.4826
"""Standard deviation of Gaussian noise over the median of its absolute value."""

PASSES = 20
CLOSE = 1e-3
"""Passes end when no parameter moves by more than this share of its standard deviation."""

Shares = Callable[[np.ndarray], np.ndarray]


def huber(problem: Problem) -> Estimate:
    """Rows beyond HUBER standard deviations count in inverse proportion to their residual."""
    return _reweighted(problem, lambda z: HUBER / np.maximum(np.abs(z), HUBER))


def tukey(problem: Problem) -> Estimate:
    """Bisquare: rows beyond TUKEY standard deviations do not count at all. Starts from `huber`'s solution."""
    start = huber(problem).parameters
    return _reweighted(problem, lambda z: np.maximum(1 - (z / TUKEY) ** 2, 0.0) ** 2, start)


def _reweighted(problem: Problem, weight: Shares, start: np.ndarray | None = None) -> Estimate:
    """Solutions with each row's share by its residual in the one before, in standard deviations of its joint."""
    reduction = problem.reduction
    counted = reduction.weight > 0.5
    parameters = solution(reduction, weights_by_noise(reduction))[2] if start is None else start
    for _ in range(PASSES):
        residual = problem.residual(parameters)
        sigma = np.array([_spread(r[rows]) for r, rows in zip(residual.T, counted.T, strict=True)])
        shares = np.sqrt(weight(residual / sigma))
        reduction = reduced(problem.blocks(), shares)
        inverse, _, new = solution(reduction, 1 / sigma)
        moved = np.max(np.abs(new - parameters) / np.sqrt(np.diag(inverse)))
        parameters = new
        if moved < CLOSE:
            break
    return estimate_of(reduction, 1 / sigma, lambda parameters: problem.residual(parameters) * shares)


def _spread(residual: np.ndarray) -> float:
    """Standard deviation of residuals, by their median absolute value."""
    return max(NORMAL * float(np.median(np.abs(residual))) if len(residual) else 0.0, 1e-12)
