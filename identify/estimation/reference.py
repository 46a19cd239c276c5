"""Reference bodies: what a link is taken for where the data don't say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.regressor.regressor import Regressor
from identify.robot.robot import Link, Robot

THIN = 0.03
"""Least radius of gyration of a reference body along any axis, in shares of the arm's mean link length."""

ROUND = 1 / 3
"""Radius of gyration of a neutral body along any axis, in the same shares."""

LENGTH = 0.3
"""Link length [m] of an arm whose axes all meet."""

DESCRIPTION, NEUTRAL = "description", "neutral"


@dataclass(frozen=True, eq=False)
class Reference:
    """bodies (n, 4, 4): pseudo-inertia ≻ 0 of each link's reference [kg·m², kg·m, kg]; actuators (n,): Ia > 0
    [kg·m² or kg]; kinds, actuator_kinds (n,): "description" or "neutral"."""

    bodies: np.ndarray
    actuators: np.ndarray
    kinds: tuple[str, ...]
    actuator_kinds: tuple[str, ...]


def reference(regressor: Regressor, estimate: np.ndarray, description: bool) -> Reference:
    """The robot's own links where `description` allows it and they have mass, else neutral bodies; drives likewise.

    Neutral bodies are even balls about each O_j, all alike; together they have the mass that the largest of the base
    parameters in estimate (p,) needs at the arm's mean link length. A described link is thickened where it has no
    extent along some axis, or an inertia that no body has.
    """
    robot = regressor.robot
    length = mean_length(robot)
    mass = mass_scale(regressor, estimate, length) / robot.n
    bodies, actuators, kinds, actuator_kinds = [], [], [], []
    for joint in robot.joints:
        known = description and joint.link.mass > 0
        ball = np.diag([mass * (ROUND * length) ** 2] * 3 + [mass])
        bodies.append(_body(joint.link, THIN * length) if known else ball)
        stated = description and joint.drive.inertia > 0
        actuators.append(joint.drive.inertia if stated else ball[0, 0] if joint.revolute else mass)
        kinds.append(DESCRIPTION if known else NEUTRAL)
        actuator_kinds.append(DESCRIPTION if stated else NEUTRAL)
    return Reference(np.array(bodies), np.array(actuators), tuple(kinds), tuple(actuator_kinds))


def mean_length(robot: Robot) -> float:
    """Mean distance [m] between the origins of joint frames that lie apart."""
    distances = np.array([np.hypot(np.hypot(joint.d, joint.b), joint.r) for joint in robot.joints[1:]])
    apart = distances[distances > 0]
    return float(apart.mean()) if len(apart) else LENGTH


def mass_scale(regressor: Regressor, estimate: np.ndarray, length: float) -> float:
    """Mass [kg] that puts the largest base parameter at `length` from its joint."""
    arms = {"kg": 1.0, "kg·m": length, "kg·m²": length**2}
    found = [abs(x) / arms[unit] for x, unit in zip(estimate, regressor.base.units, strict=False)]
    return max(max(found), 1e-6)


def _body(link: Link, thin: float) -> np.ndarray:
    """(4, 4) pseudo-inertia of a link with mass, no radius of gyration along any axis below `thin` [m]."""
    inertia = link.inertia_matrix
    values, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    second = axes @ np.diag(np.maximum(values, link.mass * thin**2)) @ axes.T
    com = np.array(link.com)
    body = np.empty((4, 4))
    body[:3, :3] = second + link.mass * np.outer(com, com)
    body[:3, 3] = body[3, :3] = link.mass * com
    body[3, 3] = link.mass
    return body
