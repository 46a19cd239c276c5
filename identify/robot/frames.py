"""Modified Denavit-Hartenberg frames for an arm described by joint axes anywhere in space (URDF and the like).

Khalil & Kleinfinger (1986): z_j along the axis of joint j, in its sense, so that the description's own joint
variable is kept; x_j along the common normal to the axis of the first child, whose γ and b are then 0. What is
left free is chosen so that θ_j and r_j vanish. R_0 is confused with R_1 at q = 0, unless gravity would then lie
askew in it: a tilted first axis gets an upright R_0 and its tilt as α_1, so that no component is rounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from identify.robot.robot import Drive, Joint, Limits, Link, Robot, Vector
from identify.robot.transforms import TOLERANCE, decompose, inverse, move_link, parameters, placement, to_matrix

NEARLY_PARALLEL = 1e-2
"""Sine of an angle between axes below which their common normal lies too far off to put a frame there."""

NOISE = 1e-12


@dataclass(frozen=True)
class Body:
    """A moving joint and its link, as read.

    parent: index of the parent body, -1 for the root. frame (4, 4): the body's own frame at q = 0, in the
    root frame. axis (3,): direction of the joint in that frame, whose origin it passes through.
    link: inertia in that frame.
    """

    name: str
    type: str
    parent: int
    frame: np.ndarray
    axis: np.ndarray
    link: Link = field(default_factory=Link)
    limits: Limits = field(default_factory=Limits)
    drive: Drive = field(default_factory=Drive)

    @property
    def direction(self) -> np.ndarray:
        """(3,) unit vector of the axis in the root frame."""
        return self.frame[:3, :3] @ self.axis

    @property
    def point(self) -> np.ndarray:
        """(3,) a point of the axis in the root frame [m]."""
        return self.frame[:3, 3]


def robot_from_bodies(
    name: str,
    bodies: Sequence[Body],
    gravity: Sequence[float],
    tip: np.ndarray,
    source: str = "",
    note: str = "",
) -> Robot:
    """Robot of the given bodies, parents before children, at least one of them.

    gravity (3,): acceleration in the root frame [m/s²]. tip (4, 4): the tool frame at q = 0, in the root
    frame, carried by the last body. Joint variables stay the bodies' own; `Robot.base` is R_0 in the root frame.
    """
    first = {other.parent: other for other in reversed(bodies)}
    children = [first.get(j) for j in range(len(bodies))]
    base = tidy(_frame(bodies[0], None, children[0]))
    if np.count_nonzero(_in(base, gravity)) > 1:
        up = -np.asarray(gravity, dtype=float) / np.linalg.norm(gravity)
        base = tidy(_frame(Body("base", "fixed", -1, np.eye(4), up), None, bodies[0]))
    frames: list[np.ndarray] = []
    for body, child in zip(bodies, children, strict=True):
        frames.append(_frame(body, frames[body.parent] if body.parent >= 0 else base, child))
    return robot_from_frames(name, bodies, frames, base, gravity, tip, source, note)


def robot_from_frames(
    name: str,
    bodies: Sequence[Body],
    frames: Sequence[np.ndarray],
    base: np.ndarray,
    gravity: Sequence[float],
    tip: np.ndarray,
    source: str = "",
    note: str = "",
) -> Robot:
    """Robot of the bodies with frames R_j (4, 4) at q = 0 and R_0 `base`, in the root frame, z_j along the axes."""
    joints: list[Joint] = []
    for body, frame in zip(bodies, frames, strict=True):
        parent = frames[body.parent] if body.parent >= 0 else base
        gamma, b, alpha, d, theta, r = parameters(inverse(parent) @ frame)
        joints.append(
            Joint(
                name=body.name,
                type=body.type,
                parent=body.parent,
                alpha=alpha,
                d=d,
                theta=theta,
                r=r,
                gamma=gamma,
                b=b,
                limits=body.limits,
                link=move_link(body.link, tidy(inverse(frame) @ body.frame)),
                drive=body.drive,
            )
        )
    return Robot(
        name=name,
        joints=tuple(joints),
        gravity=_in(base, gravity),
        base=to_matrix(base),
        tool=to_matrix(tidy(inverse(frames[-1]) @ tip)),
        source=source,
        note=note,
    )


def tidy(transform: np.ndarray) -> np.ndarray:
    """The rigid (4, 4) transform without rounding noise around 0 and ±1 in the rotation and 0 in the translation."""
    result = transform.copy()
    rotation = result[:3, :3]
    whole = np.round(rotation)
    rotation[np.abs(rotation - whole) < NOISE] = whole[np.abs(rotation - whole) < NOISE]
    result[:3, 3][np.abs(result[:3, 3]) < NOISE] = 0.0
    return result


def _in(base: np.ndarray, gravity: Sequence[float]) -> Vector:
    """(3,) the acceleration, given in the root frame, in R_0 [m/s²]."""
    vector = base[:3, :3].T @ np.asarray(gravity, dtype=float)
    vector[np.abs(vector) < NOISE * np.linalg.norm(vector)] = 0.0
    x, y, z = (float(value) for value in vector)
    return x, y, z


def _frame(body: Body, parent: np.ndarray | None, child: Body | None) -> np.ndarray:
    """(4, 4) R_j at q = 0 in the root frame."""
    z, point = body.direction, body.point
    rest = _pose(z, _across(body), point)
    if parent is not None and not TOLERANCE < np.linalg.norm(np.cross(parent[:3, 2], z)) < NEARLY_PARALLEL:
        # θ = 0 and r = 0: x_j along the common normal with the parent's axis, O_j at its foot.
        gamma, b, alpha, d, _, _ = decompose(inverse(parent) @ rest)
        rest = parent @ placement(gamma, b, alpha, d, 0.0, 0.0)
    if child is None:
        return rest
    origin, x = rest[:3, 3], rest[:3, 0]
    apart = child.point - origin
    normal = np.cross(z, child.direction)
    sine = float(np.linalg.norm(normal))
    if sine <= TOLERANCE:
        across = apart - (apart @ z) * z
        distance = float(np.linalg.norm(across))
        return _pose(z, across / distance, origin) if distance > TOLERANCE else rest
    if sine < NEARLY_PARALLEL:
        return rest
    normal = normal / sine
    distance = float(apart @ normal)
    if abs(distance) <= TOLERANCE:
        distance = float(x @ normal)
        distance = 0.0 if abs(distance) <= TOLERANCE else distance
    along = float(np.cross(apart, child.direction) @ normal) / sine
    return _pose(z, normal if distance >= 0 else -normal, origin + along * z)


def _across(body: Body) -> np.ndarray:
    """(3,) the axis of the body's own frame that is x, or failing that y, made perpendicular to the joint."""
    z = body.direction
    candidates = (axis - (axis @ z) * z for axis in body.frame[:3, :2].T)
    return next(axis / np.linalg.norm(axis) for axis in candidates if np.linalg.norm(axis) > 0.5)


def _pose(z: np.ndarray, x: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """(4, 4) frame with the given z, x as nearly as z allows, and origin."""
    z = z / np.linalg.norm(z)
    y = np.cross(z, x)
    y = y / np.linalg.norm(y)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([np.cross(y, z), y, z])
    pose[:3, 3] = origin
    return pose
