"""Printed NumPy code: equal to the expressions whatever rows it uses again, and without allocation."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from programs import ARITHMETIC, SYMBOLS, Program, on_expressions, programs

from identify.symbolic.expression import Expression, Graph, cos, evaluate, sin
from identify.symbolic.printing import compiled, compiled_for_one, numpy_source

INPUTS = {name: row for row, name in enumerate(SYMBOLS)}
X = np.random.default_rng(3).uniform(-1.5, 1.5, (3, 7))


def printed(outputs: list[Expression], x: np.ndarray = X) -> np.ndarray:
    """Values (outputs, N) by the printed function, every array poisoned beforehand."""
    function, rows = compiled("f", INPUTS, outputs)
    out, work = np.full((len(outputs), x.shape[1]), np.nan), np.full((rows, x.shape[1]), np.nan)
    before = x.copy()
    function(x, out, work)
    np.testing.assert_array_equal(x, before)
    return out


def reference(outputs: list[Expression], x: np.ndarray = X) -> np.ndarray:
    return np.array([evaluate(outputs, dict(zip(SYMBOLS, column, strict=True))) for column in x.T]).T


@settings(max_examples=150, deadline=None, derandomize=True)
@given(programs(ARITHMETIC, longest=40), st.lists(st.integers(0, 47), min_size=1, max_size=12))
def test_rows_used_again_corrupt_nothing(program: Program, chosen: list[int]) -> None:
    """Any values may be outputs: inner ones, repeated ones, symbols, constants. Arithmetic agrees to the bit."""
    expressions = on_expressions(program)
    outputs = [expressions[k % len(expressions)] for k in chosen]
    expected = reference(outputs)
    assume(np.all(np.isfinite(expected)) and np.abs(expected).max() < 1e100)
    np.testing.assert_array_equal(printed(outputs), expected)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(programs(longest=20))
def test_cosines_and_sines_agree(program: Program) -> None:
    expressions = on_expressions(program)
    expected = reference(expressions)
    # Where values grow, the last bit in which two cosines differ grows with them.
    assume(np.abs(expected).max() < 100)
    np.testing.assert_allclose(printed(expressions), expected, rtol=0, atol=1e-9)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(programs(longest=30), st.lists(st.integers(0, 37), max_size=8))
def test_code_for_one_sample_agrees_to_the_bit(program: Program, chosen: list[int]) -> None:
    expressions = on_expressions(program)
    outputs = [expressions[k % len(expressions)] for k in chosen]
    expected = reference(outputs).T[2].tolist() if outputs else []
    assume(np.all(np.isfinite(expected)))
    function = compiled_for_one("f", INPUTS, outputs)
    assert list(function(X[:, 2].tolist())) == expected


def test_a_row_may_be_one_number_for_all_samples() -> None:
    graph = Graph()
    x, y, z = (graph.symbol(name) for name in SYMBOLS)
    outputs = [x * y + z, y * 0.5, y, sin(y) * x]
    function, rows = compiled("f", INPUTS, outputs)
    out = np.empty((4, 7))
    function([X[0], -1.25, X[2]], out, np.empty((rows, 7)))
    same = X.copy()
    same[1] = -1.25
    np.testing.assert_allclose(out, reference(outputs, same), rtol=1e-14)


def test_outputs_that_are_leaves_or_repeated() -> None:
    graph = Graph()
    x, y = graph.symbol("x"), graph.symbol("y")
    product = x * y
    outputs = [graph.constant(2.5), x, product, product + 1, product, x, graph.constant(2.5)]
    expected = [np.full(7, 2.5), X[0], X[0] * X[1], X[0] * X[1] + 1, X[0] * X[1], X[0], np.full(7, 2.5)]
    np.testing.assert_array_equal(printed(outputs), expected)


def test_no_outputs() -> None:
    function, rows = compiled("f", INPUTS, [])
    function(X, np.empty((0, 7)), np.empty((0, 7)))
    assert rows == 0


def test_a_long_chain_needs_few_rows() -> None:
    graph = Graph()
    x, y = graph.symbol("x"), graph.symbol("y")
    value = x
    for _ in range(200):
        value = cos(value) * y + sin(value)
    assert numpy_source("f", INPUTS, [value])[1] <= 3


def test_the_source_does_not_change_from_run_to_run() -> None:
    expressions = [on_expressions([("mul", 7, 6), ("sub", 0, 3), ("cos", 0, 0), ("add", 2, 0)]) for _ in range(2)]
    sources = [numpy_source("f", INPUTS, outputs) for outputs in expressions]
    assert sources[0] == sources[1]


def test_an_unknown_symbol_is_named() -> None:
    with pytest.raises(KeyError, match="torque7"):
        numpy_source("f", INPUTS, [Graph().symbol("torque7")])


def test_nothing_is_allocated() -> None:
    graph = Graph()
    x, y, z = (graph.symbol(name) for name in SYMBOLS)
    outputs = [cos(x * y) * z - sin(x) * x, -(y * z) + x * 0.3, x * x * x]
    function, rows = compiled("f", INPUTS, outputs)
    samples = 100_000
    block = np.random.default_rng(1).normal(size=(3, samples))
    out, work = np.empty((3, samples)), np.empty((rows, samples))
    tracemalloc.start()
    function(block, out, work)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 * samples / 10, "a tenth of one row"
    np.testing.assert_allclose(out[:, :20], reference(outputs, block[:, :20]), rtol=1e-12, atol=1e-12)
