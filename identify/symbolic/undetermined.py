"""Which joints a pose leaves undetermined: those that move on while the tool stays where it is."""

from __future__ import annotations

import numpy as np

from identify.robot.robot import Robot
from identify.symbolic.geometry import direct_geometry, positions
from identify.symbolic.jacobian import jacobian
from identify.symbolic.numerical_inverse import refine

NEARLY = 1e-6
"""Share of the largest singular value below which a direction is tried."""

STEP = 0.2
"""How far [rad or m] joints are moved on trial."""

MOVED = 1e-3
"""What a joint must have moved to count [rad or m]; `REACHED` how near the tool must stay [m, 1]."""

REACHED = 1e-9


def undetermined(robot: Robot, q: np.ndarray) -> np.ndarray:
    """(N, n) whether each joint can move, others following, at positions q (n,) or (N, n) with the tool at rest.

    Found by a step along each direction in which the Jacobian loses rank, and Newton steps back to the pose: at a wrist
    singularity they end far away; at a stretched elbow, a double solution, they end where they began.
    """
    q = positions(robot, q)
    result = np.zeros(q.shape, dtype=bool)
    poses = direct_geometry(robot, q, robot.n - 1)
    for k, matrix in enumerate(jacobian(robot, q)):
        _, values, vt = np.linalg.svd(matrix)
        padded = np.concatenate([values, np.zeros(robot.n - len(values))])
        for direction in vt[padded <= NEARLY * values[0]]:
            for sign in (1.0, -1.0):
                tried = q[k] + sign * STEP * direction
                found, error = refine(robot, tried[None], poses[k : k + 1], steps=30, within=1.0)
                moved = np.abs(found[0] - q[k])
                if error[0] <= REACHED and moved.max() > STEP / 4:
                    result[k] |= moved > MOVED
    return result
