"""Whether a log's effort comes later than its position: all of it, that of one joint, or ever more of it."""

from __future__ import annotations

import numpy as np

from identify.logs.finding import KEPT, WARNING, Finding
from identify.logs.log import Log
from identify.validation.log_rows import SHIFTS_S, Equations, Rows

BETTER = 0.8
"""Ratio of squared residuals from which a shift of the effort is real."""
ALONE_BETTER = 0.5
"""The same for the effort of one joint among several, which chance favours as often."""
CERTAIN = 5.0
"""A delay is so many of its own standard errors long, those of its parts."""
SHIFT_STEP_S = 0.005
PARTS = 6


def effort_delay(rows: Rows, built: Equations, log: Log) -> tuple[float, list[Finding]]:
    """Delay of the effort behind the position that all joints share [s], and what there is to say of delays.

    rows, built: of the log, whose joints are those of the robot in its order.
    """
    names = log.joints
    shifts = np.arange(-SHIFTS_S, SHIFTS_S + 1e-9, SHIFT_STEP_S)
    sides = [built.side(rows.effort(shift)) for shift in shifts]
    squares = np.array([float(r @ r) for r in map(built.residual, sides)])
    none = squares[len(shifts) // 2]
    common = _lowest(shifts, squares)
    step = float(np.median(np.diff(log.time)))
    middles, delays, followed = _delays_of_parts(rows, built, sides, shifts, common)
    # Clocks that run apart: a line through the parts' delays.
    line = np.polynomial.polynomial.polyfit(middles, delays, 1)
    rest = delays - np.polynomial.polynomial.polyval(middles, line)
    spread = np.sqrt(rest @ rest / (PARTS - 2) / ((middles - middles.mean()) ** 2).sum())
    drift = line[1] * np.ptp(middles)
    least = min(float(np.interp(common, shifts, squares)), none)
    if abs(line[1]) > CERTAIN * spread and abs(drift) > 2 * step and followed < BETTER * least:
        ends = " to ".join(f"{1e3 * delay:.1f}" for delay in (delays[0], delays[-1]))
        text = f"position and effort have clocks apart: the effort's delay goes from {ends} ms through the log"
        return common, [Finding("clock apart", WARNING, text, KEPT, names)]
    alone, gain = _delay_of_joint(names, built, sides, shifts, step)
    if alone and gain < 0.9 * squares.min() / none:
        return 0.0, alone
    error = float(np.std(delays, ddof=1) / np.sqrt(PARTS))
    if abs(common) > max(step, CERTAIN * error) and squares.min() < BETTER * none:
        fine = common + np.arange(-SHIFT_STEP_S, SHIFT_STEP_S + 1e-9, SHIFT_STEP_S / 10)
        left = [built.residual(built.side(rows.effort(shift))) for shift in fine]
        common = _lowest(fine, np.array([float(r @ r) for r in left]))
        text = f"the effort is {_lag(common)} the position (standard error {1e3 * error:.2f} ms)"
        return common, [Finding("delay", WARNING, text, f"{KEPT}; shift one of them", names)]
    return 0.0, []


def _delays_of_parts(
    rows: Rows, built: Equations, sides: list[np.ndarray], shifts: np.ndarray, common: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Middle [s] and delay [s] of each of PARTS parts of the log, by one set of parameters, and what they leave."""
    theta = built.parameters(built.side(rows.effort(common)))
    predicted = built.matrix @ theta
    at = np.concatenate([np.flatnonzero(column) for column in built.counted.T])
    part = np.searchsorted(np.linspace(0, len(rows.time), PARTS + 1)[1:-1], at, side="right")
    by_part = np.array([np.bincount(part, (b - predicted) ** 2, PARTS) for b in sides])
    delays = np.array([_lowest(shifts, column) for column in by_part.T])
    middles = np.array([x.mean() for x in np.array_split(rows.time, PARTS)])
    left = sum(np.interp(delay, shifts, column) for delay, column in zip(delays, by_part.T, strict=True))
    return middles, delays, float(left)


def _delay_of_joint(
    names: tuple[str, ...], built: Equations, sides: list[np.ndarray], shifts: np.ndarray, step: float
) -> tuple[list[Finding], float]:
    """The joint whose effort alone comes late, if there is one, and the ratio of squared residuals that it explains."""
    none = sides[len(shifts) // 2]
    whole = built.basis.T @ none
    found = []
    for j, name in enumerate(names):
        own = built.joint == j
        if not own.any():
            continue
        # Only this joint's rows move: so do only their share of the projection and of the length.
        others = whole - built.basis[own].T @ none[own]
        length = float(none @ none - none[own] @ none[own])
        squares = []
        for b in sides:
            projected = others + built.basis[own].T @ b[own]
            squares.append(length + float(b[own] @ b[own] - projected @ projected))
        y = np.array(squares)
        delay = _lowest(shifts, y)
        gain = y.min() / max(y[len(shifts) // 2], 1e-300)
        if abs(delay) > max(step, SHIFT_STEP_S / 2) and gain < ALONE_BETTER:
            found.append((gain, name, delay))
    if not found:
        return [], 1.0
    gain, name, delay = min(found)
    text = f"the effort of {name} is {_lag(delay)} the position, that of the other joints is not"
    return [Finding("delay", WARNING, text, f"{KEPT}; shift it", (name,))], float(gain)


def _lag(delay: float) -> str:
    return f"{1e3 * abs(delay):.1f} ms {'behind' if delay > 0 else 'ahead of'}"


def _lowest(x: np.ndarray, y: np.ndarray) -> float:
    """Where the parabola through the lowest of y (K,) at even x (K,) and its neighbours is lowest."""
    k = int(np.clip(y.argmin(), 1, len(y) - 2))
    before, at, after = y[k - 1 : k + 2]
    bend = before - 2 * at + after
    return float(x[k] + (0.0 if bend <= 0 else 0.5 * (x[1] - x[0]) * (before - after) / bend))
