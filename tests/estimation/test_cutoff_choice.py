"""Cut-offs are found by a search, and kept as they usually are where the logs don't speak against it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from identify.estimation.cutoff_choice import ALIKE, CUTOFFS_HZ, QUIET_HZ, USUAL, Pair, Validation, choose_cutoffs
from identify.estimation.settings import Settings

BLOCKS = 40


def validation(percent: float, uneven: float = 0.0) -> Validation:
    """A residual of so many percent, its squares spread over the blocks; `uneven` of them are in the first one."""
    blocks = np.full(BLOCKS, (1 - uneven) / BLOCKS)
    blocks[0] += uneven
    return Validation({"moving_percent": percent}, {"moving_percent": percent**2 * blocks})


def found(percent: Callable[[Pair], float], uneven: float = 0.0) -> tuple[Pair, int]:
    """The pair that is chosen and how many were tried."""
    tried: list[Settings] = []

    def judged(settings: Settings) -> Validation:
        tried.append(settings)
        pair = settings.position_cutoff_hz, settings.quiet_cutoff_hz
        return validation(percent(pair), uneven if pair != USUAL else 0.0)

    chosen = choose_cutoffs(judged, Settings(effort_cutoff_hz=9.0))
    assert chosen.effort_cutoff_hz == 9.0
    assert chosen.guard_s == min(0.05, 1 / chosen.position_cutoff_hz)
    assert chosen in tried
    assert len(set(tried)) == len(tried)
    return (chosen.position_cutoff_hz, chosen.quiet_cutoff_hz), len(tried)


@pytest.mark.parametrize("cutoff", CUTOFFS_HZ)
@pytest.mark.parametrize("quiet", QUIET_HZ)
def test_the_least_is_found_wherever_it_is(cutoff: float, quiet: float | None) -> None:
    def percent(pair: Pair) -> float:
        return 1 + abs(np.log(pair[0] / cutoff)) + abs(np.log((pair[1] or 100.0) / (quiet or 100.0)))

    pair, count = found(percent)
    assert pair == (cutoff, quiet)
    assert count <= len(CUTOFFS_HZ) + len(QUIET_HZ) + 2 < len(CUTOFFS_HZ) * len(QUIET_HZ)


def test_what_is_hardly_better_changes_nothing() -> None:
    assert found(lambda pair: 1.0 if pair == USUAL else 0.999, uneven=0.3)[0] == USUAL


def test_what_is_surely_better_is_taken_however_little() -> None:
    best = CUTOFFS_HZ[CUTOFFS_HZ.index(USUAL[0]) + 1], USUAL[1]
    assert found(lambda pair: 0.999 if pair == best else 1.0)[0] == best


def test_what_is_much_worse_is_not_kept_though_it_may_be_chance() -> None:
    """The squares of the usual pair are in few blocks: the test alone would not tell it from the best."""

    def judged(settings: Settings) -> Validation:
        pair = settings.position_cutoff_hz, settings.quiet_cutoff_hz
        return validation(3.0, 0.95) if pair[1] == USUAL[1] else validation(1.0)

    assert not validation(1.0).surely_below(validation(3.0, 0.95), "moving_percent")
    assert ALIKE < 3
    assert choose_cutoffs(judged, Settings()).quiet_cutoff_hz != USUAL[1]
