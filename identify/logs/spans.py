"""Slopes and means over a short time around every sample, however uneven the clock."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

_BLOCK = 1 << 15


@dataclass(frozen=True)
class Spans:
    """Around each of N samples: the nearest samples at least half the span before and after it, or the log's ends.

    time, first, last (N,). Columns are worked on in blocks: a log may be long.
    """

    time: np.ndarray
    first: np.ndarray
    last: np.ndarray

    @staticmethod
    def of(time: np.ndarray, span: float) -> Spans:
        """The spans of `span` [s] around strictly increasing times (N,) [s]."""
        first, last = (np.empty(len(time), dtype=np.int32) for _ in range(2))
        for rows in _blocks(len(time)):
            at = time[rows]
            # At a rate too low for the span, the neighbours serve.
            after = np.maximum(np.searchsorted(time, at + span / 2), np.arange(rows.start, rows.stop) + 1)
            last[rows] = np.minimum(after, len(time) - 1)
            first[rows] = np.maximum(np.searchsorted(time, at - span / 2, side="right") - 1, 0)
        return Spans(time, first, last)

    def slope(self, x: np.ndarray) -> np.ndarray:
        """(N,) mean slope of x (N,) over each span; 0 where there is but one sample."""
        out = np.zeros(len(x))
        for rows in _blocks(len(x)):
            first, last = self.first[rows], self.last[rows]
            lapse = self.time[last] - self.time[first]
            np.divide(x[last] - x[first], lapse, out=out[rows], where=lapse > 0)
        return out

    def mean(self, x: np.ndarray) -> np.ndarray:
        """(N,) mean of x (N,) over each span, by the trapezoidal rule."""
        way = np.zeros(len(x))
        for rows in _blocks(len(x) - 1):
            ends = slice(rows.start + 1, rows.stop + 1)
            way[ends] = 0.5 * (x[ends] + x[rows]) * (self.time[ends] - self.time[rows])
        return self.slope(np.cumsum(way, out=way))


def _blocks(count: int) -> Iterator[slice]:
    return (slice(start, min(start + _BLOCK, count)) for start in range(0, count, _BLOCK))
