"""Printed models: every form says the same, and what claims to be code runs."""

from __future__ import annotations

import ctypes
import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sympy
from beside import c_compiler
from chains import random_chain
from printed_models import printed

from identify.errors import InputError
from identify.robot.length_names import length_name_problem
from identify.robot.library import load_robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.geometry import direct_geometry
from identify.symbolic.jacobian import jacobian
from identify.symbolic.model import SymbolicModel
from identify.symbolic.models import MODELS, symbolic_model
from identify.symbolic.rendering import FORMATS, arguments, render

Q = np.array([0.3, -0.7, 1.1, 0.4, -0.9, 0.2])


@pytest.fixture(scope="module")
def models() -> dict[str, SymbolicModel]:
    return {what: symbolic_model(load_robot("rx90"), what) for what in MODELS}


def inputs(model: SymbolicModel) -> list[float]:
    """Values of a model's inputs at which all of it is real: standard parameters, a reachable pose or a motion."""
    robot = load_robot("rx90")
    if model.what == "base-parameters":
        values = dict(zip(robot.standard_names, robot.standard, strict=True))
        return [float(values[name]) for name in model.inputs]
    if model.what == "inverse-geometry":
        pose = direct_geometry(robot, Q[None])[0]
        return [*(float(pose[i, k]) for k in range(4) for i in range(3)), *[1.0] * (len(model.inputs) - 12)]
    return [*Q, *np.random.default_rng(3).normal(size=len(model.inputs) - 6)]


def calls(model: SymbolicModel) -> list[float | list[float]]:
    """The inputs as the printed function takes them: signals as lists, others as numbers."""
    values, found = iter(inputs(model)), []
    for argument, names in arguments(model):
        own = [next(values) for _ in names]
        found.append(own if (argument,) != names else own[0])
    return found


