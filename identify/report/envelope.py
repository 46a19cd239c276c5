"""Long signals made short without losing a peak: extremes per bin, spans of rest, levels of a heat strip."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

GAP = 5.0  # a step this many times the median step is a gap: no line is drawn across it


def envelope(time: np.ndarray, signal: np.ndarray, bins: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Time and value (K,) with K ≤ 2·bins + gaps, of a signal (M,): each bin's extremes, in the order they came.

    Bins hold equally many samples. Non-finite samples and gaps in time break the line with a NaN.
    """
    time, signal = np.asarray(time, dtype=float), np.asarray(signal, dtype=float)
    edges = np.unique(np.linspace(0, len(signal), min(bins, max(len(signal), 1)) + 1).astype(int))
    keep: list[int] = []
    for a, b in pairwise(edges):
        block = signal[a:b]
        finite = np.flatnonzero(np.isfinite(block))
        if len(finite) < b - a:
            keep.append(a + int(np.flatnonzero(~np.isfinite(block))[0]))
        if len(finite):
            keep += [a + int(finite[np.argmin(block[finite])]), a + int(finite[np.argmax(block[finite])])]
    index = np.unique(np.array(keep, dtype=int))
    x, y = time[index], np.where(np.isfinite(signal[index]), signal[index], np.nan)
    return _broken(x, y, time)


def _broken(x: np.ndarray, y: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x, y with a NaN row put in wherever the recording itself has a gap."""
    steps = np.diff(time)
    if len(steps) < 2:
        return x, y
    ends = time[1:][steps > GAP * np.median(steps)]
    at = np.searchsorted(x, ends)
    return np.insert(x, at, ends), np.insert(y, at, np.nan)


def spans(time: np.ndarray, mask: np.ndarray, resolution: int = 400) -> list[tuple[float, float]]:
    """(start, stop) of the runs where mask (M,) is true, runs nearer than duration/resolution merged into one."""
    mask = np.asarray(mask, dtype=bool)
    if not mask.any():
        return []
    change = np.flatnonzero(np.diff(np.concatenate([[0], mask.view(np.int8), [0]])))
    starts, stops = time[change[::2]], time[np.minimum(change[1::2], len(time) - 1)]
    least = (time[-1] - time[0]) / resolution
    merged: list[tuple[float, float]] = []
    for a, b in zip(starts.tolist(), stops.tolist(), strict=True):
        if merged and a - merged[-1][1] < least:
            merged[-1] = (merged[-1][0], b)
        else:
            merged.append((a, b))
    return merged


def binned(values: np.ndarray, bins: int) -> np.ndarray:
    """(bins, n) root mean square of values (M, n) over equal runs of rows."""
    edges = np.linspace(0, len(values), bins + 1).astype(int)
    squares = np.nan_to_num(np.asarray(values, dtype=float)) ** 2
    return np.sqrt(np.array([squares[a:b].mean(axis=0) for a, b in pairwise(edges)]))


def runs(levels: np.ndarray, level: int) -> list[tuple[int, int]]:
    """(start, stop) of the runs of one level in levels (K,)."""
    change = np.flatnonzero(np.diff(np.concatenate([[0], (levels == level).view(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(change[::2], change[1::2], strict=True)]


def quantiles(x: np.ndarray, y: np.ndarray, bins: int = 48) -> tuple[np.ndarray, np.ndarray]:
    """Centres (K,) of equal bins over x and the 5, 50 and 95 % quantiles (K, 3) of y in each; bins under 3 left out."""
    good = np.isfinite(x) & np.isfinite(y)
    x, y = np.asarray(x)[good], np.asarray(y)[good]
    if not len(x) or x.min() == x.max():
        return np.empty(0), np.empty((0, 3))
    edges = np.linspace(x.min(), x.max(), bins + 1)
    which = np.clip(np.digitize(x, edges) - 1, 0, bins - 1)
    full = [k for k in range(bins) if np.count_nonzero(which == k) >= 3]
    centres = 0.5 * (edges[:-1] + edges[1:])[full]
    return centres, np.array([np.quantile(y[which == k], [0.05, 0.5, 0.95]) for k in full]).reshape(-1, 3)
