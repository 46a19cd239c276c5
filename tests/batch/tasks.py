"""Functions that tests hand to other processes, which import them by name."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable

Progress = Callable[[float, str], None]


def work(what: str, progress: Progress) -> str:
    """Do what the word says: "die", "exit", "raise", "slow", or anything else, which is returned with this process."""
    progress(0.5, what)
    if what == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if what == "exit":
        os._exit(7)
    if what == "raise":
        raise ValueError(what)
    if what == "slow":
        time.sleep(60)
    return f"{what} {os.getpid()} {os.environ.get('OMP_NUM_THREADS')}"
