"""Generated C and Python: warnings off by being right, the numbers of the package, the same text every time."""

from __future__ import annotations

import ast
import ctypes
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import oracle
import pytest
from beside import c_compiler, program
from chains import random_chain
from symbolic_models import states, tilted

from identify.codegen.angles import with_products
from identify.codegen.generate import generate, identifier, left_out
from identify.errors import InputError
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.robot import Drive, Joint, Link, Robot, Transmission
from identify.symbolic.expression import Graph, cos, evaluate, reachable, sin

WARNINGS = ("-Wall", "-Wextra", "-Werror", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wwrite-strings", "-std=c99")
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
    compiler = c_compiler()
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


def odd_names() -> Robot:
    """One joint without friction, and names that are neither ASCII nor harmless in a comment or a string."""
    robot = random_chain(np.random.default_rng(1), 1)
    joint = replace(robot.joints[0], name='Gelenk "ä" \\n ??/ */', drive=Drive())
    return replace(robot, name='Roboter "*/ \\ ??/\n#error Nr. 7', joints=(joint,))


def seven_joints() -> Robot:
    return replace(random_chain(np.random.default_rng(12), 7, special=True), name="日本 7")


@pytest.mark.parametrize("make", [odd_names, seven_joints])
def test_any_robot_passes_its_self_test(make: Callable[[], Robot], tmp_path: Path) -> None:
    robot = make()
    prefix = identifier(robot.name)
    for language in ("c", "python"):
        for file, text in generate(robot, language).items():
            (tmp_path / file).write_bytes(text.encode("ascii" if language == "c" else "utf-8"))
    told = run([sys.executable, f"{prefix}.py"], tmp_path)
    assert told.returncode == 0, told.stdout + told.stderr
    compiler = c_compiler()
    built = run([compiler, *WARNINGS, "-Wtrigraphs", "-DSELF_TEST", f"{prefix}.c", "-o", "self_test", "-lm"], tmp_path)
    assert built.returncode == 0, built.stderr
    assert run(["./self_test"], tmp_path).returncode == 0


def compiled(name: str, folder: Path, *flags: str) -> ctypes.CDLL:
    """The robot's models as a shared library, built with these flags."""
    compiler = c_compiler()
    for file, text in files(name, "c").items():
        (folder / file).write_text(text, encoding="ascii")
    library = f"models{'_'.join(flags)}.so"
    source = f"{identifier(robot_called(name).name)}.c"
    built = run([compiler, "-std=c99", *flags, "-shared", "-fPIC", source, "-o", library, "-lm"], folder)
    assert built.returncode == 0, built.stderr
    return ctypes.CDLL(str(folder / library))


def results(name: str, library: ctypes.CDLL) -> list[bytes]:
    """The bytes that every function returns at a few states."""
    robot = robot_called(name)
    rng = np.random.default_rng(3)
    found = []
    for _ in range(20):
        signals = {s: rng.normal(size=robot.n) for s in ("q", "dq", "ddq", "dq_ref", "ddq_ref")}
        for function, inputs in SIGNALS.items():
            out = np.zeros(max(16, 6 * robot.n, robot.n * len(parameters(name))))
            pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (*(signals[s] for s in inputs), out)]
            getattr(library, f"{identifier(robot.name)}_{function}")(*pointers)
            found.append(out.tobytes())
    return found


def test_the_same_bits_from_call_to_call_and_whatever_the_optimisation(tmp_path: Path) -> None:
    plain = compiled("coupled_tree", tmp_path, "-O0")
    fast = compiled("coupled_tree", tmp_path, "-O2", "-march=native", "-ffp-contract=off")
    first = results("coupled_tree", plain)
    assert first == results("coupled_tree", plain)
    assert first == results("coupled_tree", fast)


def test_valgrind_finds_nothing(tmp_path: Path) -> None:
    compiler = c_compiler()
    valgrind = program("valgrind", unknown="whether the generated C reaches for memory that is not its own")
    for file, text in files("rx90", "c").items():
        (tmp_path / file).write_text(text, encoding="ascii")
    source = f"{identifier(robot_called('rx90').name)}.c"
    assert run([compiler, "-g", "-O1", "-DSELF_TEST", source, "-o", "self_test", "-lm"], tmp_path).returncode == 0
    checked = run([valgrind, "-q", "--error-exitcode=9", "--leak-check=full", "./self_test"], tmp_path)
    assert checked.returncode == 0, checked.stderr
    assert "inverse_geometry sample 3: ok" in checked.stdout


def test_a_program_in_cpp_links_the_header(tmp_path: Path) -> None:
    compiler = c_compiler()
    plus = program("c++", "g++", "clang++", unknown="whether C++ takes the header")
    name, prefix = "rx90", identifier(robot_called("rx90").name)
    for file, text in files(name, "c").items():
        (tmp_path / file).write_text(text, encoding="ascii")
    big = prefix.upper()
    (tmp_path / "main.cpp").write_text(
        f"""#include "{prefix}.h"
        #include <cmath>
        int main() {{
            double q[{big}_JOINTS] = {{0.1, 0.2, 0.3, 0.4, 0.5, 0.6}}, pose[16];
            double found[{big}_SOLUTIONS][{big}_JOINTS];
            int inside[{big}_SOLUTIONS];
            {prefix}_direct_geometry(q, pose);
            const int count = {prefix}_inverse_geometry(pose, q, found, inside);
            bool there = false;
            for (int k = 0; k < count; ++k) there = there || std::fabs(found[k][4] - q[4]) < 1e-12;
            return there && count == 8 && {prefix}_joint_names[5][0] == 'j' && {big}_IDENTIFIED == 0 ? 0 : 1;
        }}""",
        encoding="ascii",
    )
    assert run([compiler, "-std=c99", "-c", f"{prefix}.c"], tmp_path).returncode == 0
    built = run([plus, "-std=c++11", "-Wall", "-Wextra", "-Werror", "main.cpp", f"{prefix}.o", "-o", "main"], tmp_path)
    assert built.returncode == 0, built.stderr
    assert run(["./main"], tmp_path).returncode == 0


