"""Pinocchio and MuJoCo agree with each other, with the regressor and with a torque computed elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio
import pytest
from beside import stored_values
from chains import random_chain

from identify.robot.library import load_robot
from identify.robot.robot import Joint, Link, Robot
from identify.robot.transforms import link_frames
from identify.validation.engines import mujoco_torque, pinocchio_model, pinocchio_regressor, pinocchio_torque

AGREE = 1e-10


def states(rng: np.random.Generator, n: int, count: int = 20) -> np.ndarray:
    return rng.uniform(-2, 2, (3, count, n))


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of two torques (N, n), relative to each joint's largest torque."""
    return float((np.abs(a - b).max(axis=0) / np.abs(a).max(axis=0)).max())


@pytest.mark.parametrize("tree", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_engines_and_regressor_agree(seed: int, tree: bool) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, int(rng.integers(2, 8)), special=seed % 2 == 0, tree=tree)
    robot = replace(robot, gravity=(1.5, -2.5, 9.0))
    q, dq, ddq = states(rng, robot.n)
    torque = pinocchio_torque(robot, robot.standard, q, dq, ddq)
    assert difference(torque, mujoco_torque(robot, robot.standard, q, dq, ddq)) <= AGREE
    assert difference(torque, pinocchio_regressor(robot, q, dq, ddq) @ robot.standard) <= AGREE


def test_rx90_on_a_thousand_samples() -> None:
    robot = load_robot("rx90")
    q, dq, ddq = states(np.random.default_rng(0), 6, 1000)
    torque = pinocchio_torque(robot, robot.standard, q, dq, ddq)
    assert difference(torque, mujoco_torque(robot, robot.standard, q, dq, ddq)) <= AGREE
    assert difference(torque, pinocchio_regressor(robot, q, dq, ddq) @ robot.standard) <= AGREE


def test_rx90_torque_of_two_symbolic_tools() -> None:
    """The oracle's torque comes from the chapter's printed formulas and two symbolic programs."""
    oracle = stored_values("rx90-dynamics.json")
    rx90 = load_robot("rx90")
    joints = list(rx90.joints)
    joints[2], joints[3] = replace(joints[2], d=oracle["D3"]), replace(joints[3], r=oracle["RL4"])
    robot = replace(rx90, joints=tuple(joints), gravity=tuple(oracle["gravity_0g"]))
    order = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M", "IA")
    standard = np.array([link[key] for link in oracle["std_params"] for key in order])
    sample = [np.array(oracle[key]) for key in ("q", "qd", "qdd")]
    for torque in (
        pinocchio_torque(robot, standard, *sample),
        mujoco_torque(robot, standard, *sample),
        pinocchio_regressor(robot, *sample) @ standard,
    ):
        np.testing.assert_allclose(torque[0], oracle["tau_rigid_with_IA"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_any_linear_combination_of_parameters_has_a_torque(seed: int) -> None:
    """Negative, zero and next to zero masses with first moments on them: torque stays linear in the parameters."""
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, 5, tree=seed % 2 == 1)
    standard = rng.normal(size=55)
    standard[9], standard[20], standard[31] = 0.0, -1.3, 1e-11
    standard[39:43] = 0.0
    q, dq, ddq = states(rng, 5)
    expected = pinocchio_regressor(robot, q, dq, ddq) @ standard
    assert difference(expected, pinocchio_torque(robot, standard, q, dq, ddq)) <= 1e-11
    with pytest.raises(ValueError, match=r"link of joint_1: first moments without mass"):
        pinocchio_model(robot, standard)


def test_link_parameters_are_those_of_two_point_masses() -> None:
    """Torque of a pendulum of point masses, from Newton's law: Link.standard is about O_j, in the axes of R_j."""
    places, masses = np.array([[0.3, 0.1, 0.2], [-0.1, 0.25, -0.4]]), np.array([1.5, 0.7])
    com = masses @ places / masses.sum()
    arms = places - com
    inertia = sum(m * (a @ a * np.eye(3) - np.outer(a, a)) for m, a in zip(masses, arms, strict=True))
    link = Link(float(masses.sum()), tuple(com), tuple(inertia[np.triu_indices(3)]))
    robot = Robot("pendulum", (Joint("j", alpha=0.7, d=0.2, theta=0.4, r=0.1, link=link),), gravity=(1.0, -2.0, -9.0))
    q, dq, ddq = np.array([0.6]), np.array([1.1]), np.array([-0.8])
    frame = link_frames(robot, q)[0]
    rotation, axis = frame[:3, :3], frame[:3, 2]
    expected = 0.0
    for mass, place in zip(masses, places, strict=True):
        arm = rotation @ place
        acceleration = ddq[0] * np.cross(axis, arm) + dq[0] ** 2 * np.cross(axis, np.cross(axis, arm))
        expected += axis @ np.cross(arm, mass * (acceleration - np.array(robot.gravity)))
    torque = pinocchio_torque(robot, robot.standard, q, dq, ddq)[0, 0]
    assert torque == pytest.approx(expected, rel=1e-13)


def test_pinocchio_model_stands_in_r0_and_keeps_the_joints() -> None:
    rng = np.random.default_rng(2)
    robot = random_chain(rng, 5, tree=True)
    model = pinocchio_model(robot, robot.standard)
    data = model.createData()
    q = rng.uniform(-2, 2, 5)
    pinocchio.forwardKinematics(model, data, q)
    assert tuple(model.names)[1:] == robot.joint_names
    for j, frame in enumerate(link_frames(robot, q)):
        np.testing.assert_allclose(data.oMi[j + 1].homogeneous, frame, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(model.armature, [joint.drive.inertia for joint in robot.joints])


def test_mujoco_ignores_limits_and_friction() -> None:
    robot = load_robot("rx90")
    q = np.full((1, 6), 20.0)  # far beyond every limit
    dq, ddq = np.full((2, 1, 6), 0.3)
    torque = pinocchio_torque(robot, robot.standard, q, dq, ddq)
    assert difference(torque, mujoco_torque(robot, robot.standard, q, dq, ddq)) <= AGREE


def test_mujoco_names_the_impossible_link() -> None:
    robot = load_robot("rx90")
    sample = np.zeros((3, 1, 6))
    light = robot.standard.copy()
    light[11 * 3 + 9] = 0.0
    with pytest.raises(ValueError, match="joint_4"):
        mujoco_torque(robot, light, *sample)
    flat = robot.standard.copy()
    flat[11 * 2 + 5] += 1.0
    with pytest.raises(ValueError, match="joint_3"):
        mujoco_torque(robot, flat, *sample)
    unknown = load_robot("tx40")
    with pytest.raises(ValueError, match="joint_1"):
        mujoco_torque(unknown, unknown.standard, *sample)


def test_wrong_shapes_are_named() -> None:
    robot = load_robot("rx90")
    good = np.zeros((4, 6))
    with pytest.raises(ValueError, match=r"\(65,\) standard parameters given, \(66,\) needed"):
        pinocchio_torque(robot, robot.standard[:-1], good, good, good)
    with pytest.raises(ValueError, match=r"\(N, 6\) needed"):
        pinocchio_torque(robot, robot.standard, good, good, good[:, :5])
    with pytest.raises(ValueError, match=r"\(N, 6\) needed"):
        mujoco_torque(robot, robot.standard, good, good[:3], good)
