"""Simplified expressions: the same values, fewer operations, counted by the chapter's convention."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from programs import SYMBOLS, Program, on_expressions, programs

from identify.symbolic.expression import Graph, cos, evaluate, sin
from identify.symbolic.operations import Operations, count
from identify.symbolic.simplification import simplified


@settings(max_examples=150, deadline=None)
@given(programs())
def test_simplified_programs_keep_their_values(program: Program) -> None:
    outputs = on_expressions(program)[-4:]
    point = dict(zip(SYMBOLS, (0.7, -0.4, 0.3), strict=True))
    before, after = evaluate(outputs, point), evaluate(simplified(outputs), point)
    # Rearranged sums round differently, by the size of their terms; programs without cancellation stay small.
    scale = max(1.0, *(abs(x) for x in evaluate(on_expressions(program), point)))
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-9 * scale**2)


def test_counting() -> None:
    """Every product and every binary sum of variables counts; sines, signs and constants among themselves do not."""
    graph = Graph()
    q, dq, zz, yy = (graph.symbol(name) for name in ("q1", "dq1", "ZZ1", "YY1"))
    assert count([(zz - yy) * (dq * dq)]) == Operations(2, 0, 0)
    assert count([-(sin(q) * zz) - cos(q)]) == Operations(1, 1, 2)
    assert count([dq * 2.0 + 3.0, dq * 2.0]) == Operations(1, 1, 0)
    assert count([]) == Operations(0, 0, 0)


@pytest.mark.parametrize(
    ("build", "expected"),
    [
        (lambda a, b, c: [a - b, b - a], Operations(0, 1, 0)),
        (lambda a, b, c: [a * b + a * c], Operations(1, 1, 0)),
        (lambda a, b, c: [(a + b) + c, (a + c) + b], Operations(0, 2, 0)),
        (lambda a, b, c: [(a * b) * c, (a * c) * b], Operations(2, 0, 0)),
        (lambda a, b, c: [2.0 * a + 3.0 * a], Operations(1, 0, 0)),
        (lambda a, b, c: [a + b - c, c - b - a], Operations(0, 2, 0)),
    ],
)
def test_rearrangements(build: object, expected: Operations) -> None:
    graph = Graph()
    found = simplified(build(*(graph.symbol(f"q{k + 1}") for k in range(3))))  # type: ignore[operator]
    assert count(found) == expected


def test_a_term_that_stands_twice_in_some_sums_and_once_in_another() -> None:
    """The pair a + a is shared by the sums that hold it; a sum with a single a keeps it."""
    graph = Graph()
    a, b, c, d = (graph.symbol(f"q{k + 1}") for k in range(4))
    outputs = [a + (a + b), a + (a + c), a + d]
    found = simplified(outputs)
    assert count(found) == Operations(0, 4, 0)
    point = dict(zip(("q1", "q2", "q3", "q4"), (0.7, -0.4, 0.3, 1.9), strict=True))
    np.testing.assert_allclose(evaluate(found, point), evaluate(outputs, point), rtol=1e-15)
