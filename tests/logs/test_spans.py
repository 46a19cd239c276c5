"""Slopes and means over spans are exact where the column is what they are exact for, on any clock."""

from __future__ import annotations

import numpy as np
import pytest

from identify.logs.spans import Spans

RNG = np.random.default_rng(0)
UNEVEN = np.cumsum(RNG.uniform(0.0005, 0.01, 50_000))


@pytest.mark.parametrize("time", [UNEVEN, 10 * UNEVEN[:40], np.arange(2) / 3], ids=["uneven", "too slow", "two"])
def test_a_steady_motion_has_its_speed_everywhere(time: np.ndarray) -> None:
    spans = Spans.of(time, 0.05)
    np.testing.assert_allclose(spans.slope(3.0 - 2.0 * time), -2.0, rtol=1e-9)
    np.testing.assert_allclose(spans.mean(np.full(len(time), 4.0)), 4.0, rtol=1e-9)


def test_spans_reach_half_of_them_to_both_sides_or_the_ends() -> None:
    time = UNEVEN[:300]
    spans = Spans.of(time, 0.05)
    for k, at in enumerate(time):
        before, after = np.flatnonzero(time <= at - 0.025), np.flatnonzero(time >= at + 0.025)
        assert spans.first[k] == (before[-1] if len(before) else 0)
        assert spans.last[k] == (after[0] if len(after) else 299)


def test_the_mean_of_a_derivative_is_the_slope_of_what_it_is_of() -> None:
    """Blocks and all: the trapezoidal rule is exact for the velocity of a parabola."""
    spans = Spans.of(UNEVEN, 0.05)
    np.testing.assert_allclose(spans.mean(2 * UNEVEN - 7), spans.slope((UNEVEN - 7) * UNEVEN), rtol=1e-6, atol=1e-6)


def test_one_sample_has_no_slope() -> None:
    assert Spans.of(np.zeros(1), 0.05).slope(np.ones(1)) == [0.0]
