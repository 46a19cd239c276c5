"""The observation matrix of the energy model: ∫ q̇ᵀΓ dt = Δh·K + what friction takes (Gautier & Khalil 1988).

One row a window, windows side by side. No acceleration is needed, and a joint at rest does no work, so that its unknown
friction at rest stays outside by itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identify.errors import UnsupportedLogError
from identify.estimation.least_squares import Estimate, rows_per_effective_sample, scaled_solution
from identify.estimation.noise import noise_of_rows
from identify.estimation.observation import END_S, Signals, signal_pieces
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.regressor.friction import Sign
from identify.regressor.regressor import Regressor
from identify.side_by_side import mapped

PASSES = 3
"""Times that the rows are weighted anew by the residuals of the solution before."""


@dataclass(frozen=True)
class EnergyObservation:
    """Rows of ∫ q̇ᵀΓ dt = W·θ: matrix (rows, p) and work (rows,) [J]; action (rows, n) ∫ q̇_j² dt, which is what a
    torque noise's variance is multiplied by; rate [Hz] of the rows; names (p,)."""

    matrix: np.ndarray
    work: np.ndarray
    action: np.ndarray
    rate: float
    names: tuple[str, ...]


def energy_observation(regressor: Regressor, log: Log, settings: Settings) -> EnergyObservation:
    """The log's energy rows over windows of settings.window_s, position low-passed at energy_cutoff_hz."""
    window = settings.window_s
    assert window is not None
    assert settings.energy_cutoff_hz is not None
    used = replace(settings, position_cutoff_hz=settings.energy_cutoff_hz)
    sign = used.sign if used.rest_counted else np.sign

    def rows(s: Signals) -> EnergyObservation | None:
        # A window belongs to the piece in which it starts, and may end in the next.
        width, end = max(1, round(window * s.rate)), round(END_S * s.rate)
        begin, stop = s.first + s.inside.start - end, s.first + s.inside.stop - end
        windows = (s.total - 2 * end - 1) // width
        edges = width * np.arange(max(0, -(-begin // width)), min(windows, -(-stop // width)) + 1) + end - s.first
        return _windows(regressor, s, edges, width, sign) if len(edges) > 1 else None

    pieces = signal_pieces(log, used, regressor, margin=window + 0.1)
    parts = [part for part in mapped(rows, pieces) if part is not None]
    if not parts:
        raise UnsupportedLogError(f"0 equations are left for {regressor.p} parameters: record a longer motion")
    return stacked_energy(parts)


def _windows(regressor: Regressor, s: Signals, edges: np.ndarray, width: int, sign: Sign) -> EnergyObservation:
    """The rows between consecutive edges, indices into the signals, `width` apart."""
    matrix = np.diff(regressor.energy(s.q[edges], s.dq[edges]), axis=0)
    inertial = len(regressor.base.names)
    power = regressor.power(s.dq, sign, s.slip, regressor.load(s.q, s.dq, s.ddq))
    matrix[:, inertial:] += _integrals(power[:, inertial:], s, edges)
    work = _integrals((s.dq * s.effort).sum(axis=1, keepdims=True), s, edges)[:, 0]
    return EnergyObservation(matrix, work, _integrals(s.dq**2, s, edges), s.rate / width, regressor.names)


def stacked_energy(observations: list[EnergyObservation]) -> EnergyObservation:
    """The rows of several parts as one observation."""
    return EnergyObservation(
        np.concatenate([o.matrix for o in observations]),
        np.concatenate([o.work for o in observations]),
        np.concatenate([o.action for o in observations]),
        observations[0].rate,
        observations[0].names,
    )


def energy_least_squares(observation: EnergyObservation) -> Estimate:
    """Weighted least squares over the windows: a row's variance is c0 + Σ_j c_j ∫ q̇_j² dt, with c ≥ 0 fitted to the
    squared residuals of the pass before (feasible generalised least squares)."""
    w, y = observation.matrix, observation.work
    rows = len(w)
    variance = np.ones(rows)
    for _ in range(PASSES + 1):
        root = np.sqrt(variance)
        inverse, condition, parameters = scaled_solution(w / root[:, None], y / root, observation.names)
        residual = y - w @ parameters
        variance = row_variance(observation, residual, variance)
        whitened = residual / root
    inflation = rows_per_effective_sample(whitened, observation.rate)
    noise = noise_of_rows(inverse, w / root[:, None], whitened, observation.rate)
    return Estimate(
        names=observation.names,
        parameters=parameters,
        covariance=noise.covariance,
        condition_number=condition,
        sigma=np.array([np.sqrt(np.mean(residual**2))]),
        inflation=np.array([inflation]),
        rows=rows,
        effective_samples=rows / inflation,
        noise=noise,
    )


def row_variance(observation: EnergyObservation, residual: np.ndarray, before: np.ndarray) -> np.ndarray:
    """(rows,) c0 + Σ_j c_j ∫ q̇_j² dt with c ≥ 0 nearest to the squared residuals (rows,), each counted by what its
    variance was taken for before."""
    from scipy.optimize import nnls

    action = observation.action
    explain = np.column_stack([np.full(len(action), action.mean() or 1.0), action])
    coefficients, _ = nnls(explain / before[:, None], residual**2 / before)
    return np.maximum(explain @ coefficients, max(1e-3 * float(np.mean(residual**2)), 1e-300))


def energy_residual_percent(observation: EnergyObservation, parameters: np.ndarray) -> float:
    """100·‖work − W·θ‖ / ‖work‖ over the windows [%]."""
    return float(
        100 * np.linalg.norm(observation.work - observation.matrix @ parameters) / np.linalg.norm(observation.work)
    )


def _integrals(rate_of: np.ndarray, s: Signals, edges: np.ndarray) -> np.ndarray:
    """(windows, c) integrals of (N, c) between consecutive edges, by the trapezoidal rule."""
    running = np.concatenate([np.zeros((1, rate_of.shape[1])), np.cumsum(rate_of[1:] + rate_of[:-1], axis=0)])
    return np.diff(running[edges], axis=0) / (2 * s.rate)
