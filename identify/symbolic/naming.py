"""An expression graph as named sympy expressions: one statement for what is read more than once, the rest in line."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from identify.symbolic.expression import (
    ARITHMETIC,
    OPERATIONS,
    Expression,
    Graph,
    Scalar,
    arguments,
    evaluate,
    reachable,
)
from identify.symbolic.form import turn_symbol
from identify.symbolic.geometry import canonical, trigonometric
from identify.symbolic.operations import varying
from identify.symbolic.simplification import simplified

if TYPE_CHECKING:
    import sympy

LONGEST = 12
"""Operations that one statement may hold before its inner part gets a name of its own."""

ALIKE = 1e-11
"""Relative difference of values below which two expressions are taken to be the same quantity."""


def named(
    outputs: Mapping[str, Expression], labels: Mapping[int, str] | None = None, as_counted: bool = False
) -> dict[str, sympy.Expr]:
    """The outputs under their names, and before them what they share: {name: expression}, in the order of computing.

    Cosines and sines are called as in the chapter (C2, S23); nodes in `labels` {index: name} by their label if they are
    a statement of their own; other shared ones t1, t2 …, and k1, k2 … those that only read parameters and lengths,
    which are summed up first. Names that a symbol has already get an underscore. `as_counted`: sums of joint variables
    that a cosine and a sine are of, and sums that hold a term twice, are statements too, so that the operations are
    those of the graph.
    """
    import sympy

    graph = next(iter(outputs.values())).graph
    labels = labels or {}
    order = reachable(graph, list(outputs.values()))
    angles, moving = _angles(graph, order), varying(graph, order)
    constants: dict[int, sympy.Expr] = {}
    for i in order:
        if i not in moving:
            constants[i] = _expression(graph.nodes[i], [constants[k] for k in arguments(graph.nodes[i])])
    readers = Counter(e.index for e in outputs.values())
    alike: Counter[sympy.Expr] = Counter()
    for i in reversed(order):
        # An opposite costs nothing: its readers read what stands behind the sign.
        times = readers[i] if graph.nodes[i][0] == "neg" else 1
        for k in arguments(graph.nodes[i]) if i in moving else ():
            readers[k] += times
            if k in constants:
                alike[constants[k]] += times
    taken = {graph.nodes[i][1] for i in order if graph.nodes[i][0] == "symbol"} | set(outputs)
    own: dict[int, str] = {}
    for name, e in outputs.items():
        if arguments(e.key):
            own.setdefault(e.index, name)
    result: dict[str, sympy.Expr] = {}
    place: dict[int, sympy.Expr] = {}
    size: dict[int, int] = {}
    known: dict[sympy.Expr, sympy.Symbol] = {}
    sums: dict[sympy.Symbol, sympy.Expr] = {}
    numbered: Counter[str] = Counter()

    def state(expression: sympy.Expr, name: str, is_output: bool = False) -> sympy.Symbol:
        if name in ("t", "k"):
            numbered[name] += 1
            name += str(numbered[name])
        while name in taken and not is_output:
            name += "_"
        taken.add(name)
        result[name] = expression
        return sympy.Symbol(name)

    def constant(i: int) -> sympy.Expr:
        expression = constants[i]
        if expression in known:
            return known[expression]
        if len(expression.free_symbols) < 2 or alike[expression] < 2:
            return expression
        known[expression] = state(expression, labels.get(i, "k"))
        return known[expression]

    for i in order:
        node = graph.nodes[i]
        if i in constants:
            if i in own:
                place[i] = state(constants[i], own[i], True)
            elif readers[i]:
                place[i] = constant(i)
            size[i] = 0
            continue
        expression = _expression(node, [place[k] for k in arguments(node)])
        size[i] = sum(size[k] for k in arguments(node)) + (node[0] in ("add", "sub", "mul"))
        name = ""
        if i in own:
            name = own[i]
        elif node[0] in ("cos", "sin"):
            name = _trigonometric(node[0], expression.xreplace(sums))
        elif as_counted and node[0] in ("add", "sub") and (terms := _repeated(node, [place[k] for k in node[1:]])):
            expression, name = sympy.Add(*terms, evaluate=False), labels.get(i, "t")
        elif as_counted and size[i] and i in angles and readers[i] > 1:
            name = "t"
        elif size[i] and i not in angles:
            if i in labels and (readers[i] > 1 or size[i] > 2):
                name = labels[i]
            elif node[0] != "neg" and (readers[i] > 1 or size[i] > LONGEST):
                name = "t"
        place[i] = state(expression, name, i in own) if name else expression
        if name and i in angles:
            sums[place[i]] = expression.xreplace(sums)
        size[i] = 0 if name else size[i]
    return result | {name: place[e.index] for name, e in outputs.items() if name not in result}


def _angles(graph: Graph, order: Sequence[int]) -> set[int]:
    """Indices of the sums of joint variables that cosines and sines are of."""
    todo = [graph.nodes[i][1] for i in order if graph.nodes[i][0] in ("cos", "sin")]
    found: set[int] = set()
    while todo:
        i = todo.pop()
        found.add(i)
        todo += arguments(graph.nodes[i])
    return found


def _expression(node: tuple, x: Sequence[sympy.Expr]) -> sympy.Expr:
    import sympy

    match node[0]:
        case "constant":
            return exact(node[1])
        case "symbol":
            return sympy.Symbol(node[1])
        case "cos":
            return sympy.cos(x[0])
        case "sin":
            return sympy.sin(x[0])
    return ARITHMETIC[node[0]](*x)


def exact(value: float) -> sympy.Expr:
    """A whole number, a half or a quarter as a fraction, any other as it is."""
    import sympy

    return sympy.Rational(round(4 * value), 4) if 4 * value == round(4 * value) else sympy.Float(value)


def _repeated(node: tuple, x: Sequence[sympy.Expr]) -> list[sympy.Expr]:
    """Terms of a sum or difference of x that has a moving one twice, which sympy would write as a product."""
    import sympy

    first, second = (sympy.Add.make_args(e) for e in x)
    if not {abs_term for e in first if not e.is_number for abs_term in (e, -e)} & set(second):
        return []
    return [*first, *(e if node[0] == "add" else -e for e in second)]


def _trigonometric(kind: str, expression: sympy.Expr) -> str:
    """C2, S23 … for the cosine and sine of a sum of joint variables, CP6 and SP6 for those of q6 + PHI6."""
    import sympy

    (call,) = expression.atoms(sympy.cos, sympy.sin)
    angle = call.args[0]
    turned = {sympy.Symbol(turn_symbol(j)): f"{kind[0].upper()}P{j + 1}" for j in harmonic_joints(angle)}
    for symbol, name in turned.items():
        if symbol in angle.free_symbols:
            return name
    return trigonometric(canonical(harmonic(call.args[0]))[0])[kind == "sin"].name


def harmonic_joints(angle: sympy.Expr) -> list[int]:
    """Indices of the joints whose variables are in a sum."""
    return sorted(int(s.name[1:]) - 1 for s in angle.free_symbols if re.fullmatch(r"q\d+", s.name))


def harmonic(angle: sympy.Expr) -> dict[int, int]:
    """{joint index: factor} of a sum of joint variables."""
    return {int(s.name[1:]) - 1: int(k) for s, k in angle.as_coefficients_dict().items()}


def recognised(outputs: Sequence[Expression], quantities: Mapping[str, Scalar]) -> dict[int, str]:
    """{node index: name} of the nodes below the outputs that are one of the quantities, expressions of any graph.

    Told by their values at an arbitrary point, so that it does not matter how either is written.
    """
    nodes = [
        e for e in (Expression(outputs[0].graph, i) for i in reachable(outputs[0].graph, outputs)) if arguments(e.key)
    ]
    sought = {name: e for name, e in quantities.items() if isinstance(e, Expression) and arguments(e.key)}
    graphs = {id(e.graph): e.graph for e in (*nodes[:1], *sought.values())}
    symbols = sorted({node[1] for graph in graphs.values() for node in graph.nodes if node[0] == "symbol"})
    point = dict(zip(symbols, np.random.default_rng(0).uniform(0.5, 1.9, len(symbols)).tolist(), strict=True))
    values = np.array(evaluate(nodes, point))
    found: dict[int, str] = {}
    for graph in graphs.values():
        own = {name: e for name, e in sought.items() if e.graph is graph}
        for name, value in zip(own, evaluate(list(own.values()), point), strict=True):
            for k in np.flatnonzero(np.abs(values - value) <= ALIKE * abs(value))[:1]:
                if value:
                    found.setdefault(nodes[k].index, name)
    return found


def short_statements(outputs: Mapping[str, Expression], quantities: Mapping[str, Scalar]) -> dict[str, sympy.Expr]:
    """The outputs as named statements after `simplified`, earlier outputs first, with the quantities by their names."""
    # The simplifier puts what its last output needs first.
    backwards = list(outputs)[::-1]
    short = dict(zip(backwards, simplified([outputs[name] for name in backwards]), strict=True))
    return named({name: short[name] for name in outputs}, recognised(list(short.values()), quantities))


def graph_of(graph: Graph, expression: sympy.Expr) -> Expression:
    """A polynomial in symbols, cosines and sines as an expression of the graph. ValueError for anything else."""
    parts = [graph_of(graph, x) for x in expression.args if not expression.is_Pow or x is expression.base]
    total: Scalar
    if expression.is_Symbol:
        return graph.symbol(expression.name)
    if expression.is_Number:
        return graph.constant(float(expression))
    if expression.is_Add:
        total = 0
        for x in parts:
            total = x + total
        return graph.constant(0) + total
    if expression.is_Mul:
        total = 1
        for x in parts:
            total = x * total
        return graph.constant(1) * total
    kind = expression.func.__name__
    if kind in ("cos", "sin"):
        return OPERATIONS[kind](parts[0])
    if expression.is_Pow and expression.exp.is_Integer and expression.exp > 0:
        total = parts[0]
        for _ in range(int(expression.exp) - 1):
            total = total * parts[0]
        return graph.constant(1) * total
    if expression.is_number:
        return graph.constant(float(expression))
    raise ValueError(f"{expression} is no polynomial")
