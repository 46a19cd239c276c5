"""URDF robots against Pinocchio's own reading of the same file, in torque and in place; and every refusal."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from beside import shared
from chains import random_link

from identify.errors import RobotError
from identify.robot.library import load_robot
from identify.robot.robot import Limits, Link, Robot
from identify.robot.toml import read_toml, write_toml
from identify.robot.transforms import link_frames, to_matrix
from identify.robot.urdf import read_urdf
from identify.validation.engines import pinocchio_torque

RIGHT = math.pi / 2


def spaced(values: object) -> str:
    return " ".join(repr(float(x)) for x in values)  # type: ignore[attr-defined]


def random_urdf(rng: np.random.Generator, count: int, special: bool, tree: bool) -> str:
    """A URDF of `count` joints, the first moving, about 30 % of the others fixed; `special`: right angles abound."""

    def vector(scale: float) -> np.ndarray:
        return rng.normal(size=3) * scale * (rng.random(3) > (0.6 if special else 0.0))

    def angles() -> np.ndarray:
        return rng.integers(-2, 3, 3) * RIGHT if special else rng.uniform(-3, 3, 3)

    parts = ['<robot name="random"><link name="link_0"/>']
    for k in range(1, count + 1):
        kind = (
            "revolute"
            if k == 1
            else rng.choice(["revolute", "continuous", "prismatic", "fixed"], p=[0.4, 0.1, 0.2, 0.3])
        )
        parent = int(rng.integers(0, k)) if tree else k - 1
        axis = rng.permutation([0.0, 0.0, rng.choice([-1.0, 2.0])]) if special else rng.normal(size=3)
        link = random_link(rng)
        keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        inertia = " ".join(f'{key}="{float(value)!r}"' for key, value in zip(keys, link.inertia, strict=True))
        parts.append(
            f'<joint name="j{k}" type="{kind}"><parent link="link_{parent}"/><child link="link_{k}"/>'
            f'<origin xyz="{spaced(vector(0.4))}" rpy="{spaced(angles())}"/><axis xyz="{spaced(axis)}"/>'
            '<limit lower="-2" upper="2" effort="10" velocity="1"/></joint>'
            f'<link name="link_{k}"><inertial><mass value="{link.mass!r}"/>'
            f'<origin xyz="{spaced(link.com)}" rpy="{spaced(angles())}"/>'
            f"<inertia {inertia}/></inertial></link>"
        )
    return "\n".join([*parts, "</robot>"])


def reference(text: str, robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Torque (n,) and tip pose (4, 4) in the root link by Pinocchio's reading, joints in the robot's order."""
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    position, velocity, acceleration = pinocchio.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    rows = []
    for j, name in enumerate(robot.joint_names):
        index = model.getJointId(name)
        at, row = model.joints[index].idx_q, model.joints[index].idx_v
        continuous = model.joints[index].nq == 2
        position[at : at + 1 + continuous] = (np.cos(q[j]), np.sin(q[j])) if continuous else q[j]
        velocity[row], acceleration[row] = dq[j], ddq[j]
        rows.append(row)
    torque = pinocchio.rnea(model, data, position, velocity, acceleration)[rows]
    pinocchio.framesForwardKinematics(model, data, position)
    tip = data.oMf[model.getFrameId(f"link_{text.count('</link>')}")].homogeneous
    return torque, tip


@pytest.mark.parametrize("special", [False, True])
@pytest.mark.parametrize("tree", [False, True])
@pytest.mark.parametrize("seed", range(10))
def test_torque_and_tip_equal_pinocchios(seed: int, tree: bool, special: bool) -> None:
    rng = np.random.default_rng(seed)
    text = random_urdf(rng, int(rng.integers(1, 9)), special, tree)
    robot = read_urdf(text, "random.urdf")
    for _ in range(3):
        q, dq, ddq = rng.uniform(-2, 2, (3, robot.n))
        torque, tip = reference(text, robot, q, dq, ddq)
        ours = pinocchio_torque(robot, robot.standard, q, dq, ddq)[0]
        assert np.abs(ours - torque).max() <= 1e-9 * max(1.0, np.abs(torque).max())
        if not tree:
            reached = np.array(robot.base) @ link_frames(robot, q)[-1] @ np.array(robot.tool)
            np.testing.assert_allclose(reached, tip, rtol=0, atol=1e-8)