def test_identified_parameters_carry_their_covariance(tmp_path: Path) -> None:
    robot = odd_names()
    p = Regressor(robot).p
    square = np.random.default_rng(0).normal(size=(p, p))
    covariance = square @ square.T
    theta = np.arange(1.0, p + 1)
    ((file, text),) = generate(robot, "python", theta, covariance).items()
    space: dict = {"__name__": "generated"}
    exec(compile(text, file, "exec"), space)
    np.testing.assert_array_equal(space["COVARIANCE"], covariance)
    np.testing.assert_array_equal(space["STANDARD_DEVIATIONS"], np.sqrt(np.diag(covariance)))
    with pytest.raises(InputError, match=f"give {p} by {p} finite numbers"):
        generate(robot, "c", theta, covariance[:-1])
    compiler = c_compiler()
    prefix = identifier(robot.name)
    for name, source in generate(robot, "c", theta, covariance).items():
        (tmp_path / name).write_text(source, encoding="ascii")
    built = run([compiler, *WARNINGS, "-shared", "-fPIC", f"{prefix}.c", "-o", "models.so", "-lm"], tmp_path)
    assert built.returncode == 0, built.stderr
    library = ctypes.CDLL(str(tmp_path / "models.so"))

    def array(name: str, size: int) -> np.ndarray:
        return np.array((ctypes.c_double * size).in_dll(library, f"{prefix}_{name}"))

    np.testing.assert_array_equal(array("parameters", p), theta)
    np.testing.assert_array_equal(array("covariance", p * p).reshape(p, p), covariance)
    np.testing.assert_array_equal(array("standard_deviations", p), np.sqrt(np.diag(covariance)))
    np.testing.assert_array_equal(array("position_high", 1), [robot.joints[0].limits.position[1]])
    (joint,) = (ctypes.c_char_p * 1).in_dll(library, f"{prefix}_joint_names")
    assert joint is not None
    assert joint.decode() == robot.joints[0].name


def test_products_for_cosines_of_sums_keep_the_values() -> None:
    graph = Graph()
    a, b, c = (graph.symbol(name) for name in "abc")
    outputs = [cos(a) + sin(a), cos(b) * sin(b), cos(c) - sin(c), cos(a + b), sin(a + b) * sin(a - c), cos((a + b) - c)]
    outputs += [cos(a * b), sin(b + graph.constant(0.3)), cos(a - c)]
    made = with_products(outputs)
    values = {"a": 0.7, "b": -1.9, "c": 2.3}
    np.testing.assert_allclose(evaluate(made, values), evaluate(outputs, values), rtol=0, atol=1e-15)
    calls = [made[0].graph.nodes[i] for i in reachable(made[0].graph, made)]
    assert sum(node[0] in ("cos", "sin") for node in calls) == 8


def test_the_self_test_can_fail(tmp_path: Path) -> None:
    compiler = c_compiler()
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


def test_the_text_is_the_same_in_every_process() -> None:
    """Other hash seeds, other order of sets: the same bytes."""
    code = (
        "import hashlib, identify; from identify.codegen.generate import generate; "
        "from identify.robot.robot import Joint, Robot; "
        "arm = Robot('arm', tuple(Joint(f'j{k}', alpha=1.5707963267948966 * (k % 2), d=0.1 * k) for k in range(3))); "
        "print(hashlib.sha256(repr([generate(arm, language) for language in ('c', 'python')]).encode()).hexdigest())"
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
    # A file of that name beside a program would be imported in place of the library's.
    assert identifier("Math") == "robot_math"
    assert identifier("class") == "robot_class"


def test_gravity_says_which_offset_it_holds() -> None:
    """A vertical slide's offset and its weight are one constant force; an arm without slides has nothing to say."""
    link, drive = Link(2.0, (0.1, 0.02, 0.03), (0.1, 0.01, 0.02, 0.2, 0.01, 0.15)), Drive(0.1, 0.2, 0.3, 0.4)
    slide = Joint("slide", "prismatic", 0, d=0.4, link=link, drive=drive)
    robot = Robot("crane", (Joint("turn", link=link, drive=drive), slide), (0.0, 0.0, -9.81))
    regressor = Regressor(robot)
    assert "off2" in regressor.dropped
    space: dict = {}
    exec(generate(robot, "python")["crane.py"], space)
    assert "holds off2" in space["gravity"].__doc__
    assert "holds off2" in space["energy_regressor"].__doc__
    weight = oracle.inverse_dynamics(robot, *np.zeros((3, 1, 2)))[0]
    np.testing.assert_allclose(space["gravity"]([0.0, 0.0]), weight + np.array([0.0, drive.offset]), rtol=1e-12)
    assert "holds off" not in generate(load_robot("rx90"), "python")["staubli_rx_90.py"]
