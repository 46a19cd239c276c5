"""A part of a robot moves like the whole one whose other joints are held: torque by Pinocchio, place by the frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio
import pytest
from chains import random_chain

from identify.errors import RobotError
from identify.robot.library import load_robot
from identify.robot.robot import Drive, Joint, Robot, Transmission
from identify.robot.selection import Selection, parse_selection, sub_chain
from identify.robot.toml import read_toml, write_toml
from identify.robot.transforms import from_roll_pitch_yaw, link_frames, to_matrix
from identify.robot.urdf import read_urdf
from identify.validation.engines import pinocchio_torque

HAND = """<robot name="hand">
  <link name="ground"/><link name="arm"><inertial><mass value="2"/><origin xyz="0.2 0.1 0"/>
    <inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.025"/></inertial></link>
  {fingers}
  <joint name="swing" type="revolute"><parent link="ground"/><child link="arm"/><axis xyz="0 1 0.5"/>
    <limit lower="-2" upper="2" effort="9" velocity="9"/></joint>
</robot>"""
FINGER = """<link name="{name}"><inertial><mass value="0.7"/><origin xyz="0.02 0 0.05"/>
  <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.0025"/></inertial></link>
  <joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}"/>
  <origin xyz="0.4 0 0.1" rpy="0.3 0 1"/><limit lower="-2" upper="2" effort="9" velocity="9"/>
  <axis xyz="1 2 0"/>{more}</joint>"""


def hand(*fingers: tuple[str, str, str, str]) -> str:
    """A URDF of one joint, "swing", that carries fingers (name, type, parent link, more of the joint)."""
    keys = ("name", "kind", "parent", "more")
    return HAND.format(fingers="".join(FINGER.format(**dict(zip(keys, finger, strict=True))) for finger in fingers))


def reference(text: str, positions: dict[str, float], state: np.ndarray) -> float:
    """Torque of "swing" at its state (q, dq, ddq) by Pinocchio's reading of the file, the other joints at rest."""
    model = pinocchio.buildModelFromXML(text)
    q, dq, ddq = np.zeros(model.nq), np.zeros(model.nv), np.zeros(model.nv)
    for name, position in positions.items():
        q[model.joints[model.getJointId(name)].idx_q] = position
    at = model.joints[model.getJointId("swing")].idx_q
    q[at], dq[at], ddq[at] = state
    return float(pinocchio.rnea(model, model.createData(), q, dq, ddq)[at])


def check_hand(text: str, held: dict[str, float], joints: str = "") -> Robot:
    robot = read_urdf(text, "hand.urdf", parse_selection(joints) if joints else None)
    assert robot.joint_names == ("swing",)
    state = np.array([0.7, -1.1, 0.4])
    expected = reference(text, held, state)
    found = pinocchio_torque(robot, robot.standard, *state[:, None, None])[0, 0]
    assert found == pytest.approx(expected, rel=1e-12)
    for name, position in held.items():
        assert f"{name!r} at {position:g}" in robot.note
    return robot


def test_a_gripper_that_mimics_is_held() -> None:
    left = ("left", "prismatic", "arm", "")
    right = ("right", "revolute", "arm", '<mimic joint="left" multiplier="-2" offset="0.3"/>')
    third = ("third", "revolute", "right", '<mimic joint="right" offset="0.1"/>')
    robot = check_hand(hand(left, right, third), {"left": 0.0, "right": 0.3, "third": 0.4})
    assert "'right' mimics 'left', 'third' mimics 'right'" in robot.note
    check_hand(hand(third, right, left), {"left": 0.04, "right": 0.22, "third": 0.32}, "left=0.04")
    check_hand(hand(third, right, left), {"left": 0.0, "right": 0.3, "third": 0.4}, "swing")
    for joints, message in {
        "swing,right": "'right' can't be kept: 'right' mimics 'left'",
        "left": "'left' can't be kept: 'right' mimics 'left'",
        "right=1": "'right' follows 'left'; give the position of that one",
    }.items():
        with pytest.raises(RobotError, match=f"hand.urdf: --joints: {message}"):
            read_urdf(hand(left, right), "hand.urdf", parse_selection(joints))


def test_mimics_of_a_fixed_joint_and_in_a_circle_are_held() -> None:
    still = ("still", "fixed", "arm", "")
    check_hand(hand(still, ("f", "revolute", "still", '<mimic joint="still" offset="0.2"/>')), {"f": 0.2})
    circle = [(a, "revolute", "arm", f'<mimic joint="{b}" offset="0.2"/>') for a, b in ("ab", "ba")]
    assert read_urdf(hand(*circle), "hand.urdf").joint_names == ("swing",)


def test_joints_of_other_types_are_held_when_left_out() -> None:
    text = hand(("loose", "floating", "arm", ""), ("turn", "continuous", "loose", ""))
    assert read_urdf(text, "hand.urdf", Selection(("swing",))).n == 1
    assert read_urdf(text, "hand.urdf", Selection(("swing", "turn"))).n == 2
    with pytest.raises(RobotError, match="'loose' can't be kept: type 'floating'"):
        read_urdf(text, "hand.urdf", Selection(("loose",)))
    with pytest.raises(RobotError, match="held at its origin, it takes no position"):
        read_urdf(text, "hand.urdf", Selection(("swing",), {"loose": 0.3}))