def by_python(model: SymbolicModel) -> dict[str, float]:
    """Every entry of every result by name."""
    space: dict = {}
    exec(render(model, "python"), space)
    answer = space[model.what.replace("-", "_")](*calls(model))
    if not model.results:
        return answer
    if len(model.results) == 1:
        answer = {model.results[0].name: answer}
    flat = {r.name: np.ravel(answer[r.name]) for r in model.results}
    for r in model.results:
        assert np.shape(answer[r.name]) == (
            () if r.number else (len(r.entries) // r.columns, r.columns) if r.columns else (len(r.entries),)
        )
    return {f"{r.name}[{i}]": float(x) for r in model.results for i, x in enumerate(flat[r.name])}


@pytest.mark.parametrize("what", MODELS)
def test_python_is_the_expressions(models: dict[str, SymbolicModel], what: str) -> None:
    model = models[what]
    found = by_python(model)
    known = dict(model.constants) | dict(zip(model.inputs, inputs(model), strict=True))
    for name, expression in model.expressions.items():
        known[name] = float(
            expression.xreplace({s: sympy.Float(known[s.name]) for s in expression.free_symbols}).evalf()
        )
    entries = [name for r in model.results for name in r.entries] or list(model.expressions)
    np.testing.assert_allclose(list(found.values()), [known[name] for name in entries], rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("what", MODELS)
def test_c_is_the_python(models: dict[str, SymbolicModel], what: str, tmp_path: Path) -> None:
    model = models[what]
    (tmp_path / "model.c").write_text(render(model, "c"), encoding="utf-8")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    subprocess.run([c_compiler(), *flags, "model.c", "-o", "model.so", "-lm"], cwd=tmp_path, check=True)
    function = getattr(ctypes.CDLL(str(tmp_path / "model.so")), what.replace("-", "_"))
    given = [(ctypes.c_double * len(x))(*x) if isinstance(x, list) else ctypes.c_double(x) for x in calls(model)]
    sizes = [len(r.entries) for r in model.results] or [len(model.expressions)]
    out = [(ctypes.c_double * size)() for size in sizes]
    function(*given, *out)
    expected = list(by_python(model).values())
    np.testing.assert_allclose(np.concatenate([list(x) for x in out]), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("what", MODELS)
def test_json_reads_back_and_text_and_latex_name_everything(models: dict[str, SymbolicModel], what: str) -> None:
    model = models[what]
    table = json.loads(render(model, "json"))
    text, latex = render(model, "text"), render(model, "latex")
    rng = np.random.default_rng(1)
    for name, expression in model.expressions.items():
        symbols = {s.name: s for s in expression.free_symbols}
        again = sympy.sympify(table["expressions"][name], locals=symbols)
        point = {s: sympy.Float(x) for s, x in zip(symbols.values(), rng.uniform(0.2, 0.9, len(symbols)), strict=True)}
        if again != expression:
            assert abs(complex((again - expression).xreplace(point))) < 1e-12
        assert f"\n{name}" in text
    assert table["parameters"] == dict(model.parameters)
    assert latex.count("&=") == len(model.expressions)
    assert table["results"].keys() == ({r.name for r in model.results} or model.expressions.keys())


def test_no_length_may_be_called_like_a_variable(models: dict[str, SymbolicModel]) -> None:
    """What models print is refused as the name of a length, and so are words of C and Python; natural names are not."""
    for model in models.values():
        own = {name for name, _ in model.lengths}
        names = {*model.expressions, *model.inputs, *(name for name, _ in model.parameters)} - own
        names |= {*(r.name for r in model.results), model.what.replace("-", "_")}
        assert [name for name in sorted(names) if length_name_problem(name) is None] == [], model.what
        assert all(length_name_problem(name) is None for name in own)
    for name in (
        "Fsm6",
        "A1_12",
        "C10_11",
        "lambda",
        "double",
        "bool",
        "match_",
        "sinf",
        "M_PI",
        "2a",
        "é",
        "_a",
        "C2_",
    ):
        assert (length_name_problem(name) is None) == (name == "match_"), name
    for name in ("D3", "RL4", "a2", "r4", "L1", "l", "L", "forearm", "D12"):
        assert length_name_problem(name) is None, name


def test_inverse_geometry_inverts(models: dict[str, SymbolicModel]) -> None:
    found, robot = by_python(models["inverse-geometry"]), load_robot("rx90")
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


def test_axes_at_any_angle_get_intermediate_variables() -> None:
    """Written out, the pose and the Jacobian of such an arm would fill pages; in statements they do not."""
    robot = random_chain(np.random.default_rng(5), 6)
    q = np.random.default_rng(6).uniform(-1.5, 1.5, 6)
    pose, velocity = (symbolic_model(robot, what) for what in ("direct-geometry", "jacobian"))
    assert "t1" in pose.expressions
    assert any("not factored" in note for note in velocity.notes)
    found = np.array([float(x) for x in printed(pose)(q=q).values()])
    np.testing.assert_allclose(found, direct_geometry(robot, q)[0][:3].T.ravel(), rtol=0, atol=1e-12)
    found = np.array([float(x) for x in printed(velocity)(q=q).values()])
    np.testing.assert_allclose(found, jacobian(robot, q, 3)[0].ravel(), rtol=0, atol=1e-12)


@pytest.mark.parametrize("what", ["lagrange", "newton-euler", "direct-dynamics", "energy"])
def test_results_have_names_that_all_forms_use(models: dict[str, SymbolicModel], what: str) -> None:
    """A result is an array of its name in C and a key or the value in Python, and the text says how large it is."""
    model = models[what]
    code, text = render(model, "c"), render(model, "text")
    for result in model.results:
        assert set(result.entries) <= set(model.expressions)
        assert f"double {result.name}{'_out' if result.number else ''}[{len(result.entries)}]" in code
    assert "gives " in text
    constants = {name for name, _ in model.constants}
    read = {s.name for e in model.expressions.values() for s in e.free_symbols}
    assert read <= constants | set(model.inputs) | set(model.expressions)


@pytest.mark.parametrize("what", ["lagrange", "newton-euler", "direct-dynamics", "energy"])
def test_statements_come_before_their_readers(models: dict[str, SymbolicModel], what: str) -> None:
    model = models[what]
    known = {name for name, _ in model.constants} | set(model.inputs)
    for name, expression in model.expressions.items():
        assert {s.name for s in expression.free_symbols} <= known, name
        assert name not in known
        known.add(name)


def test_latex_writes_rates_with_dots(models: dict[str, SymbolicModel]) -> None:
    text = render(models["newton-euler"], "latex")
    assert r"\ddot{q}_{1}" in text
    assert r"\omega_{3,1} &= S_{23} \dot{q}_{1}" in text
    assert r"\tau_{1} &=" in text
    assert r"\mathbf{C}_{12}" in render(models["lagrange"], "latex")
