"""One hash-consed expression graph, from which every model and every printed form is made.

A node is stored once, however often it is written, so that common subexpressions are shared by
construction. Nodes are numbered in the order of their making: a node's arguments always come before it.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Union

Number = int | float
Scalar = Union["Expression", Number]


@dataclass
class Graph:
    """The store of nodes: ("constant", value), ("symbol", name) or (operation, argument, …)."""

    nodes: list[tuple] = field(default_factory=list)
    index: dict[tuple, int] = field(default_factory=dict)

    def node(self, *key: object) -> Expression:
        """The one expression of this key, made if it is new."""
        if key not in self.index:
            self.index[key] = len(self.nodes)
            self.nodes.append(key)
        return Expression(self, self.index[key])

    def constant(self, value: Number) -> Expression:
        """A number."""
        return self.node("constant", float(value))

    def symbol(self, name: str) -> Expression:
        """A variable or a parameter."""
        return self.node("symbol", name)


@dataclass(frozen=True, slots=True)
class Expression:
    """A node of a graph, with the arithmetic that builds further nodes and folds 0, 1 and constants away."""

    graph: Graph = field(repr=False, compare=False)
    index: int

    @property
    def key(self) -> tuple:
        """The node as the graph stores it."""
        return self.graph.nodes[self.index]

    @property
    def value(self) -> float | None:
        """The number, where the expression is a constant."""
        return self.key[1] if self.key[0] == "constant" else None

    def _lift(self, other: Scalar) -> Expression:
        return other if isinstance(other, Expression) else self.graph.constant(other)

    def __add__(self, other: Scalar) -> Expression:
        other = self._lift(other)
        a, b = self.value, other.value
        if a is not None and b is not None:
            return self.graph.constant(a + b)
        if a == 0:
            return other
        if b == 0:
            return self
        if other.key[0] == "neg":
            return self - Expression(self.graph, other.key[1])
        if self.key[0] == "neg":
            return other - Expression(self.graph, self.key[1])
        return self.graph.node("add", *sorted((self.index, other.index)))

    def __sub__(self, other: Scalar) -> Expression:
        other = self._lift(other)
        a, b = self.value, other.value
        if a is not None and b is not None:
            return self.graph.constant(a - b)
        if b == 0:
            return self
        if a == 0:
            return -other
        if self.index == other.index:
            return self.graph.constant(0)
        if other.key[0] == "neg":
            return self + Expression(self.graph, other.key[1])
        return self.graph.node("sub", self.index, other.index)

    def __mul__(self, other: Scalar) -> Expression:
        other = self._lift(other)
        a, b = self.value, other.value
        if a is not None and b is not None:
            return self.graph.constant(a * b)
        for value, rest in ((a, other), (b, self)):
            if value == 0:
                return self.graph.constant(0)
            if value == 1:
                return rest
            if value == -1:
                return -rest
        if self.key[0] == "neg":
            return -(Expression(self.graph, self.key[1]) * other)
        if other.key[0] == "neg":
            return -(self * Expression(self.graph, other.key[1]))
        return self.graph.node("mul", *sorted((self.index, other.index)))

    def __neg__(self) -> Expression:
        if self.value is not None:
            return self.graph.constant(-self.value)
        if self.key[0] == "neg":
            return Expression(self.graph, self.key[1])
        if self.key[0] == "sub":
            return self.graph.node("sub", self.key[2], self.key[1])
        return self.graph.node("neg", self.index)

    def __radd__(self, other: Number) -> Expression:
        return self._lift(other) + self

    def __rsub__(self, other: Number) -> Expression:
        return self._lift(other) - self

    def __rmul__(self, other: Number) -> Expression:
        return self._lift(other) * self


def cos(x: Expression) -> Expression:
    """Cosine; of a constant, the constant."""
    return x.graph.constant(math.cos(x.value)) if x.value is not None else x.graph.node("cos", x.index)


def sin(x: Expression) -> Expression:
    """Sine; of a constant, the constant."""
    return x.graph.constant(math.sin(x.value)) if x.value is not None else x.graph.node("sin", x.index)


ARITHMETIC: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "neg": operator.neg,
}
"""Each operation of a node but the circular functions: on expressions, on numbers or on SymPy's expressions."""

OPERATIONS: dict[str, Callable[..., Expression]] = ARITHMETIC | {"cos": cos, "sin": sin}
"""Each operation of a node, on expressions."""


def reachable(graph: Graph, outputs: Iterable[Expression]) -> list[int]:
    """Indices, in order, of all nodes that the outputs read: what is dead is left out."""
    live: set[int] = set()
    todo = [e.index for e in outputs]
    while todo:
        i = todo.pop()
        if i not in live:
            live.add(i)
            todo.extend(arguments(graph.nodes[i]))
    return sorted(live)


def arguments(node: tuple) -> tuple[int, ...]:
    """Indices of a node's arguments; none for a constant or a symbol."""
    return () if node[0] in ("constant", "symbol") else node[1:]


def evaluate(outputs: Sequence[Expression], values: Mapping[str, float]) -> list[float]:
    """Numbers of the outputs at the symbols' values: the slow reference that printed code is tested against."""
    if not outputs:
        return []
    graph = outputs[0].graph
    operations = ARITHMETIC | {"cos": math.cos, "sin": math.sin}
    result: dict[int, float] = {}
    for i in reachable(graph, outputs):
        kind, *rest = graph.nodes[i]
        match kind:
            case "constant":
                result[i] = rest[0]
            case "symbol":
                result[i] = values[rest[0]]
            case _:
                result[i] = operations[kind](*(result[k] for k in rest))
    return [result[e.index] for e in outputs]


def gradient(
    outputs: Sequence[Expression], weights: Sequence[Expression], wrt: Sequence[Expression]
) -> list[Expression]:
    """Reverse-mode derivative of Σ weights·outputs with respect to each symbol of `wrt`, in the same graph.

    One backward sweep, whatever the number of variables (Linnainmaa 1976). The weights are held constant, even
    where they are expressions of the same symbols.
    """
    graph = outputs[0].graph
    adjoint: dict[int, Expression] = {}

    def add(i: int, term: Expression) -> None:
        adjoint[i] = adjoint[i] + term if i in adjoint else term

    for output, weight in zip(outputs, weights, strict=True):
        add(output.index, weight)
    for i in reversed(reachable(graph, outputs)):
        if i not in adjoint:
            continue
        node, a = graph.nodes[i], adjoint[i]
        x = [Expression(graph, k) for k in arguments(node)]
        match node[0]:
            case "add":
                add(x[0].index, a)
                add(x[1].index, a)
            case "sub":
                add(x[0].index, a)
                add(x[1].index, -a)
            case "mul":
                add(x[0].index, a * x[1])
                add(x[1].index, a * x[0])
            case "neg":
                add(x[0].index, -a)
            case "cos":
                add(x[0].index, -(a * sin(x[0])))
            case "sin":
                add(x[0].index, a * cos(x[0]))
    zero = graph.constant(0)
    return [adjoint.get(v.index, zero) for v in wrt]
