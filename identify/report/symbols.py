"""Names of parameters and their grouping formulas, set as a reader expects them: XX₃, I_a3, RL4², M₄ + M₅."""

from __future__ import annotations

import re
from html import escape

LONGEST = 420  # characters of a formula before it is cut; parameters.json has the whole

_PARAMETER = re.compile(r"(XX|XY|XZ|YY|YZ|ZZ|MX|MY|MZ|M|IA|Ia|Iam|F[vscpba]m|F[vscpbal]|off)(R?)(\d+)")
_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_TOKEN = re.compile(
    r"\s*(?:(?P<power>(?:\*\*|\^)\s*(?:\(\s*(?P<inner>-?\d+(?:/\d+)?)\s*\)|(?P<exponent>-?\d+)))|(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<word>[^\W\d]\w*)|(?P<sign>[-+*/()])|(?P<other>\S))"
)
_WORDS = {"pi": "π", "alpha": "α", "beta": "β", "gamma": "γ", "theta": "θ", "sqrt": "√"}
_SHAFTS = {"Ia": ("I", "a"), "IA": ("I", "a"), "Iam": ("I", "am")}
_SHAFTS |= {f"F{kind}{motor}": ("F", kind + motor) for kind in "vscpba" for motor in ("", "m")}
_SHAFTS |= {"off": ("off", ""), "Fl": ("F", "l")}


def symbol_html(name: str) -> str:
    """A parameter's name as HTML, its index as a subscript; any other name escaped as it is."""
    match = _PARAMETER.fullmatch(name)
    if not match:
        return escape(name)
    letters, grouped, index = match.groups()
    head, inner = _SHAFTS.get(letters, (letters + grouped, ""))
    return f"{head}<sub>{inner}{index}</sub>"


def symbol_text(name: str) -> str:
    """A parameter's name as plain text with subscript digits, for figures and labels."""
    match = _PARAMETER.fullmatch(name)
    if not match:
        return name
    letters, grouped, index = match.groups()
    return f"{letters}{grouped}{index.translate(_SUBSCRIPTS)}"


def formula_html(grouping: str) -> str:
    """A grouping formula as text ("XX3 - YY3 + RL4**2*M4", powers as ** or ^) as HTML.

    Subscripts for parameters, superscripts for powers, products with a narrow gap; cut at a whole term
    after `LONGEST` characters.
    """
    text, cut = grouping.strip(), ""
    if len(text) > LONGEST:
        end = max(text.rfind(" + ", 0, LONGEST), text.rfind(" - ", 0, LONGEST))
        text, cut = text[: end if end > 0 else LONGEST], " + … (whole in parameters.json)"
    parts: list[str] = []
    binary = False  # whether a sign that follows stands between two operands
    for match in _TOKEN.finditer(text):
        token = match.group(0).strip()
        if match.group("power"):
            exponent = match.group("inner") or match.group("exponent")
            parts.append(f"<sup>{escape(exponent.replace('-', '−'))}</sup>")
        elif match.group("number"):
            parts.append(_number(token))
        elif match.group("word"):
            parts.append(_WORDS.get(token) or symbol_html(token))
        elif match.group("sign"):
            parts.append(_sign(token, binary))
        else:
            parts.append(escape(token))
        binary = token not in ("(", "*", "/", "+", "-")
    return "".join(parts) + cut


def _number(token: str) -> str:
    """A number as HTML, without the digits that only show how a computer stores it."""
    if not set(".eE") & set(token):
        return token
    mantissa, _, exponent = f"{float(token):.6g}".partition("e")
    return f"{mantissa}·10<sup>{str(int(exponent)).replace('-', '−')}</sup>" if exponent else mantissa


def _sign(token: str, binary: bool) -> str:
    if token in "+-":
        sign = "−" if token == "-" else "+"
        return f" {sign} " if binary else sign
    return {"*": "\u202f", "/": "\u2009/\u2009"}.get(token, token)
