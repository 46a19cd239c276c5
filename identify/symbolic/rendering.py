"""A symbolic model as text, LaTeX, Python, C or JSON: one printer a form, the same named expressions in each."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Iterable
from functools import lru_cache
from itertools import groupby
from typing import TYPE_CHECKING

from identify.symbolic.formula import STANDARD, formula
from identify.symbolic.model import Result, SymbolicModel

if TYPE_CHECKING:
    import sympy

FORMATS = ("text", "latex", "python", "c", "json")

WIDTH = 116

SIGNALS = ("q", "dq", "ddq", "tau", "F", "N")
"""Inputs that come as a whole: q1 q2 … are the entries of q."""


LETTERS = {
    "dq": r"\dot{q}", "ddq": r"\ddot{q}", "w": r"\omega", "wp": r"\dot{\omega}", "V": "V", "Vp": r"\dot{V}",
    "Cc": r"\mathbf{C}", "U": "U", "f": "f", "m": "m",
}  # fmt: skip
"""How LaTeX writes what has more than letters and digits on paper; a second index is a component."""


def render(model: SymbolicModel, form: str) -> str:
    """The model in one of FORMATS, ending with a line break.

    Python and C are functions of the model's inputs with lengths and parameters as constants, needing math and math.h
    alone: signals q, dq … are arrays, other inputs numbers. Python gives a dictionary of results, or the result if
    there is one; JSON holds expressions as text that sympy reads back. ValueError for another form.
    """
    printers = {"text": _text, "latex": _latex, "python": _python, "c": _c, "json": _json}
    if form not in printers:
        raise ValueError(f"format is {form!r}; choose one of {', '.join(FORMATS)}")
    return printers[form](model) + "\n"


def arguments(model: SymbolicModel) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """(argument, inputs in it): a signal with its entries, or one input of its own name."""
    found: list[tuple[str, tuple[str, ...]]] = []
    for prefix, names in groupby(model.inputs, lambda name: name.rstrip("0123456789")):
        own = tuple(names)
        found += [(prefix, own)] if prefix in SIGNALS else [(name, (name,)) for name in own]
    return tuple(found)


def _text(model: SymbolicModel) -> str:
    lines = [f"{model.robot}: {model.what}", *(f"  {note}" for note in _notes(model))]
    if model.lengths:
        lines.append("  " + ", ".join(f"{name} = {value:g} m" for name, value in model.lengths))
    if model.parameters:
        values = ", ".join(f"{name} = {value:.8g}" for name, value in model.parameters)
        lines += textwrap.wrap(f"with {values}", WIDTH, initial_indent="  ", subsequent_indent="    ")
    if not model.expressions:
        return "\n".join(lines)
    width = min(max(len(name) for name in model.expressions), 10)
    return "\n".join([*lines, "", *(f"{k:<{width}} = {_written(k, e)}" for k, e in model.expressions.items())])


def _written(name: str, expression: sympy.Expr) -> str:
    """An expression as text; a grouping formula with its own parameter first."""
    own = re.sub(r"R(?=\d)", "", name)
    names = {s.name for s in expression.free_symbols}
    return formula(expression, own) if STANDARD.fullmatch(own) and own in names else _printers()["text"](expression)


def _latex(model: SymbolicModel) -> str:
    import sympy

    latex = _printers()["latex"]
    rows = [rf"  {latex(sympy.Symbol(k))} &= {latex(e)} \\" for k, e in model.expressions.items()]
    values = [f"% {name} = {value!r}" for name, value in model.constants]
    begin, end = ([r"{\allowdisplaybreaks", r"\begin{align*}"], [r"\end{align*}}"]) if rows else ([], [])
    return "\n".join([*_comments(model, "% "), *values, *begin, *rows, *end])


def _python(model: SymbolicModel) -> str:
    name, code = _identifier(model), _printers()["python"]
    lines = [*_comments(model, "# "), "import math", "", ""]
    lines += [f"{k} = {v!r}" for k, v in model.constants] + ([""] * 2 if model.constants else [])
    lines.append(f"def {name}({', '.join(argument for argument, _ in arguments(model))}):")
    lines += [f"    {', '.join(e)}{',' * (len(e) == 1)} = {a}" for a, e in arguments(model) if (a,) != e]
    lines += [f"    {k} = {code(e)}" for k, e in model.expressions.items()]
    if len(model.results) == 1:
        answer = _value(model.results[0])
    else:
        answer = "{" + ", ".join(f'"{r.name}": {_value(r)}' for r in _results(model)) + "}"
    return "\n".join([*lines, *_wrapped(f"return {answer}", "    ", "        ")])


def _value(result: Result) -> str:
    """The result in Python: a number, a list, or a list of rows."""
    if result.number:
        return result.name
    step = result.columns or len(result.entries)
    rows = [result.entries[i : i + step] for i in range(0, len(result.entries), step)]
    inside = [f"[{', '.join(row)}]" for row in rows]
    return f"[{', '.join(inside)}]" if result.columns else inside[0]


def _c(model: SymbolicModel) -> str:
    name, code = _identifier(model), _printers()["c"]
    used = {s.name for e in model.expressions.values() for s in e.free_symbols}
    whole = "\n".join(_comments(model, " * ")).replace("*/", "* /")
    lines = [
        "/*",
        whole,
        " */",
        "#include <math.h>",
        "",
        "#ifndef M_PI",
        "#define M_PI 3.14159265358979323846",
        "#endif",
    ]
    lines += ["", *(f"static const double {k} = {v!r};" for k, v in model.constants), ""]
    given = [f"const double {a}[{len(e)}]" if (a,) != e else f"double {a}" for a, e in arguments(model)]
    if model.results:
        given += [f"double {_argument(r)}[{len(r.entries)}]" for r in model.results]
    elif model.expressions:
        lines += _wrapped(f"out: {', '.join(model.expressions)} */", "/* ", " * ")
        given.append(f"double out[{len(model.expressions)}]")
    lines += _wrapped(f"void {name}({', '.join(given) or 'void'})", "", "    ")
    lines.append("{")
    for argument, entries in arguments(model):
        if not used.intersection(entries):
            lines.append(f"    (void){argument};")
        elif (argument,) != entries:
            lines += [f"    const double {e} = {argument}[{i}];" for i, e in enumerate(entries) if e in used]
    lines += [f"    const double {k} = {code(e)};" for k, e in model.expressions.items()]
    if model.results:
        lines += [f"    {_argument(r)}[{i}] = {e};" for r in model.results for i, e in enumerate(r.entries)]
    else:
        lines += [f"    out[{i}] = {k};" for i, k in enumerate(model.expressions)]
    return "\n".join([*lines, "}"])


def _argument(result: Result) -> str:
    """Name of the result's array in C, where the number of that name is a variable."""
    return f"{result.name}_out" if result.number else result.name


