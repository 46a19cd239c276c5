"""Random straight-line programs, run on expressions and on numbers alike."""

from __future__ import annotations

import cmath
from collections.abc import Callable, Sequence
from typing import Any

from hypothesis import strategies as st

from identify.symbolic.expression import Expression, Graph, cos, sin

ARITHMETIC = ("add", "sub", "mul", "neg")
SYMBOLS = ("x", "y", "z")
CONSTANTS = (0.0, 1.0, -1.0, 0.5, -3.25)

Program = list[tuple[str, int, int]]


def programs(operations: Sequence[str] = (*ARITHMETIC, "cos", "sin"), longest: int = 25) -> st.SearchStrategy[Program]:
    """Steps (operation, first argument, second argument); arguments count back from the newest value."""
    step = st.tuples(st.sampled_from(operations), st.integers(0, 30), st.integers(0, 30))
    return st.lists(step, min_size=1, max_size=longest)


def run(program: Program, inputs: Sequence[Any], cosine: Callable, sine: Callable) -> list[Any]:
    """All values of the program on any numbers or expressions: inputs, then one a step."""
    values = list(inputs)
    for operation, i, k in program:
        a, b = values[-1 - i % len(values)], values[-1 - k % len(values)]
        match operation:
            case "add":
                values.append(a + b)
            case "sub":
                values.append(a - b)
            case "mul":
                values.append(a * b)
            case "neg":
                values.append(-a)
            case "cos":
                values.append(cosine(a))
            case "sin":
                values.append(sine(a))
    return values


def on_expressions(program: Program) -> list[Expression]:
    """The program on three symbols and a few constants that folding looks for."""
    graph = Graph()
    leaves = [graph.symbol(name) for name in SYMBOLS] + [graph.constant(value) for value in CONSTANTS]
    return run(program, leaves, cos, sin)


def on_numbers(program: Program, point: Sequence[complex]) -> list[complex]:
    """The program on complex numbers, without a graph."""
    return run(program, [*(complex(x) for x in point), *map(complex, CONSTANTS)], cmath.cos, cmath.sin)
