"""A function's expressions as numbered statements, the same for every language."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from identify.codegen.functions import REFERENCES, Function
from identify.symbolic.expression import Expression, arguments, reachable

SYMBOLS = {"add": "{} + {}", "sub": "{} - {}", "mul": "{} * {}", "neg": "-{}"}


def argument(prefix: str) -> str:
    """Argument name of the signal whose symbols have this prefix."""
    return REFERENCES.get(prefix, prefix)


def statements(
    function: Function, constants: Mapping[str, str], call: Callable[[str], str]
) -> tuple[list[tuple[str, str]], dict[int, str]]:
    """([(temporary, its value)], {flat index: entry}) in the order of computing.

    `constants` {symbol: text}; `call` gives the name of "cos" and "sin" in the language. Temporaries are numbered from
    1 in each function, so that the text depends on nothing but the robot.
    """
    outputs = list(function.entries.values())
    graph = outputs[0].graph if outputs else None
    n = max((len(ratios) for ratios in function.signs.values()), default=0)
    place: dict[int, str] = {}
    lines: list[tuple[str, str]] = []
    signals = {f"{prefix}{j + 1}": f"{argument(prefix)}[{j}]" for prefix in function.inputs for j in range(n or 64)}
    for i in reachable(graph, outputs) if graph else []:
        node = graph.nodes[i]  # type: ignore[union-attr]
        x = [place[k] for k in arguments(node)]
        match node[0]:
            case "constant":
                place[i] = repr(node[1]) if node[1] >= 0 else f"({node[1]!r})"
            case "symbol":
                name = node[1]
                place[i] = signals.get(name) or constants.get(name, name)
            case "cos" | "sin":
                lines.append((f"t{len(lines) + 1}", f"{call(node[0])}({x[0]})"))
                place[i] = lines[-1][0]
            case _:
                lines.append((f"t{len(lines) + 1}", SYMBOLS[node[0]].format(*x)))
                place[i] = lines[-1][0]
    return lines, {at: place[e.index] for at, e in function.entries.items()}


def unused(function: Function) -> list[str]:
    """Arguments that no entry reads."""
    outputs: list[Expression] = list(function.entries.values())
    graph = outputs[0].graph if outputs else None
    read = {graph.nodes[i][1] for i in reachable(graph, outputs) if graph.nodes[i][0] == "symbol"} if graph else set()
    prefixes = {name.rstrip("0123456789") for name in read}
    if "sign" in prefixes:
        prefixes.add("dq")
    return [argument(prefix) for prefix in function.inputs if prefix not in prefixes]


def live_signs(function: Function) -> dict[str, tuple[float, ...]]:
    """The function's signs that its entries read."""
    outputs = list(function.entries.values())
    if not outputs:
        return {}
    graph = outputs[0].graph
    read = {graph.nodes[i][1] for i in reachable(graph, outputs) if graph.nodes[i][0] == "symbol"}
    return {name: ratios for name, ratios in function.signs.items() if name in read}


def speed(ratios: tuple[float, ...]) -> str:
    """ratios · q̇ as text."""
    terms = [f"dq[{j}]" if r == 1.0 else f"{float(r)!r} * dq[{j}]" for j, r in enumerate(ratios) if r]
    return " + ".join(terms)
