"""Expression graphs as named statements: the same values, nothing computed twice, names that tell what they are."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from programs import Program, on_expressions, programs

from identify.symbolic.expression import Graph, cos, evaluate, sin
from identify.symbolic.naming import graph_of, named, recognised, short_statements


def computed(statements: dict[str, sympy.Expr], values: dict[str, float]) -> dict[str, complex]:
    known: dict[str, complex] = dict(values)
    for name, expression in statements.items():
        point = {s: sympy.Float(known[s.name]) for s in expression.free_symbols}
        known[name] = float(expression.xreplace(point).evalf())
    return known


@settings(deadline=None, max_examples=60)
@given(programs(("add", "sub", "mul", "neg")))
def test_statements_compute_what_the_graph_does(program: Program) -> None:
    """x is made a joint variable, so that y and z are constants beside it."""
    outputs = on_expressions(program)[-3:]
    names = {f"out{k}": e for k, e in enumerate(outputs)}
    graph = outputs[0].graph
    moving = {f"out{k}": e + graph.symbol("q1") * e for k, e in enumerate(outputs)}
    values = {"x": 0.7, "y": -1.3, "z": 0.4, "q1": 0.9}
    for given_outputs in (names, moving):
        known = computed(named(given_outputs), values)
        expected = evaluate(list(given_outputs.values()), values)
        np.testing.assert_allclose([known[k] for k in given_outputs], expected, rtol=1e-9, atol=1e-9)


def test_what_is_read_twice_is_a_statement_and_what_is_read_once_is_none() -> None:
    graph = Graph()
    q, a, b, dq = graph.symbol("q1"), graph.symbol("a"), graph.symbol("b"), graph.symbol("dq1")
    twice = dq * cos(q) + a
    found = named({"u": twice * twice + sin(q) * b, "v": twice + (a - b) * dq})
    assert list(found) == ["C1", "t1", "S1", "u", "v"]
    assert found["u"] == sympy.Symbol("t1") ** 2 + sympy.Symbol("S1") * sympy.Symbol("b")


def test_constants_are_summed_up_before_they_are_named() -> None:
    """½(x + y − z) + ½(z + x − y) is x, whatever it was made of."""
    graph = Graph()
    x, y, z, q = (graph.symbol(name) for name in ("x", "y", "z", "q1"))
    one, other = 0.5 * (x + y - z), 0.5 * (z + x - y)
    found = named({"u": (one + other) * q + one * cos(q), "v": one * sin(q)})
    assert found["u"] == sympy.Symbol("x") * sympy.Symbol("q1") + sympy.Symbol("k1") * sympy.Symbol("C1")
    assert sympy.expand(found["k1"] - (sympy.Symbol("x") + sympy.Symbol("y") - sympy.Symbol("z")) / 2) == 0


def test_cosines_are_called_as_in_the_chapter_and_never_as_a_length() -> None:
    graph = Graph()
    q2, q3, length = graph.symbol("q2"), graph.symbol("q3"), graph.symbol("C23")
    found = named({"x": length * cos(q2 + q3) + sin(q2 - q3), "y": cos(q3)})
    assert found["C23_"] == sympy.cos(sympy.Symbol("q2") + sympy.Symbol("q3"))
    assert found["S2m3"] == sympy.sin(sympy.Symbol("q2") - sympy.Symbol("q3"))
    assert found["x"] == sympy.Symbol("C23") * sympy.Symbol("C23_") + sympy.Symbol("S2m3")


def test_quantities_are_recognised_however_they_are_written() -> None:
    ours, theirs = Graph(), Graph()
    a, b, q = (ours.symbol(name) for name in ("a", "b", "q1"))
    product = (a + b) * q
    x, y, z = (theirs.symbol(name) for name in ("a", "b", "q1"))
    found = recognised([product * product + a], {"P": z * y + x * z, "other": x * z})
    assert found == {product.index: "P"}
    statements = short_statements({"u": product * product, "v": product * cos(q)}, {"P": z * y + x * z})
    assert sympy.expand(statements["P"] - sympy.Symbol("q1") * (sympy.Symbol("a") + sympy.Symbol("b"))) == 0


def test_formulas_become_graphs_and_others_are_refused() -> None:
    q, a = sympy.symbols("q1 a")
    formula = 3 * a**2 * sympy.cos(q) - sympy.sin(2 * q) / 4 + a
    values = {"q1": 0.6, "a": -1.7}
    (found,) = evaluate([graph_of(Graph(), formula)], values)
    assert found == pytest.approx(float(formula.subs({q: 0.6, a: -1.7})), rel=1e-14)
    with pytest.raises(ValueError, match="no polynomial"):
        graph_of(Graph(), 1 / a)
