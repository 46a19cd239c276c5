"""Capsules of links: distances against MuJoCo's on frames by Pinocchio, derivatives, and what counts as apart."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from arms import OFFSET_SHOULDER, PUMA, SCARA, STANFORD
from capsules import ends, engine_gaps
from chains import random_chain
from numpy.testing import assert_allclose

from identify import load_robot
from identify.experiment.clearance import Clearance
from identify.experiment.limits import working_limits
from identify.robot.robot import Robot
from identify.robot.transforms import from_roll_pitch_yaw, to_matrix


def dressed(robot: Robot) -> Robot:
    """The arm on a tilted base, with a tool, a floor, and links of different radii."""
    joints = tuple(replace(joint, radius=0.02 + 0.01 * j) for j, joint in enumerate(robot.joints))
    base = to_matrix(from_roll_pitch_yaw([0.1, -0.2, 0.3], [0.2, -0.1, 0.7]))
    tool = to_matrix(from_roll_pitch_yaw([0.03, 0.05, 0.17], [0.0, 0.0, 0.0]))
    return replace(robot, joints=joints, base=base, tool=tool, floor=-0.15)


def poses(robot: Robot, count: int, seed: int = 0) -> np.ndarray:
    limits = working_limits(robot)
    return np.random.default_rng(seed).uniform(limits.low, limits.high, (count, robot.n))


def revolute_chain() -> Robot:
    robot = random_chain(np.random.default_rng(3), 5)
    return replace(robot, joints=tuple(replace(joint, type="revolute") for joint in robot.joints))


@pytest.mark.parametrize(
    "robot",
    [load_robot("rx90"), dressed(revolute_chain()), dressed(STANFORD), SCARA, dressed(PUMA), OFFSET_SHOULDER],
    ids=lambda robot: robot.name,
)
def test_distances_are_mujocos_on_frames_by_pinocchio(robot: Robot) -> None:
    clearance = Clearance.of(robot)
    assert clearance is not None
    q = poses(robot, 12)
    found = clearance.gaps(q.T)
    expected = np.array([list(engine_gaps(clearance, pose)) for pose in q]).T
    assert len(found) == clearance.rows == len(clearance.names) > 0
    assert_allclose(found, expected, atol=2e-6)


def test_height_of_a_capsule_is_mujocos() -> None:
    """A capsule's distance from a plane is that of its lower end: of two links of one radius, as here, the rows of
    their two points are the capsules' distances."""
    robot = load_robot("rx90")
    clearance = Clearance.of(robot)
    assert clearance is not None
    q = poses(robot, 12, seed=1)
    found = clearance.gaps(q.T)[len(clearance.pairs) :]
    for pose, heights in zip(q, found.T, strict=True):
        points = ends(robot, pose, clearance.foot, clearance.tip)[list(clearance.points)]
        for s in range(1, len(clearance.radius)):
            fromto = " ".join(map(str, (*points[s], *points[s + 1])))
            model = mujoco.MjModel.from_xml_string(
                f'<mujoco><worldbody><geom type="capsule" size="{clearance.radius[s]}" fromto="{fromto}"/>'
                '<geom type="plane" size="9 9 1" pos="0 0 -0.42"/></worldbody></mujoco>'
            )
            data = mujoco.MjData(model)
            mujoco.mj_kinematics(model, data)
            # the shoulder never moves, and has no row
            fixed = points[1, 2] + 0.42 - clearance.radius[1]
            lower = min(fixed if s == 1 else heights[s - 2], heights[s - 1])
            if lower > 0:
                assert mujoco.mj_geomDistance(model, data, 0, 1, 10.0, None) == pytest.approx(lower, abs=1e-6)


@pytest.mark.parametrize(
    "robot", [dressed(revolute_chain()), dressed(STANFORD), load_robot("rx90")], ids=lambda r: r.name
)
def test_what_is_pulled_back_is_the_derivative(robot: Robot) -> None:
    clearance = Clearance.of(robot)
    assert clearance is not None
    assert clearance.pairs
    assert clearance.over
    q = poses(robot, 40).T
    rng = np.random.default_rng(1)
    adjoint, along = rng.standard_normal((clearance.rows, 40)), rng.standard_normal(q.shape)
    pulled = np.sum(clearance.along(q)[1](adjoint) * along, axis=0)

    def slope(h: float) -> np.ndarray:
        ahead, behind = (np.sum(adjoint * clearance.gaps(q + side * h * along), axis=0) for side in (1, -1))
        return (ahead - behind) / (2 * h)

    assert_allclose(pulled, (4 * slope(1e-5) - slope(2e-5)) / 3, rtol=1e-6, atol=1e-6)


def test_the_rx90_is_four_capsules_of_which_neighbours_may_touch() -> None:
    clearance = Clearance.of(load_robot("rx90"))
    assert clearance is not None
    assert clearance.names == (
        "joint_3's link and the base",
        "joint_6's link and the base",
        "joint_6's link and joint_2's link",
        "joint_2's link and the floor",
        "joint_3's link and the floor",
        "joint_6's link and the floor",
    )
    assert clearance.floor == -0.42
    assert_allclose(clearance.foot, [0.0, 0.0, -0.42])
    # No tool is described: as far beyond the centre of mass (0.021, −0.013, 0.112) as this is from O_6.
    assert_allclose(clearance.tip, [0.042, -0.026, 0.224])
    reach = 0.45 + 0.45 + np.linalg.norm([0.042, -0.026, 0.224])
    assert clearance.reach == pytest.approx(reach)
    assert_allclose(clearance.radius, 0.08 * reach)


def test_a_floor_is_what_the_file_says_or_the_worlds_plane_under_an_arm_that_stands_above_it() -> None:
    standing, lying = SCARA, replace(load_robot("rx90"), floor=None)
    above = Clearance.of(standing)
    assert above is not None
    assert above.floor == 0.0
    unknown = Clearance.of(lying)
    assert unknown is not None
    assert unknown.floor is None
    assert unknown.over == ()
    # nor is there a column under the shoulder
    assert unknown.names == ("joint_6's link and joint_2's link",)
    raised = Clearance.of(replace(lying, base=to_matrix(from_roll_pitch_yaw([0.0, 0.0, 0.42], [0.0, 0.0, 0.0]))))
    assert raised is not None
    assert raised.floor == 0.0
    q = poses(lying, 10).T
    described = Clearance.of(load_robot("rx90"))
    assert described is not None
    assert_allclose(raised.gaps(q), described.gaps(q), atol=1e-12)


def test_arms_without_shape_or_with_branches_have_no_capsules() -> None:
    assert Clearance.of(random_chain(np.random.default_rng(8), 5, tree=True)) is None
    joint = load_robot("rx90").joints[0]
    alone = Robot("one joint", (replace(joint, link=type(joint.link)()),))
    assert Clearance.of(alone) is None


def test_links_that_touch_in_most_poses_count_as_built_so() -> None:
    """Short links of large radius overlap with those after the next whatever the arm does."""
    robot = load_robot("rx90")
    thick = tuple(replace(joint, radius=0.4) for joint in robot.joints)
    clearance = Clearance.of(replace(robot, joints=thick, floor=None))
    assert clearance is None or (1, 3) not in clearance.pairs