@pytest.mark.parametrize("special", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_frames_are_modified_denavit_hartenberg(seed: int, special: bool) -> None:
    rng = np.random.default_rng(seed)
    robot = read_urdf(random_urdf(rng, 8, special, tree=True), "random.urdf")
    assert np.count_nonzero(robot.gravity) == 1
    assert np.linalg.norm(robot.gravity) == pytest.approx(9.81, rel=1e-15)
    np.testing.assert_allclose(np.array(robot.base)[:3, :3] @ robot.gravity, [0, 0, -9.81], rtol=0, atol=1e-14)
    first_children = {joint.parent: joint for joint in reversed(robot.joints)}
    for joint in first_children.values():
        assert (joint.gamma, joint.b) == (0.0, 0.0)
        assert joint.d >= 0.0
    last = robot.joints[-1]
    assert (last.theta, last.r) == (0.0, 0.0)


def test_a_read_urdf_written_as_toml_is_the_same_robot() -> None:
    robot = read_urdf(random_urdf(np.random.default_rng(3), 7, special=False, tree=True), "random.urdf")
    assert read_toml(write_toml(robot), "random.urdf") == robot


def test_nearly_parallel_axes_keep_their_frames_near() -> None:
    """Calibrated arms have axes 1e-5 rad from parallel, whose common normal is hundreds of metres away."""
    text = random_urdf(np.random.default_rng(7), 4, special=False, tree=False)
    for k in range(1, 5):
        start = text.index("rpy", text.index(f'"j{k}"'))
        stop = text.index("/>", text.index("<axis", start))
        text = text[:start] + f'rpy="{k}e-5 -3e-5 0.4"/><axis xyz="0 0 1"' + text[stop:]
    text = text.replace('type="fixed"', 'type="revolute"')
    robot = read_urdf(text, "calibrated.urdf")
    assert max(np.linalg.norm(joint.link.com) for joint in robot.joints) < 5.0
    q, dq, ddq = np.random.default_rng(1).uniform(-2, 2, (3, robot.n))
    torque, _ = reference(text, robot, q, dq, ddq)
    ours = pinocchio_torque(robot, robot.standard, q, dq, ddq)[0]
    assert np.abs(ours - torque).max() <= 1e-9 * np.abs(torque).max()


def test_tx40_urdf_and_toml_are_one_arm() -> None:
    file = shared("data", "tx40", "tx40.urdf")
    urdf, toml = load_robot(file), load_robot("tx40")
    model = pinocchio.buildModelFromUrdf(str(file))
    data = model.createData()
    flange = model.getFrameId("tool0")
    toml_tool = None
    for q in np.random.default_rng(0).uniform(-2, 2, (20, 6)):
        pinocchio.framesForwardKinematics(model, data, q)
        pose = data.oMf[flange].homogeneous
        np.testing.assert_allclose(
            np.array(urdf.base) @ link_frames(urdf, q)[-1] @ np.array(urdf.tool), pose, rtol=0, atol=1e-9
        )
        # tx40.toml counts r1 = 0.320 m in joint 1 and leaves the tool frame where R_6 is: one constant turn apart.
        turn = np.linalg.inv(np.array(toml.base) @ link_frames(toml, q)[-1]) @ pose
        toml_tool = turn if toml_tool is None else toml_tool
        np.testing.assert_allclose(turn, toml_tool, rtol=0, atol=1e-9)
    np.testing.assert_allclose(toml_tool, np.diag([-1.0, -1.0, 1.0, 1.0]), rtol=0, atol=1e-9)
    for ours, theirs in zip(toml.joints, urdf.joints, strict=True):
        assert (ours.alpha, ours.d, ours.name) == (theirs.alpha, theirs.d, theirs.name)
        assert (ours.limits.velocity, ours.limits.effort) == (theirs.limits.velocity, theirs.limits.effort)
    # The URDF gives the limits of joints 2 and 3 for the controller's zero, a quarter turn away from its own.
    shifts = [a.limits.position[0] - b.limits.position[0] for a, b in zip(toml.joints, urdf.joints, strict=True)]
    np.testing.assert_allclose(shifts, [0, -RIGHT, RIGHT, 0, 0, 0], rtol=0, atol=1e-6)


ARM = """<robot name="arm">
  <link name="ground"><inertial><mass value="9"/></inertial></link>
  <link name="upper"><inertial><mass value="2.0"/><origin xyz="0.1 0 0.02"/>
    <inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.025"/></inertial></link>
  <link name="hand"/>
  <joint name="shoulder" type="revolute">
    <parent link="ground"/><child link="upper"/><origin xyz="0 0 0.3" rpy="0 1.57079632679 0"/><axis xyz="0 0 -2"/>
    <limit lower="-1" upper="2" velocity="3" effort="40"/><dynamics damping="1.5" friction="0.7"/>
  </joint>
  <joint name="wrist" type="continuous">
    <parent link="upper"/><child link="hand"/><origin xyz="0.2 0 0"/>
    <limit velocity="0" effort="0" lower="1" upper="2"/>
  </joint>
</robot>"""


def test_limits_friction_and_missing_inertia() -> None:
    shoulder, wrist = read_urdf(ARM, "arm.urdf").joints
    assert shoulder.limits == Limits((-1.0, 2.0), 3.0, math.inf, 40.0)
    assert (shoulder.drive.viscous, shoulder.drive.coulomb) == (1.5, 0.7)
    assert shoulder.link.mass == 2.0
    assert wrist.limits == Limits()
    assert wrist.link == Link()


def test_infinite_limits_are_no_limits() -> None:
    text = ARM.replace('lower="-1" upper="2" velocity="3"', 'lower="-inf" upper="inf" velocity="inf"')
    assert read_urdf(text, "arm.urdf").joints[0].limits == Limits(effort=40.0)


def test_joints_come_depth_first_in_the_files_order() -> None:
    links = "".join(f'<link name="{name}"/>' for name in "abcdef")
    joints = "".join(
        f'<joint name="{parent}{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/></joint>'
        for parent, child, kind in (
            ("c", "f", "fixed"),
            ("a", "d", "revolute"),
            ("d", "e", "prismatic"),
            ("a", "b", "continuous"),
            ("b", "c", "revolute"),
        )
    )
    robot = read_urdf(f'<robot name="tree">{links}{joints}</robot>', "tree.urdf")
    assert robot.joint_names == ("ad", "de", "ab", "bc")
    assert [joint.parent for joint in robot.joints] == [-1, 0, -1, 2]


def test_a_file_is_read_by_its_path(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM, encoding="utf-8")
    assert read_urdf(path) == read_urdf(ARM, str(path)) == load_robot(path)


def test_impossible_inertia_is_kept_and_noted() -> None:
    robot = read_urdf(ARM.replace('izz="0.025"', 'izz="0.25"'), "arm.urdf")
    assert "Link 'upper': no body has the principal moments" in robot.note
    assert "\n" not in robot.note


def test_almost_right_angles_are_noted_and_kept() -> None:
    assert read_urdf(ARM, "arm.urdf").note == ""
    rounded = read_urdf(ARM.replace("1.57079632679", "1.5708"), "arm.urdf")
    assert "Joint 'shoulder': the angle 1.5708 is taken as written" in rounded.note
    assert rounded.base != read_urdf(ARM, "arm.urdf").base


def test_right_angles_are_exact() -> None:
    robot = read_urdf(ARM.replace('xyz="0 0 -2"', 'xyz="0 1 0"'), "arm.urdf")
    assert {abs(x) for row in robot.base for x in row} <= {0.0, 1.0, 0.2, 0.3}
    assert to_matrix(np.array(robot.base)) == robot.base


def arm(old: str, new: str) -> str:
    assert old in ARM
    return ARM.replace(old, new)


THIRD = '<joint name="third" type="fixed"><parent link="{}"/><child link="{}"/></joint></robot>'
REFUSALS = {
    "no XML": ("name = 3", "not valid XML: syntax error: line 1, column 0"),
    "cut off": (ARM[:300], "not valid XML"),
    "doctype": (f"<!DOCTYPE robot>{ARM}", "holds a DOCTYPE or ENTITY declaration, which is refused"),
    "another language": ("<sdf/>", "not a URDF: expected the element <robot> at the top, found <sdf>"),
    "xacro": (arm('xyz="0.2 0 0"', 'xyz="${l} 0 0"'), "holds xacro macros; expand it first"),
    "no link": ("<robot name='r'/>", "no <link>"),
    "fixed alone": (arm("revolute", "fixed").replace("continuous", "fixed"), "no moving joint"),
    "link twice": (arm('<link name="hand"/>', '<link name="upper"/>'), "link 'upper': a second link of this name"),
    "joint twice": (arm('"wrist"', '"shoulder"'), "joint 'shoulder': a second joint of this name"),
    "link without name": (arm('<link name="hand"/>', "<link/>"), "a <link>: no attribute name"),
    "joint without type": (arm(' type="continuous"', ""), "joint 'wrist': no attribute type"),
    "floating": (
        arm("continuous", "floating"),
        "joint 'wrist': type 'floating' can't be used; name the joints to keep with --joints",
    ),
    "planar": (arm("continuous", "planar"), "joint 'wrist': type 'planar' can't be used"),
    "misspelt": (
        arm("continuous", "continous"),
        "joint 'wrist': type 'continous' can't be used; did you mean 'continuous'?",
    ),
    "mimic": (
        arm('<origin xyz="0.2 0 0"/>', '<mimic joint="shoulder"/>'),
        "no joint is left that moves on its own: 'wrist' mimics",
    ),
    "mimic of nothing": (
        arm('<origin xyz="0.2 0 0"/>', '<mimic joint="sholder"/>'),
        "joint 'wrist': mimics 'sholder', which is no other joint; name the joints to keep with --joints",
    ),
    "mimic that carries": (
        arm(
            "</robot>",
            '<link name="tip"/><joint name="tool" type="revolute"><parent link="hand"/><child link="tip"/></joint>'
            "</robot>",
        ).replace('<origin xyz="0.2 0 0"/>', '<mimic joint="shoulder"/>'),
        "joint 'wrist': 'wrist' mimics 'shoulder', and it carries 'tool': coupled joints can't be used; name the",
    ),
    "no parent": (arm('<parent link="upper"/>', ""), "joint 'wrist': no <parent"),
    "no child": (arm('<child link="hand"/>', ""), "joint 'wrist': no <child"),
    "unknown parent": (
        arm('<parent link="upper"/>', '<parent link="uper"/>'),
        "parent: no link 'uper'; did you mean 'upper'?",
    ),
    "two parents": (arm("</robot>", THIRD.format("ground", "hand")), "hangs on joint 'wrist' already; closed loops"),
    "cycle": (arm("</robot>", THIRD.format("hand", "ground")), "form a closed loop"),
    "two roots": (
        arm('<link name="hand"/>', '<link name="hand"/><link name="lost"/>'),
        "'ground', 'lost' have no parent",
    ),
    "zero axis": (arm("0 0 -2", "0 0 0"), "joint 'shoulder': axis: expected a direction, found a zero vector"),
    "axis of two": (arm("0 0 -2", "0 1"), "joint 'shoulder': axis: xyz: expected 3 numbers, found '0 1'"),
    "origin in words": (
        arm("0 0 0.3", "0 0 high"),
        "joint 'shoulder': origin: xyz: expected numbers, found '0 0 high'",
    ),
    "origin nan": (arm("0 0 0.3", "0 0 nan"), "joint 'shoulder': origin: xyz: expected a finite number, found nan"),
    "limits reversed": (arm('lower="-1"', 'lower="4"'), "joint 'shoulder': limit: lower 4 lies above upper 2"),
    "negative effort": (
        arm('effort="40"', 'effort="-1"'),
        "joint 'shoulder': limit: effort: expected 0 or more, found -1",
    ),
    "negative damping": (arm('"1.5"', '"-1.5"'), "joint 'shoulder': dynamics: damping: expected 0 or more, found -1.5"),
    "negative mass": (arm('"2.0"', '"-2.0"'), "link 'upper': inertial: mass: expected 0 or more, found -2"),
    "no mass": (arm('<mass value="2.0"/>', ""), "link 'upper': inertial: no <mass"),
    "mass in words": (arm('"2.0"', '"heavy"'), "link 'upper': inertial: mass: value: expected numbers, found 'heavy'"),
    "infinite inertia": (
        arm('"0.02"', '"inf"'),
        "link 'upper': inertial: inertia: ixx: expected a finite number, found inf",
    ),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_refusals(case: str) -> None:
    text, message = REFUSALS[case]
    with pytest.raises(RobotError) as caught:
        read_urdf(text, "arm.urdf")
    said = str(caught.value)
    assert message in said
    assert said.startswith("arm.urdf: ")
    assert "\n" not in said


def test_entities_are_never_expanded() -> None:
    bomb = '<!DOCTYPE r [<!ENTITY a "aaaaaaaa"><!ENTITY b "&a;&a;&a;">]><robot name="&b;"/>'
    with pytest.raises(RobotError, match="refused"):
        read_urdf(bomb, "bomb.urdf")
