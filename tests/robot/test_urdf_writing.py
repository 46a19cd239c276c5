"""A robot written as URDF moves alike in Pinocchio, in MuJoCo and when this package reads it back."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import oracle
import pinocchio
import pytest
from chains import random_chain

from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.mjcf import depth_first
from identify.robot.robot import INFINITY, Drive, Limits, Link, Robot
from identify.robot.transforms import from_roll_pitch_yaw, link_frames, to_matrix
from identify.robot.urdf import read_urdf
from identify.robot.urdf_writing import FAR, lost_in_urdf, to_urdf

AGREE = 1e-10


def placed(robot: Robot, seed: int) -> Robot:
    """The robot on a base that is turned about the vertical and lifted, with a tool."""
    rng = np.random.default_rng(seed)
    base = from_roll_pitch_yaw(rng.uniform(-1, 1, 3), (0.0, 0.0, float(rng.uniform(-3, 3))))
    tool = from_roll_pitch_yaw(rng.uniform(-1, 1, 3), tuple(rng.uniform(-1, 1, 3)))
    return replace(robot, base=to_matrix(base), tool=to_matrix(tool))


def robots() -> list[Robot]:
    """Chains and trees of both kinds of joint, all under 9.81 m/s² along some axis of R_0."""
    plain = [load_robot("rx90"), replace(random_chain(np.random.default_rng(1), 3), gravity=(0.0, 0.0, -9.81))]
    sideways = replace(random_chain(np.random.default_rng(11), 5, special=True), gravity=(0.0, -9.81, 0.0))
    tilted = replace(random_chain(np.random.default_rng(2), 3), gravity=(9.81 * 0.6, 0.0, 9.81 * 0.8))
    tree = random_chain(np.random.default_rng(12), 5, tree=True)
    return [*plain, sideways, tilted, tree, placed(plain[0], 3), placed(tree, 4)]


def states(robot: Robot, count: int = 20) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    q, dq, ddq = np.random.default_rng(7).uniform(-2, 2, (3, count, robot.n))
    return q, dq, ddq


def rigid(robot: Robot) -> Robot:
    """The robot without what URDF has no place for."""
    drives = [replace(joint.drive, inertia=0.0, offset=0.0) for joint in robot.joints]
    joints = [replace(joint, drive=drive) for joint, drive in zip(robot.joints, drives, strict=True)]
    return replace(robot, joints=tuple(joints))


@pytest.mark.parametrize("number", range(7))
def test_pinocchio_and_mujoco_move_alike(number: int) -> None:
    robot = rigid(robots()[number])
    text = to_urdf(robot)
    q, dq, ddq = states(robot)
    expected = oracle.inverse_dynamics(robot, q, dq, ddq)
    scale = np.abs(expected).max()

    model = pinocchio.buildModelFromXML(text)
    order = [model.names[k + 1] for k in range(model.njoints - 1)]
    assert sorted(order) == sorted(robot.joint_names)
    columns = [robot.joint_names.index(name) for name in order]
    data = model.createData()
    for k in range(len(q)):
        torque = pinocchio.rnea(model, data, q[k, columns], dq[k, columns], ddq[k, columns])
        np.testing.assert_allclose(torque, expected[k, columns], rtol=0, atol=AGREE * scale)

    theirs = mujoco.MjModel.from_xml_string(text)
    assert theirs.opt.gravity.tolist() == [0.0, 0.0, -9.81]
    flags = mujoco.mjtDisableBit
    theirs.opt.disableflags |= flags.mjDSBL_LIMIT | flags.mjDSBL_CONTACT | flags.mjDSBL_FRICTIONLOSS
    theirs.dof_damping[:] = 0.0
    state = mujoco.MjData(theirs)
    columns = list(depth_first(robot))
    for k in range(len(q)):
        state.qpos[:], state.qvel[:], state.qacc[:] = q[k, columns], dq[k, columns], ddq[k, columns]
        mujoco.mj_inverse(theirs, state)
        np.testing.assert_allclose(state.qfrc_inverse, expected[k, columns], rtol=0, atol=AGREE * scale)


@pytest.mark.parametrize("number", range(7))
def test_it_reads_back_with_the_same_names_tree_limits_and_motion(number: int) -> None:
    robot = rigid(robots()[number])
    again = read_urdf(to_urdf(robot))
    order = [again.joint_names.index(name) for name in robot.joint_names]
    assert sorted(again.joint_names) == sorted(robot.joint_names)
    assert again.name == robot.name

    def parents(of: Robot) -> dict[str, str]:
        return {joint.name: of.joint_names[joint.parent] if joint.parent >= 0 else "" for joint in of.joints}

    assert parents(again) == parents(robot)
    for k, joint in zip(order, robot.joints, strict=True):
        assert again.joints[k].limits == joint.limits
        assert again.joints[k].type == joint.type
        assert (again.joints[k].drive.viscous, again.joints[k].drive.coulomb) == (
            joint.drive.viscous,
            joint.drive.coulomb,
        )
    q, dq, ddq = states(robot)
    expected = oracle.inverse_dynamics(robot, q, dq, ddq)
    mixed = np.empty((3, *q.shape))
    mixed[:, :, order] = [q, dq, ddq]
    torque = oracle.inverse_dynamics(again, *mixed)[:, order]
    np.testing.assert_allclose(torque, expected, rtol=0, atol=AGREE * np.abs(expected).max())


@pytest.mark.parametrize("number", [0, 1, 5])
def test_the_tool_stays_where_it_is_in_the_world(number: int) -> None:
    """A serial chain under gravity straight down keeps its base: the pose of the tool is the same."""
    robot = robots()[number]
    again = read_urdf(to_urdf(robot))

    def tool(of: Robot, q: np.ndarray) -> np.ndarray:
        return np.array(of.base) @ link_frames(of, q)[-1] @ np.array(of.tool)

    for q in states(robot, 5)[0]:
        np.testing.assert_allclose(tool(again, q), tool(robot, q), rtol=0, atol=1e-12)


def test_the_frames_of_a_read_urdf_come_back_so_that_its_parameters_do() -> None:
    """What was read from a URDF is written to one that reads back to the same frames and base parameters."""
    for seed in range(4):
        read = read_urdf(to_urdf(rigid(random_chain(np.random.default_rng(seed), 4))))
        again = read_urdf(to_urdf(read))
        for one, other in zip(read.joints, again.joints, strict=True):
            for key in ("alpha", "d", "theta", "r", "gamma", "b"):
                assert getattr(other, key) == pytest.approx(getattr(one, key), abs=1e-9)
        first, second = Regressor(read), Regressor(again)
        assert first.names == second.names
        np.testing.assert_allclose(second.parameters, first.parameters, rtol=0, atol=1e-9)


def test_limits_that_are_not_given_are_far_and_joints_without_any_continuous() -> None:
    robot = random_chain(np.random.default_rng(3), 4)
    kinds = [
        ("revolute", Limits()),
        ("revolute", Limits((-1.0, INFINITY), 2.0)),
        ("prismatic", Limits()),
        ("revolute", Limits(effort=7.0)),
    ]
    joints = [replace(j, type=kind, limits=limits) for j, (kind, limits) in zip(robot.joints, kinds, strict=True)]
    text = to_urdf(rigid(replace(robot, joints=tuple(joints))))
    assert [text.count(f'type="{kind}"') for kind in ("continuous", "revolute", "prismatic")] == [2, 1, 1]
    model = pinocchio.buildModelFromXML(text)
    assert model.nv == 4
    theirs = mujoco.MjModel.from_xml_string(text)
    assert theirs.jnt_range[1].tolist() == [-1.0, FAR]
    again = read_urdf(text)
    assert again.joints[0].limits.position == (-INFINITY, INFINITY)
    assert again.joints[3].limits.effort == 7.0


def test_what_urdf_has_no_place_for_is_told() -> None:
    robot = rigid(load_robot("rx90"))
    assert lost_in_urdf(robot) == ()
    assert lost_in_urdf(placed(robot, 1)) == ()
    drive = Drive(inertia=0.5, offset=0.1)
    armed = replace(robot, joints=(replace(robot.joints[0], drive=drive), *robot.joints[1:]))
    told = lost_in_urdf(armed)
    assert [line.split(":")[0] for line in told] == ["actuator inertias", "constant friction offsets"]
    assert 'armature="0.5" offset="0.1"' in to_urdf(armed)
    assert "gravity of 1.62 m/s²" in lost_in_urdf(replace(robot, gravity=(0.0, 0.0, -1.62)))[0]
    assert "the root link is turned" in lost_in_urdf(replace(robot, gravity=(0.0, -9.81, 0.0)))[0]
    assert len(lost_in_urdf(replace(robot, gravity=(0.0, 0.0, 0.0)))) == 1


def test_links_get_names_of_their_own_and_none_without_mass_an_inertia() -> None:
    robot = random_chain(np.random.default_rng(1), 3)
    joints = [replace(j, name=name) for j, name in zip(robot.joints, ("base", "base_link", "tool"), strict=True)]
    joints[1] = replace(joints[1], link=Link())
    text = to_urdf(placed(replace(robot, joints=tuple(joints)), 1))
    names = [part.split('"')[1] for part in text.split("<link name=")[1:]]
    assert len(set(names)) == len(names) == 5
    assert text.count("<inertial>") == 2
    assert read_urdf(text).joint_names == ("base", "base_link", "tool")
