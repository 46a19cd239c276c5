"""Rigid transforms of modified Denavit-Hartenberg geometry, and links carried from frame to frame.

All transforms are (4, 4) homogeneous matrices; `T` "from A to B" holds the axes and origin of B in A.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from identify.robot.robot import Joint, Link, Matrix, Robot, Vector

QUARTER = math.pi / 2
TOLERANCE = 1e-9
"""Angles [rad] this close to a multiple of π/2 and lengths [m] this close to 0 are meant to be it."""

DECIMALS = 13
"""Decimals of a length [m] that a product of rotations leaves in place."""


def snap_angle(angle: float) -> float:
    """The angle [rad], or the multiple of π/2 it lies within TOLERANCE of."""
    quarters = round(angle / QUARTER)
    return quarters * QUARTER if abs(angle - quarters * QUARTER) <= TOLERANCE else angle


def snap_length(length: float) -> float:
    """The length [m], or 0.0 when it lies within TOLERANCE of it."""
    return 0.0 if abs(length) <= TOLERANCE else length


def cosine_sine(angle: float) -> tuple[float, float]:
    """cos and sin of an angle [rad], exactly 0 and ±1 at the floating-point multiples of π/2."""
    quarters = round(angle / QUARTER)
    if angle == quarters * QUARTER:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarters % 4]
    return math.cos(angle), math.sin(angle)


def screw_z(angle: float, length: float) -> np.ndarray:
    """(4, 4) Rot(z, angle) Trans(z, length)."""
    c, s = cosine_sine(angle)
    return np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, length], [0.0, 0.0, 0.0, 1.0]])


def screw_x(angle: float, length: float) -> np.ndarray:
    """(4, 4) Rot(x, angle) Trans(x, length)."""
    c, s = cosine_sine(angle)
    return np.array([[1.0, 0.0, 0.0, length], [0.0, c, -s, 0.0], [0.0, s, c, 0.0], [0.0, 0.0, 0.0, 1.0]])


def placement(gamma: float, b: float, alpha: float, d: float, theta: float, r: float) -> np.ndarray:
    """(4, 4) parent frame to R_j: Rot(z,γ) Trans(z,b) Rot(x,α) Trans(x,d) Rot(z,θ) Trans(z,r), [2.3] with γ and b."""
    return screw_z(gamma, b) @ screw_x(alpha, d) @ screw_z(theta, r)


def decompose(transform: np.ndarray) -> tuple[float, float, float, float, float, float]:
    """(gamma, b, alpha, d, theta, r) whose `placement` is the rigid `transform` (4, 4).

    gamma and b are 0 whenever that is possible, |gamma| ≤ π/2 otherwise. Angles within TOLERANCE of a
    multiple of π/2 and lengths within TOLERANCE of 0 are snapped to it.
    """
    rotation, p = transform[:3, :3], transform[:3, 3]
    parallel = math.hypot(rotation[0, 2], rotation[1, 2]) <= TOLERANCE
    if parallel:
        # A tilt just within the tolerance moves the origin sideways by as much of the height.
        beside = abs(p[1]) > TOLERANCE * (1.0 + abs(p[2]))
        gamma = _half_turn(math.atan2(p[1], p[0])) if beside else 0.0
    else:
        gamma = _half_turn(math.atan2(rotation[0, 2], -rotation[1, 2]))
    cosine, sine = cosine_sine(-gamma)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    rotation, p = turn @ rotation, turn @ p
    alpha = math.atan2(-rotation[1, 2], rotation[2, 2])
    alpha = QUARTER * 2 * round(abs(alpha) / math.pi) if parallel else snap_angle(alpha)
    cosine, sine = cosine_sine(alpha)
    # Read θ from what is left of the rotation, so that errors of γ and α near parallel axes do not add up.
    theta = snap_angle(math.atan2(-rotation[0, 1], rotation[0, 0]))
    if sine == 0.0:
        b, r = 0.0, cosine * p[2]
    else:
        r = snap_length(-p[1] / sine)
        b = p[2] - r * cosine
    b, d, r = (snap_length(float(x)) for x in (b, p[0], r))
    return gamma, b, alpha, d, theta, r


def parameters(transform: np.ndarray) -> tuple[float, float, float, float, float, float]:
    """`decompose`, with the noise of multiplied rotations taken off its lengths (0.22500000000000003 was 0.225)."""
    gamma, b, alpha, d, theta, r = decompose(transform)
    return gamma, round(b, DECIMALS), alpha, round(d, DECIMALS), theta, round(r, DECIMALS)


def _half_turn(angle: float) -> float:
    """The angle [rad], snapped and brought into (-π/2, π/2] by a half turn."""
    angle = snap_angle(angle)
    if angle > QUARTER:
        return snap_angle(angle - math.pi)
    return snap_angle(angle + math.pi) if angle <= -QUARTER else angle


def from_roll_pitch_yaw(xyz: Sequence[float], rpy: Sequence[float]) -> np.ndarray:
    """(4, 4) Trans(xyz) Rot(z, yaw) Rot(y, pitch) Rot(x, roll): URDF's origin; lengths in m, angles in rad."""
    (cr, sr), (cp, sp), (cy, sy) = (cosine_sine(angle) for angle in rpy)
    transform = np.eye(4)
    transform[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    transform[:3, 3] = xyz
    return transform


def to_roll_pitch_yaw(transform: np.ndarray) -> tuple[Vector, Vector]:
    """(xyz [m], rpy [rad]) of a rigid (4, 4) transform, the inverse of `from_roll_pitch_yaw`."""
    rotation = transform[:3, :3]
    pitch = math.atan2(-rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
    if math.hypot(rotation[0, 0], rotation[1, 0]) > TOLERANCE:
        roll, yaw = math.atan2(rotation[2, 1], rotation[2, 2]), math.atan2(rotation[1, 0], rotation[0, 0])
    else:
        roll, yaw = 0.0, math.atan2(-rotation[0, 1], rotation[1, 1])
    x, y, z = (float(value) for value in transform[:3, 3])
    return (x, y, z), (roll, pitch, yaw)


def inverse(transform: np.ndarray) -> np.ndarray:
    """(4, 4) inverse of a rigid transform, by transposing its rotation."""
    result = np.eye(4)
    result[:3, :3] = transform[:3, :3].T
    result[:3, 3] = -transform[:3, :3].T @ transform[:3, 3]
    return result


def to_matrix(transform: np.ndarray) -> Matrix:
    """The (4, 4) array as nested tuples, as `Robot.base` and `Robot.tool` hold it (-0.0 becomes 0.0)."""
    return tuple(tuple(float(x) + 0.0 for x in row) for row in transform)


def joint_transform(joint: Joint, q: float) -> np.ndarray:
    """(4, 4) parent frame to R_j at joint position q [rad or m], q = 0 giving the constant part."""
    turn, slide = (q, 0.0) if joint.revolute else (0.0, q)
    return placement(joint.gamma, joint.b, joint.alpha, joint.d, joint.theta + turn, joint.r + slide)


def link_frames(robot: Robot, q: Sequence[float] | np.ndarray) -> np.ndarray:
    """(n, 4, 4) frames R_1 … R_n in R_0 at joint positions q (n,) [rad or m]."""
    frames = np.empty((robot.n, 4, 4))
    for j, joint in enumerate(robot.joints):
        parent = frames[joint.parent] if joint.parent >= 0 else np.eye(4)
        frames[j] = parent @ joint_transform(joint, float(q[j]))
    return frames


def make_link(mass: float, com: np.ndarray, inertia: np.ndarray) -> Link:
    """Link from mass [kg], com (3,) [m] and inertia (3, 3) about it [kg·m²], symmetric part taken."""
    upper = (0.5 * (inertia + inertia.T))[np.triu_indices(3)]
    x, y, z = (float(value) + 0.0 for value in com)
    return Link(float(mass), (x, y, z), tuple(float(value) + 0.0 for value in upper))


def move_link(link: Link, transform: np.ndarray) -> Link:
    """The same body seen from another frame; `transform` (4, 4) holds the link's present frame in the new one."""
    rotation = transform[:3, :3]
    com = rotation @ np.asarray(link.com) + transform[:3, 3] if link.mass else np.zeros(3)
    return make_link(link.mass, com, rotation @ link.inertia_matrix @ rotation.T)


def merge_links(first: Link, second: Link) -> Link:
    """Two links that move as one body, both given in the same frame (parallel-axis theorem)."""
    if second == Link():
        return first
    mass = first.mass + second.mass
    if mass == 0.0:
        return make_link(0.0, np.zeros(3), first.inertia_matrix + second.inertia_matrix)
    a, b = np.asarray(first.com), np.asarray(second.com)
    apart = b - a
    steiner = first.mass * second.mass / mass * (apart @ apart * np.eye(3) - np.outer(apart, apart))
    com = (first.mass * a + second.mass * b) / mass
    return make_link(mass, com, first.inertia_matrix + second.inertia_matrix + steiner)
