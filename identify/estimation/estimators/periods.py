"""A periodic log as one period: its length, the mean over its repetitions, and what they differ by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identify.errors import InputError, UnsupportedLogError
from identify.estimation.motion import low_pass
from identify.estimation.settings import STILL
from identify.experiment.control import REFERENCE, trajectory_of
from identify.logs.log import MOTION_START, Log

SHORTEST_S = 1.0
"""Periods shorter than this [s] are not looked for."""

ALIKE = 1e-3
"""Repetitions of a motion differ by no more than this share of its variance."""

SPEED_CUTOFF_HZ = 5.0
"""Low-pass of the position [Hz] by which rest at the ends is told from motion."""

SLOW = 0.05
"""Share of a period at its ends that may be too slow to be told from rest."""

RATE_HZ = 50.0
"""Rate at which periods are looked for [Hz]."""

WHY_NOT = "the motion does not repeat itself: averaging needs two periods or more (`identify excite --periods`)"


@dataclass(frozen=True, eq=False)
class Periods:
    """P repetitions of a motion: position, effort (P, N, n), N samples a period of `length` [s]."""

    position: np.ndarray
    effort: np.ndarray
    length: float

    @property
    def rate(self) -> float:
        """Samples a second [Hz]."""
        return self.position.shape[1] / self.length


def periods_of(log: Log, joints: Sequence[str]) -> Periods:
    """The whole periods of a log, by the trajectory that it carries or by its own motion, joints in this order.

    UnsupportedLogError where there are fewer than two.
    """
    columns = [log.joints.index(name) for name in joints]
    start, length, count = _told(log) or _found(log)
    samples = round(length * log.rate_hz)
    if count < 2 or samples < 2:
        raise UnsupportedLogError(WHY_NOT)
    at = start + np.arange(count * samples) * (length / samples)
    assert log.effort is not None
    position, effort = (
        np.column_stack([np.interp(at, log.time, x[:, k]) for k in columns]).reshape(count, samples, len(columns))
        for x in (log.position, log.effort)
    )
    if np.var(position, axis=0).mean() > ALIKE * np.var(position, axis=(0, 1)).mean():
        raise UnsupportedLogError(WHY_NOT)
    return Periods(position, effort, length)


def _told(log: Log) -> tuple[float, float, int] | None:
    """Start [s], length [s] and number of the whole periods in the log, of the trajectory that it carries."""
    if REFERENCE not in log.attachments:
        return None
    try:
        trajectory = trajectory_of(log)
        begin = float(log.metadata.get(MOTION_START, "0")) + trajectory.rest
    except (InputError, ValueError):
        return None
    skipped = max(0, int(np.ceil((log.time[0] - begin) / trajectory.period - 1e-9)))
    start = begin + skipped * trajectory.period
    held = int((log.time[-1] + 1 / log.rate_hz - start) / trajectory.period + 1e-9)
    return start, trajectory.period, min(trajectory.periods - skipped, held)


def _found(log: Log) -> tuple[float, float, int]:
    """The same of the shortest time after which the motion, rests at the ends left out, is what it was."""
    speed = np.gradient(low_pass(log.position, SPEED_CUTOFF_HZ, log.rate_hz), log.time, axis=0)
    moving = np.flatnonzero((np.abs(speed) > STILL).any(axis=1))
    if len(moving) < 2:
        raise UnsupportedLogError(WHY_NOT)
    first, last = log.time[moving[0]], log.time[moving[-1]]
    step = max(1 / RATE_HZ, 1 / log.rate_hz)
    time = np.arange(first, last, step)
    q = np.column_stack([np.interp(time, log.time, x) for x in log.position.T])
    q = (q - q.mean(axis=0)) / np.maximum(q.std(axis=0), 1e-12)
    lags = np.arange(round(SHORTEST_S / step), round(len(q) / (2 - 2 * SLOW)))
    if not len(lags):
        raise UnsupportedLogError(WHY_NOT)
    difference = _differences(q, lags)
    dips = 1 + np.flatnonzero((difference[1:-1] <= difference[:-2]) & (difference[1:-1] <= difference[2:]))
    near = [k for k in dips if difference[k] < 30 * ALIKE]
    for k in near:
        length = _refined(log, first, last, lags[k] * step, step)
        if length is not None:
            count = int((last - first) / length + SLOW)
            return max(log.time[0], first - max(0.0, count * length - (last - first)) / 2), length, count
    raise UnsupportedLogError(WHY_NOT)


def _differences(q: np.ndarray, lags: np.ndarray) -> np.ndarray:
    """Mean square of q(t + lag) − q(t), (N, n), in shares of twice the variance, for each lag in rows."""
    size = 2 * len(q)
    spectrum = np.fft.rfft(q, size, axis=0)
    products = np.fft.irfft(np.abs(spectrum) ** 2, size, axis=0).sum(axis=1)[lags]
    squares = np.concatenate([[0.0], np.cumsum((q**2).sum(axis=1))])
    total = squares[len(q) - lags] + squares[-1] - squares[lags]
    return (total - 2 * products) / np.maximum(total, 1e-300)


def _refined(log: Log, first: float, last: float, guess: float, step: float) -> float | None:
    """The period near a guess [s] to a small part of a sample, or None where the motion is not the same after it."""
    from scipy.optimize import minimize_scalar

    def apart(length: float) -> float:
        time = np.arange(first, last - length, 1 / log.rate_hz)
        shares = []
        for x in log.position.T:
            a, b = np.interp(time, log.time, x), np.interp(time + length, log.time, x)
            shares.append(np.mean((a - b) ** 2) / max(2 * np.var(a), 1e-300))
        return float(np.mean(shares))

    found = minimize_scalar(apart, bounds=(guess - step, guess + step), method="bounded", options={"xatol": 1e-7})
    # Sampled on the period's own beat, as a log rarely is by chance, no interpolation is needed.
    whole = round(found.x * log.rate_hz) / log.rate_hz
    length = whole if abs(whole - found.x) < 0.2 / log.rate_hz else float(found.x)
    return length if apart(length) < ALIKE else None
