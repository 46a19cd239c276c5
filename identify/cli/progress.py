"""How far long work has come: one line on a terminal, which overwrites itself and leaves nothing behind."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

LEAST_PAUSE = 0.05
"""Seconds between two updates of the line."""
_CLEAR = "\r\x1b[K"


@contextmanager
def progress_line(stream: TextIO) -> Iterator[Callable[[float, str], None] | None]:
    """A function (fraction 0..1, text) that shows progress on `stream`; None where `stream` is no terminal."""
    if not stream.isatty():
        yield None
        return
    shown = ("", float("-inf"))

    def show(fraction: float, text: str) -> None:
        nonlocal shown
        line = f"{100 * min(max(fraction, 0.0), 1.0):3.0f} %  {text}"
        now = time.monotonic()
        if line == shown[0] or (now - shown[1] < LEAST_PAUSE and text == shown[0][7:]):
            return
        shown = (line, now)
        stream.write(_CLEAR + line[: shutil.get_terminal_size().columns - 1])
        stream.flush()

    try:
        yield show
    finally:
        stream.write(_CLEAR)
        stream.flush()
