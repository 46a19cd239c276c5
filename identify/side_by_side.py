"""Work on the parts of something long, side by side: filters, products and sorting leave the interpreter free."""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from threading import local
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

T = TypeVar("T")
R = TypeVar("R")

MOST = 4
"""Threads beyond which Python itself is what they wait for."""

_here = local()


def workers() -> int:
    """How many threads are worth having: one in a process that is itself one of many, and for parts of parts."""
    # It is loaded in every process that it has started.
    processes = sys.modules.get("multiprocessing")
    if getattr(_here, "at_work", False) or (processes and processes.parent_process()):
        return 1
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(cores, MOST)


def mapped(function: Callable[[T], R], items: Iterable[T]) -> Iterator[R]:
    """The function of each item, in their order, several at a time.

    Items are made one after the other in the caller's thread, few ahead of what is taken, so that they may build on one
    another and memory does not grow with their number. What the function raises comes in its place.
    """
    count = workers()
    if count == 1:
        yield from map(function, items)
        return
    pool = _threads(count)
    waiting: deque[Future[R]] = deque()
    try:
        for item in items:
            waiting.append(pool.submit(function, item))
            if len(waiting) > count:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        for future in waiting:
            future.cancel()


def meanwhile(function: Callable[[], R]) -> Callable[[], R]:
    """The function, called while the caller goes on with something else; what is returned waits for its result."""
    count = workers()
    return function if count == 1 else _threads(count).submit(function).result


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Threads cost more than they bring on matrices of this size: each hand-over takes longer than the work. They would
    also make the order of sums a matter of chance."""
    import scipy.linalg  # noqa: F401  loaded before the limit, which reaches only libraries that are there
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        yield


def give_back() -> None:
    """Return memory that is free to the system, where the C library keeps it for each thread, as glibc does."""
    from ctypes import CDLL

    trim = getattr(CDLL(None), "malloc_trim", None)
    if trim:
        trim(0)


@cache
def _threads(count: int) -> ThreadPoolExecutor:
    """The same ones for all work: each keeps memory of its own."""
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(count, initializer=lambda: setattr(_here, "at_work", True))
