"""Cosine and sine in sums and products, against ones of higher precision."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import sympy

from identify.symbolic.circular import QUARTER, as_arithmetic
from identify.symbolic.expression import Graph, cos, evaluate, reachable, sin
from identify.symbolic.printing import compiled, compiled_for_one

INPUTS = {"x": 0}


def both(x: np.ndarray) -> np.ndarray:
    graph = Graph()
    angle = graph.symbol("x")
    function, rows = compiled("f", INPUTS, as_arithmetic([cos(angle), sin(angle)]))
    out = np.empty((2, len(x)))
    function(x[None], out, np.empty((rows, len(x))))
    return out


@pytest.mark.parametrize("span", [0.8, 7.0, 1e3, 1e6])
def test_the_error_is_in_the_last_bit(span: float) -> None:
    x = np.random.default_rng(0).uniform(-span, span, 200_000)
    wide = x.astype(np.longdouble)
    expected = np.array([np.cos(wide), np.sin(wide)])
    assert np.abs(both(x) - expected).max() < 2.3e-16


def test_quarter_turns_and_their_neighbours() -> None:
    """Where the nearest quarter turn changes, and where a function is next to nothing, by 40 digits."""
    turns = np.arange(-9, 10)
    x = np.concatenate([turns * np.pi / 2, turns * np.pi / 2 + 1e-9, (turns + 0.5) * np.pi / 2, [0.0, -0.0, 1e-300]])
    x = np.concatenate([x, np.nextafter(x, 10), np.nextafter(x, -10)])
    exact = [[float(f(sympy.Float(v, 40))) for v in x] for f in (sympy.cos, sympy.sin)]
    np.testing.assert_allclose(both(x), exact, rtol=2.3e-16, atol=1e-25)
    assert both(np.array([0.0])).tolist() == [[1.0], [0.0]]


def test_what_is_no_angle_stays_so() -> None:
    assert np.isnan(both(np.array([np.nan]))).all()


def test_the_parts_make_a_quarter_turn() -> None:
    total = sum(sympy.Rational(part) for part in QUARTER)
    assert abs(sympy.N(total - sympy.pi / 2, 50)) < 1e-36
    for part in QUARTER[:2]:
        assert Fraction(part) * (2**20 - 1) == Fraction(part * (2**20 - 1))


def test_no_function_is_left_and_one_angle_is_worked_out_once() -> None:
    graph = Graph()
    x, y = graph.symbol("x"), graph.symbol("y")
    nested = sin(cos(x) * y) + cos(x) * sin(x)
    outputs = as_arithmetic([nested, cos(x), x])
    operations = [graph.nodes[i][0] for i in reachable(graph, outputs)]
    assert not {"cos", "sin"} & set(operations)
    assert len(reachable(graph, as_arithmetic([cos(x), sin(x)]))) < 1.5 * len(reachable(graph, as_arithmetic([cos(x)])))
    values = {"x": 0.7, "y": -2.3}
    np.testing.assert_allclose(evaluate(outputs, values), evaluate([nested, cos(x), x], values), rtol=1e-15)


def test_python_and_numpy_agree_to_the_bit() -> None:
    graph = Graph()
    angle = graph.symbol("x")
    single = compiled_for_one("f", INPUTS, as_arithmetic([cos(angle), sin(angle)]))
    x = np.random.default_rng(1).uniform(-30, 30, 500)
    np.testing.assert_array_equal(np.transpose([single([v]) for v in x.tolist()]), both(x))
