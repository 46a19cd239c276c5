"""Arms with closed-form inverse geometry, described from their modified Denavit-Hartenberg tables alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from identify.robot.library import load_robot
from identify.robot.robot import Joint, Limits, Matrix, Robot

RIGHT = math.pi / 2

Row = tuple[str, float, float, float, float]


def arm(name: str, rows: list[Row], limit: float = 3.0) -> Robot:
    """Robot from rows (type, alpha, d, theta, r)."""
    joints = tuple(
        Joint(f"joint_{j + 1}", kind, j - 1, alpha, d, theta, r, limits=Limits((-limit, limit)))
        for j, (kind, alpha, d, theta, r) in enumerate(rows)
    )
    return Robot(name, joints)


R, P = "revolute", "prismatic"

STANFORD = arm(
    "Stanford arm",
    [
        (R, 0, 0, 0, 0),
        (R, -RIGHT, 0, 0, 0.154),
        (P, RIGHT, 0, 0, 0),
        (R, 0, 0, 0, 0),
        (R, -RIGHT, 0, 0, 0),
        (R, RIGHT, 0, 0, 0),
    ],
)
SCARA = arm("SCARA", [(R, 0, 0, 0, 0.31), (R, 0, 0.4, 0, 0), (P, math.pi, 0.35, 0, 0), (R, 0, 0, 0, 0.05)])
PUMA = arm(
    "Puma with offsets",
    [
        (R, 0, 0, 0, 0.67),
        (R, -RIGHT, 0, 0, 0.2435),
        (R, 0, 0.4318, 0, -0.0934),
        (R, RIGHT, -0.0203, 0, 0.4331),
        (R, -RIGHT, 0, 0, 0),
        (R, RIGHT, 0, 0, 0.056),
    ],
)
OFFSET_SHOULDER = arm(
    "shoulder offset",
    [
        (R, 0, 0, 0, 0.675),
        (R, -RIGHT, 0.26, 0, 0),
        (R, 0, 0.68, -RIGHT, 0),
        (R, -RIGHT, -0.035, 0, 0.67),
        (R, RIGHT, 0, 0, 0),
        (R, -RIGHT, 0, 0, 0.158),
    ],
)
THREE_PARALLEL = arm(
    "three parallel axes",
    [
        (R, 0, 0, 0, 0.089),
        (R, RIGHT, 0, 0, 0),
        (R, 0, -0.425, 0, 0),
        (R, 0, -0.392, 0, 0.109),
        (R, RIGHT, 0, 0, 0.0947),
        (R, -RIGHT, 0, 0, 0.0823),
    ],
)


def rx90(forearm: float = 0.52) -> Robot:
    """RX-90 with a forearm of its own length, so that a swap of D3 and RL4 shows."""
    robot = load_robot("rx90")
    joints = tuple(replace(joint, r=forearm) if joint.r else joint for joint in robot.joints)
    return replace(robot, joints=joints)


def placed(robot: Robot) -> Robot:
    """The robot on a tilted base and with a tool, both arbitrary."""
    return replace(robot, base=_rigid(0.4, (0.3, -0.2, 0.9)), tool=_rigid(-1.1, (0.02, 0.05, 0.13)))


def _rigid(angle: float, position: tuple[float, float, float]) -> Matrix:
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    matrix = np.eye(4)
    matrix[:3, :3] += math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    matrix[:3, 3] = position
    return tuple(tuple(float(x) for x in row) for row in matrix)
