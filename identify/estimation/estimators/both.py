"""Energy and torque together: the rows of both models, each in units of its own noise, solved as one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.estimation.energy import row_variance
from identify.estimation.estimators.problem import Problem
from identify.estimation.least_squares import (
    Estimate,
    estimate_of,
    rows_per_effective_sample,
    scaled_solution,
    weights_by_noise,
)

PASSES = 2
"""Times that the energy rows' noise is told anew from the residuals of the solution before."""


def both(problem: Problem) -> Estimate:
    """Least squares over the rows of both models; further forms of friction take their part of the work.

    Both are made of the same samples, so that their errors are correlated. With A and B the parts of the solution's
    error that stem from either, E(A + B)(A + B)ᵀ ⪯ (1 + 1/c)·EAAᵀ + (1 + c)·EBBᵀ for every c > 0. The covariance is
    this bound, at the c for which its trace in units of the variances is least.
    """
    reduction, work = problem.reduction, problem.work
    weights = weights_by_noise(reduction)
    torque = estimate_of(reduction, weights, problem.residual)
    w, y = reduction.weighted(weights)
    rows = reduction.equations + len(work.work)
    parameters, variance = torque.parameters, np.ones(len(work.work))
    for _ in range(PASSES):
        root = np.sqrt(row_variance(work, work.work - work.matrix @ parameters, variance))
        variance = root**2
        energy, wanted = work.matrix / root[:, None], work.work / root
        stacked = np.concatenate([w, energy]), np.concatenate([y, wanted])
        inverse, condition, parameters = scaled_solution(*stacked, reduction.names, rows)
    left = wanted - energy @ parameters
    inflation = rows_per_effective_sample(left, work.rate)
    normal = w.T @ w
    of_torque = inverse @ normal @ torque.covariance @ normal @ inverse
    of_energy = inverse @ (energy.T @ energy) @ inverse * (left @ left / len(left) * inflation)
    unit = np.diag(of_torque)
    ratio = np.sqrt(np.sum(np.diag(of_energy) / unit) / len(unit))
    covariance = (1 + ratio) * of_torque + (1 + 1 / max(ratio, 1e-12)) * of_energy
    assert torque.noise is not None
    return replace(
        torque,
        parameters=parameters,
        covariance=covariance,
        condition_number=condition,
        rows=rows,
        noise=replace(torque.noise, covariance=covariance, textbook=np.sqrt(np.diag(inverse))),
    )
