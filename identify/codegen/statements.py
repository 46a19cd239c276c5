"""A function's expressions as numbered statements, the same for every language."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from identify.codegen.functions import REFERENCES, FrictionSignal, Function
from identify.symbolic import printing
from identify.symbolic.expression import reachable


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
    n = max((len(signal.ratios) for signal in function.friction_signals.values()), default=0)
    signals = {f"{prefix}{j + 1}": f"{argument(prefix)}[{j}]" for prefix in function.inputs for j in range(n or 64)}

    def leaf(name: str) -> str:
        return signals.get(name) or constants.get(name, name)

    lines, values = printing.statements(list(function.entries.values()), leaf, call)
    return lines, dict(zip(function.entries, values, strict=True))


def unused(function: Function) -> list[str]:
    """Arguments that no entry reads."""
    prefixes = {name.rstrip("0123456789") for name in _symbols(function)}
    if live_friction_signals(function):
        prefixes.add("dq")
    return [argument(prefix) for prefix in function.inputs if prefix not in prefixes]


def live_friction_signals(function: Function) -> dict[str, FrictionSignal]:
    """The function's friction signals that its entries read."""
    read = _symbols(function)
    return {name: signal for name, signal in function.friction_signals.items() if name in read}


def _symbols(function: Function) -> set[str]:
    """Symbols that the entries read."""
    outputs = list(function.entries.values())
    if not outputs:
        return set()
    graph = outputs[0].graph
    return {graph.nodes[i][1] for i in reachable(graph, outputs) if graph.nodes[i][0] == "symbol"}


def speed(ratios: tuple[float, ...]) -> str:
    """ratios · q̇ as text."""
    terms = [f"dq[{j}]" if r == 1.0 else f"{float(r)!r} * dq[{j}]" for j, r in enumerate(ratios) if r]
    return " + ".join(terms)
