"""Expressions printed as code: NumPy code that works on blocks of samples without allocating, plain Python code for
one sample, where NumPy's overhead would be most of the time, and C99 for a few samples side by side."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from identify.symbolic.expression import Expression, arguments, reachable

Single = Callable[[Sequence[float]], tuple[float, ...]]

UFUNCS = {"add": "add", "sub": "subtract", "mul": "multiply", "neg": "negative", "cos": "cos", "sin": "sin"}

Block = Callable[[Sequence[np.ndarray | float] | np.ndarray, Sequence[np.ndarray] | np.ndarray, np.ndarray], None]

INFIX = {"add": "{} + {}", "sub": "{} - {}", "mul": "{} * {}", "neg": "-{}"}


def numpy_source(name: str, inputs: Mapping[str, int], outputs: Sequence[Expression]) -> tuple[str, int]:
    """Source of `name(x, out, work)` and the number of work rows it needs.

    x (len(inputs), N) and out (len(outputs), N) hold one variable a row; `inputs` maps symbol names to rows of
    x. Where a symbol has one value for all samples, its row may be a number. Intermediate rows of `work` (rows, N)
    are used again once their last reader is done.
    """
    if not outputs:
        return f"def {name}(x, out, work):\n    pass\n", 0
    graph = outputs[0].graph
    order = reachable(graph, outputs)
    last = {i: at for at, i in enumerate(order)}
    for at, i in enumerate(order):
        for k in arguments(graph.nodes[i]):
            last[k] = max(last[k], at)
    target: dict[int, int] = {}
    for row, e in enumerate(outputs):
        target.setdefault(e.index, row)
    place: dict[int, str] = {}
    free: list[str] = []
    rows = 0
    body: list[str] = []
    for at, i in enumerate(order):
        node = graph.nodes[i]
        if node[0] == "constant":
            place[i] = repr(node[1])
            continue
        if node[0] == "symbol":
            place[i] = f"x{inputs[node[1]]}"
            continue
        operands = ", ".join(place[k] for k in arguments(node))
        # A row whose last reader this is may take the result itself: NumPy's element-wise work allows it.
        free += [place[k] for k in set(arguments(node)) if last[k] == at and place[k].startswith("w")]
        if i in target:
            place[i] = f"o{target[i]}"
        elif free:
            place[i] = free.pop()
        else:
            place[i] = f"w{rows}"
            rows += 1
        body.append(f"    {UFUNCS[node[0]]}({operands}, {place[i]})")
    for row, e in enumerate(outputs):
        if place[e.index] != f"o{row}":
            body.append(f"    o{row}[:] = {place[e.index]}")
    # Rows get local names once: taking them out of the array again at every operation would cost more than the work.
    head = [f"def {name}(x, out, work):"]
    head.append("    add, subtract, multiply = np.add, np.subtract, np.multiply")
    head.append("    negative, cos, sin = np.negative, np.cos, np.sin")
    for letter, array, count in (("x", "x", len(inputs)), ("o", "out", len(outputs)), ("w", "work", rows)):
        if count:
            head.append(f"    {''.join(f'{letter}{k}, ' for k in range(count))}= {array}")
    return "\n".join([*head, *body]) + "\n", rows


def python_source(name: str, inputs: Mapping[str, int], outputs: Sequence[Expression]) -> str:
    """Source of `name(x)`: the outputs' values, a tuple of floats, at one sample x of len(inputs) floats."""
    lines = [f"def {name}(x):"]
    if inputs:
        lines.append(f"    {''.join(f'x{k}, ' for k in range(len(inputs)))}= x")
    work, values = statements(outputs, lambda symbol: f"x{inputs[symbol]}")
    lines += [f"    {temporary} = {value}" for temporary, value in work]
    return "\n".join([*lines, f"    return ({''.join(f'{value}, ' for value in values)})"]) + "\n"


def c_source(name: str, inputs: Mapping[str, int], outputs: Sequence[Expression], lanes: int) -> str:
    """Source of `static void name(const double x[][lanes], double out[][lanes])`, one variable a row as in
    `numpy_source`, one sample a lane. The loop over the lanes is what a compiler turns into vector instructions."""
    work, values = statements(outputs, lambda symbol: f"x[{inputs[symbol]}][k]")
    lines = [
        f"static void {name}(const double x[restrict][{lanes}], double out[restrict][{lanes}])",
        "{",
        f"    for (int k = 0; k < {lanes}; ++k) {{",
        *(f"        const double {temporary} = {value};" for temporary, value in work),
        *(f"        out[{row}][k] = {value};" for row, value in enumerate(values)),
    ]
    return "\n".join([*lines, "    }", "}"]) + "\n"


def statements(
    outputs: Sequence[Expression], leaf: Callable[[str], str], call: Callable[[str], str] = str
) -> tuple[list[tuple[str, str]], list[str]]:
    """([(temporary, its value)] in the order of computing, the outputs' values), as Python and C both write them.

    `leaf` gives a symbol's text, `call` the name of "cos" and "sin". Temporaries are numbered from 1, so that the text
    depends on the expressions alone and not on what else their graph holds.
    """
    place: dict[int, str] = {}
    lines: list[tuple[str, str]] = []
    for i in reachable(outputs[0].graph, outputs) if outputs else []:
        node = outputs[0].graph.nodes[i]
        match node[0]:
            case "constant":
                place[i] = repr(node[1]) if node[1] >= 0 else f"({node[1]!r})"
            case "symbol":
                place[i] = leaf(node[1])
            case operation:
                x = [place[k] for k in arguments(node)]
                pattern = INFIX.get(operation) or f"{call(operation)}({{}})"
                place[i] = f"t{len(lines) + 1}"
                lines.append((place[i], pattern.format(*x)))
    return lines, [place[e.index] for e in outputs]


def compiled(name: str, inputs: Mapping[str, int], outputs: Sequence[Expression]) -> tuple[Block, int]:
    """The printed NumPy function, ready to call, and its number of work rows."""
    source, rows = numpy_source(name, inputs, outputs)
    return _run(name, source, {"np": np}), rows


def compiled_for_one(name: str, inputs: Mapping[str, int], outputs: Sequence[Expression]) -> Single:
    """The printed Python function for one sample, ready to call."""
    return _run(name, python_source(name, inputs, outputs), {"cos": math.cos, "sin": math.sin})


def _run(name: str, source: str, space: dict[str, Any]) -> Any:
    exec(compile(source, f"<{name}>", "exec"), space)
    return space[name]
