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
RESIDUALS = ("relative_residual_percent", "moving_relative_residual_percent")
"""Keys of the two figures of all joints together: over every sample, and where joints move."""

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
    """`figures_of` predictions (N, n), one a log, at its samples. Each log is filtered on its own."""
    tallies = [
        Smooth.of(piece_at(log, place, [hat[place.part]])).tally(0)
        for log, hat in zip(logs, predictions, strict=True)
        for place in places(log)
    ]
    return figures_of(tallies, sum(log.duration for log in logs), robot)


def figures_of(tallies: Sequence[Tally], duration: float, robot: Robot) -> dict[str, Any]:
    """Figures of one prediction over pieces of all logs, `duration` [s] together: over all, moving and at rest, joints
    together and per joint.

    RMSE in N·m or N, residuals in percent. rmse and moving_rmse are over every sample, the latter with rows at rest set
    to zero before the filter; rest_rmse is that of the samples at rest.
    """
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
        "duration_s": float(duration),
    }
    return explained(total, WHY_NOT)


@dataclass(frozen=True)
class Place:
    """Rows of a log's even clock, those around them that the rule's filter reaches, and the samples under all these.

    rate [Hz]; time (m,) [s] of `around`, None where the samples are its rows as they are.
    """

    rows: slice
    around: slice
    part: slice
    rate: float
    time: np.ndarray | None

    @property
    def inside(self) -> slice:
        """Where `rows` are in `around`."""
        return slice(self.rows.start - self.around.start, self.rows.stop - self.around.start)


def places(log: Log) -> Iterator[Place]:
    """The whole log piece by piece, as one may be long."""
    # The rule interpolates whatever the clock; figures then agree to the last digit.
    time, rate, regular = clock(log, jitter=0.0)
    step, margin = max(1, round(PIECE_S * rate)), settled(CUTOFF_HZ, rate)
    for start in range(0, len(time), step):
        rows = slice(start, min(start + step, len(time)))
        around = slice(max(0, rows.start - margin), min(len(time), rows.stop + margin))
        if regular:
            yield Place(rows, around, around, rate, None)
        else:
            yield Place(rows, around, beneath(log.time, time[around]), rate, time[around])


@dataclass(frozen=True)
class Piece:
    """A log at a place: effort, errors (measured − each prediction) and moves, (m, n) each, at the rows of `around`."""

    place: Place
    effort: np.ndarray
    errors: tuple[np.ndarray, ...]
    moves: np.ndarray


def piece_at(log: Log, place: Place, predictions: Sequence[np.ndarray]) -> Piece:
    """The log at a place, with predictions (k, n) at the samples of `place.part`."""
    assert log.effort is not None
    channels = [log.effort[place.part], speed_of(log, place.part), *predictions]
    if place.time is not None:
        channels = [interpolated(place.time, log.time[place.part], x) for x in channels]
    effort, speed, *hats = channels
    return Piece(place, effort, tuple(effort - hat for hat in hats), np.abs(speed) > STILL)


@dataclass(frozen=True)
class Smooth:
    """A piece by the rule's filter, (rows, n) each: effort and errors; moving_effort and moving_errors, with rows at
    rest set to zero before it; more, whatever else was given. moves: as it is."""

    effort: np.ndarray
    errors: tuple[np.ndarray, ...]
    moving_effort: np.ndarray
    moving_errors: tuple[np.ndarray, ...]
    more: tuple[np.ndarray, ...]
    moves: np.ndarray

    @staticmethod
    def of(x: Piece, *more: np.ndarray) -> Smooth:
        """more (m, n): further channels at the rows of `around`."""
        channels = [x.effort, *x.errors, *(values * x.moves for values in (x.effort, *x.errors)), *more]
        # One call for all: it takes as long to begin as for a second of log.
        smooth = low_pass(np.concatenate(channels, axis=1), CUTOFF_HZ, x.place.rate)[x.place.inside]
        found = np.split(smooth, len(channels), axis=1)
        k = 1 + len(x.errors)
        inside = x.moves[x.place.inside]
        return Smooth(found[0], tuple(found[1:k]), found[k], tuple(found[k + 1 : 2 * k]), tuple(found[2 * k :]), inside)

    def tally(self, k: int) -> Tally:
        """That of the k-th prediction."""
        still, mean = ~self.moves, self.effort.mean(axis=0)
        error = self.errors[k]
        signals = (self.effort, self.moving_effort, error, self.moving_errors[k], error * still)
        sums = [np.einsum("ij,ij->j", x, x) for x in signals]
        scatter, largest = ((self.effort - mean) ** 2).sum(axis=0), np.abs(error).max(axis=0)
        return Tally(len(still), mean, scatter, largest, np.array([*sums, still.sum(axis=0)]))


@dataclass(frozen=True)
class Tally:
    """Sums over some rows: how many, mean and scatter of the measured effort (n,), the largest error (n,), and sums
    (6, n) of the squared effort, the same moving, squared error, the same moving and at rest, and rows at rest."""

    count: int
    mean: np.ndarray
    scatter: np.ndarray
    largest: np.ndarray
    sums: np.ndarray


def _percent(error: float, size: float) -> float | None:
    return float(100 * np.sqrt(error / size)) if size > 0 else None
