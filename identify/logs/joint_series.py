"""Joint states of one publisher, gathered message by message into arrays that grow in place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_FIRST_ROWS = 1 << 10
_GROWTH = 8
_MANY_ROWS = 1 << 17
_SPARE = 1.02
_BLOCK = 1 << 16


@dataclass(frozen=True, eq=False)
class Block:
    """Joint states with the same names: stamps and log times (k,) [ns], values (k, n); velocity, effort or None."""

    joints: tuple[str, ...]
    stamp: np.ndarray
    log_time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None
    effort: np.ndarray | None


class Series:
    """Joint states of the publisher of `publishes` on `topic`: those of `joints` are kept, or none where None.

    samples: how many came; first_log_time: of the first one [ns]. The arrays hold no more than an eighth beyond
    what came, so that a long recording never lies in memory twice.
    """

    def __init__(
        self, topic: str, rank: int, publishes: tuple[str, ...], joints: tuple[str, ...] | None, skip: Sequence[str]
    ) -> None:
        self.topic = topic
        self.rank = rank
        self.publishes = publishes
        self.joints = joints
        self.samples = 0
        self.first_log_time = 0
        self._skip = frozenset(skip)
        self._times = {name: np.empty(0, dtype=np.int64) for name in ("stamp", "log_time")}
        self._values: dict[str, np.ndarray] = {}

    def add(self, block: Block, share: float = 1.0, most: int = 0) -> None:
        """Append the rows of a block, whose joints are those of the publisher in any order.

        share: how much of the recording has been read with it, from which the room for the rest is guessed, `most`
        rows at most.
        """
        begin, end = self.samples, self.samples + len(block.stamp)
        if not begin:
            self.first_log_time = int(block.log_time[0])
        self.samples = end
        if self.joints is None:
            return
        self._reserve(end, min(most, int(_SPARE * end / share)))
        self._times["stamp"][begin:end] = block.stamp
        self._times["log_time"][begin:end] = block.log_time
        whole = self.joints == block.joints
        columns = None if whole else [block.joints.index(joint) for joint in self.joints]
        for name in ("position", "velocity", "effort"):
            values = getattr(block, name)
            if name in self._skip:
                continue
            if values is None:
                if name in self._values:
                    self._values[name][begin:end] = np.nan
                continue
            if name not in self._values:
                self._values[name] = np.empty((self._room, len(self.joints)))
                self._values[name][:begin] = np.nan
            self._values[name][begin:end] = values if columns is None else values[:, columns]

    def times(self, name: str) -> np.ndarray:
        """(N,) int64 `stamp` or `log_time` [ns]."""
        return self._times[name][: self.samples]

    def take(self, name: str) -> np.ndarray | None:
        """(N, n) position, velocity or effort, or None where no message had it; the series lets go of it."""
        values = self._values.pop(name, None)
        if values is not None:
            values.resize((self.samples, values.shape[1]), refcheck=False)
        return values

    def take_seconds(self, name: str) -> np.ndarray:
        """(N,) float64 seconds since the first one, by `stamp` or `log_time`, in the place of the integers."""
        times = self._times.pop(name)
        times.resize(self.samples, refcheck=False)
        seconds = times.view(np.float64)
        origin = int(times[0])
        for start in range(0, len(times), _BLOCK):
            part = slice(start, start + _BLOCK)
            seconds[part] = (times[part] - origin) / 1e9
        return seconds

    @property
    def _room(self) -> int:
        return len(self._times["stamp"])

    def _reserve(self, rows: int, guess: int) -> None:
        """Room for so many rows; growing moves pages and copies nothing once the arrays are large."""
        if rows <= self._room:
            return
        room = max(rows, _FIRST_ROWS, guess, self._room + self._room // (1 if self._room < _MANY_ROWS else _GROWTH))
        for name, times in self._times.items():
            self._times[name] = _grown(times, room)
        for name, values in self._values.items():
            self._values[name] = _grown(values, room)


def _grown(values: np.ndarray, room: int) -> np.ndarray:
    if not len(values):
        # Memory that is not touched costs nothing.
        return np.empty((room, *values.shape[1:]), dtype=values.dtype)
    values.resize((room, *values.shape[1:]), refcheck=False)
    return values
