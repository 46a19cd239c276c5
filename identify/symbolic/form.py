"""In which of several equal ways the customised recurrence writes each link."""

from __future__ import annotations

from dataclasses import dataclass, replace

from identify.robot.robot import Robot
from identify.symbolic.chain import quarter_turns


@dataclass(frozen=True)
class Form:
    """How one link is written; the count differs, the value does not.

    `shared_squares`: ω2² from U33 and ω1². `doubled_rate`: U31 and U32 through 2ω3 where no child reads that entry of
    ω̇; `turned_row`: there, from the row in axes that do not turn with the joint. `unturned`: the moment of the second
    moments in axes that do not turn with the joint, which pays where the link before hardly turns. `unturned_first`:
    the first moments and the mass likewise, for a link seen from the one before it. `level`: for a link behind a
    parallel axis, acceleration and force go through the axes that none of the parallel joints turns; `levered`: the
    parent's first moments and SXZ, SYZ then act as forces at this link's axis; `stepped`: the force's lever about the
    parent's axis is taken in the parent's axes. `merged`: a last link without offsets and with axes at right angles to
    its parent's as part of the parent's body.
    """

    shared_squares: bool = True
    doubled_rate: bool = False
    turned_row: bool = False
    unturned: bool = False
    unturned_first: bool = False
    level: bool = False
    levered: bool = False
    stepped: bool = False
    merged: bool = False


@dataclass(frozen=True)
class Forms:
    """Forms of the links (n,), the unit of length that the recurrence works in [m], and the merged links whose frame
    is turned about z by a constant, the symbol `turn_symbol`, so that MY is zero: their parameters are the turned
    frame's, a wrench on them is still in the robot's.
    """

    links: tuple[Form, ...]
    unit: float = 1.0
    turned: tuple[int, ...] = ()


def turn_symbol(j: int) -> str:
    """Name of the constant angle by which the frame of link j is turned."""
    return f"PHI{j + 1}"


def unit_letter(robot: Robot, unit: float) -> str | None:
    """Name of the length that is the unit, None if it has none."""
    for joint in robot.joints:
        for key, name in joint.symbols:
            if abs(getattr(joint, key)) == unit:
                return name
    return None


def with_unequal_lengths(robot: Robot) -> Robot:
    """The robot with every named length a little longer than the one before, so that none equals another by chance."""
    names = dict.fromkeys(name for joint in robot.joints for _, name in joint.symbols)
    factor = {name: 1 + i / 128 for i, name in enumerate(names)}
    joints = tuple(
        replace(joint, **{key: getattr(joint, key) * factor[name] for key, name in joint.symbols})
        for joint in robot.joints
    )
    return replace(robot, joints=joints)


def can_merge(robot: Robot, j: int) -> bool:
    """Whether link j can be carried as part of its parent's body: nothing hangs on it, it turns about the parent's
    origin, and its axes are the parent's but for right angles."""
    joint = robot.joints[j]
    last = joint.parent >= 0 and all(other.parent != j for other in robot.joints)
    square = quarter_turns(joint.alpha) in (1, 3) and quarter_turns(joint.gamma) is not None
    return last and joint.revolute and square and not (joint.d or joint.r or joint.b)
