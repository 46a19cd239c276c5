"""How many multiplications and additions a model costs, by the chapter's convention.

Every product counts one, a square too; every binary plus or minus counts one. What a controller does not pay for at
each sample counts nothing: sines, cosines, changes of sign, and all arithmetic among constants, which are numbers,
lengths and inertial parameters.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from identify.symbolic.expression import Expression, Graph, Scalar, arguments, reachable

if TYPE_CHECKING:
    import sympy

VARIABLE = re.compile(r"(q|dq|ddq|dqr|ddqr|sign|F|N)\d+")
"""Symbols that change from sample to sample: q, its derivatives, their signs and references, the wrench."""


@dataclass(frozen=True)
class Operations:
    """Multiplications and additions of a model, and the sines and cosines beside them."""

    multiplications: int
    additions: int
    functions: int

    def __str__(self) -> str:
        return f"{self.multiplications} ×, {self.additions} +"


def lifted(graph: Graph, scalars: Iterable[Scalar]) -> list[Expression]:
    """Expressions, with plain numbers made constants of the graph."""
    return [x if isinstance(x, Expression) else graph.constant(x) for x in scalars]


def varying(graph: Graph, order: Iterable[int]) -> set[int]:
    """Indices, of those in `order` (arguments before readers), of nodes that depend on a variable."""
    found: set[int] = set()
    for i in order:
        node = graph.nodes[i]
        is_variable = node[0] == "symbol" and VARIABLE.fullmatch(node[1]) is not None
        if is_variable or any(k in found for k in arguments(node)):
            found.add(i)
    return found


def count(outputs: list[Expression]) -> Operations:
    """Operations that compute the outputs, each shared one counted once."""
    if not outputs:
        return Operations(0, 0, 0)
    graph = outputs[0].graph
    order = reachable(graph, outputs)
    kinds = [graph.nodes[i][0] for i in varying(graph, order)]
    return Operations(
        kinds.count("mul"), kinds.count("add") + kinds.count("sub"), kinds.count("cos") + kinds.count("sin")
    )


def written(expressions: Iterable[sympy.Expr]) -> Operations:
    """Operations of sums and products of symbols as they stand; a quotient counts as a product."""
    products = sums = 0
    for whole in expressions:
        for e in whole.as_ordered_terms():
            products += sum(not factor.is_number for factor in e.as_ordered_factors()) - 1
        sums += len(whole.as_ordered_terms()) - 1
    return Operations(products, sums, 0)
