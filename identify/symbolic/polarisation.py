"""Symbols replaced, and derivatives in one direction: what turns the torque regressor into Slotine and Li's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from identify.symbolic.expression import OPERATIONS, Expression, Scalar, arguments, cos, reachable, sin


def substituted(outputs: Sequence[Expression], values: Mapping[str, Scalar]) -> list[Expression]:
    """The outputs, in the same graph, with expressions or numbers for the symbols named in `values`."""
    graph = outputs[0].graph
    place: dict[int, Expression] = {}
    for i in reachable(graph, outputs):
        kind, *rest = graph.nodes[i]
        match kind:
            case "constant":
                place[i] = Expression(graph, i)
            case "symbol":
                value = values.get(rest[0], Expression(graph, i))
                place[i] = value if isinstance(value, Expression) else graph.constant(value)
            case _:
                place[i] = OPERATIONS[kind](*(place[k] for k in rest))
    return [place[e.index] for e in outputs]


def directional(outputs: Sequence[Expression], direction: Mapping[str, Expression]) -> list[Expression]:
    """Derivatives of the outputs, in the same graph, as the symbols named move in the direction given."""
    graph = outputs[0].graph
    zero = graph.constant(0)
    tangent: dict[int, Expression] = {}
    for i in reachable(graph, outputs):
        node = graph.nodes[i]
        x = [Expression(graph, k) for k in arguments(node)]
        t = [tangent[k] for k in arguments(node)]
        match node[0]:
            case "symbol":
                tangent[i] = direction.get(node[1], zero)
            case "add":
                tangent[i] = t[0] + t[1]
            case "sub":
                tangent[i] = t[0] - t[1]
            case "mul":
                tangent[i] = t[0] * x[1] + x[0] * t[1]
            case "neg":
                tangent[i] = -t[0]
            case "cos":
                tangent[i] = -(sin(x[0]) * t[0])
            case "sin":
                tangent[i] = cos(x[0]) * t[0]
            case _:
                tangent[i] = zero
    return [tangent[e.index] for e in outputs]


def bilinear_in_rates(outputs: Sequence[Expression], n: int) -> list[Expression]:
    """Efforts f(q, dq, ddq), quadratic in dq, as f0(q, ddqr) + the symmetric bilinear form of the rest in dq and dqr.

    For a quadratic form c, ½ ∂c/∂u·v is its symmetric bilinear form: A(q)·q̈r + C(q,q̇)·q̇r + Q(q) with the C of the
    Christoffel symbols (Slotine & Li 1987).
    """
    graph = outputs[0].graph
    joints = range(1, n + 1)
    still = {f"dq{j}": 0.0 for j in joints} | {f"ddq{j}": graph.symbol(f"ddqr{j}") for j in joints}
    derivative = directional(outputs, {f"dq{j}": graph.symbol(f"dqr{j}") for j in joints})
    return [a + 0.5 * b for a, b in zip(substituted(outputs, still), derivative, strict=True)]
