"""Whether a logged velocity is the derivative of the position beside it."""

from __future__ import annotations

import math

import numpy as np

from identify.logs.finding import WARNING, Finding
from identify.logs.log import Log
from identify.logs.spans import Spans

FITS = 0.1
"""Share of the speed by which a velocity may differ from it and still be its derivative."""

NOT_USED = "kept; fits take their velocity from position"


def of_velocity(log: Log, j: int, spans: Spans, own: np.ndarray) -> list[Finding]:
    """Findings of joint j's velocity; spans: those of the log over which speeds are taken; own (N,): its speed there.

    The mean over the same span of a velocity that is the derivative equals the mean speed exactly; its slope on the
    mean speed tells sign, unit and gear ratio, another joint's speed a swap.
    """
    if log.velocity is None or log.samples < 20 or not _moves(log, j):
        return []
    v, joint = np.ascontiguousarray(log.velocity[:, j]), log.joints[j]
    if not np.isfinite(v).all() or np.ptp(v) == 0:
        return []
    mean = spans.mean(v)
    slope = float(own @ mean / (own @ own))
    if _apart(mean, own) <= FITS:
        return []
    words = f"the velocity of {joint} is not the derivative of its position"
    if _apart(mean, slope * own) <= FITS:
        return [Finding("velocity", WARNING, f"{words} but {_factor(slope)}", NOT_USED, (joint,))]
    others = (k for k in range(len(log.joints)) if k != j and _moves(log, k))
    alike = [k for k in others if _apart(mean, spans.slope(log.position[:, k])) <= FITS]
    why = f" but that of {log.joints[alike[0]]}" if alike else f": they differ by {100 * _apart(mean, own):.0f} %"
    return [Finding("velocity", WARNING, words + why, NOT_USED, (joint,))]


def _moves(log: Log, j: int) -> bool:
    from identify.logs.triage import STILL_RANGE

    return bool(np.ptp(log.position[:, j]) > STILL_RANGE)


def _apart(a: np.ndarray, b: np.ndarray) -> float:
    size = max(float(np.linalg.norm(b)), 1e-300)
    return float(np.linalg.norm(a - b)) / size


def _factor(slope: float) -> str:
    if abs(slope + 1) < 0.05:
        return "its negative: its sign is wrong"
    for value, words in ((180 / math.pi, "it is in degrees"), (math.pi / 180, "the position is in degrees")):
        if abs(abs(slope) / value - 1) < 0.05:
            return f"{slope:.4g} times it: {words}"
    return f"{slope:.4g} times it: unit or gear ratio is wrong"
