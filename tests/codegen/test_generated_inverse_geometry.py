"""Generated inverse geometry against the package's, in C for many poses and in Python for some."""

from __future__ import annotations

import ctypes
import math
import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from arms import OFFSET_SHOULDER, PUMA, SCARA, STANFORD, THREE_PARALLEL, placed, rx90
from beside import c_compiler
from chains import random_chain

from identify.codegen import c, python
from identify.codegen.functions import Models, direct_geometry, jacobian
from identify.codegen.inverse import inverse, left_out
from identify.codegen.samples import pose_samples
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.robot import Joint, Limits, Robot
from identify.symbolic import geometry
from identify.symbolic.inverse_geometry import differences, inverse_geometries

WARNINGS = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-Wpedantic", "-Wconversion", "-Wshadow"]


def unlimited(robot: Robot) -> Robot:
    return replace(robot, joints=tuple(replace(joint, limits=Limits()) for joint in robot.joints))


def sliding_wrist() -> Robot:
    """Two sliding joints, a constant angle that is no multiple of a right one, and limits of several turns."""
    rows = [("revolute", 0.3, 0.1, 0.2, 0.3), ("prismatic", -math.pi / 3, 0.2, 0.3, 0.1),
            ("prismatic", math.pi / 2, 0.15, 0.0, 0.0), ("revolute", math.pi / 2, 0.0, 0.0, 0.0),
            ("revolute", -math.pi / 2, 0.0, 0.0, 0.0), ("revolute", math.pi / 2, 0.0, 0.0, 0.1)]  # fmt: skip
    return Robot(
        "sliding", tuple(
            Joint(f"j{k}", kind, k - 1, alpha, d, theta, r, limits=Limits((-7.0, 4.0)))
            for k, (kind, alpha, d, theta, r) in enumerate(rows)
        )
    )  # fmt: skip


ROBOTS: dict[str, Callable[[], Robot]] = {
    "rx90": lambda: placed(rx90(0.52)),
    "tx40": lambda: load_robot("tx40"),
    "stanford": lambda: unlimited(STANFORD),
    "scara": lambda: SCARA,
    "puma": lambda: PUMA,
    "offset_shoulder": lambda: OFFSET_SHOULDER,
    "three_parallel": lambda: THREE_PARALLEL,
    "sliding": sliding_wrist,
    "three_general": lambda: random_chain(np.random.default_rng(2), 3),
    "one": lambda: random_chain(np.random.default_rng(0), 1),
}

Solve = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@cache
def geometric(name: str) -> Models:
    """The robot's models without those of dynamics, which have tests of their own."""
    robot = ROBOTS[name]()
    regressor = Regressor(robot)
    functions = (direct_geometry(robot, regressor), jacobian(robot, regressor))
    theta = regressor.parameters
    return Models(robot, regressor, theta, None, "as given", {}, functions, inverse(robot), left_out(robot))


