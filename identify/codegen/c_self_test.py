"""The self-test of the generated C: a main that compares every function with stored samples made by other code."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from identify.codegen.functions import Models
from identify.codegen.samples import PoseSample, Sample
from identify.codegen.text import rows


def self_test(models: Models, samples: tuple[Sample, ...], poses: tuple[PoseSample, ...], prefix: str) -> list[str]:
    """Lines of the main: 1e-12 of the largest entry for every function, 1e-9 for the solutions of inverse geometry."""
    n, count = models.robot.n, len(samples)
    largest = max(function.size for function in models.functions)
    lines = ["#ifdef SELF_TEST", "#include <stdio.h>", ""]
    for name in ("q", "dq", "ddq", "dqr", "ddqr"):
        lines += _table("double", f"sample_{name}[{count}][{n}]", (sample.signals[name] for sample in samples))
    for function in models.functions:
        values = (np.ravel(sample.expected[function.name]) for sample in samples)
        lines += _table("double", f"expected_{function.name}[{count}][{function.size}]", values)
    if models.inverse:
        lines += _poses(poses, n, models.inverse.most, prefix)
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
        f"    for (int k = 0; k < {count}; ++k) {{",
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
    lines.append("    }")
    if models.inverse:
        lines += [
            f"    for (int k = 0; k < {len(poses)}; ++k) {{",
            "        const int right = solutions_are_right(k);",
            "        failed += !right;",
            '        printf("inverse_geometry sample %d: %s\\n", k, right ? "ok" : "WRONG");',
            "    }",
        ]
    return [*lines, "    return failed != 0;", "}", "#endif"]


def _table(type_: str, declaration: str, values: Iterable[np.ndarray]) -> list[str]:
    lines = [f"static const {type_} {declaration} = {{"]
    for row in values:
        texts = [repr(x) for x in np.asarray(row, dtype=int if type_ == "int" else float).tolist()]
        lines += ["    {", *rows(texts, indent="        "), "    },"]
    return [*lines, "};"]


def _poses(poses: tuple[PoseSample, ...], n: int, most: int, prefix: str) -> list[str]:
    """Stored poses and solutions, and the function that compares."""
    counts = [len(sample.q) if sample.q is not None else -1 for sample in poses]
    solutions = np.zeros((len(poses), most, n))
    inside = np.zeros((len(poses), most), dtype=int)
    for k, sample in enumerate(poses):
        if sample.q is not None and sample.inside is not None:
            solutions[k, : len(sample.q)] = sample.q
            inside[k, : len(sample.q)] = sample.inside
    lines = _table("double", f"sample_pose[{len(poses)}][16]", (np.ravel(sample.pose) for sample in poses))
    lines += _table("double", f"sample_current[{len(poses)}][{n}]", (sample.current for sample in poses))
    lines += _table("double", f"expected_solutions[{len(poses)}][{most * n}]", (np.ravel(s) for s in solutions))
    lines += _table("int", f"expected_inside[{len(poses)}][{most}]", inside)
    lines += [
        "/* -1: a pose that may be singular, where rounding decides how many solutions there are. */",
        f"static const int expected_count[{len(poses)}] = {{{', '.join(map(str, counts))}}};",
        "",
        "static int solutions_are_right(int k)",
        "{",
        f"    double found[{most}][{n}], reached[16];",
        f"    int inside[{most}];",
        f"    const int count = {prefix}_inverse_geometry(sample_pose[k], sample_current[k], found, inside);",
        "    if (expected_count[k] < 0 ? count < 1 : count != expected_count[k]) return 0;",
        "    for (int s = 0; s < count; ++s) {",
        f"        {prefix}_direct_geometry(found[s], reached);",
        "        for (int i = 0; i < 16; ++i)",
        "            if (!(fabs(reached[i] - sample_pose[k][i]) <= 1e-9)) return 0;",
        "    }",
        "    for (int e = 0; e < expected_count[k]; ++e) {",
        "        int there = 0;",
        "        for (int s = 0; s < count; ++s) {",
        "            int same = inside[s] == expected_inside[k][e];",
        f"            for (int j = 0; j < {n}; ++j)",
        f"                if (!(fabs(apart(j, found[s][j], expected_solutions[k][{n} * e + j])) <= 1e-9)) same = 0;",
        "            there += same;",
        "        }",
        "        if (there != 1) return 0;",
        "    }",
        "    return 1;",
        "}",
    ]
    return lines
