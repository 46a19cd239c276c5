"""A function over many tasks, one process each, a few at a time; a process that dies costs its own task alone."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Environment variables that keep a process's linear algebra on one core."""


@dataclass(frozen=True)
class Done:
    """The task of this number has returned `result`, or died with `death`, one sentence."""

    index: int
    result: Any = None
    death: str = ""


@dataclass(frozen=True)
class Step:
    """The task of this number has come to `share` (0..1) of its work, which is `text`."""

    index: int
    share: float
    text: str


def over_processes(function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]], jobs: int) -> Iterator[Done | Step]:
    """Call function(*task, progress) for each task in a fresh process, at most `jobs` at once; tell as they come.

    `function` lies in a module, its arguments and result can be pickled. Processes are spawned, not forked. When the
    caller stops listening, for an interruption too, all are ended before it goes on; when this process is killed they
    end by themselves.
    """
    context = multiprocessing.get_context("spawn")
    resource_tracker.ensure_running()  # its start, within that of the first process, would unblock SIGINT
    waiting = list(range(len(tasks)))
    running: dict[Connection, tuple[int, Any]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                index = waiting.pop(0)
                ours, theirs = context.Pipe(duplex=False)
                process = context.Process(target=_work, args=(theirs, function, tasks[index]), daemon=True)
                with _one_thread(), _uninterrupted():
                    process.start()
                theirs.close()
                running[ours] = (index, process)
            for ready in wait(list(running)):
                assert isinstance(ready, Connection)
                index, process = running[ready]
                try:
                    kind, value = ready.recv()
                except (EOFError, OSError):
                    process.join()
                    kind, value = "death", _death(process.exitcode)
                if kind == "step":
                    yield Step(index, *value)
                    continue
                del running[ready]
                ready.close()
                process.join()
                yield Done(index, value) if kind == "result" else Done(index, death=value)
    finally:
        for ours, (_, process) in running.items():
            process.terminate()
            ours.close()
        for _, process in running.values():
            process.join()


def _work(pipe: Connection, function: Callable[..., Any], task: tuple[Any, ...]) -> None:
    """What each process does: the task, progress on the way, the result at the end."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    pipe.send(("result", function(*task, lambda share, text: pipe.send(("step", (share, text))))))
    pipe.close()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _death(status: int | None) -> str:
    if status is not None and status < 0:
        name = signal.Signals(-status).name
        hint = ", perhaps for lack of memory" if name == "SIGKILL" else ""
        return f"its process was ended by {name}{hint}; fit it alone"
    return f"its process ended with status {status} and no result; fit it alone"


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Processes started within never hear an interruption: their parent does, and ends them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _one_thread() -> Iterator[None]:
    """One thread of linear algebra for processes started within; what the user has set himself stays."""
    added = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(added, "1"))
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]
