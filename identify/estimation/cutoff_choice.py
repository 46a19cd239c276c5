"""Which low-passes of positions suit these logs: one cut-off, or a lower one away from starts, stops and reversals.

The search begins at the usual pair and goes on to neighbours as long as they are better. Of all that it met, those
hardly and not surely worse than the best are as good as that; the one fewest steps away from the usual pair is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from identify.estimation.settings import Settings

Pair = tuple[float, float | None]
"""The cut-off of positions, and the lower one or None [Hz]."""

CUTOFFS_HZ = (15.0, 20.0, 30.0, 40.0, 60.0, 100.0)
QUIET_HZ = (3.0, 5.0, 8.0, None)
USUAL: Pair = (30.0, 5.0)

FIGURE = "moving_percent"
"""What cut-offs are judged by: a joint at rest tells nothing of them."""

GUARD_S = 0.05
"""Longest time around rest that is left out: a low-pass spreads a reversal over about one period of its cut-off."""

SURE = 2.0
"""One residual is surely below another where its square is, by so many standard errors of what is between them."""


ALIKE = 1.05
"""Residuals may be so many times the least one to count as hardly worse."""


@dataclass(frozen=True, eq=False)
class Validation:
    """Residuals of the effort in blocks that the fit has not seen: `percent` {"all_percent", "moving_percent"} [%] of
    all, and `blocks` of the same names (B,): the sum of their squares over each block."""

    percent: dict[str, float]
    blocks: dict[str, np.ndarray]

    def surely_below(self, other: Validation, figure: str) -> bool:
        """Whether this figure is below the other one by more than chance, by the scatter over the blocks."""
        gain = other.blocks[figure] - self.blocks[figure]
        error = np.std(gain, ddof=1) * np.sqrt(len(gain)) if len(gain) > 1 else np.inf
        return bool(gain.sum() > SURE * error)


def choose_cutoffs(judged: Callable[[Settings], Validation], settings: Settings) -> Settings:
    """The settings with the cut-offs that the logs speak for; judged: what others come to on these logs."""
    met: dict[Pair, Validation] = {}

    def figure(pair: Pair) -> float:
        if pair not in met:
            met[pair] = judged(_with_cutoffs(settings, pair))
        return met[pair].percent[FIGURE]

    cutoff, _ = _walk(figure, USUAL)
    pair = _walk(figure, min(((cutoff, q) for q in QUIET_HZ if q is None or q < cutoff), key=figure))
    best = met[pair]
    alike = [other for other in met if figure(other) <= ALIKE * figure(pair)]
    as_good = [other for other in alike if not best.surely_below(met[other], FIGURE)]
    return _with_cutoffs(settings, min(as_good, key=lambda pair: (_steps(pair), figure(pair))))


def _walk(figure: Callable[[Pair], float], start: Pair) -> Pair:
    """From one cut-off to the next as long as that is better, the lower one as it is."""
    cutoff, quiet = start
    at = CUTOFFS_HZ.index(cutoff)
    beside = [(f, quiet) for f in CUTOFFS_HZ[max(0, at - 1) : at + 2] if quiet is None or f > quiet]
    best = min([start, *beside], key=figure)
    return start if best == start else _walk(figure, best)


def _steps(pair: Pair) -> int:
    """How many steps a pair is away from the usual one."""
    (cutoff, quiet), (usual, usually) = pair, USUAL
    away = CUTOFFS_HZ.index(cutoff) - CUTOFFS_HZ.index(usual), QUIET_HZ.index(quiet) - QUIET_HZ.index(usually)
    return abs(away[0]) + abs(away[1])


def _with_cutoffs(settings: Settings, pair: Pair) -> Settings:
    cutoff, quiet = pair
    return replace(settings, position_cutoff_hz=cutoff, quiet_cutoff_hz=quiet, guard_s=min(GUARD_S, 1 / cutoff))
