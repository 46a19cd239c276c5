"""Jacobian of the tool and in three matrices, orientations as formulas: against the numeric functions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from arms import PUMA, SCARA, STANFORD
from chains import random_chain
from printed_models import printed

from identify.robot.library import load_robot
from identify.robot.robot import Robot
from identify.robot.transforms import from_roll_pitch_yaw, to_matrix
from identify.symbolic import orientation
from identify.symbolic.geometry import direct_geometry
from identify.symbolic.jacobian import jacobian, tool_jacobian
from identify.symbolic.models import symbolic_model

TOOL = to_matrix(from_roll_pitch_yaw((0.1, -0.2, 0.3), (0.4, 0.5, -0.6)))
ARMS = [
    replace(robot, tool=TOOL)
    for robot in (load_robot("rx90"), SCARA, STANFORD, random_chain(np.random.default_rng(8), 3))
]
BACK = {
    "euler": orientation.from_euler,
    "roll-pitch-yaw": orientation.from_roll_pitch_yaw,
    "quaternion": orientation.from_quaternion,
}


def numbers(model, q: np.ndarray) -> np.ndarray:
    return np.array([float(x) for x in printed(model)(q=q).values()])


@pytest.mark.parametrize("robot", ARMS, ids=lambda r: r.name)
def test_jacobian_of_the_tool(robot: Robot) -> None:
    q = np.random.default_rng(1).uniform(-1, 1, robot.n)
    turn = direct_geometry(robot, q)[0, :3, :3]
    expected = np.kron(np.eye(2), turn.T) @ tool_jacobian(robot, q)[0]
    found = numbers(symbolic_model(robot, "jacobian", frame="tool"), q).reshape(6, robot.n)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("robot", ARMS, ids=lambda r: r.name)
def test_three_matrices_multiply_to_the_jacobian(robot: Robot) -> None:
    q = np.random.default_rng(2).uniform(-1, 1, robot.n)
    for frame in (None, 0, robot.n):
        parts = printed(symbolic_model(robot, "jacobian", frame=frame, decomposed=True))(q=q)
        shift = np.eye(6)
        shift[:3, 3:] = -np.cross(np.eye(3), parts["lever"], axisb=0, axisa=0).T
        shift[:3, 3:] = np.array([np.cross(e, parts["lever"]) for e in np.eye(3)]).T
        found = np.kron(np.eye(2), parts["turn"]) @ shift @ parts["J"]
        np.testing.assert_allclose(found, jacobian(robot, q, frame or 0)[0], rtol=0, atol=1e-12)


def test_a_spherical_wrist_has_its_simple_matrix() -> None:
    """RX-90: at the centre of the wrist the upper right block is zero, as [2.36] says."""
    model = symbolic_model(load_robot("rx90"), "jacobian", decomposed=True)
    assert all(model.expressions[f"J{i}{k}"] == 0 for i in (1, 2, 3) for k in (4, 5, 6))


@pytest.mark.parametrize("kind", BACK)
@pytest.mark.parametrize("robot", [*ARMS, SCARA, PUMA], ids=lambda r: r.name)
def test_orientations_are_those_of_the_pose(robot: Robot, kind: str) -> None:
    """Arbitrary positions, and those of right angles, where only the sum of two angles may be determined."""
    model = symbolic_model(robot, "direct-geometry", orientation=kind)
    rng = np.random.default_rng(3)
    q = np.vstack([rng.uniform(-3, 3, (6, robot.n)), rng.integers(-2, 3, (6, robot.n)) * np.pi / 2])
    found = np.array([numbers(model, row) for row in q])
    pose = direct_geometry(robot, q)
    np.testing.assert_allclose(found[:, :3], pose[:, :3, 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(BACK[kind](found[:, 3:]), pose[:, :3, :3], rtol=0, atol=1e-12)
    assert [r.name for r in model.results][:3] == ["Px", "Py", "Pz"]
    if kind == "quaternion":
        np.testing.assert_allclose(np.linalg.norm(found[:, 3:], axis=1), 1, rtol=0, atol=1e-12)
