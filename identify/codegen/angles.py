"""Cosines and sines of sums from those of the terms: six operations where a library call takes ten times as long."""

from __future__ import annotations

from collections.abc import Sequence

from identify.symbolic.expression import ARITHMETIC, OPERATIONS, Expression, Graph, reachable


def with_products(outputs: Sequence[Expression]) -> list[Expression]:
    """The outputs in a new graph, where cos(a ± b) and sin(a ± b) are products of the cosines and sines of a and b.

    Only where those four are computed anyway.
    """
    if not outputs:
        return []
    old, new = outputs[0].graph, Graph()
    live = reachable(old, outputs)
    angles = {name: {old.nodes[i][1] for i in live if old.nodes[i][0] == name} for name in ("cos", "sin")}
    both = angles["cos"] & angles["sin"]
    made: dict[int, Expression] = {}

    def turned(name: str, i: int) -> Expression:
        """cos or sin of the old node i."""
        node = old.nodes[i]
        if node[0] not in ("add", "sub") or not set(node[1:]) <= both:
            return OPERATIONS[name](made[i])
        (ca, sa), (cb, sb) = ((turned("cos", k), turned("sin", k)) for k in node[1:])
        if node[0] == "sub":
            sb = -sb
        return ca * cb - sa * sb if name == "cos" else sa * cb + ca * sb

    for i in live:
        kind, *rest = old.nodes[i]
        match kind:
            case "constant" | "symbol":
                made[i] = new.node(kind, *rest)
            case "cos" | "sin":
                made[i] = turned(kind, rest[0])
            case _:
                made[i] = ARITHMETIC[kind](*(made[k] for k in rest))
    return [made[e.index] for e in outputs]
