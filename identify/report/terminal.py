"""A log in the terminal: position and effort of every joint as strips of braille dots, 80 columns wide."""

from __future__ import annotations

import numpy as np

from identify.logs.log import Log

NAME, CELLS, ROWS = 12, 32, 2
"""Letters of a joint's name; characters of a strip, 2 dots wide and 4 high each; lines of a strip."""
_BLANK = 0x2800
_DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
"""Bits of a braille character, row by row from the top."""


def picture(log: Log) -> str:
    """Position and effort of every joint over time, from each channel's lowest to its highest value."""
    head = f"{'':{NAME}} {'position':<{CELLS}} {'effort' if log.effort is not None else '':<{CELLS}}".rstrip()
    lines = [head]
    for j, joint in enumerate(log.joints):
        name = joint if len(joint) <= NAME else joint[: NAME - 1] + "…"
        left = strip(log.time, log.position[:, j])
        right = [""] * ROWS if log.effort is None else strip(log.time, log.effort[:, j])
        for row, (a, b) in enumerate(zip(left, right, strict=True)):
            lines.append(f"{name if row == 0 else '':{NAME}} {a} {b}".rstrip())
    lines.append(f"{'':{NAME}} {_axis(log.duration)} {_axis(log.duration) if log.effort is not None else ''}".rstrip())
    return "\n".join(lines)


def strip(time: np.ndarray, x: np.ndarray) -> list[str]:
    """ROWS lines of CELLS characters: the range of x (N,) in every fraction of time (N,) [s]; gaps stay empty."""
    columns, height = 2 * CELLS, 4 * ROWS
    dots = np.zeros((height, columns), dtype=bool)
    seen = np.isfinite(x)
    if seen.any():
        time, x = time[seen], x[seen]
        low, span = float(x.min()), float(np.ptp(x))
        level = np.full(len(x), height // 2) if span == 0 else np.rint((x - low) / span * (height - 1)).astype(int)
        lapse = float(np.ptp(time)) or 1.0
        column = np.minimum((time - time[0]) / lapse * columns, columns - 1).astype(int)
        starts = np.flatnonzero(np.diff(column, prepend=-1))
        lowest, highest = np.minimum.reduceat(level, starts), np.maximum.reduceat(level, starts)
        for at, bottom, top in zip(column[starts], lowest, highest, strict=True):
            dots[height - 1 - top : height - bottom, at] = True
    cells = dots.reshape(ROWS, 4, CELLS, 2)
    codes = _BLANK + (cells * _DOTS[None, :, None, :]).sum(axis=(1, 3))
    return ["".join(map(chr, row)) for row in codes]


def _axis(duration: float) -> str:
    """A line of time beneath a strip."""
    end = f"{duration:.4g} s"
    return f"0{end:>{CELLS - 1}}"
