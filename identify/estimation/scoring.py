"""How well a predicted effort fits a measured one: the same rule for every model, log and tool.

Both efforts go through one zero-phase Butterworth low-pass at 10 Hz, every sample counts. "Moving": before the filter,
rows of a joint that is at rest are set to zero in both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.estimation.motion import PIECE_S, beneath, clock, interpolated, low_pass, settled
from identify.estimation.settings import STILL
from identify.logs.log import Log
from identify.robot.robot import Robot

CUTOFF_HZ = 10.0
SPEED_CUTOFF_HZ = 20.0
WHY_NOT = {
    "relative_residual_percent": "the measured effort is zero",
    "moving_relative_residual_percent": "the joint never moves with any effort",
    "moving_rmse": "the joint never moves",
    "rest_rmse": "the joint is never at rest",
}


def speed_of(log: Log, rows: slice = slice(None)) -> np.ndarray:
    """(rows, n) measured velocity where the log has it, else differences of the position low-passed at 20 Hz.

    rows: without step; of a part of a log, as of the whole.
    """
    if log.velocity is not None:
        return log.velocity[rows]
    start, stop, _ = rows.indices(log.samples)
    margin = settled(SPEED_CUTOFF_HZ, log.rate_hz) + 1
    around = slice(max(0, start - margin), stop + margin)
    smooth = low_pass(log.position[around], SPEED_CUTOFF_HZ, log.rate_hz)
    return np.gradient(smooth, log.time[around], axis=0)[start - around.start :][: stop - start]


def relative(measured: np.ndarray, predicted: np.ndarray) -> float | None:
    """100·‖measured − predicted‖ / ‖measured‖ [%]; None where nothing was measured."""
    size = np.linalg.norm(measured)
    return float(100 * np.linalg.norm(measured - predicted) / size) if size > 0 else None


def explained(row: dict[str, Any], reasons: dict[str, str]) -> dict[str, Any]:
    """The row with, for each of its values that is None, the reason beside it as "<key>_reason"."""
    return row | {f"{key}_reason": text for key, text in reasons.items() if key in row and row[key] is None}


def scored(logs: Sequence[Log], predictions: Sequence[np.ndarray], robot: Robot) -> dict[str, Any]:
    """Figures of predictions (N, n), one a log: over all, moving and at rest, logs and joints together and per joint.

    RMSE in N·m or N, residuals in percent. Each log is filtered on its own. rmse and moving_rmse are over every sample,
    the latter with rows at rest set to zero before the filter; rest_rmse is that of the samples at rest.
    """
    tallies = [_Tally.of(x) for log, hat in zip(logs, predictions, strict=True) for x in pieces(log, hat)]
    count = np.array([[tally.count] for tally in tallies])
    mean = np.array([tally.mean for tally in tallies])
    samples, middle = count.sum(), (count * mean).sum(axis=0) / count.sum()
    power, moving_power, error, moving_error, rest_error, rest = np.sum([tally.sums for tally in tallies], axis=0)
    within = np.sum([tally.scatter for tally in tallies], axis=0)
    scatter = within + (count * (mean - middle) ** 2).sum(axis=0)
    largest = np.max([tally.largest for tally in tallies], axis=0)
    joints = [
        {
            "joint": joint.name,
            "unit": joint.effort_unit,
            "rmse": float(np.sqrt(error[j] / samples)),
            "relative_residual_percent": _percent(error[j], power[j]),
            "moving_relative_residual_percent": _percent(moving_error[j], moving_power[j]),
            "moving_rmse": float(np.sqrt(moving_error[j] / samples)) if rest[j] < samples else None,
            "rest_rmse": float(np.sqrt(rest_error[j] / rest[j])) if rest[j] else None,
            "max_abs_error": float(largest[j]),
            "std_of_signal": float(np.sqrt(scatter[j] / samples)),
            "rest_share_percent": float(100 * rest[j] / samples),
        }
        for j, joint in enumerate(robot.joints)
    ]
    total = {
        "relative_residual_percent": _percent(error.sum(), power.sum()),
        "moving_relative_residual_percent": _percent(moving_error.sum(), moving_power.sum()),
        "per_joint": [explained(joint, WHY_NOT) for joint in joints],
        "duration_s": float(sum(log.duration for log in logs)),
    }
    return explained(total, WHY_NOT)


@dataclass(frozen=True)
class Piece:
    """Some rows of a log on its even clock, and as many around them as the rule's filter reaches.

    rows, around: without and with those around; rate [Hz]. effort, error (measured − predicted) and moves (m, n) are
    all of `around`; what is low-passed is of `rows` alone.
    """

    rows: slice
    around: slice
    rate: float
    effort: np.ndarray
    error: np.ndarray
    moves: np.ndarray

    def low_passed(self, *channels: np.ndarray) -> list[np.ndarray]:
        """(rows, n) of each of the channels (m, n) by the rule's filter."""
        # One call for all: it takes as long to begin as for a second of log.
        smooth = low_pass(np.concatenate(channels, axis=1), CUTOFF_HZ, self.rate)[self.inside]
        return np.split(smooth, len(channels), axis=1)

    @property
    def inside(self) -> slice:
        """Where `rows` are in `around`."""
        return slice(self.rows.start - self.around.start, self.rows.stop - self.around.start)


def pieces(log: Log, predicted: np.ndarray) -> Iterator[Piece]:
    """The whole log piece by piece, as one may be long; predicted (N, n)."""
    assert log.effort is not None
    # The rule interpolates whatever the clock; figures then agree to the last digit.
    time, rate, regular = clock(log, jitter=0.0)
    step, margin = max(1, round(PIECE_S * rate)), settled(CUTOFF_HZ, rate)
    for start in range(0, len(time), step):
        rows = slice(start, min(start + step, len(time)))
        around = slice(max(0, rows.start - margin), min(len(time), rows.stop + margin))
        part = around if regular else beneath(log, time[around])
        effort, hat, speed = log.effort[part], predicted[part], speed_of(log, part)
        if not regular:
            effort, hat, speed = (interpolated(time[around], log.time[part], x) for x in (effort, hat, speed))
        yield Piece(rows, around, rate, effort, effort - hat, np.abs(speed) > STILL)


@dataclass(frozen=True)
class _Tally:
    """Sums over some rows: how many, mean and scatter of the measured effort (n,), the largest error (n,), and sums
    (6, n) of the squared effort, the same moving, squared error, the same moving and at rest, and rows at rest."""

    count: int
    mean: np.ndarray
    scatter: np.ndarray
    largest: np.ndarray
    sums: np.ndarray

    @staticmethod
    def of(x: Piece) -> _Tally:
        still = ~x.moves[x.inside]
        measured, moving, error, moving_error = x.low_passed(x.effort, x.effort * x.moves, x.error, x.error * x.moves)
        mean = measured.mean(axis=0)
        sums = [(v**2).sum(axis=0) for v in (measured, moving, error, moving_error, error * still)]
        scatter, largest = ((measured - mean) ** 2).sum(axis=0), np.abs(error).max(axis=0)
        return _Tally(len(still), mean, scatter, largest, np.array([*sums, still.sum(axis=0)]))


def _percent(error: float, size: float) -> float | None:
    return float(100 * np.sqrt(error / size)) if size > 0 else None
