"""Printed models: every form says the same, and what claims to be code runs."""

from __future__ import annotations

import ctypes
import json
import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sympy

from identify.errors import InputError
from identify.robot.library import load_robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.geometry import direct_geometry
from identify.symbolic.models import MODELS, symbolic_model
from identify.symbolic.rendering import FORMATS, render

Q = np.array([0.3, -0.7, 1.1, 0.4, -0.9, 0.2])


def arguments(what: str) -> list[float]:
    """Values of a model's inputs at which all of it is real: standard parameters, joints or a reachable pose."""
    robot = load_robot("rx90")
    model = symbolic_model(robot, what)
    if what == "base-parameters":
        values = dict(zip(robot.standard_names, robot.standard, strict=True))
        return [float(values[name]) for name in model.inputs]
    if what == "inverse-geometry":
        pose = direct_geometry(robot, Q[None])[0]
        signs = len(model.inputs) - 12
        return [*(float(pose[i, k]) for k in range(4) for i in range(3)), *[1.0] * signs]
    return [float(x) for x in Q]


def by_python(text: str, what: str) -> dict[str, float]:
    space: dict = {}
    exec(text, space)
    return space[what.replace("-", "_")](*arguments(what))


@pytest.mark.parametrize("what", MODELS)
def test_python_is_the_expressions(what: str) -> None:
    model = symbolic_model(load_robot("rx90"), what)
    found = by_python(render(model, "python"), what)
    known = dict(model.lengths) | dict(zip(model.inputs, arguments(what), strict=True))
    for name, expression in model.expressions.items():
        known[name] = float(sympy.sympify(expression).subs(known))
        assert math.isclose(found[name], known[name], rel_tol=1e-12, abs_tol=1e-12)


@pytest.mark.parametrize("what", MODELS)
def test_c_is_the_python(what: str, tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler here")
    model = symbolic_model(load_robot("rx90"), what)
    (tmp_path / "model.c").write_text(render(model, "c"), encoding="utf-8")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "model.c", "-o", "model.so", "-lm"], cwd=tmp_path, check=True)
    out = (ctypes.c_double * len(model.expressions))()
    function = getattr(ctypes.CDLL(str(tmp_path / "model.so")), what.replace("-", "_"))
    function(*(ctypes.c_double(x) for x in arguments(what)), out)
    expected = list(by_python(render(model, "python"), what).values())
    np.testing.assert_allclose(list(out), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("what", MODELS)
def test_json_reads_back_and_text_and_latex_name_everything(what: str) -> None:
    model = symbolic_model(load_robot("rx90"), what)
    table = json.loads(render(model, "json"))
    for name, expression in model.expressions.items():
        symbols = {s.name: s for s in sympy.sympify(expression).free_symbols}
        assert sympy.expand(sympy.sympify(table["expressions"][name], locals=symbols) - expression) == 0
        assert name in render(model, "text")
    assert r"\begin{align*}" in render(model, "latex")


def test_inverse_geometry_inverts() -> None:
    found = by_python(render(symbolic_model(load_robot("rx90"), "inverse-geometry"), "python"), "inverse-geometry")
    robot = load_robot("rx90")
    again = direct_geometry(robot, np.array([[found[f"q{j + 1}"] for j in range(6)]]))[0]
    np.testing.assert_allclose(again, direct_geometry(robot, Q[None])[0], atol=1e-12)


def test_grouping_is_written_with_its_own_parameter_first() -> None:
    robot = load_robot("rx90")
    text = render(symbolic_model(robot, "base-parameters"), "text")
    assert "ZZR2 = ZZ2 + Ia2 + D3**2*(M3 + M4 + M5 + M6)" in text
    assert f"{len(base_parameters(robot).names)} base parameters" in text


def test_unknown_names_are_told_what_there_is() -> None:
    with pytest.raises(InputError, match="choose one of base-parameters"):
        symbolic_model(load_robot("rx90"), "nothing")
    with pytest.raises(ValueError, match=", ".join(FORMATS)):
        render(symbolic_model(load_robot("rx90"), "base-parameters"), "pdf")
