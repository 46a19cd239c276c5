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
    usual = _height(step, _some(np.arange(len(step) - 1)), 1)
    limit = max(least, BEYOND * float(np.quantile(usual, 0.999)))
    flanks = np.flatnonzero(np.abs(step[:-WIDEST_SPIKE]) > limit)
    found = []
    for width in range(1, WIDEST_SPIKE + 1):
        tall = flanks[_height(step, flanks, width) > limit]
        if width > 1:
            # Back where it came from, or it is two jumps.
            tall = tall[np.abs(x[tall] - x[tall + width + 1]) < 0.25 * np.abs(step[tall])]
        found.append(tall)
    starts = np.unique(np.concatenate(found)) + 1
    return starts[np.diff(starts, prepend=-WIDEST_SPIKE - 1) > WIDEST_SPIKE]


def jumps(x: np.ndarray, time: np.ndarray, least: float) -> np.ndarray:
    """Indices k of jumps from x[k] to x[k + 1] of at least `least`, which the speed around them does not explain.

    Steps across gaps in time (N,) [s] do not count: there the speed explains anything.
    """
    if len(x) < 16:
        return np.empty(0, dtype=int)
    step = np.diff(x)
    size = np.abs(step)
    sample = _some(np.arange(2, len(step) - 2))
    usual = np.quantile(time[sample + 1] - time[sample], 0.5)
    limit = max(least, BEYOND * float(np.quantile(_odd(x, time, sample), 0.999)), 2 * _quantile(size, 0.999))
    large = np.flatnonzero(size[2:-2] > 0.5 * limit) + 2
    large = large[time[large + 1] - time[large] <= 1.5 * usual]
    return large[_odd(x, time, large) > limit]


def _odd(x: np.ndarray, time: np.ndarray, k: np.ndarray) -> np.ndarray:
    """What the speed around the steps from x[k] to x[k + 1] does not explain of them."""
    around = np.sort([(x[k + i + 1] - x[k + i]) / (time[k + i + 1] - time[k + i]) for i in (-2, -1, 1, 2)], axis=0)
    # The middle of four neighbours: one that is odd itself does not count.
    expected = 0.5 * (around[1] + around[2]) if len(k) else np.empty(0)
    return np.abs(x[k + 1] - x[k] - expected * (time[k + 1] - time[k]))


def runs(same: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(starts, lengths) of the runs of True in same (M,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8)))
    return edges[::2], edges[1::2] - edges[::2]


def robust_range(x: np.ndarray) -> float:
    """From the first to the last percent of the values of x (N,), which single outliers do not widen."""
    low, high = np.quantile(_some(x), [0.01, 0.99])
    return float(high - low)


def _height(step: np.ndarray, k: np.ndarray, width: int) -> np.ndarray:
    """Height of what rises at the steps k and falls `width` steps later, or the other way round; else 0."""
    up, down = step[k], step[k + width]
    return np.where(up * down < 0, np.minimum(np.abs(up), np.abs(down)), 0.0)


def _quantile(values: np.ndarray, share: float) -> float:
    return float(np.quantile(_some(values), share))


def _some(values: np.ndarray) -> np.ndarray:
    return values[:: max(1, len(values) // _ENOUGH)]
