"""Python: one file that needs NumPy alone."""

from __future__ import annotations

import numpy as np

from identify.codegen.functions import Function, Models
from identify.codegen.samples import Sample
from identify.codegen.statements import argument, live_signs, speed, statements, title


def python_files(models: Models, samples: tuple[Sample, ...], prefix: str) -> dict[str, str]:
    """{file name: text} of the module."""
    names = models.regressor.names
    constants = {name: f"CONSTANTS[{name!r}]" for name in models.constants}
    lines = [
        f'"""{title(models.robot.name)}: dynamic and geometric models, SI units, radians, joint side.',
        "",
        "Every function takes joint signals of n numbers each, for one sample, and returns a NumPy array.",
        f"Self-test: python {prefix}.py",
        '"""',
        "",
        "from math import cos, sin",
        "",
        "import numpy as np",
        "",
        f"JOINTS = {models.robot.n}",
        "PARAMETER_NAMES = (",
        *(f"    {name!r}," for name in names),
        ")",
        "PARAMETERS = np.array([",
        *(f"    {float(x)!r},  # {name}" for name, x in zip(names, models.theta, strict=True)),
        "])",
        "# The same parameters as the recurrences read them: second moments of the links they stand for.",
        "CONSTANTS = {",
        *(f"    {name!r}: {x!r}," for name, x in models.constants.items()),
        "}",
        "",
    ]
    for function in models.functions:
        lines += ["", *_body(function, constants), ""]
    return {f"{prefix}.py": "\n".join([*lines, *_self_test(models, samples)]) + "\n"}


def _body(function: Function, constants: dict[str, str]) -> list[str]:
    shape = " by ".join(map(str, function.shape))
    lines = [
        f"def {function.name}({', '.join(argument(name) for name in function.inputs)}):",
        f'    """{function.about} ({shape})"""',
    ]
    # Plain floats: arithmetic on NumPy's scalars would take several times as long.
    lines += [f"    {x} = np.asarray({x}, dtype=float).tolist()" for x in map(argument, function.inputs)]
    for name, ratios in live_signs(function).items():
        lines += [f"    speed = {speed(ratios)}", f"    {name} = float((speed > 0.0) - (speed < 0.0))"]
    work, entries = statements(function, constants, str)
    lines += [f"    {name} = {value}" for name, value in work]
    lines.append(f"    out = np.zeros({function.size})")
    lines += [f"    out[{at}] = {value}" for at, value in sorted(entries.items())]
    return [*lines, f"    return out.reshape({function.shape!r})"]


def _self_test(models: Models, samples: tuple[Sample, ...]) -> list[str]:
    """A function that compares every other with stored samples, made by other code, to 1e-12 of the largest entry."""
    lines = ["", "SAMPLES = ["]
    for sample in samples:
        for function in models.functions:
            signals = [[float(x) for x in sample.signals[name]] for name in function.inputs]
            expected = [float(x) for x in np.ravel(sample.expected[function.name])]
            lines.append(f"    ({function.name}, {signals!r}, {expected!r}),")
    return [
        *lines,
        "]",
        "",
        "",
        "def self_test():",
        '    """The largest relative error over all functions and stored samples."""',
        "    worst = 0.0",
        "    for function, signals, expected in SAMPLES:",
        "        found, expected = function(*signals).ravel(), np.array(expected)",
        "        largest = np.abs(expected).max()",
        "        error = np.abs(found - expected).max() / (largest if largest > 1e-9 else 1.0)",
        "        worst = max(worst, error)",
        "    return worst",
        "",
        "",
        'if __name__ == "__main__":',
        "    error = self_test()",
        '    print(f"largest relative error {error:.1e}")',
        "    raise SystemExit(not error <= 1e-12)",
    ]
