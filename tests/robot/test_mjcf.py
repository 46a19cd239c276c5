"""MuJoCo's model of a Robot against Pinocchio's, on random chains and trees."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from chains import random_chain
from oracle import inertia_matrix, inverse_dynamics

from identify.errors import RobotError
from identify.robot.mjcf import depth_first, to_mjcf
from identify.robot.robot import Drive, Joint, Limits, Link, Robot


def compiled(text: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(text)
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("seed", range(20))
def test_inertia_matrix_and_inverse_dynamics_equal_pinocchios(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, 2 + seed % 6, special=seed % 3 == 0, tree=seed % 2 == 1)
    model, data = compiled(to_mjcf(robot, friction=False, limits=False))
    q, dq, ddq = rng.uniform(-3, 3, (3, robot.n))
    order = list(depth_first(robot))
    data.qpos[:], data.qvel[:], data.qacc[:] = q[order], dq[order], ddq[order]
    mujoco.mj_inverse(model, data)
    matrix = np.empty((robot.n, robot.n))
    mujoco.mj_fullM(model, data, matrix)
    expected = inertia_matrix(robot, q)
    assert np.abs(matrix - expected[np.ix_(order, order)]).max() <= 1e-10 * np.abs(expected).max()
    effort = inverse_dynamics(robot, q[None], dq[None], ddq[None])[0]
    assert np.abs(data.qfrc_inverse - effort[order]).max() <= 1e-10 * np.abs(effort).max()


def test_inertias_come_back_as_they_went_in() -> None:
    robot = random_chain(np.random.default_rng(3), 4)
    model, _ = compiled(to_mjcf(robot))
    for body, joint in enumerate(robot.joints, start=1):
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[body])
        axes = turn.reshape(3, 3)
        about_com = axes @ np.diag(model.body_inertia[body]) @ axes.T
        assert np.allclose(about_com[np.triu_indices(3)], joint.link.inertia, rtol=0, atol=1e-14)
        assert np.allclose(model.body_ipos[body], joint.link.com, rtol=0, atol=1e-14)
        assert model.body_mass[body] == joint.link.mass


def test_given_standard_parameters_replace_the_robots_own() -> None:
    rng = np.random.default_rng(4)
    robot, other = random_chain(rng, 3), random_chain(rng, 3)
    pairs = zip(robot.joints, other.joints, strict=True)
    mixed = replace(robot, joints=tuple(replace(own, link=new.link, drive=new.drive) for own, new in pairs))
    model, data = compiled(to_mjcf(robot, other.standard, friction=False, limits=False))
    q, dq, ddq = rng.uniform(-2, 2, (3, 3))
    data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
    mujoco.mj_inverse(model, data)
    assert np.allclose(data.qfrc_inverse, inverse_dynamics(mixed, q[None], dq[None], ddq[None])[0], rtol=1e-10)


def test_drive_friction_stops_and_controller_are_the_robots() -> None:
    robot = random_chain(np.random.default_rng(5), 3)
    robot = replace(robot, joints=(replace(robot.joints[0], limits=Limits((-1.0, float("inf")))), *robot.joints[1:]))
    stiffness, damping = np.array([100.0, 70.0, 30.0]), np.array([9.0, 5.0, 2.0])
    model, data = compiled(to_mjcf(robot, position_gain=stiffness, velocity_gain=damping))
    drives = [joint.drive for joint in robot.joints]
    assert model.dof_armature.tolist() == [drive.inertia for drive in drives]
    assert model.dof_damping.tolist() == [drive.viscous for drive in drives]
    assert model.dof_frictionloss.tolist() == [drive.coulomb for drive in drives]
    assert model.jnt_range[0, 0] == -1.0
    assert model.jnt_range[0, 1] > 1e6
    assert model.jnt_range[1].tolist() == [-2.0, 2.0]
    assert model.opt.timestep == 0.0005
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER
    rng = np.random.default_rng(6)
    data.qpos[:], data.qvel[:], data.ctrl[:] = rng.uniform(-1, 1, (3, 3))
    mujoco.mj_forward(model, data)
    offset = np.array([drive.offset for drive in drives])
    expected = data.ctrl - offset - stiffness * data.qpos - damping * data.qvel
    assert np.allclose(data.actuator_force, expected, rtol=1e-14)
    free, _ = compiled(to_mjcf(robot, friction=False, limits=False))
    assert not free.dof_damping.any()
    assert not free.dof_frictionloss.any()
    assert not free.jnt_limited.any()
    assert free.nu == 0


def test_depth_first_is_the_order_mujoco_chooses() -> None:
    rng = np.random.default_rng(7)
    joints = [replace(random_chain(rng, 1).joints[0], name=f"axis {j}") for j in range(6)]
    parents = (-1, 0, 0, 1, 2, -1)
    robot = Robot("tree", tuple(replace(joint, parent=p) for joint, p in zip(joints, parents, strict=True)))
    model, _ = compiled(to_mjcf(robot, position_gain=np.ones(6)))
    order = depth_first(robot)
    assert order != tuple(range(6))
    assert [model.joint(j).name for j in range(6)] == [f"axis {j}" for j in order]
    assert [model.actuator(j).name for j in range(6)] == [f"axis {j}" for j in order]
    assert depth_first(random_chain(rng, 5)) == (0, 1, 2, 3, 4)


def test_flat_links_are_held_though_rounding_breaks_the_triangle() -> None:
    # A + B = C exactly, turned at random: about half of them break A + B >= C in the last digit
    for seed in range(40):
        rng = np.random.default_rng(seed)
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        a, b = rng.uniform(1e-4, 1.0, 2)
        inertia = turn @ np.diag([a, b, a + b]) @ turn.T
        link = Link(1.0, tuple(rng.normal(size=3)), tuple(inertia[np.triu_indices(3)]))
        model, _ = compiled(to_mjcf(Robot("plate", (Joint("axis", link=link),))))
        assert np.allclose(np.sort(model.body_inertia[1]), np.sort([a, b, a + b]), rtol=1e-11)


GOOD = Link(2.0, (0.1, 0.0, 0.2), (0.02, 0.001, 0.0, 0.03, 0.0, 0.025))


@pytest.mark.parametrize(
    ("joint", "words"),
    [
        (Joint("elbow"), ("elbow", "mass 0")),
        (Joint("elbow", link=Link(1.0, (0.1, 0.0, 0.0))), ("elbow", "principal moment")),
        (Joint("elbow", link=replace(GOOD, inertia=(0.01, 0, 0, 0.01, 0, 0.05))), ("elbow", "A + B >= C")),
        (Joint("elbow", link=replace(GOOD, mass=float("nan"))), ("elbow", "not a number")),
        (Joint("elbow", link=GOOD, drive=Drive(inertia=-0.1)), ("elbow", "actuator inertia")),
        (Joint("elbow", link=GOOD, drive=Drive(coulomb=-0.1)), ("elbow", "negative friction")),
    ],
)
def test_what_mujoco_cannot_hold_is_refused_by_name(joint: Joint, words: tuple[str, ...]) -> None:
    with pytest.raises(RobotError) as caught:
        to_mjcf(Robot("arm", (Joint("shoulder", link=GOOD), replace(joint, parent=0))))
    assert all(word in str(caught.value) for word in words)
    assert "\n" not in str(caught.value)


def test_standard_parameters_of_another_robot_are_refused() -> None:
    with pytest.raises(RobotError, match="standard parameters"):
        to_mjcf(Robot("arm", (Joint("axis", link=GOOD),)), np.ones(22))


def test_names_are_escaped() -> None:
    text = to_mjcf(Robot('R&D "<arm>"', (Joint('a<b & "c"', link=GOOD),)))
    assert ElementTree.fromstring(text).get("model") == 'R&D "<arm>"'
    model, _ = compiled(text)
    assert model.joint(0).name == 'a<b & "c"'
