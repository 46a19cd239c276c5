"""A symbolic model as text, LaTeX, Python, C or JSON: one printer a form, the same named expressions in each."""

from __future__ import annotations

import json
import re
import textwrap

import sympy

from identify.symbolic.formula import STANDARD, formula
from identify.symbolic.model import SymbolicModel

FORMATS = ("text", "latex", "python", "c", "json")


def render(model: SymbolicModel, form: str) -> str:
    """The model in one of FORMATS, ending with a line break.

    Python and C are functions of the model's inputs with the lengths as constants, needing math and math.h alone;
    JSON holds expressions as text that sympy reads back. ValueError for another form.
    """
    printers = {"text": _text, "latex": _latex, "python": _python, "c": _c, "json": _json}
    if form not in printers:
        raise ValueError(f"format is {form!r}; choose one of {', '.join(FORMATS)}")
    return printers[form](model) + "\n"


def _text(model: SymbolicModel) -> str:
    lines = [f"{model.robot}: {model.what}", *(f"  {note}" for note in model.notes)]
    if model.lengths:
        lines.append("  " + ", ".join(f"{name} = {value:g} m" for name, value in model.lengths))
    width = max((len(name) for name in model.expressions), default=0)
    return "\n".join([*lines, "", *(f"{k:<{width}} = {_written(k, e)}" for k, e in model.expressions.items())])


def _written(name: str, expression: sympy.Expr) -> str:
    """An expression as text; a grouping formula with its own parameter first."""
    own = re.sub(r"R(?=\d)", "", name)
    names = {s.name for s in expression.free_symbols}
    return formula(expression, own) if STANDARD.fullmatch(own) and own in names else sympy.sstr(expression)


def _latex(model: SymbolicModel) -> str:
    rows = [rf"  {sympy.latex(sympy.Symbol(k))} &= {sympy.latex(e)} \\" for k, e in model.expressions.items()]
    return "\n".join([*_comments(model, "% "), r"\begin{align*}", *rows, r"\end{align*}"])


def _python(model: SymbolicModel) -> str:
    name = _identifier(model)
    lines = [*_comments(model, "# "), "import math", "", ""]
    lines += [f"{k} = {v!r}" for k, v in model.lengths] + ([""] * 2 if model.lengths else [])
    lines.append(f"def {name}({', '.join(model.inputs)}):")
    lines += [f"    {k} = {sympy.pycode(e)}" for k, e in model.expressions.items()]
    results = ", ".join(f'"{k}": {k}' for k in model.expressions)
    return "\n".join(
        [*lines, *textwrap.wrap(f"return {{{results}}}", 100, initial_indent="    ", subsequent_indent="        ")]
    )


def _c(model: SymbolicModel) -> str:
    name = _identifier(model)
    arguments = ", ".join(f"double {k}" for k in model.inputs)
    lines = ["/*", *_comments(model, " * "), " */", "#include <math.h>", ""]
    lines += ["#ifndef M_PI", "#define M_PI 3.14159265358979323846", "#endif", ""]
    lines += [f"static const double {k} = {v!r};" for k, v in model.lengths] + [""]
    lines.append(f"/* out: {', '.join(model.expressions)} */")
    lines.append(f"void {name}({arguments}{', ' if arguments else ''}double out[{len(model.expressions)}])")
    lines.append("{")
    used = {s.name for e in model.expressions.values() for s in e.free_symbols}
    lines += [f"    (void){k};" for k in model.inputs if k not in used]
    lines += [f"    const double {k} = {sympy.ccode(e)};" for k, e in model.expressions.items()]
    lines += [f"    out[{i}] = {k};" for i, k in enumerate(model.expressions)]
    return "\n".join([*lines, "}"])


def _json(model: SymbolicModel) -> str:
    table = {
        "robot": model.robot,
        "what": model.what,
        "inputs": list(model.inputs),
        "lengths": dict(model.lengths),
        "notes": list(model.notes),
        "expressions": {k: sympy.sstr(e) for k, e in model.expressions.items()},
    }
    return json.dumps(table, indent=1, ensure_ascii=False)


def _comments(model: SymbolicModel, mark: str) -> list[str]:
    return [f"{mark}{line}".rstrip() for line in (f"{model.robot}: {model.what}", *model.notes)]


def _identifier(model: SymbolicModel) -> str:
    return model.what.replace("-", "_")
