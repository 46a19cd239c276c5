"""Where one channel breaks off: spikes that come and go, jumps that stay, stretches that are frozen."""

from __future__ import annotations

import numpy as np

WIDEST_SPIKE = 3
"""A value that comes back within so many samples is a spike; one that does not is a jump."""
BEYOND = 8.0
"""A spike or jump is so many times larger than all but a thousandth of the channel's own irregularities."""
_ENOUGH = 50_000
"""So many values tell a quantile."""


def spikes(x: np.ndarray, least: float) -> np.ndarray:
    """Indices of the first samples of spikes in x (N,): at least `least` high, up to WIDEST_SPIKE samples wide.

    Height of a spike: the smaller of its two flanks; it is compared with that of the channel's ordinary samples.
    """
    if len(x) < 8:
        return np.empty(0, dtype=int)
    step = np.diff(x)
    height = _height(step, 1)
    limit = max(least, BEYOND * _quantile(height, 0.999))
    found = [np.flatnonzero(height > limit)]
    for width in range(2, WIDEST_SPIKE + 1):
        wide = np.flatnonzero(_height(step, width) > limit)
        # Back where it came from, or it is two jumps.
        back = np.abs(x[wide] - x[wide + width + 1]) < 0.25 * np.abs(step[wide])
        found.append(wide[back])
    starts = np.unique(np.concatenate(found)) + 1
    return starts[np.diff(starts, prepend=-WIDEST_SPIKE - 1) > WIDEST_SPIKE]


def jumps(x: np.ndarray, time: np.ndarray, least: float) -> np.ndarray:
    """Indices k of jumps from x[k] to x[k + 1] of at least `least`, which the speed around them does not explain.

    Steps across gaps in time (N,) [s] do not count: there the speed explains anything.
    """
    if len(x) < 16:
        return np.empty(0, dtype=int)
    step = np.diff(x)
    lapse = np.diff(time)
    speed = step / lapse
    around = np.stack([speed[:-4], speed[1:-3], speed[3:-1], speed[4:]])
    # The middle of four neighbours: one that is odd itself does not count.
    expected = 0.5 * (np.maximum(np.minimum(around[0], around[1]), np.minimum(around[2], around[3])))
    expected += 0.5 * (np.minimum(np.maximum(around[0], around[1]), np.maximum(around[2], around[3])))
    odd = np.abs(step[2:-2] - expected * lapse[2:-2])
    odd[lapse[2:-2] > 1.5 * _quantile(lapse, 0.5)] = 0
    limit = max(least, BEYOND * _quantile(odd, 0.999), 2 * _quantile(np.abs(step), 0.999))
    return np.flatnonzero(odd > limit) + 2


def runs(same: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(starts, lengths) of the runs of True in same (M,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8)))
    return edges[::2], edges[1::2] - edges[::2]


def robust_range(x: np.ndarray) -> float:
    """From the first to the last percent of the values of x (N,), which single outliers do not widen."""
    low, high = np.quantile(_some(x), [0.01, 0.99])
    return float(high - low)


def _height(step: np.ndarray, width: int) -> np.ndarray:
    """Height of what rises at one step and falls `width` steps later, or the other way round; else 0."""
    up, down = step[:-width], step[width:]
    height = np.minimum(np.abs(up), np.abs(down))
    height[up * down >= 0] = 0
    return height


def _quantile(values: np.ndarray, share: float) -> float:
    return float(np.quantile(_some(values), share))


def _some(values: np.ndarray) -> np.ndarray:
    return values[:: max(1, len(values) // _ENOUGH)]