def _json(model: SymbolicModel) -> str:
    text = _printers()["text"]
    table = {
        "robot": model.robot,
        "what": model.what,
        "inputs": list(model.inputs),
        "lengths": dict(model.lengths),
        "parameters": dict(model.parameters),
        "notes": list(model.notes),
        "expressions": {k: text(e) for k, e in model.expressions.items()},
        "results": {r.name: {"entries": list(r.entries), "columns": r.columns} for r in _results(model)},
    }
    return json.dumps(table, indent=1, ensure_ascii=False)


def _results(model: SymbolicModel) -> tuple[Result, ...]:
    return model.results or tuple(Result(name, (name,)) for name in model.expressions)


def _notes(model: SymbolicModel) -> list[str]:
    """The model's notes, and its results with their sizes."""
    sizes = [
        r.name if r.number else f"{r.name} ({len(r.entries) // r.columns} x {r.columns})" if r.columns
        else f"{r.name} ({len(r.entries)})"
        for r in model.results
    ]  # fmt: skip
    return [*model.notes, *([f"gives {', '.join(sizes)}"] if sizes else [])]


def _comments(model: SymbolicModel, mark: str) -> list[str]:
    # Names in a robot file may hold line breaks, after which a comment would be code.
    lines = (" ".join(line.split()) for line in (f"{model.robot}: {model.what}", *_notes(model)))
    return [f"{mark}{line}".rstrip() for line in lines]


def _wrapped(text: str, first: str, others: str) -> Iterable[str]:
    return textwrap.wrap(
        text, WIDTH, initial_indent=first, subsequent_indent=others, break_long_words=False, break_on_hyphens=False
    )


def _identifier(model: SymbolicModel) -> str:
    return model.what.replace("-", "_")


@lru_cache(maxsize=1)
def _printers() -> dict:
    """Sympy's printers, with floating-point numbers as short as they can be read back, and squares as products in C."""
    from sympy.printing.c import C99CodePrinter
    from sympy.printing.latex import LatexPrinter
    from sympy.printing.pycode import PythonCodePrinter
    from sympy.printing.str import StrPrinter

    def number(printer: object, e: sympy.Float) -> str:
        return repr(float(e))

    def power(printer: C99CodePrinter, e: sympy.Pow) -> str:
        if e.exp == 2 and e.base.is_Symbol:
            return f"({e.base.name}*{e.base.name})"
        return C99CodePrinter._print_Pow(printer, e)

    def symbol(printer: LatexPrinter, e: sympy.Symbol) -> str:
        found = re.fullmatch(r"(\D+)(\d+)(?:_(\d+))?", e.name)
        if found is None or found[1] not in LETTERS:
            return LatexPrinter._print_Symbol(printer, e)
        index = found[2] if found[3] is None else f"{found[2]},{found[3]}"
        return f"{LETTERS[found[1]]}_{{{index}}}"

    kinds = {"text": StrPrinter, "latex": LatexPrinter, "python": PythonCodePrinter, "c": C99CodePrinter}
    made = {}
    for form, kind in kinds.items():
        own = {"_print_Float": number} if form != "latex" else {"_print_Symbol": symbol}
        if form == "c":
            own["_print_Pow"] = power
        made[form] = type(f"{form.title()}Printer", (kind,), own)().doprint
    return made
