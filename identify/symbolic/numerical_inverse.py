"""Inverse geometry by numbers: damped Newton steps, from one start to refine, from many where there is no formula."""

from __future__ import annotations

import numpy as np

from identify.robot.robot import Robot
from identify.symbolic.geometry import direct_geometry
from identify.symbolic.jacobian import jacobian

STARTS = 120
STEPS = 60
CONVERGED = 1e-11


def pose_error(robot: Robot, q: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 6) displacement and rotation vector (of small rotations) from ⁰T_n(q) to pose, and (N,) largest entry."""
    reached = direct_geometry(robot, q, robot.n - 1)
    difference = pose - reached
    # Half the sum of s × s' and its like is the sine of the angle about its axis.
    turn = 0.5 * np.cross(reached[:, :3, :3], pose[:, :3, :3], axisa=1, axisb=1, axisc=1).sum(axis=2)
    return np.concatenate([difference[:, :3, 3], turn], axis=1), np.abs(difference[:, :3]).max(axis=(1, 2))


def refine(
    robot: Robot, q: np.ndarray, pose: np.ndarray, steps: int = 3, within: float = 1e-3
) -> tuple[np.ndarray, np.ndarray]:
    """q (N, n) brought nearer to pose (N, 4, 4), and (N,) the largest entry of the remaining error.

    Takes off rounding errors that a formula near the edge of the workspace amplifies; never makes one worse.
    Positions with an error above `within` are left as they are.
    """
    q = q.copy()
    error, size = pose_error(robot, q, pose)
    for _ in range(steps):
        rows = np.flatnonzero((size > 1e-13) & (size < within))
        if not len(rows):
            break
        candidate = q[rows] + _step(robot, q[rows], error[rows], np.full(len(rows), 1e-14))
        new_error, new_size = pose_error(robot, candidate, pose[rows])
        better = new_size < size[rows]
        rows = rows[better]
        q[rows], error[rows], size[rows] = candidate[better], new_error[better], new_size[better]
    return q, size


def _step(robot: Robot, q: np.ndarray, error: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """(N, n) damped least-squares step (Wampler 1986; Nakamura & Hanafusa 1986)."""
    j = jacobian(robot, q)
    normal = np.swapaxes(j, 1, 2) @ j + damping[:, None, None] * np.eye(robot.n)
    return np.linalg.solve(normal, np.swapaxes(j, 1, 2) @ error[:, :, None])[:, :, 0]


def search(robot: Robot, pose: np.ndarray, current: np.ndarray) -> np.ndarray:
    """(k, n) solutions of ⁰T_n(q) = pose (4, 4) found by Newton from `current` and from STARTS seeded starts.

    Finds what it finds: other solutions may exist. Redundant robots have infinitely many; these are some.
    """
    rng = np.random.default_rng(0)
    q = np.vstack([current, rng.uniform(*_box(robot, pose), (STARTS, robot.n))])
    poses = np.broadcast_to(pose, (len(q), 4, 4))
    damping = np.full(len(q), 1e-3)
    error, size = pose_error(robot, q, poses)
    merit = np.linalg.norm(error, axis=1) + size
    for _ in range(STEPS):
        rows = np.flatnonzero(size > CONVERGED)
        if not len(rows):
            break
        candidate = q[rows] + _step(robot, q[rows], error[rows], damping[rows])
        new_error, new_size = pose_error(robot, candidate, poses[rows])
        new_merit = np.linalg.norm(new_error, axis=1) + new_size
        better = new_merit < merit[rows]
        damping[rows] = np.clip(np.where(better, damping[rows] * 0.1, damping[rows] * 8.0), 1e-14, 1e3)
        rows = rows[better]
        q[rows], error[rows] = candidate[better], new_error[better]
        size[rows], merit[rows] = new_size[better], new_merit[better]
    return q[size <= 100 * CONVERGED]


def _box(robot: Robot, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest starts: a full turn, and for prismatic joints their limits or as far as the pose."""
    far = float(np.linalg.norm(pose[:3, 3])) + sum(abs(j.d) + abs(j.r) + abs(j.b) for j in robot.joints)
    low, high = [], []
    for joint in robot.joints:
        a, b = (-np.pi, np.pi) if joint.revolute else (-far, far)
        if not joint.revolute:
            a, b = max(a, joint.limits.position[0]), min(b, joint.limits.position[1])
        low.append(min(a, b))
        high.append(max(a, b))
    return np.array(low), np.array(high)