def in_c(name: str, folder: Path) -> Solve:
    models = geometric(name)
    compiler = c_compiler()
    for file, text in c.c_files(models, (), pose_samples(models), "arm").items():
        (folder / file).write_text(text.partition("#ifdef SELF_TEST")[0], encoding="ascii")
    command = [compiler, *WARNINGS, "-shared", "-fPIC", "arm.c", "-o", "arm.so", "-lm"]
    built = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    function = ctypes.CDLL(str(folder / "arm.so")).arm_inverse_geometry
    assert models.inverse is not None
    most, n = models.inverse.most, models.robot.n

    def solve(pose: np.ndarray, current: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q, inside = np.full((most, n), np.nan), np.full(most, -1, dtype=np.int32)
        arrays = (np.ascontiguousarray(pose), np.ascontiguousarray(current), q, inside)
        count = function(*(x.ctypes.data_as(ctypes.c_void_p) for x in arrays))
        assert np.isnan(q[count:]).all()
        return q[:count], inside[:count].astype(bool)

    return solve


def in_python(name: str) -> Solve:
    models = geometric(name)
    ((file, text),) = python.python_files(models, (), pose_samples(models), "arm").items()
    space: dict = {"__name__": "generated"}
    exec(compile(text, file, "exec"), space)
    return space["inverse_geometry"]


def positions(robot: Robot, count: int, corners: bool) -> np.ndarray:
    """Random joint positions, or multiples of a right angle, where most arms are singular."""
    rng = np.random.default_rng(7)
    if not corners:
        return rng.uniform(-3, 3, (count, robot.n))
    q = rng.integers(-2, 3, (count, robot.n)) * math.pi / 2
    slides = [j for j, joint in enumerate(robot.joints) if not joint.revolute]
    q[:, slides] = rng.choice([0.0, 0.3], (count, len(slides)))
    return q


def right(robot: Robot, solve: Solve, count: int) -> None:
    """As many solutions as the package finds, the same ones, each of which reaches the pose."""
    q = positions(robot, count, corners=False)
    poses = geometry.direct_geometry(robot, q)
    known = inverse_geometries(robot, poses, q)
    for k, (pose, now) in enumerate(zip(poses, q, strict=True)):
        rows = known.pose == k
        found, inside = solve(pose, now)
        assert len(found) == rows.sum() > 0
        assert np.abs(geometry.direct_geometry(robot, found) - pose).max() < 1e-9
        for stored, flag in zip(known.q[rows], known.inside_limits[rows], strict=True):
            near = np.abs(differences(robot, found, stored)).max(axis=1)
            assert near.min() < 1e-7
            at = near.argmin()
            assert inside[at] == flag
            np.testing.assert_allclose(found[at], stored, rtol=0, atol=1e-7)


def singular(robot: Robot, solve: Solve, count: int) -> None:
    """At corners every solution is finite and reaches the pose, and the current position is one of them.

    Not always: where the elbow is straight, rounding of 1e-16 in the pose is 1e-8 in its angle, and an undetermined
    wrist behind it is not seen as such.
    """
    q = positions(robot, count, corners=True)
    again = []
    for now, pose in zip(q, geometry.direct_geometry(robot, q), strict=True):
        found, _ = solve(pose, now)
        assert len(found)
        assert np.abs(geometry.direct_geometry(robot, found) - pose).max() < 1e-9
        again.append(np.abs(differences(robot, found, now)).max(axis=1).min() < 1e-4)
    assert np.mean(again) > 0.9


@pytest.mark.parametrize("name", ROBOTS)
def test_c_finds_the_solutions_of_the_package(name: str, tmp_path: Path) -> None:
    robot, solve = geometric(name).robot, in_c(name, tmp_path)
    right(robot, solve, 200)
    singular(robot, solve, 200)
    assert len(solve(np.full((4, 4), np.nan), np.zeros(robot.n))[0]) == 0
    if robot.n > 1:
        far = geometry.direct_geometry(robot, np.zeros(robot.n))[0] + np.pad([[50.0]] * 3, ((0, 1), (3, 0)))
        slides = any(not joint.revolute for joint in robot.joints)
        assert slides or len(solve(far, np.zeros(robot.n))[0]) == 0
    sheared = geometry.direct_geometry(robot, np.zeros(robot.n))[0]
    sheared[0] *= 1.1
    assert len(solve(sheared, np.zeros(robot.n))[0]) == 0


@pytest.mark.parametrize("name", ROBOTS)
def test_python_finds_the_solutions_of_the_package(name: str) -> None:
    robot, solve = geometric(name).robot, in_python(name)
    right(robot, solve, 10)
    singular(robot, solve, 10)
    assert solve(np.full((4, 4), np.nan), np.zeros(robot.n))[0].shape == (0, robot.n)


def test_what_has_no_inverse_geometry_says_why() -> None:
    def why(robot: Robot) -> str:
        reason = left_out(robot)
        assert reason is not None
        assert inverse(robot) is None
        return reason

    assert "branch" in why(random_chain(np.random.default_rng(3), 4, tree=True))
    assert "7 joints" in why(random_chain(np.random.default_rng(2), 7))
    assert "no equation of a known type for q1" in why(random_chain(np.random.default_rng(0), 6))
    assert left_out(load_robot("rx90")) is None
