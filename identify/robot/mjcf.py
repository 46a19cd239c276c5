"""A Robot as a MuJoCo model in MJCF text: the plant of simulated experiments and one of the cross-checks.

The world frame of the model is R_0, every body frame is R_j, every joint turns about or slides along its
body's z axis, and the constant part of the joint variable sits in the body frame, so a joint position of
the model is the robot's q_j itself.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

import numpy as np

from identify.errors import RobotError
from identify.robot.robot import Joint, Robot

FRICTION_SOLREF = "0.002 1"
FRICTION_SOLIMP = "0.9999 0.9999 0.001"
"""Stiffness of MuJoCo's soft Coulomb friction: a joint at rest creeps by far less than an encoder can see."""

ROUNDING = 1e-12
"""Relative rounding allowed for in A + B >= C, which flat links meet with equality and MuJoCo tests without slack."""

FAR = 1e9
"""Stands for an infinite bound where only one side of a joint is limited [rad or m]."""


def to_mjcf(
    robot: Robot,
    standard: np.ndarray | None = None,
    *,
    friction: bool = True,
    timestep: float = 0.0005,
    limits: bool = True,
    position_gain: Sequence[float] | np.ndarray | None = None,
    velocity_gain: Sequence[float] | np.ndarray | None = None,
) -> str:
    """MJCF text of `robot`, full precision, Euler integrator, no contacts, one hinge or slide a joint.

    standard (11 n,): inertial parameters in the order of `Robot.standard_names`, robot.standard when None.
    Inertias go in as they are; where MuJoCo can't hold them this raises instead of altering them (a flat
    link, A + B = C up to rounding, has C lowered by 2e-12 of itself, or MuJoCo refuses every second one).
    friction: `damping` = Fv and `frictionloss` = Fs. limits: position limits as joint stops.
    timestep [s]. position_gain Kp (n,) [N·m/rad or N/m] and velocity_gain Kd (n,) [N·m·s/rad or N·s/m], in
    the robot's order, add one actuator a joint with force = ctrl − offset − Kp·q − Kd·q̇: with
    ctrl = Kp·q_ref + Kd·q̇_ref + Γ_ff the whole loop runs inside MuJoCo. The drive's effort is that force plus
    the constant friction `offset` (0 when friction is False), which never reaches the link: Γ = rigid + Fv·q̇
    + Fs·sign(q̇) + offset [2.63]. Without gains there is no actuator and the offset has no place.

    MuJoCo numbers joints depth first; `depth_first(robot)` is that order, 0 … n−1 for every serial chain.
    Raises RobotError naming the link whose inertia no rigid body can have, or that has none.
    """
    values = robot.standard if standard is None else np.asarray(standard, dtype=float)
    if values.shape != (11 * robot.n,):
        raise RobotError(f"{robot.name}: {values.shape} standard parameters given, ({11 * robot.n},) needed")

    root = ElementTree.Element("mujoco", model=robot.name)
    ElementTree.SubElement(
        root, "compiler", angle="radian", autolimits="false", balanceinertia="false", inertiafromgeom="false"
    )
    option = ElementTree.SubElement(
        root, "option", timestep=_text(timestep), integrator="Euler", gravity=_text(*robot.gravity)
    )
    ElementTree.SubElement(option, "flag", contact="disable")

    bodies = {-1: ElementTree.SubElement(root, "worldbody")}
    for index, joint in enumerate(robot.joints):
        link = values[11 * index : 11 * index + 10]
        inertia = values[11 * index + 10]
        placement = {"name": f"{joint.name}_link"} | _placement(joint)
        body = ElementTree.SubElement(bodies[joint.parent], "body", placement)
        ElementTree.SubElement(body, "inertial", _inertial(robot, joint, link))
        ElementTree.SubElement(body, "joint", _joint(robot, joint, float(inertia), friction, limits))
        bodies[index] = body

    if position_gain is not None or velocity_gain is not None:
        stiffness = np.zeros(robot.n) if position_gain is None else np.asarray(position_gain, dtype=float)
        damping = np.zeros(robot.n) if velocity_gain is None else np.asarray(velocity_gain, dtype=float)
        actuators = ElementTree.SubElement(root, "actuator")
        for index in depth_first(robot):
            joint = robot.joints[index]
            offset = joint.drive.offset if friction else 0.0
            ElementTree.SubElement(
                actuators,
                "general",
                name=joint.name,
                joint=joint.name,
                gaintype="fixed",
                gainprm="1",
                biastype="affine",
                biasprm=_text(-offset, -stiffness[index], -damping[index]),
            )
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def depth_first(robot: Robot) -> tuple[int, ...]:
    """(n,) robot index of each joint of the MuJoCo model, in the model's order: q_model = q[..., order]."""

    children: dict[int, list[int]] = {}
    for index, joint in enumerate(robot.joints):
        children.setdefault(joint.parent, []).append(index)
    order, pending = [], children.get(-1, [])[::-1]
    while pending:
        order.append(pending.pop())
        pending += children.get(order[-1], [])[::-1]
    return tuple(order)


