"""A load's ten parameters as a body: mass, centre of mass, inertia about it; and the nearest body that can be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.errors import InputError
from identify.estimation.payload import TEN, root_of_information
from identify.estimation.physical import pseudo_inertias

LEAST = 1e-6
"""Share of its size in every direction that a possible body keeps: P ⪰ LEAST·P₀, which is ≻ 0."""

PULL = 1e-3
"""Weight of the pull towards a ball, for what the data leave open: a body twice the ball adds so much to the cost, in
which one σ of a parameter adds 1."""

SIZE = 0.05
"""Radius of gyration along any axis [m] of that ball."""

_UPPER = np.triu_indices(3)


@dataclass(frozen=True, eq=False)
class PossibleBody:
    """The possible load nearest to an estimate: parameters (10,) XX … M about O_n; moved: whether they differ from the
    estimate; cost: δᵀ·Λ·δ of how far, so that one parameter off by one standard deviation costs 1; eigenvalue: the
    smallest of the estimate's own pseudo-inertia, and least: that of the possible body's, SI."""

    parameters: np.ndarray
    moved: bool
    cost: float
    eigenvalue: float
    least: float


def body_values(load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(10,) mass [kg], centre of mass x y z [m] in R_n, Ixx Ixy Ixz Iyy Iyz Izz [kg·m²] about it in the axes of R_n, of
    parameters (10,) XX … M about O_n; and their derivatives (10, 10) with respect to those. The mass is not zero."""
    mass, first = load[9], load[6:9]
    values, slopes = np.zeros(TEN), np.zeros((TEN, TEN))
    values[0], slopes[0, 9] = mass, 1.0
    values[1:4], slopes[1:4, 6:9], slopes[1:4, 9] = first / mass, np.eye(3) / mass, -first / mass**2
    # Huygens and Steiner: I = J − (h·h·1 − h·hᵀ)/m, h the first moments.
    values[4:] = load[:6] - _steiner(first, first)[_UPPER] / mass
    slopes[4:, :6] = np.eye(6)
    for k, axis in enumerate(np.eye(3)):
        slopes[4:, 6 + k] = -(_steiner(first, axis) + _steiner(axis, first))[_UPPER] / mass
    slopes[4:, 9] = _steiner(first, first)[_UPPER] / mass**2
    return values, slopes


def _steiner(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(3, 3) a·b·1 − ½(a·bᵀ + b·aᵀ)."""
    return a @ b * np.eye(3) - (np.outer(a, b) + np.outer(b, a)) / 2


def seen_from(transform: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives (10, 10) and values (10,) of a body's `body_values` (10,) in another frame.

    transform (4, 4) holds the body's present frame in the other one.
    """
    rotation = transform[:3, :3]
    slopes = np.zeros((TEN, TEN))
    slopes[0, 0] = 1.0
    slopes[1:4, 1:4] = rotation
    for k, (i, j) in enumerate(zip(*_UPPER, strict=True)):
        unit = np.zeros((3, 3))
        unit[i, j] = unit[j, i] = 1.0
        slopes[4:, 4 + k] = (rotation @ unit @ rotation.T)[_UPPER]
    moved = slopes @ values
    moved[1:4] += transform[:3, 3]
    return slopes, moved


def smallest_eigenvalue(load: np.ndarray) -> float:
    """Smallest eigenvalue of the load's pseudo-inertia [[½tr(I)·1 − I, h], [hᵀ, m]]; SI."""
    return float(np.linalg.eigvalsh(pseudo_inertias(np.append(load, 0.0))[0])[0])


def nearest_body(load: np.ndarray, covariance: np.ndarray, told: np.ndarray) -> PossibleBody:
    """The body with pseudo-inertia ≻ 0 nearest to parameters (10,) in the norm of their covariance's inverse.

    covariance (10, 10), zero along what is not told; told (k, 10): rows that span what is. A semidefinite programme of
    ten unknowns (Traversaro et al. 2016; Wensing, Kim & Slotine 2018). What is not told is pulled weakly to an even
    ball of that mass about the centre of mass. InputError if the solver finds no solution.
    """
    eigenvalue = smallest_eigenvalue(load)
    mass = max(float(load[9]), float(np.sqrt(covariance[9, 9])), 1e-6)
    centre = load[6:9] / mass if load[9] > 0 else np.zeros(3)
    shape = np.zeros((4, 4))
    shape[:3, :3] = mass * (SIZE**2 * np.eye(3) + np.outer(centre, centre))
    shape[:3, 3] = shape[3, :3] = mass * centre
    shape[3, 3] = mass
    lower = np.linalg.inv(np.linalg.cholesky(shape))
    maps = np.array([lower @ pseudo_inertias(np.append(e, 0.0))[0] @ lower.T for e in np.eye(TEN)])
    least = float(np.linalg.eigvalsh(np.tensordot(load, maps, 1))[0])
    if len(told) == TEN and least >= LEAST:
        return PossibleBody(load, False, 0.0, eigenvalue, eigenvalue)
    root = root_of_information(told @ covariance @ told.T) @ told
    found = _solved(maps, root, load, open_=len(told) < TEN)
    shift = root @ (found - load)
    return PossibleBody(found, True, float(shift @ shift), eigenvalue, smallest_eigenvalue(found))


def _solved(maps: np.ndarray, root: np.ndarray, load: np.ndarray, open_: bool) -> np.ndarray:
    """(10,) φ least in ‖root·(φ − load)‖² with Σ φ_k·maps_k ⪰ LEAST·1, and where `open_` the pull to 1 beside it."""
    import clarabel
    from scipy import sparse

    columns = np.array([(i, j) for j in range(4) for i in range(j + 1)]).T
    twice = np.where(columns[0] == columns[1], 1.0, np.sqrt(2.0))
    triangle = (maps[:, columns[0], columns[1]] * twice).T  # (10, 10): φ to the triangle that Clarabel reads
    even = (columns[0] == columns[1]).astype(float)
    pulled = np.sqrt(PULL) if open_ else 0.0
    stacked = np.vstack([root, pulled * triangle])
    start = np.linalg.lstsq(stacked, np.concatenate([root @ load, pulled * even]), rcond=None)[0]
    stretch = np.linalg.inv(np.linalg.qr(stacked, mode="r"))
    # φ = start + stretch·w: the objective is ‖w‖², and v = w / size of order one.
    size = max(float(np.linalg.norm(np.linalg.solve(stretch, np.linalg.solve(triangle, even) - start))), 1.0)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    solver = clarabel.DefaultSolver(
        2 * sparse.eye(TEN, format="csc"),
        np.zeros(TEN),
        sparse.csc_matrix(-size * triangle @ stretch),
        triangle @ start - LEAST * even,
        [clarabel.PSDTriangleConeT(4)],
        settings,
    )
    solution = solver.solve()
    if str(solution.status) not in ("Solved", "AlmostSolved"):
        raise InputError(f"no possible load was found near the estimate: the solver ended with {solution.status}")
    found = start + size * stretch @ np.array(solution.x)
    # What the solver's precision left outside the cone is brought inside.
    values, axes = np.linalg.eigh(np.tensordot(found, maps, 1))
    inside = (axes * np.maximum(values, LEAST)) @ axes.T
    return np.linalg.solve(triangle, inside[columns[0], columns[1]] * twice)
