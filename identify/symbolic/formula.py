"""Grouping formulas as a reader expects them: the link's own parameter first, masses with one factor in one bracket."""

from __future__ import annotations

import re

import sympy

from identify.robot.robot import LINK_PARAMETERS

STANDARD = re.compile(rf"({'|'.join((*LINK_PARAMETERS, 'Ia'))})(\d+)")


def formula(expression: sympy.Expr, leading: str) -> str:
    """A linear combination of standard parameters as text: `leading` first, then by link, equal factors together.

    "ZZ2 + Ia2 + D3**2*(M3 + M4 + M5 + M6)": the text reads back as the same expression.
    """
    factors: dict[sympy.Expr, list[str]] = {}
    for term in sympy.Add.make_args(sympy.expand(expression)):
        (parameter,) = (s for s in term.free_symbols if STANDARD.fullmatch(s.name))
        factors.setdefault(term / parameter, []).append(parameter.name)
    groups = [(factor, sorted(names, key=lambda name: _rank(name, leading))) for factor, names in factors.items()]
    groups.sort(key=lambda group: _rank(group[1][0], leading))
    text = ""
    for factor, names in groups:
        inside = " + ".join(names)
        size = sympy.Abs(factor) if factor.is_number else -factor if factor.could_extract_minus_sign() else factor
        negative = size != factor
        if size != 1:
            inside = f"{sympy.sstr(size)}*{inside if len(names) == 1 else f'({inside})'}"
        elif negative and len(names) > 1:
            inside = f"({inside})"
        text += (" - " if negative else " + ") + inside
    return text[3:] if text.startswith(" + ") else "-" + text[3:]


def _rank(name: str, leading: str) -> tuple[bool, int, int]:
    """Sorting key: the leading parameter, then by link, in the order of the standard parameters."""
    found = STANDARD.fullmatch(name)
    assert found is not None
    order = ("Ia", *LINK_PARAMETERS)
    return name != leading, int(found[2]), order.index(found[1])