def _text(*numbers: float) -> str:
    """Shortest decimals that read back to the same floats."""
    return " ".join(repr(float(number)) for number in numbers)


def _placement(joint: Joint) -> dict[str, str]:
    """R_j at q_j = 0 in the parent's frame [2.3], as MuJoCo's position and quaternion (w x y z)."""
    sin_alpha, cos_alpha = math.sin(joint.alpha), math.cos(joint.alpha)
    sin_gamma, cos_gamma = math.sin(joint.gamma), math.cos(joint.gamma)
    x, y, z = joint.d, -joint.r * sin_alpha, joint.r * cos_alpha
    position = (cos_gamma * x - sin_gamma * y, sin_gamma * x + cos_gamma * y, z + joint.b)
    # Rz(gamma) Rx(alpha) Rz(theta) multiplied out in half angles
    half = joint.alpha / 2
    total, difference = (joint.gamma + joint.theta) / 2, (joint.gamma - joint.theta) / 2
    quaternion = (
        math.cos(half) * math.cos(total),
        math.sin(half) * math.cos(difference),
        math.sin(half) * math.sin(difference),
        math.cos(half) * math.sin(total),
    )
    return {"pos": _text(*position), "quat": _text(*quaternion)}


def _inertial(robot: Robot, joint: Joint, link: np.ndarray) -> dict[str, str]:
    """Attributes of <inertial> from XX XY XZ YY YZ ZZ MX MY MZ M about O_j (10,); RobotError where impossible."""
    xx, xy, xz, yy, yz, zz, mx, my, mz, mass = link
    where = f"{robot.name}, link of {joint.name}"
    if not np.all(np.isfinite(link)):
        raise RobotError(f"{where}: a standard parameter is not a number; MuJoCo needs finite inertias")
    if mass <= 0:
        raise RobotError(f"{where}: mass {mass:g} kg; MuJoCo needs every moving link to have mass and inertia")
    com = np.array([mx, my, mz]) / mass
    about_origin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    inertia = about_origin - mass * (com @ com * np.eye(3) - np.outer(com, com))
    (smallest, middle, largest), axes = np.linalg.eigh(inertia)
    if smallest <= 0:
        raise RobotError(
            f"{where}: a principal moment about the centre of mass is {smallest:g} kg·m²; MuJoCo needs all positive"
        )
    margin = (smallest + middle - largest) / largest
    if margin < -ROUNDING:
        raise RobotError(
            f"{where}: principal moments {smallest:g}, {middle:g}, {largest:g} kg·m² break A + B >= C; "
            "no rigid body has them and MuJoCo refuses them"
        )
    if margin < ROUNDING:
        inertia = inertia - 2 * ROUNDING * largest * np.outer(axes[:, 2], axes[:, 2])
    full = (inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2])
    return {"pos": _text(*com), "mass": _text(mass), "fullinertia": _text(*full)}


def _joint(robot: Robot, joint: Joint, inertia: float, friction: bool, limits: bool) -> dict[str, str]:
    """Attributes of <joint>: axis, armature, friction and stops."""
    if not math.isfinite(inertia) or inertia < 0:
        raise RobotError(f"{robot.name}, {joint.name}: actuator inertia {inertia:g}; MuJoCo needs it at least 0")
    attributes = {
        "name": joint.name,
        "type": "hinge" if joint.revolute else "slide",
        "axis": "0 0 1",
        "armature": _text(inertia),
    }
    if friction:
        if joint.drive.viscous < 0 or joint.drive.coulomb < 0:
            raise RobotError(f"{robot.name}, {joint.name}: negative friction; MuJoCo needs it at least 0")
        attributes |= {
            "damping": _text(joint.drive.viscous),
            "frictionloss": _text(joint.drive.coulomb),
            "solreffriction": FRICTION_SOLREF,
            "solimpfriction": FRICTION_SOLIMP,
        }
    low, high = joint.limits.position
    if limits and (math.isfinite(low) or math.isfinite(high)):
        attributes |= {"limited": "true", "range": _text(max(low, -FAR), min(high, FAR))}
    return attributes
