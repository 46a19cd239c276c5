"""Generated C and Python: warnings off by being right, the numbers of the package, the same text every time."""

from __future__ import annotations

import ast
import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import oracle
import pytest
from chains import random_chain
from symbolic_models import states, tilted

from identify.codegen.generate import generate, identifier, left_out
from identify.errors import InputError
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.robot import Robot, Transmission

WARNINGS = ("-Wall", "-Wextra", "-Werror", "-Wpedantic", "-std=c99")
SIGNALS = {
    "inverse_dynamics": ("q", "dq", "ddq"),
    "torque_regressor": ("q", "dq", "ddq"),
    "energy_regressor": ("q", "dq"),
    "slotine_li_regressor": ("q", "dq", "dq_ref", "ddq_ref"),
    "inertia_matrix": ("q",),
    "coriolis": ("q", "dq"),
    "gravity": ("q",),
    "direct_geometry": ("q",),
    "jacobian": ("q",),
}


def coupled_tree() -> Robot:
    """Sliding and turning joints on branches, and a motor that two joints share."""
    robot = tilted(random_chain(np.random.default_rng(9), 4, tree=True))
    turn, shift = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0], (0.1, -0.2, 0.3)
    place = tuple(map(tuple, np.vstack([np.column_stack([turn, shift]), [0, 0, 0, 1]])))
    matrix = np.diag([20.0, 30.0, 40.0, 50.0])
    matrix[3, 2] = 25.0
    return replace(robot, base=place, tool=place, transmission=Transmission(tuple(map(tuple, matrix))))


ROBOTS: dict[str, Callable[[], Robot]] = {"rx90": lambda: load_robot("rx90"), "coupled_tree": coupled_tree}


@cache
def robot_called(name: str) -> Robot:
    return ROBOTS[name]()


@cache
def parameters(name: str) -> np.ndarray:
    regressor = Regressor(robot_called(name))
    return regressor.parameters + np.random.default_rng(4).normal(size=regressor.p)


@cache
def files(name: str, language: str) -> dict[str, str]:
    return generate(robot_called(name), language, parameters(name))


def run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


