"""The expression graph: nodes are stored once, folding changes no value, the reverse sweep is the derivative."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from programs import ARITHMETIC, CONSTANTS, SYMBOLS, Program, on_expressions, on_numbers, programs, run

from identify.symbolic.expression import Expression, Graph, cos, evaluate, gradient, reachable, sin

points = st.tuples(*[st.floats(-2, 2, allow_subnormal=False)] * 3)
BIG = 1e4


def same(a: Expression, b: Expression) -> bool:
    return a.graph is b.graph and a.index == b.index


def test_an_expression_is_stored_once() -> None:
    graph = Graph()
    x, y = graph.symbol("x"), graph.symbol("y")
    first = cos(x) * y + x * y
    size = len(graph.nodes)
    assert same(first, y * x + y * cos(graph.symbol("x")))
    assert len(graph.nodes) == size
    assert not same(x - y, y - x)
    assert not same(cos(x), sin(x))
    assert all(argument < i for i, node in enumerate(graph.nodes) if node[0] not in ("symbol", "constant")
               for argument in node[1:])  # fmt: skip


def test_neutral_elements_and_signs_fold_away() -> None:
    graph = Graph()
    x, y, zero = graph.symbol("x"), graph.symbol("y"), graph.constant(0)
    for whole in (x + 0, 0 + x, x - 0, x * 1, 1 * x, 0.0 - (-x), x + zero, x - zero):
        assert same(whole, x)
    minus = -x
    assert same(-minus, x)
    for nothing in (x * 0, 0 * x, x - x, x + (-x), (-x) + x, zero * x, -zero):
        assert same(nothing, zero)
    assert same(x * -1, -x)
    assert same(0 - x, -x)
    assert same(x + (-y), x - y)
    assert same((-x) + y, y - x)
    assert same(x - (-y), x + y)
    assert same(-(x - y), y - x)
    assert same((-x) * y, -(x * y))
    assert same((-x) * (-y), x * y)


def test_constants_are_computed() -> None:
    graph = Graph()
    a, b = graph.constant(0.3), graph.constant(-2.5)
    assert [(a + b).value, (a - b).value, (a * b).value, (-a).value] == [0.3 - 2.5, 0.3 + 2.5, 0.3 * -2.5, -0.3]
    assert [cos(a).value, sin(a).value] == [math.cos(0.3), math.sin(0.3)]
    assert (2 - a).value == 1.7
    assert graph.symbol("x").value is None


@settings(max_examples=150, deadline=None, derandomize=True)
@given(programs(ARITHMETIC), points)
def test_folding_changes_no_bit_of_arithmetic(program: Program, point: tuple[float, ...]) -> None:
    direct = run(program, [*point, *CONSTANTS], math.cos, math.sin)
    assume(all(abs(value) < BIG for value in direct))
    expressions = on_expressions(program)
    assert evaluate(expressions, dict(zip(SYMBOLS, point, strict=True))) == direct


def test_only_what_outputs_read_is_evaluated() -> None:
    graph = Graph()
    x, unused = graph.symbol("x"), graph.symbol("unused")
    dead = sin(unused) * x
    output = cos(x) + 1
    assert dead.index not in reachable(graph, [output])
    assert evaluate([output, output, x], {"x": 0.5}) == [math.cos(0.5) + 1, math.cos(0.5) + 1, 0.5]
    with pytest.raises(KeyError, match="unused"):
        evaluate([dead], {"x": 0.5})


@settings(max_examples=150, deadline=None, derandomize=True)
@given(programs(longest=14), points, st.integers(0, 2))
def test_gradient_is_the_complex_step_derivative(program: Program, point: tuple[float, ...], which: int) -> None:
    """Im f(x + i·h)/h at h = 1e-100 has no truncation and no cancellation error (Squire & Trapp 1998)."""
    at = dict(zip(SYMBOLS, point, strict=True))
    stepped = [complex(x, 1e-100 * (k == which)) for k, x in enumerate(point)]
    numbers = on_numbers(program, stepped)
    assume(all(abs(value) < BIG and abs(value.imag) < BIG * 1e-100 for value in numbers))
    expressions = on_expressions(program)
    outputs = expressions[-3:]
    weights = [outputs[0].graph.symbol(f"weight{k}") for k in range(3)]
    values = {"weight0": 0.7, "weight1": -1.3, "weight2": 2.1}
    expected = sum(w * value.imag / 1e-100 for w, value in zip(values.values(), numbers[-3:], strict=True))
    found = evaluate(gradient(outputs, weights, expressions[:3]), at | values)[which]
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_gradient_against_finite_differences_and_of_what_is_not_read() -> None:
    graph = Graph()
    x, y, z = (graph.symbol(name) for name in SYMBOLS)
    inner = x * y - sin(x)
    outputs = [inner * inner, cos(inner) - y, -inner]
    weights = [graph.constant(2), y, graph.constant(-0.5)]
    at = {"x": 0.4, "y": -1.1, "z": 3.0}

    def total(**changed: float) -> float:
        # Weights are held: they are factors of the sum, not part of what is differentiated.
        return sum(w * f for w, f in zip((2, at["y"], -0.5), evaluate(outputs, at | changed), strict=True))

    dx, dy, dz = evaluate(gradient(outputs, weights, [x, y, z]), at)
    step = 1e-6
    for found, name in ((dx, "x"), (dy, "y")):
        difference = total(**{name: at[name] + step}) - total(**{name: at[name] - step})
        assert found == pytest.approx(difference / (2 * step), rel=1e-8)
    assert dz == 0
