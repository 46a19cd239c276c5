"""Filtered power: q̇ᵀΓ = d/dt (h·K) + what friction takes, low-passed on both sides (Gautier 1997).

Between the torque and the energy model: one row a sample as the latter has one a window, no acceleration of the joints,
but one derivative of their energies.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.errors import UnsupportedLogError
from identify.estimation.energy import EnergyObservation, energy_least_squares, stacked_energy
from identify.estimation.estimators.problem import Problem
from identify.estimation.least_squares import Estimate
from identify.estimation.observation import Thinning, signal_pieces
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.regressor.regressor import Regressor


def power(problem: Problem) -> Estimate:
    """Weighted least squares over the rows of power, noise of each by the motion in it."""
    settings = problem.windows
    rows = [power_observation(problem.plain, log, settings) for log in problem.logs]
    return energy_least_squares(stacked_energy(rows))


def power_observation(regressor: Regressor, log: Log, settings: Settings) -> EnergyObservation:
    """The log's rows of power [W] in place of work, (rows, p); action: low-passed q̇² (rows, n)."""
    assert settings.energy_cutoff_hz is not None
    # A joint at rest has no power: none of its rows need be left out.
    used = replace(settings, position_cutoff_hz=settings.energy_cutoff_hz, rest_counted=True)
    parts = []
    for s in signal_pieces(log, used):
        thin = Thinning.of(s, used)
        if thin.rows:
            change = np.gradient(regressor.energy(s.q, s.dq), 1 / s.rate, axis=0)
            matrix = thin((change + regressor.power(s.dq)).T).T
            work = thin((s.dq * s.effort).sum(axis=1)[None])[0]
            action = np.maximum(thin(s.dq.T**2).T, 0.0)
            parts.append(EnergyObservation(matrix, work, action, s.rate / thin.step, regressor.names))
    if not parts:
        raise UnsupportedLogError(f"0 equations are left for {regressor.p} parameters: record a longer motion")
    return stacked_energy(parts)
