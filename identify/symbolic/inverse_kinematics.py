"""Inverse kinematic model [2.34]–[2.41]: joint velocities for a velocity of the end frame.

Velocities are (…, 6): that of O_n, then the angular velocity, in the axes of one frame. All functions take one
Jacobian (6, n) or a stack (N, 6, n), and velocities of matching shape.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from identify.errors import InputError
from identify.robot.robot import Robot
from identify.symbolic.geometry import letters, positions, serial, transform
from identify.symbolic.jacobian import checked_frame, jacobian, largest_rank, shorter, symbolic_matrix
from identify.symbolic.model import SymbolicModel
from identify.symbolic.trigonometry import Algebra, algebra

if TYPE_CHECKING:
    import sympy

RANK = 1e-9
"""Share of the largest singular value below which another counts as zero."""

SINGULAR = 1e-2
"""Share of the largest singular value below which damping sets in."""

DAMPING = 1e-2
"""Largest damping factor, as a share of the largest singular value."""

DIFFERENCE = 1e-6
"""Step of the central differences [rad or m]."""


def pseudo_inverse(matrix: np.ndarray) -> np.ndarray:
    """(…, n, 6) J⁺ [2.38]: singular values below RANK times the largest count as zero."""
    return np.linalg.pinv(np.asarray(matrix, dtype=float), rcond=RANK)


def damped_inverse(matrix: np.ndarray, freedom: int | None = None) -> np.ndarray:
    """(…, n, 6) inverse with factors σ/(σ² + λ²) for 1/σ, of each singular value σ: bounded through a singularity.

    λ² = (1 − (σ_min/ε)²) λ_max² below ε = SINGULAR·σ_max and 0 above (Nakamura & Hanafusa 1986; Maciejewski &
    Klein 1988), so that the solution is exact away from singularities; λ_max = DAMPING·σ_max. freedom: largest rank
    the robot's Jacobian has anywhere (min(6, n) if not given); singular values beyond it count as zero.
    """
    u, s, vt = np.linalg.svd(np.asarray(matrix, dtype=float), full_matrices=False)
    largest = np.maximum(s[..., :1], np.finfo(float).tiny)
    freedom = s.shape[-1] if freedom is None else freedom
    near = np.minimum(s[..., freedom - 1 : freedom] / (SINGULAR * largest), 1.0)
    square = (1.0 - near**2) * (DAMPING * largest) ** 2
    factors = s / np.maximum(s * s + square, np.finfo(float).tiny)
    factors[..., freedom:] = 0.0
    return np.swapaxes(vt, -1, -2) @ (factors[..., None] * np.swapaxes(u, -1, -2))


def joint_velocity(
    robot: Robot,
    q: np.ndarray,
    velocity: np.ndarray,
    frame: int = 0,
    criterion: Callable[[np.ndarray], np.ndarray] | None = None,
    gain: float = 0.0,
) -> np.ndarray:
    """(N, n) joint velocities at q (n,) or (N, n) that give `velocity` (6,) or (N, 6) of R_n in the axes of R_frame.

    Exact where the Jacobian is regular, damped near singularities. criterion: gradient ∇φ of a function of q
    (`away_from_limits`, `toward_manipulability`, or the caller's: (N, n) -> (N, n)); its projection on the null
    space, times `gain`, uses what freedom is left [2.40]: gain > 0 lets φ grow, gain < 0 lets it fall.
    """
    q = positions(robot, q)
    matrix = jacobian(robot, q, frame)
    wanted = np.broadcast_to(np.asarray(velocity, dtype=float), (len(q), 6))
    result = (damped_inverse(matrix, largest_rank(robot)) @ wanted[:, :, None])[:, :, 0]
    if criterion is not None and gain:
        result = result + gain * null_space_part(matrix, criterion(q))
    return result


def null_space_part(matrix: np.ndarray, z: np.ndarray) -> np.ndarray:
    """(…, n) (I_n − J⁺J) Z of [2.39]: the part of joint velocities Z (…, n) that leaves the end frame at rest."""
    matrix = np.asarray(matrix, dtype=float)
    z = np.asarray(z, dtype=float)[..., None]
    return (z - pseudo_inverse(matrix) @ (matrix @ z))[..., 0]


def limit_distance(robot: Robot, q: np.ndarray) -> np.ndarray:
    """(N,) φ(q) = Σ ((q_j − middle_j)/range_j)², over joints with two limits: small far from them (Fournier 1980)."""
    middle, span, bounded = _ranges(robot)
    scaled = np.where(bounded, (positions(robot, q) - middle) / span, 0.0)
    return (scaled**2).sum(axis=1)


def away_from_limits(robot: Robot) -> Callable[[np.ndarray], np.ndarray]:
    """Gradient of −`limit_distance`: with a positive gain, joints move towards the middle of their range."""
    middle, span, bounded = _ranges(robot)

    def gradient(q: np.ndarray) -> np.ndarray:
        return np.where(bounded, -2 * (positions(robot, q) - middle) / span**2, 0.0)

    return gradient


def _ranges(robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middle and width of every joint's range, and whether it has one."""
    limits = np.array([joint.limits.position for joint in robot.joints])
    bounded = np.all(np.isfinite(limits), axis=1) & (limits[:, 1] > limits[:, 0])
    low, high = np.where(bounded[:, None], limits, [-1.0, 1.0]).T
    return (low + high) / 2, high - low, bounded


def manipulability(robot: Robot, q: np.ndarray) -> np.ndarray:
    """(N,) w(q): product of the singular values that are not zero everywhere; √det(J Jᵀ) of Yoshikawa (1984)."""
    values = np.linalg.svd(jacobian(robot, positions(robot, q)), compute_uv=False)
    return values[:, : largest_rank(robot)].prod(axis=1)


def toward_manipulability(robot: Robot) -> Callable[[np.ndarray], np.ndarray]:
    """Gradient of `manipulability` by central differences: with a positive gain, away from singularities."""

    def gradient(q: np.ndarray) -> np.ndarray:
        q = positions(robot, q)
        moves = DIFFERENCE * np.eye(robot.n)
        pairs = [manipulability(robot, q + move) - manipulability(robot, q - move) for move in moves]
        return np.stack(pairs, axis=1) / (2 * DIFFERENCE)

    return gradient


def symbolic_inverse_kinematics(robot: Robot, frame: int | None = None) -> SymbolicModel:
    """ⁱJ_n⁻¹ as entries K11 … K66 in joint variables: by blocks [2.37] where ⁱJ_n has the form [2.36].

    InputError where it has not, and for n ≠ 6: the entries of ⁱJ_n⁻¹ would fill pages or do not exist. frame: the
    middle of the chain if not given.
    """
    space = algebra(serial(robot))
    inputs = tuple(f"q{j + 1}" for j in range(robot.n))
    if robot.n != 6:
        what = "J+ with an optimisation term [2.40]" if robot.n > 6 else "J+ [2.38]"
        raise InputError(
            f"{robot.name}: J is 6 x {robot.n} and has no inverse to print; joint_velocity gives numbers ({what})"
        )
    i = robot.n // 2 if frame is None else checked_frame(robot, frame)
    for point in (6, 5, 4):
        core = symbolic_matrix(robot, i, point, space)
        if all(e == 0 for e in core[:3, 3:]) and _regular(space, core):
            inverse = block_inverse(space, core) * _shift(space, robot, i, point)
            names = {f"K{r + 1}{c + 1}": (r, c) for r in range(6) for c in range(6)}
            entries = {name: space.to_joint_variables(inverse[at]) for name, at in names.items()}
            note = f"inverse of the Jacobian of R6 in the axes of R{i}: by its blocks at O{point} [2.37]"
            notes = (note, "qdot = K [V; omega]; no entry exists where the determinant is zero: see jacobian")
            return SymbolicModel(robot.name, "inverse-kinematics", entries, inputs, letters(robot), notes)
    raise InputError(
        f"{robot.name}: no inverse to print: no point gives J the form [A 0; B C] [2.36] (no spherical wrist); "
        "joint_velocity inverts it numerically"
    )


def _shift(space: Algebra, robot: Robot, frame: int, point: int) -> sympy.Matrix:
    """(6, 6) from the velocity of O_n to that of O_point on the same link, in the axes of R_frame [2.30]."""
    import sympy

    reach = transform(robot, frame, point)[:3, :3] * transform(robot, point, robot.n)[:3, 3]
    x, y, z = (shorter(space, e) for e in reach)
    result = sympy.eye(6)
    result[:3, 3:] = sympy.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return result


def _regular(space: Algebra, matrix: sympy.Matrix) -> bool:
    """Whether both diagonal blocks have a determinant that is not zero everywhere."""
    return all(_adjugate(space, block)[1] for block in (matrix[:3, :3], matrix[3:, 3:]))


def _adjugate(space: Algebra, block: sympy.Matrix) -> tuple[list[list], object]:
    """Adjugate and determinant of a (3, 3) block as polynomials."""
    m = [[space.polynomial(block[r, c]) for c in range(3)] for r in range(3)]

    def minor(r: int, c: int) -> object:
        (a, b), (d, e) = ([m[i][k] for k in range(3) if k != c] for i in range(3) if i != r)
        return space.reduce((-1) ** (r + c) * (a * e - b * d))

    adjugate = [[minor(c, r) for c in range(3)] for r in range(3)]
    total = sum((m[0][k] * adjugate[k][0] for k in range(3)), space.ring.zero)
    return adjugate, space.reduce(total)


def _inverse(space: Algebra, block: sympy.Matrix) -> sympy.Matrix:
    """Inverse of a regular (3, 3) block: every entry a quotient without common factors."""
    import sympy

    adjugate, det = _adjugate(space, block)

    def entry(r: int, c: int) -> sympy.Expr:
        above, below = adjugate[r][c].cancel(det)
        return sympy.factor(space.expression(above)) / sympy.factor(space.expression(below))

    return sympy.Matrix(3, 3, entry)


def block_inverse(space: Algebra, matrix: sympy.Matrix) -> sympy.Matrix:
    """(6, 6) inverse [[A⁻¹, 0], [−C⁻¹ B A⁻¹, C⁻¹]] of [[A, 0], [B, C]] with (3, 3) blocks [2.36], [2.37]."""
    import sympy

    if any(e != 0 for e in matrix[:3, 3:]):
        raise InputError("the Jacobian has no block of zeros in its upper right; use pseudo_inverse")
    a, c = _inverse(space, matrix[:3, :3]), _inverse(space, matrix[3:, 3:])
    lower = (-c * matrix[3:, :3] * a).applyfunc(lambda e: sympy.factor(sympy.together(e)) if e != 0 else e)
    return sympy.Matrix.vstack(sympy.Matrix.hstack(a, sympy.zeros(3, 3)), sympy.Matrix.hstack(lower, c))
