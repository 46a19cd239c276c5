"""The limits that a motion is planned within: a robot's own, and plain defaults where it has none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.robot.robot import Joint, Robot


@dataclass(frozen=True, eq=False)
class WorkingLimits:
    """Limits of n joints, all (n,), SI: low and high position, velocity and acceleration are finite; effort may be
    infinite, which means that it is not limited."""

    low: np.ndarray
    high: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray

    @property
    def middle(self) -> np.ndarray:
        """(n,) middle of the position range."""
        return (self.low + self.high) / 2

    @property
    def half(self) -> np.ndarray:
        """(n,) half of the position range."""
        return (self.high - self.low) / 2


def working_limits(robot: Robot) -> WorkingLimits:
    """The robot's limits. Where one is infinite this stands for it: ±1.5 rad about zero (3 rad of room beside a
    single finite side), 1.5 rad/s, 3 rad/s²; prismatic: ±0.3 m (0.6 m of room), 0.3 m/s, 0.6 m/s²."""
    size = np.array([1.0 if joint.revolute else 0.2 for joint in robot.joints])
    low, high = np.array([_position_range(joint) for joint in robot.joints]).T
    velocity = np.array([joint.limits.velocity for joint in robot.joints])
    acceleration = np.array([joint.limits.acceleration for joint in robot.joints])
    return WorkingLimits(
        low=low,
        high=high,
        velocity=np.where(np.isfinite(velocity), velocity, 1.5 * size),
        acceleration=np.where(np.isfinite(acceleration), acceleration, 3.0 * size),
        effort=np.array([joint.limits.effort for joint in robot.joints]),
    )


def _position_range(joint: Joint) -> tuple[float, float]:
    """Position limits of a joint, with 3 rad or 0.6 m of room where a side has none."""
    low, high = joint.limits.position
    room = 3.0 if joint.revolute else 0.6
    if np.isinf(low) and np.isinf(high):
        return -room / 2, room / 2
    return (high - room if np.isinf(low) else low), (low + room if np.isinf(high) else high)
