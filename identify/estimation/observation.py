"""The observation matrix of the torque model: Γ = Y·θ over a log, filtered in parallel and decimated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.estimation.motion import decimated, differentiated, low_pass, uniform
from identify.estimation.settings import STILL, Settings
from identify.logs.log import Log
from identify.regressor.regressor import Regressor

WORKING_RATE_HZ = 400.0
"""Logs are brought down to about this rate, by a zero-phase low-pass, before regressors are built."""

CHUNK_S = 60.0
"""Length of the pieces in which a long log's regressor is built, so that memory does not grow with the log."""

MARGIN_S = 1.0
"""What is added on either side of a piece for the filters to settle; also cut, in part, from the log's ends."""

END_S = 0.1
"""Cut from both ends of every log, where zero-phase filters have no neighbours."""


@dataclass(frozen=True)
class Observation:
    """Rows of Γ = W·θ, joint by joint.

    matrix: n arrays (rows, p); effort: n arrays (rows,) [N·m or N]; time (rows,) [s] from the log's first sample;
    weight (rows, n): share of each row that is not at rest, in 0 … 1; rate of the rows [Hz]; names (p,).
    """

    matrix: tuple[np.ndarray, ...]
    effort: tuple[np.ndarray, ...]
    time: np.ndarray
    weight: np.ndarray
    rate: float
    names: tuple[str, ...]


@dataclass(frozen=True)
class Signals:
    """A log's filtered motion and raw effort at the working rate: all (N, n) but time (N,)."""

    time: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    effort: np.ndarray
    rate: float


def signals(log: Log, settings: Settings) -> Signals:
    """Position filtered and differentiated at the log's rate; then all is brought down to the working rate."""
    assert log.effort is not None
    time, (position, effort), rate = uniform(log, log.position, log.effort)
    q, dq, ddq = differentiated(position, settings.position_cutoff_hz, rate)
    factor = max(1, int(rate // WORKING_RATE_HZ))
    # The motion is already low-passed: taking every factor-th row of it is enough where the cut-off allows.
    rows = slice(None, None, factor)
    return Signals(time[rows], q[rows], dq[rows], ddq[rows], decimated(effort, factor, rate), rate / factor)


def moving(dq: np.ndarray, guard: int) -> np.ndarray:
    """(N, n) bool: the joint is faster than STILL, and with a guard, no rest or reversal is within `guard` samples.

    A fast reversal may fall between two samples, neither of them slow: a change of sign tells it.
    """
    from scipy.ndimage import maximum_filter1d

    still = np.abs(dq) <= STILL
    if not guard:
        return ~still
    reversal = dq[1:] * dq[:-1] < 0
    still[1:] |= reversal
    still[:-1] |= reversal
    return maximum_filter1d(still.astype(np.uint8), 2 * guard + 1, axis=0) == 0


def torque_observation(regressor: Regressor, log: Log, settings: Settings) -> Observation:
    """The log's observation matrix. Built in pieces, so that the full-rate regressor of a long log is never held."""
    s = signals(log, settings)
    n = regressor.robot.n
    counted = np.ones_like(s.dq, dtype=bool)
    if not settings.rest_counted:
        counted = moving(s.dq, round(settings.guard_s * s.rate))
    step = max(1, round(s.rate / settings.decimated_rate_hz))
    end, margin, chunk = (round(x * s.rate) for x in (END_S, MARGIN_S, CHUNK_S))
    matrices: list[list[np.ndarray]] = [[] for _ in range(n)]
    efforts: list[list[np.ndarray]] = [[] for _ in range(n)]
    weights = []
    keep = np.arange(end, len(s.time) - end, step)
    for start in range(0, len(s.time), chunk):
        inside = keep[(keep >= start) & (keep < start + chunk)]
        if not len(inside):
            continue
        piece = slice(max(0, start - margin), min(len(s.time), start + chunk + margin))
        y = regressor.torque(s.q[piece], s.dq[piece], s.ddq[piece], sign=settings.sign)
        rows = inside - piece.start
        mask = counted[piece]
        weights.append(low_pass(mask.astype(float), settings.effort_cutoff_hz, s.rate)[rows])
        for j in range(n):
            filtered = low_pass(y[:, j] * mask[:, j, None], settings.effort_cutoff_hz, s.rate)
            matrices[j].append(filtered[rows])
            efforts[j].append(low_pass(s.effort[piece, j] * mask[:, j], settings.effort_cutoff_hz, s.rate)[rows])
    return Observation(
        matrix=tuple(np.concatenate(x) for x in matrices),
        effort=tuple(np.concatenate(x) for x in efforts),
        time=s.time[keep],
        weight=np.clip(np.concatenate(weights), 0, 1),
        rate=s.rate / step,
        names=regressor.names,
    )


def stacked(observations: list[Observation]) -> Observation:
    """The rows of several logs as one observation."""
    first = observations[0]
    return Observation(
        matrix=tuple(np.concatenate([o.matrix[j] for o in observations]) for j in range(len(first.matrix))),
        effort=tuple(np.concatenate([o.effort[j] for o in observations]) for j in range(len(first.effort))),
        time=np.concatenate([o.time for o in observations]),
        weight=np.concatenate([o.weight for o in observations]),
        rate=first.rate,
        names=first.names,
    )