@pytest.mark.parametrize("tree", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_torque_and_place_are_those_of_the_whole_robot(seed: int, tree: bool) -> None:
    rng = np.random.default_rng(seed)
    whole = random_chain(rng, 7, special=seed % 2 == 0, tree=tree)
    whole = replace(whole, tool=to_matrix(from_roll_pitch_yaw((0.1, 0.2, -0.3), (0.4, 1.0, -2.0))))
    kept = sorted(rng.choice(7, 4, replace=False).tolist())
    names = [whole.joint_names[k] for k in kept]
    given = {name: float(rng.uniform(-1, 1)) for name in whole.joint_names[1:5] if name not in names}
    part = sub_chain(whole, rng.permutation(names).tolist(), given)
    assert list(part.joint_names) == names
    full = np.zeros((3, 7))
    state = rng.uniform(-2, 2, (3, 4))
    full[:, kept] = state
    for name, position in given.items():
        full[0, whole.joint_names.index(name)] = position
    expected = pinocchio_torque(whole, whole.standard, *full)[0, kept]
    found = pinocchio_torque(part, part.standard, *state)[0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    if not tree:
        place = link_frames(whole, full[0])[-1] @ np.array(whole.tool)
        np.testing.assert_allclose(link_frames(part, state[0])[-1] @ np.array(part.tool), place, rtol=0, atol=1e-12)
    assert read_toml(write_toml(part), "part.toml") == replace(part, source="part.toml")


def test_gravity_is_given_in_the_files_own_frame() -> None:
    text = hand(("finger", "revolute", "arm", ""))
    wall = (9.0, -1.0, 3.0)
    model = pinocchio.buildModelFromXML(text)
    model.gravity.linear = np.array(wall)
    q = np.array([0.4, -0.6])
    expected = pinocchio.rnea(model, model.createData(), q, np.zeros(2), np.zeros(2))
    robot = read_urdf(text, "hand.urdf", gravity=wall)
    at = [model.joints[model.getJointId(name)].idx_q for name in robot.joint_names]
    found = pinocchio_torque(robot, robot.standard, q[at][None], *np.zeros((2, 1, 2)))[0]
    np.testing.assert_allclose(found, expected[at], rtol=1e-10)
    tilted = load_robot("rx90", gravity=wall)
    assert np.array(tilted.base)[:3, :3] @ tilted.gravity == pytest.approx(wall)


def test_nothing_held_is_the_robot_itself() -> None:
    robot = load_robot("rx90")
    assert sub_chain(robot) is robot
    assert load_robot("rx90", joints=["joint_6=0.5"]).joint_names == robot.joint_names[:5]


def test_lengths_that_stay_keep_their_letters() -> None:
    part = load_robot("rx90", joints="joint_1,joint_2,joint_3")
    assert [joint.symbols for joint in part.joints] == [joint.symbols for joint in load_robot("rx90").joints[:3]]


def test_a_coupled_motor_keeps_its_joints_together() -> None:
    robot = load_robot("tx40")
    assert robot.transmission is not None
    part = load_robot("tx40", joints="joint_5=0.2")
    kept = [0, 1, 2, 3, 5]
    assert part.transmission == Transmission(tuple(map(tuple, robot.transmission.array[np.ix_(kept, kept)].tolist())))
    motors = tuple(Drive(inertia=float(k)) for k in range(1, 7))
    armed = replace(robot, transmission=replace(robot.transmission, motors=motors))
    kept_motors = sub_chain(armed, held={"joint_5": 0.2}).transmission
    assert kept_motors is not None
    assert kept_motors.motors == tuple(motors[k] for k in kept)
    with pytest.raises(RobotError, match="the motor of 'joint_6' turns with 'joint_5'; keep both, or neither"):
        load_robot("tx40", joints="joint_6=0")


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        ("a,,b", "expected names and name=position with commas between, found 'a,,b'"),
        ("=3", "expected names and name=position"),
        ("a,b,a=1", "'a' stands there twice"),
        ("a=left", "a: expected a position in rad or m, found 'left'"),
        ("a=nan", "a: expected a position in rad or m, found 'nan'"),
        ("a=1e9", "a: expected a position in rad or m, found '1e9'"),
        ("a,elbw", "two.toml: --joints: no joint 'elbw'; did you mean 'elbow'?"),
        ("a=0,elbow=0", "two.toml: no moving joint"),
    ],
)
def test_refusals(joints: str, message: str) -> None:
    robot = Robot("two", (Joint("a"), Joint("elbow", parent=0)), source="two.toml")

    def part() -> Robot:
        selection = parse_selection(joints)
        return sub_chain(robot, selection.keep, selection.held)

    with pytest.raises(RobotError) as caught:
        part()
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
