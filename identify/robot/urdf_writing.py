"""A Robot as URDF, with the standard library's XML alone: joint variables, names and tree are the robot's own.

Every link frame is R_j, every joint turns about or slides along its z axis. The root link is the world that
`Robot.base` places R_0 in, unless gravity would not point down there. `lost_in_urdf` says what URDF has no place for.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from identify.robot.robot import IDENTITY, Joint, Robot
from identify.robot.transforms import joint_transform, to_roll_pitch_yaw

GRAVITY = 9.81
"""What readers of a URDF take for gravity [m/s²], down the root link's z axis."""

SKEW = 1e-9
"""Sine of an angle below which gravity counts as pointing down."""

FAR = 1e9
"""Stands for an infinite limit where URDF must have a number."""


def to_urdf(robot: Robot) -> str:
    """URDF text of the robot, full precision.

    Joint limits that are not given read 1e9; a revolute joint without position limits is `continuous`. Actuator inertia
    and offset stand as attributes `armature` and `offset` of <dynamics>, which other readers pass over. A link without
    mass has no <inertial>.
    """
    root = Element("robot", name=robot.name)
    names = _link_names(robot)
    SubElement(root, "link", name=names[-1])
    placed = _root_frame(robot)
    for index, joint in enumerate(robot.joints):
        link = SubElement(root, "link", name=names[index])
        if joint.link.mass > 0:
            _inertial(link, joint)
        frame = joint_transform(joint, 0.0)
        _joint(root, joint, names[joint.parent], names[index], placed @ frame if joint.parent < 0 else frame)
    if robot.tool != IDENTITY:
        tool = _free("tool", [*names.values(), *robot.joint_names])
        SubElement(root, "link", name=tool)
        fixed = SubElement(root, "joint", name=tool, type="fixed")
        _edge(fixed, names[robot.n - 1], tool, np.array(robot.tool))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def lost_in_urdf(robot: Robot) -> tuple[str, ...]:
    """What of the robot no URDF holds, or only readers like this package take from it; one sentence each."""
    lost = []
    if any(joint.drive.inertia for joint in robot.joints):
        lost.append(
            "actuator inertias: URDF has none; they stand as `armature` in <dynamics>, which simulators pass over "
            "(Pinocchio takes them as model.armature, MuJoCo as dof_armature)"
        )
    if any(joint.drive.offset for joint in robot.joints):
        lost.append("constant friction offsets: URDF has none; they stand as `offset` in <dynamics>")
    size = float(np.linalg.norm(robot.gravity))
    if abs(size - GRAVITY) > SKEW * GRAVITY:
        lost.append(f"gravity of {size:g} m/s²: readers of a URDF assume {GRAVITY} m/s² down the root link's z axis")
    if size > 0 and not _upright(robot):
        lost.append("the placement of R_0 in the world: the root link is turned so that gravity points down its z axis")
    return tuple(lost)


def _upright(robot: Robot) -> bool:
    """Whether gravity points down the z axis of the world."""
    down = np.array(robot.base)[:3, :3] @ np.array(robot.gravity)
    return bool(down[2] < 0 and np.hypot(down[0], down[1]) <= -SKEW * down[2])


def _root_frame(robot: Robot) -> np.ndarray:
    """(4, 4) R_0 in the root link, in which gravity points down z."""
    size = float(np.linalg.norm(robot.gravity))
    if size == 0 or _upright(robot):
        return np.array(robot.base)
    up = -np.array(robot.gravity) / size
    across = np.eye(3)[int(np.argmin(np.abs(up)))]
    x = across - (across @ up) * up
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, :3] = np.array([x, np.cross(up, x), up])
    return frame


def _link_names(robot: Robot) -> dict[int, str]:
    """Name of each joint's link by its index, and of the root link at -1."""
    taken: list[str] = []
    names = {}
    for index, wanted in [(-1, "base_link"), *((k, f"{name}_link") for k, name in enumerate(robot.joint_names))]:
        names[index] = _free(wanted, taken)
        taken.append(names[index])
    return names


def _free(wanted: str, taken: list[str]) -> str:
    while wanted in taken:
        wanted += "_"
    return wanted


def _inertial(link: Element, joint: Joint) -> None:
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_text(*joint.link.com), rpy="0 0 0")
    SubElement(inertial, "mass", value=_text(joint.link.mass))
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    SubElement(inertial, "inertia", dict(zip(keys, map(_text, joint.link.inertia), strict=True)))


def _joint(root: Element, joint: Joint, parent: str, child: str, frame: np.ndarray) -> None:
    low, high = joint.limits.position
    free = math.isinf(low) and math.isinf(high)
    kind = "prismatic" if not joint.revolute else "continuous" if free else "revolute"
    element = SubElement(root, "joint", name=joint.name, type=kind)
    _edge(element, parent, child, frame)
    SubElement(element, "axis", xyz="0 0 1")
    limits, sizes = joint.limits, ("effort", "velocity")
    given = {key: _text(min(getattr(limits, key), FAR)) for key in sizes}
    if kind != "continuous":
        given = {"lower": _text(max(low, -FAR)), "upper": _text(min(high, FAR))} | given
    if math.isfinite(limits.acceleration):
        given["acceleration"] = _text(limits.acceleration)
    SubElement(element, "limit", given)
    drive = joint.drive
    dynamics = {"damping": _text(drive.viscous), "friction": _text(drive.coulomb)}
    dynamics |= {key: _text(x) for key, x in (("armature", drive.inertia), ("offset", drive.offset)) if x}
    SubElement(element, "dynamics", dynamics)


def _edge(element: Element, parent: str, child: str, frame: np.ndarray) -> None:
    xyz, rpy = to_roll_pitch_yaw(frame)
    SubElement(element, "parent", link=parent)
    SubElement(element, "child", link=child)
    SubElement(element, "origin", xyz=_text(*xyz), rpy=_text(*rpy))


def _text(*numbers: float) -> str:
    """Shortest decimals that read back to the same floats."""
    return " ".join(repr(float(number) + 0.0) for number in numbers)
