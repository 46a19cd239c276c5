"""From base parameters back to standard ones: some set that maps to them, and one that a physical robot could have."""

from __future__ import annotations

import numpy as np

from identify.robot.robot import Robot
from identify.symbolic.base_parameters import base_parameters

MARGIN = 1e-4
"""Smallest eigenvalue of a pseudo-inertia that is asked for, in units of kg with lengths in units of LENGTH."""

LENGTH = 0.3
"""Length [m] that makes masses, first and second moments of an arm's link alike in size."""

MASS_COST = 1e-7
"""Keeps masses that nothing determines from growing."""


def any_standard(robot: Robot, base: np.ndarray) -> np.ndarray:
    """(11 n,) the standard parameters nearest to unit-mass links without inertia that map to base (p,)."""
    matrix = base_parameters(robot).matrix
    start = np.tile([0.0] * 9 + [1.0, 0.0], robot.n)
    return start + np.linalg.lstsq(matrix, base - matrix @ start, rcond=None)[0]


def consistent_standard(robot: Robot, base: np.ndarray) -> np.ndarray | None:
    """(11 n,) physically consistent standard parameters that map exactly to base (p,), or None where there are none.

    Consistent: every link's pseudo-inertia [[½tr(I)·1 − I, h], [hᵀ, m]] ≻ 0 (Wensing, Kim & Slotine 2018) and every
    actuator inertia ≥ 0. A feasibility problem over the standard parameters, solved by Clarabel.
    """
    import clarabel
    from scipy import sparse

    n, m = robot.n, 11 * robot.n
    matrix = base_parameters(robot).matrix
    unit = np.tile([LENGTH**2] * 6 + [LENGTH] * 3 + [1.0, LENGTH**2], n)
    pseudo = _pseudo_inertia_rows()
    # Variables: scaled standard parameters and the margin t. Clarabel: minimise qᵀx with b − A x in the cones.
    equality = matrix * unit
    scale = np.linalg.norm(equality, axis=1)
    blocks = [np.hstack([equality / scale[:, None], np.zeros((len(base), 1))])]
    right = [base / scale]
    cones = [clarabel.ZeroConeT(len(base))]
    identity = np.array([1.0, 0, 1, 0, 0, 1, 0, 0, 0, 1])
    for j in range(n):
        block = np.zeros((10, m + 1))
        block[:, 11 * j : 11 * j + 10] = -pseudo
        block[:, m] = identity
        blocks.append(block)
        right.append(np.zeros(10))
        cones.append(clarabel.PSDTriangleConeT(4))
    bounds = np.zeros((n + 1, m + 1))
    bounds[np.arange(n), 11 * np.arange(n) + 10] = -1.0
    bounds[n, m] = 1.0
    blocks.append(bounds)
    right.append(np.array([0.0] * n + [MARGIN]))
    cones.append(clarabel.NonnegativeConeT(n + 1))
    cost = np.zeros(m + 1)
    cost[9:m:11] = MASS_COST
    cost[m] = -1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    a = sparse.csc_matrix(np.vstack(blocks))
    empty = sparse.csc_matrix((m + 1, m + 1))
    solution = clarabel.DefaultSolver(empty, cost, a, np.concatenate(right), cones, settings).solve()
    if solution.x is None or not np.all(np.isfinite(solution.x)):
        return None
    x = np.array(solution.x[:m]) * unit
    x += np.linalg.lstsq(matrix * unit, base - matrix @ x, rcond=None)[0] * unit
    return x if smallest_eigenvalues(x).min() > 0 and x[10::11].min() >= 0 else None


def smallest_eigenvalues(standard: np.ndarray) -> np.ndarray:
    """(n,) smallest eigenvalue of each link's pseudo-inertia, from standard parameters (11 n,); SI."""
    values = []
    for xx, xy, xz, yy, yz, zz, mx, my, mz, mass, _ in standard.reshape(-1, 11):
        half = (xx + yy + zz) / 2
        values.append(
            np.linalg.eigvalsh(
                [
                    [half - xx, -xy, -xz, mx],
                    [-xy, half - yy, -yz, my],
                    [-xz, -yz, half - zz, mz],
                    [mx, my, mz, mass],
                ]
            )[0]
        )
    return np.array(values)


def _pseudo_inertia_rows() -> np.ndarray:
    """(10, 10) takes XX … M to the upper triangle, column by column, of the pseudo-inertia, off-diagonals times √2."""
    root = np.sqrt(2.0)
    rows = np.zeros((10, 10))
    xx, xy, xz, yy, yz, zz, mx, my, mz, mass = range(10)
    for at, sign in ((0, (-1, 1, 1)), (2, (1, -1, 1)), (5, (1, 1, -1))):
        rows[at, [xx, yy, zz]] = np.array(sign) / 2
    for at, parameter in ((1, xy), (3, xz), (4, yz)):
        rows[at, parameter] = -root
    for at, parameter in ((6, mx), (7, my), (8, mz)):
        rows[at, parameter] = root
    rows[9, mass] = 1.0
    return rows
