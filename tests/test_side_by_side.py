"""Work side by side: in order, few ahead of what is taken, errors in their place, never a pool within a pool."""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Iterator

import pytest

from identify import side_by_side
from identify.side_by_side import mapped, meanwhile, workers


@pytest.fixture(params=[1, 2, 4])
def threads(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(side_by_side, "workers", lambda: request.param)
    return int(request.param)


def counted(taken: list[int], total: int = 100) -> Iterator[int]:
    for k in range(total):
        taken.append(k)
        yield k


def test_results_come_in_order_and_few_items_are_made_ahead(threads: int) -> None:
    taken: list[int] = []
    for k, square in enumerate(mapped(lambda x: x * x, counted(taken))):
        assert square == k * k
        assert len(taken) <= k + 2 + threads
    assert len(taken) == 100
    assert list(mapped(str, [])) == []


def test_an_error_comes_in_its_place_and_ends_the_work(threads: int) -> None:
    taken: list[int] = []
    found = mapped(lambda x: 1 / (x - 3), counted(taken))
    assert [next(found) for _ in range(3)] == [-1 / 3, -1 / 2, -1.0]
    with pytest.raises(ZeroDivisionError):
        next(found)
    assert len(taken) <= 5 + threads


def test_meanwhile_gives_the_result_or_raises_the_error(threads: int) -> None:
    assert meanwhile(lambda: 7)() == 7
    with pytest.raises(ZeroDivisionError):
        meanwhile(lambda: 1 // 0)()


def test_parts_of_parts_are_worked_on_in_place() -> None:
    """Waiting in a thread for others of the same few would never end."""

    def inner(k: int) -> tuple[int, int, int]:
        here = threading.get_ident()
        return workers(), here, next(mapped(lambda _: threading.get_ident(), [k]))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(side_by_side.os, "sched_getaffinity", lambda _: range(3), raising=False)
        assert workers() == 3
        for count, outer, within in mapped(inner, range(20)):
            assert count == 1
            assert outer == within != threading.get_ident()


def test_one_of_many_processes_has_one_thread() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(workers) == 1
