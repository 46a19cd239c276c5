"""C99: one source file and its header, without allocation, needing math.h alone."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from identify.codegen.functions import Function, Models
from identify.codegen.samples import Sample
from identify.codegen.statements import argument, live_signs, speed, statements, title, unused

SIGN = "(double)(({0} > 0.0) - ({0} < 0.0))"
"""Exact sign of a speed, zero at rest."""


def c_files(models: Models, samples: tuple[Sample, ...], prefix: str) -> dict[str, str]:
    """{file name: text} of the header and the source."""
    return {f"{prefix}.h": _header(models, prefix), f"{prefix}.c": _source(models, samples, prefix)}


def _signature(function: Function, n: int, prefix: str) -> str:
    arguments = [f"const double {argument(name)}[{n}]" for name in function.inputs]
    return f"void {prefix}_{function.name}({', '.join(arguments)}, double out[{function.size}])"


def _header(models: Models, prefix: str) -> str:
    n, p = models.robot.n, models.regressor.p
    guard = f"{prefix.upper()}_H"
    lines = [
        f"/* {title(models.robot.name)}: dynamic and geometric models, SI units, radians, joint side.",
        "   Matrices lie row by row. Nothing is allocated; math.h is all that is needed.",
        f"   Self-test: cc -std=c99 -DSELF_TEST {prefix}.c -lm && ./a.out */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        f"#define {prefix.upper()}_JOINTS {n}",
        f"#define {prefix.upper()}_PARAMETERS {p}",
        "",
        "/* Parameters, in the order of the regressors' columns, and their names. */",
        f"extern const double {prefix}_parameters[{p}];",
        f"extern const char *const {prefix}_parameter_names[{p}];",
    ]
    for function in models.functions:
        shape = " by ".join(map(str, function.shape))
        lines += ["", f"/* {function.about} ({shape}) */", f"{_signature(function, n, prefix)};"]
    return "\n".join([*lines, "", f"#endif /* {guard} */", ""])


def _source(models: Models, samples: tuple[Sample, ...], prefix: str) -> str:
    names, p = models.regressor.names, models.regressor.p
    used = sorted({name for function in models.functions for name in _read(function)} & set(models.constants))
    constants = {name: f"constant[{k}]" for k, name in enumerate(used)}
    lines = [f'#include "{prefix}.h"', "", "#include <math.h>", ""]
    lines += [f"const double {prefix}_parameters[{p}] = {{"]
    lines += [f"    {float(x)!r}, /* {name} */" for name, x in zip(names, models.theta, strict=True)]
    lines += ["};", "", f"const char *const {prefix}_parameter_names[{p}] = {{"]
    lines += [f'    "{name}",' for name in names]
    lines += ["};", ""]
    if used:
        lines += ["/* The same parameters as the recurrences read them: second moments of the links they stand for. */"]
        lines += [f"static const double constant[{len(used)}] = {{"]
        lines += [f"    {models.constants[name]!r}, /* {name} */" for name in used]
        lines += ["};", ""]
    for function in models.functions:
        lines += _body(function, models.robot.n, prefix, constants)
    return "\n".join([*lines, *_self_test(models, samples, prefix)]) + "\n"


def _read(function: Function) -> set[str]:
    graphs = {id(e.graph): e.graph for e in function.entries.values()}
    return {node[1] for graph in graphs.values() for node in graph.nodes if node[0] == "symbol"}


def _body(function: Function, n: int, prefix: str, constants: dict[str, str]) -> list[str]:
    lines = [f"{_signature(function, n, prefix)}", "{"]
    lines += [f"    (void){name};" for name in unused(function)]
    for name, ratios in live_signs(function).items():
        single = sum(1 for r in ratios if r) == 1
        value = speed(ratios)
        if not single:
            lines.append(f"    const double speed_{name} = {value};")
            value = f"speed_{name}"
        lines.append(f"    const double {name} = {SIGN.format(value)};")
    work, entries = statements(function, constants, str)
    lines += [f"    const double {name} = {value};" for name, value in work]
    if len(entries) < function.size:
        lines.append(f"    for (int i = 0; i < {function.size}; ++i) out[i] = 0.0;")
    lines += [f"    out[{at}] = {value};" for at, value in sorted(entries.items())]
    return [*lines, "}", ""]


def _array(values: Iterable[float]) -> str:
    return "{" + ", ".join(repr(float(x)) for x in values) + "}"


def _self_test(models: Models, samples: tuple[Sample, ...], prefix: str) -> list[str]:
    """A main that compares every function with stored samples, made by other code, to 1e-12 of the largest entry."""
    n = models.robot.n
    largest = max(function.size for function in models.functions)
    lines = ["#ifdef SELF_TEST", "#include <stdio.h>", ""]
    for prefix_of in ("q", "dq", "ddq", "dqr", "ddqr"):
        rows = ", ".join(_array(sample.signals[prefix_of]) for sample in samples)
        lines.append(f"static const double sample_{prefix_of}[{len(samples)}][{n}] = {{{rows}}};")
    for function in models.functions:
        rows = ", ".join(_array(np.ravel(sample.expected[function.name])) for sample in samples)
        lines.append(f"static const double expected_{function.name}[{len(samples)}][{function.size}] = {{{rows}}};")
    lines += [
        "",
        "static double worst_difference(const double *found, const double *expected, int count)",
        "{",
        "    double difference = 0.0, largest = 1e-300;",
        "    for (int i = 0; i < count; ++i) {",
        "        const double d = fabs(found[i] - expected[i]);",
        "        if (!(d <= difference)) difference = d;",
        "        if (fabs(expected[i]) > largest) largest = fabs(expected[i]);",
        "    }",
        "    return largest > 1e-9 ? difference / largest : difference;",
        "}",
        "",
        "int main(void)",
        "{",
        f"    static double out[{largest}];",
        "    int failed = 0;",
        f"    for (int k = 0; k < {len(samples)}; ++k) {{",
        "        double error;",
    ]
    for function in models.functions:
        signals = ", ".join(f"sample_{name}[k]" for name in function.inputs)
        lines += [
            f"        {prefix}_{function.name}({signals}, out);",
            f"        error = worst_difference(out, expected_{function.name}[k], {function.size});",
            "        failed += !(error <= 1e-12);",
            f'        printf("{function.name} sample %d: %.1e %s\\n", k, error, error <= 1e-12 ? "ok" : "WRONG");',
        ]
    return [*lines, "    }", "    return failed != 0;", "}", "#endif"]
