"""Instrumental variables from a simulated closed loop (IDIM-IV; Janot, Vandanjon & Gautier 2014).

Noise of the position is in the observation matrix and, under feedback, in the effort too, which biases least squares.
The matrix Z along a simulation of the last estimate, same reference and same controller, is as W without noise:
θ = (ZᵀΛW)⁻¹ZᵀΛΓ, again until it stays.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from identify.estimation.estimators.problem import Problem
from identify.estimation.estimators.simulated import closed
from identify.estimation.least_squares import Estimate, estimate_of
from identify.estimation.observation import Observation, torque_blocks
from identify.estimation.reduction import reduced
from identify.logs.log import Log


def idim_iv(problem: Problem) -> Estimate:
    """IV estimate, from weighted least squares on; joints weighted by the residual of the pass before."""
    return closed(problem, lambda last, logs, _: _instrumented(problem, logs, 1 / np.maximum(last.sigma, 1e-12)))


def _instrumented(problem: Problem, logs: list[Log], weights: np.ndarray) -> Estimate:
    """θ by the instruments of simulated logs.

    θ = T·θ_Z with θ_Z the least-squares solution of the instruments' own rows and T = (ZᵀΛW)⁻¹ZᵀΛZ, so that the
    covariance is that of least squares on Z, with the residuals of θ, between T and Tᵀ.
    """
    regressor, settings = problem.regressor, problem.settings
    cross = np.zeros((regressor.robot.n, regressor.p, regressor.p))

    def rows() -> Iterator[Observation]:
        for measured, exact in zip(problem.blocks(), torque_blocks(regressor, logs, settings), strict=True):
            for product, z, w in zip(cross, exact.matrix, measured.matrix, strict=True):
                product += z.T @ w
            yield replace(measured, matrix=exact.matrix)

    reduction = reduced(rows())
    z, y = reduction.weighted(weights)
    mixed = np.einsum("j,jkl->kl", weights**2, cross)
    scale = np.linalg.norm(z, axis=0)
    unit = np.outer(scale, scale)
    parameters = np.linalg.solve(mixed / unit, (z.T @ y) / scale) / scale
    own = estimate_of(reduction, weights, lambda _: problem.residual(parameters))
    turn = np.linalg.solve(mixed / unit, (z.T @ z) / unit) * (scale / scale[:, None])
    return replace(own, parameters=parameters, covariance=turn @ own.covariance @ turn.T)