def expected(name: str, signals: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What each function is to return, by the package's regressor and by Pinocchio."""
    robot, theta = robot_called(name), parameters(name)
    regressor = Regressor(robot)
    q, dq, ddq, dq_ref, ddq_ref = signals.values()
    return {
        "inverse_dynamics": regressor.torque(q, dq, ddq) @ theta,
        "torque_regressor": regressor.torque(q, dq, ddq),
        "energy_regressor": regressor.energy(q, dq),
        "slotine_li_regressor": regressor.slotine_li(q, dq, dq_ref, ddq_ref),
    }


def agreeing(name: str, call: Callable[[str, list[np.ndarray], tuple[int, ...]], np.ndarray]) -> None:
    """Every function at random states against `expected`, and by laws that link the functions among themselves."""
    robot, theta = robot_called(name), parameters(name)
    n, rng = robot.n, np.random.default_rng(11)
    rigid = theta.copy()
    names = Regressor(robot).names
    rigid[[at for at, x in enumerate(names) if x.startswith(("Fv", "Fs", "off"))]] = 0.0
    shapes = {
        "torque_regressor": (n, len(theta)),
        "slotine_li_regressor": (n, len(theta)),
        "energy_regressor": (len(theta),),
    }
    shapes |= {"inertia_matrix": (n, n), "direct_geometry": (4, 4), "jacobian": (6, n)}
    for _ in range(3):
        q, dq, ddq = states(rng, robot, 1)[:, 0]
        signals = dict(
            zip(("q", "dq", "ddq", "dq_ref", "ddq_ref"), (q, dq, ddq, *rng.normal(size=(2, n))), strict=True)
        )
        found = {f: call(f, [signals[s] for s in inputs], shapes.get(f, (n,))) for f, inputs in SIGNALS.items()}
        for function, value in expected(name, signals).items():
            np.testing.assert_allclose(found[function], value, rtol=0, atol=1e-12 * np.abs(value).max())
        effort = Regressor(robot).inverse_dynamics(q, dq, ddq, rigid)
        total = found["inertia_matrix"] @ ddq + found["coriolis"] + found["gravity"]
        np.testing.assert_allclose(total, effort, rtol=0, atol=1e-12 * np.abs(effort).max())
        np.testing.assert_array_equal(found["inertia_matrix"], found["inertia_matrix"].T)
        # The Jacobian is the derivative of the transform, along each joint by a central difference.
        for j in range(n):
            step = np.eye(n)[j] * 1e-5
            ahead, behind = (call("direct_geometry", [q + s], (4, 4)) for s in (step, -step))
            rate = (ahead - behind) / 2e-5
            spin = rate[:3, :3] @ found["direct_geometry"][:3, :3].T
            turning = [spin[2, 1], spin[0, 2], spin[1, 0]]
            np.testing.assert_allclose(found["jacobian"][:, j], [*rate[:3, 3], *turning], rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", ROBOTS)
def test_c_is_right_clean_and_tests_itself(name: str, tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: the generated C is not compiled")
    for file, text in files(name, "c").items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    prefix = identifier(robot_called(name).name)
    built = run([compiler, *WARNINGS, "-O2", "-DSELF_TEST", f"{prefix}.c", "-o", "self_test", "-lm"], tmp_path)
    assert built.returncode == 0, built.stderr
    told = run(["./self_test"], tmp_path)
    assert told.returncode == 0
    # Three states of every function, and as many poses and a singular one.
    assert told.stdout.count(" ok") == 3 * len(SIGNALS) + (4 if left_out(robot_called(name)) is None else 0)
    shared = run([compiler, *WARNINGS, "-O1", "-shared", "-fPIC", f"{prefix}.c", "-o", "models.so", "-lm"], tmp_path)
    assert shared.returncode == 0, shared.stderr
    library = ctypes.CDLL(str(tmp_path / "models.so"))

    def call(function: str, signals: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
        out = np.full(shape, np.nan)
        pointers = [np.ascontiguousarray(x).ctypes.data_as(ctypes.c_void_p) for x in (*signals, out)]
        getattr(library, f"{prefix}_{function}")(*pointers)
        return out

    agreeing(name, call)


def test_the_self_test_can_fail(tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: the generated C is not compiled")
    prefix = identifier(robot_called("rx90").name)
    for file, text in files("rx90", "c").items():
        changed = text.replace("const double t9 = ", "const double t9 = 1e-9 + ", 1)
        (tmp_path / file).write_text(changed, encoding="utf-8")
    assert run([compiler, "-DSELF_TEST", f"{prefix}.c", "-o", "self_test", "-lm"], tmp_path).returncode == 0
    told = run(["./self_test"], tmp_path)
    assert told.returncode == 1
    assert "WRONG" in told.stdout


@pytest.mark.parametrize("name", ROBOTS)
def test_python_is_right_and_needs_numpy_alone(name: str, tmp_path: Path) -> None:
    ((file, text),) = files(name, "python").items()
    imported = {a.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import) for a in node.names}
    imported |= {node.module for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom) and node.module}
    assert imported == {"math", "numpy"}
    (tmp_path / file).write_text(text, encoding="utf-8")
    told = run([sys.executable, file], tmp_path)
    assert told.returncode == 0, told.stdout + told.stderr
    space: dict = {"__name__": "generated"}
    exec(compile(text, file, "exec"), space)
    np.testing.assert_array_equal(space["PARAMETERS"], parameters(name))

    def call(function: str, signals: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
        found = space[function](*signals)
        assert found.shape == shape
        return found

    agreeing(name, call)


def test_direct_geometry_and_inertia_against_pinocchio() -> None:
    robot = load_robot("rx90")
    ((file, text),) = generate(robot, "python").items()
    space: dict = {"__name__": "generated"}
    exec(compile(text, file, "exec"), space)
    q = np.random.default_rng(2).uniform(-2, 2, robot.n)
    matrix = oracle.inertia_matrix(robot, q)
    np.testing.assert_allclose(space["inertia_matrix"](q), matrix, rtol=0, atol=1e-12 * np.abs(matrix).max())


@pytest.mark.parametrize("language", ["c", "python"])
def test_the_text_is_the_same_in_every_process(language: str) -> None:
    """Other hash seeds, other order of sets: the same bytes."""
    code = (
        "import hashlib, identify; from identify.codegen.generate import generate; "
        "from identify.robot.robot import Joint, Robot; "
        "arm = Robot('arm', tuple(Joint(f'j{k}', alpha=1.5707963267948966 * (k % 2), d=0.1 * k) for k in range(3))); "
        f"print(hashlib.sha256(repr(generate(arm, {language!r})).encode()).hexdigest())"
    )
    told = []
    for seed in ("1", "2"):
        environment = os.environ | {"PYTHONHASHSEED": seed}
        command = [sys.executable, "-c", code]
        told.append(subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout)
    assert told[0] == told[1]


def test_bad_requests_name_the_mend() -> None:
    robot = load_robot("rx90")
    with pytest.raises(InputError, match="choose one of c, python"):
        generate(robot, "fortran")
    with pytest.raises(InputError, match="give 58 finite numbers"):
        generate(robot, "c", np.ones(40))
    with pytest.raises(InputError, match="give 58 finite numbers"):
        generate(robot, "c", np.full(58, np.nan))


def test_identifiers() -> None:
    assert identifier("Stäubli RX-90") == "staubli_rx_90"
    assert identifier("3R planar") == "robot_3r_planar"
    assert identifier("*") == "robot"
