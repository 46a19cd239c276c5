"""Direct and inverse dynamic model (DIDIM; Gautier, Janot & Vandanjon 2013): simulated effort fitted to measured.

Gauss–Newton on Γ − Γ_sim(θ), Γ_sim the effort of a simulation with θ in the same closed loop. As the controller holds
the simulated arm on nearly the same motion whatever θ is, the sensitivity ∂Γ_sim/∂θ is the regressor along the
simulated motion. No measured position is differentiated, or read at all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.estimation.estimators.problem import Problem
from identify.estimation.estimators.simulated import closed
from identify.estimation.least_squares import Estimate, estimate_of, weights_by_noise
from identify.estimation.observation import torque_blocks, torque_residual
from identify.estimation.reduction import reduced
from identify.logs.log import Log
from identify.logs.slicing import select


def didim(problem: Problem) -> Estimate:
    """Weighted least squares of Γ − Γ_sim, from the weighted least squares of the torque model on."""
    return closed(problem, lambda _, logs, parameters: _step(problem, logs, parameters))


def _step(problem: Problem, logs: list[Log], start: np.ndarray) -> Estimate:
    """The estimate after a Gauss–Newton step from the parameters (p,) whose simulated logs these are."""
    regressor, settings = problem.regressor, problem.settings
    gaps = []
    for log, run in zip(problem.logs, logs, strict=True):
        measured = select(log, run.joints)
        assert measured.effort is not None
        assert run.effort is not None
        gaps.append(replace(run, effort=measured.effort - run.effort))
    reduction = reduced(torque_blocks(regressor, gaps, settings))
    weights = weights_by_noise(reduction)
    found = estimate_of(reduction, weights, lambda step: torque_residual(regressor, gaps, settings, step))
    return replace(found, parameters=start + found.parameters)
