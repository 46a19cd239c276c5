"""Jacobian matrices [2.22]–[2.31]: in any frame, by three matrices, their determinant and singular configurations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from identify.errors import InputError
from identify.robot.robot import Robot
from identify.symbolic.geometry import frames, letters, path, positions, serial, transform
from identify.symbolic.model import SymbolicModel
from identify.symbolic.trigonometry import Algebra, algebra

if TYPE_CHECKING:
    import sympy

RANK_TOLERANCE = 1e-9

ENTRY_TOO_LONG = 200
"""Operations in an entry beyond which it is not expanded, as it would not get shorter."""

TOO_LONG = 1000
"""Operations in the entries of a Jacobian beyond which its determinant is not factored: it would take minutes."""


def jacobian(robot: Robot, q: np.ndarray, frame: int = 0, link: int | None = None) -> np.ndarray:
    """(N, 6, n) Jacobian ⁱJ of frame R_link (the last one if not given; index from 0) at q (n,) or (N, n).

    Velocity of its origin, then angular velocity, both in the axes of R_frame (numbered as in the chapter: 0 the
    base, j the frame of joint j) [2.29]. Rows in m/s and rad/s per rad/s or m/s.
    """
    q = positions(robot, q)
    checked_frame(robot, frame)
    all_frames = frames(robot, q)
    way = path(robot, link)
    tip = all_frames[:, way[-1], :3, 3] if way else np.zeros((len(q), 3))
    result = np.zeros((len(q), 6, robot.n))
    for k in way:
        axis = all_frames[:, k, :3, 2]
        if robot.joints[k].revolute:
            result[:, :3, k] = np.cross(axis, tip - all_frames[:, k, :3, 3])
            result[:, 3:, k] = axis
        else:
            result[:, :3, k] = axis
    if frame:
        back = np.swapaxes(all_frames[:, frame - 1, :3, :3], 1, 2)
        result[:, :3], result[:, 3:] = back @ result[:, :3], back @ result[:, 3:]
    return result


def checked_frame(robot: Robot, frame: int) -> int:
    """The number of a frame: 0 the base, j the frame of joint j. InputError if there is none of it."""
    if not 0 <= frame <= robot.n:
        raise InputError(f"{robot.name}: there is no frame {frame}; frames are numbered 0 to {robot.n}")
    return frame


def tool_jacobian(robot: Robot, q: np.ndarray) -> np.ndarray:
    """(N, 6, n) Jacobian of the tool frame in the axes of the world: velocity of its origin, then ω."""
    turn = np.array(robot.base)[:3, :3]
    result = jacobian(robot, q)
    arm = frames(robot, positions(robot, q))[:, -1, :3, :3] @ np.array(robot.tool)[:3, 3]
    result[:, :3] += np.cross(result[:, 3:], arm[:, :, None], axisa=1, axisb=1, axisc=1)
    result[:, :3], result[:, 3:] = turn @ result[:, :3], turn @ result[:, 3:]
    return result


def rank(matrix: np.ndarray) -> np.ndarray:
    """(N,) ranks of matrices (N, 6, n): singular values above 1e-9 of the largest."""
    values = np.linalg.svd(matrix, compute_uv=False)
    return (values > RANK_TOLERANCE * values[..., :1]).sum(axis=-1)


@lru_cache(maxsize=16)
def largest_rank(robot: Robot) -> int:
    """Rank of the Jacobian at an arbitrary configuration: the degrees of freedom of the operational space."""
    q = np.random.default_rng(4).uniform(-2.5, 2.5, (8, robot.n))
    return int(rank(jacobian(robot, q)).max())


@dataclass(frozen=True)
class ThreeMatrices:
    """ˢJ_n = turn · shift · core [2.30]: the first two are regular, `core` ⁱJ_{n,j} is of the same rank and simpler."""

    turn: sympy.Matrix
    shift: sympy.Matrix
    core: sympy.Matrix


def symbolic_matrix(robot: Robot, frame: int, point: int | None = None, space: Algebra | None = None) -> sympy.Matrix:
    """(6, n) ⁱJ_{n,j} [2.31] of link n at point O_j in the axes of R_frame; point n (not given): ⁱJ_n [2.28].

    In the symbols of `trigonometric`.
    """
    import sympy

    serial(robot)
    space = space or algebra(robot)
    point = robot.n if point is None else point
    columns = []
    end = transform(robot, frame, point)[:3, 3]
    for k, joint in enumerate(robot.joints, start=1):
        own = transform(robot, frame, k)
        turn, axis = own[:3, :3], own[:3, 2]
        if joint.revolute:
            # The same velocity two ways: turned from R_k, and across the difference of two points in R_frame.
            p, lever = transform(robot, k, point)[:3, 3], end - own[:3, 3]
            velocity = p[0] * turn[:, 1] - p[1] * turn[:, 0]
            entries = zip(velocity, axis.cross(lever), strict=True)
            shortest = [min((shorter(space, e) for e in pair), key=lambda e: e.count_ops()) for pair in entries]
            columns.append(sympy.Matrix([*shortest, *(shorter(space, e) for e in axis)]))
        else:
            columns.append(sympy.Matrix([*(shorter(space, e) for e in axis), 0, 0, 0]))
    return sympy.Matrix.hstack(*columns)


def shorter(space: Algebra, expression: sympy.Expr) -> sympy.Expr:
    """The expression as it is, or expanded with c² + s² = 1, whichever takes fewer operations; the former if long."""
    import sympy

    if expression.count_ops() > ENTRY_TOO_LONG:
        return expression
    expanded = space.expression(space.polynomial(expression))
    return min(expression, expanded, sympy.factor_terms(expanded), key=lambda e: e.count_ops())


def three_matrices(robot: Robot, frame: int, i: int, j: int) -> ThreeMatrices:
    """ˢJ_n with s = frame, by the intermediate frame R_i and point O_j [2.30], in joint variables."""
    import sympy

    space = algebra(robot)
    turn = transform(robot, frame, i)[:3, :3]
    reach = transform(robot, i, j)[:3, :3] * transform(robot, j, robot.n)[:3, 3]
    x, y, z = (shorter(space, e) for e in reach)
    shift = sympy.eye(6)
    shift[:3, 3:] = sympy.Matrix([[0, z, -y], [-z, 0, x], [y, -x, 0]])
    return ThreeMatrices(
        space.to_joint_variables(sympy.diag(turn, turn)),
        space.to_joint_variables(shift),
        space.to_joint_variables(symbolic_matrix(robot, i, j, space)),
    )


@dataclass(frozen=True)
class Singularity:
    """A factor whose zero makes the Jacobian lose rank, and where it is zero.

    joint: index of the joint it is solved for; values: its positions, exact angles or expressions in the other
    joints; `generic_rank` the rank there (at an arbitrary such configuration), None where no position is real.
    """

    factor: sympy.Expr
    joint: int | None
    values: tuple[sympy.Expr, ...]
    generic_rank: int | None


@dataclass(frozen=True)
class Determinant:
    """Factors of the determinant of ⁱJ_n (n = 6), or for n ≠ 6 of what all its largest minors share.

    value: product of `factors` for a square Jacobian, None otherwise; full_rank: the largest rank of J; factored:
    False where the entries are too long for that, as those of arms with axes at any angle: then there are no factors.
    never: one of those minors is a number, so that no configuration is singular.
    """

    value: sympy.Expr | None
    factors: tuple[sympy.Expr, ...]
    full_rank: int
    singularities: tuple[Singularity, ...]
    factored: bool = True
    never: bool = False


@lru_cache(maxsize=16)
def determinant(robot: Robot) -> Determinant:
    """Determinant, factored, and singular configurations of the robot's Jacobian, in joint variables."""
    import sympy

    space = algebra(serial(robot))
    full = largest_rank(robot)
    if symbolic_matrix(robot, robot.n // 2, None, space).applyfunc(lambda e: e.count_ops()).norm(1) > TOO_LONG:
        return Determinant(None, (), full, (), factored=False)
    best = min(
        (symbolic_matrix(robot, i, point, space) for i in range(robot.n + 1) for point in {i, robot.n}),
        key=lambda m: (sum(e != 0 for e in m), m.applyfunc(lambda e: e.count_ops()).norm(1)),
    )
    entries = [[space.polynomial(best[i, k]) for k in range(robot.n)] for i in range(6)]
    common, never = space.ring.zero, False
    for rows in combinations(range(6), full):
        for columns in combinations(range(robot.n), full):
            minor = _minor(space, entries, rows, columns, {})
            never = never or bool(minor and minor.is_ground)
            common = minor if not common else common.gcd(minor) if minor else common
    constant, powers = sympy.factor_list(space.expression(_separated(space, common)))
    factors = [factor for factor, power in powers for _ in range(power)]
    value = space.to_joint_variables(sympy.Mul(constant, *factors)) if full == 6 == robot.n else None
    moving = [f for f in dict.fromkeys(factors) if f.free_symbols & _variables(space)]
    return Determinant(
        value,
        (constant, *(space.to_joint_variables(f) for f in factors)),
        full,
        tuple(_singularity(space, f) for f in moving),
        never=never,
    )


def _variables(space: Algebra) -> set[sympy.Symbol]:
    own = [k for pair in space.angles.values() for k in pair] + list(space.prismatic.values())
    return {space.symbols[k] for k in own}


def _minor(
    space: Algebra, entries: Sequence[Sequence[Any]], rows: Sequence[int], columns: Sequence[int], seen: dict
) -> Any:
    """Determinant of the rows and columns, along the row with the fewest entries."""
    if not rows:
        return space.ring.one
    key = (tuple(rows), tuple(columns))
    if key not in seen:
        at = min(range(len(rows)), key=lambda i: sum(bool(entries[rows[i]][k]) for k in columns))
        left = [*rows[:at], *rows[at + 1 :]]
        total = space.ring.zero
        for position, k in enumerate(columns):
            if entries[rows[at]][k]:
                others = [*columns[:position], *columns[position + 1 :]]
                part = _minor(space, entries, left, others, seen)
                total += (-1) ** (at + position) * entries[rows[at]][k] * part
        seen[key] = space.reduce(total)
    return seen[key]


def _separated(space: Algebra, polynomial: Any) -> Any:
    """The polynomial with sums of angles written out, if it then has no more terms."""
    rules = []
    for angle, (c, s) in space.angles.items():
        if len(angle) > 1:
            cosine, sine = space.ring.one, space.ring.zero
            for j, sign in angle:
                cj, sj = (space.ring.gens[k] for k in space.angles[((j, 1),)])
                cosine, sine = cosine * cj - sign * sine * sj, sine * cj + sign * cosine * sj
            rules += [(space.ring.gens[c], cosine), (space.ring.gens[s], sine)]
    if not rules or not polynomial:
        return polynomial
    written = space.reduce(polynomial.compose(rules))
    return written if len(written) <= len(polynomial) else polynomial


def _singularity(space: Algebra, factor: sympy.Expr) -> Singularity:
    """Where the factor is zero: solved for a joint in which it is linear in r, or in cosine and sine."""
    import sympy

    robot = space.robot
    expression = space.to_joint_variables(factor)
    variables = [sympy.Symbol(f"q{j + 1}") for j in range(robot.n)]
    for j in reversed(range(robot.n)):
        if variables[j] not in expression.free_symbols:
            continue
        values = _zeros(sympy.expand_trig(expression), variables[j], robot.joints[j].revolute)
        if values is not None:
            return Singularity(expression, j, values, _rank_at(robot, j, values))
    return Singularity(expression, None, (), None)


def _zeros(expression: sympy.Expr, q: sympy.Symbol, revolute: bool) -> tuple[sympy.Expr, ...] | None:
    """Zeros of the expression in q, None where it is not linear in q, or in cos q and sin q."""
    import sympy

    c, s = sympy.Symbol("_c"), sympy.Symbol("_s")
    unknown = (c, s) if revolute else (q,)
    replaced = expression.xreplace({sympy.cos(q): c, sympy.sin(q): s}) if revolute else expression
    if revolute and q in replaced.free_symbols:
        return None
    polynomial = sympy.Poly(replaced, *unknown)
    if polynomial.total_degree() != 1:
        return None
    parts = [sympy.factor_terms(polynomial.coeff_monomial(x)) for x in (*unknown, 1)]
    if not revolute:
        return (sympy.simplify(-parts[1] / parts[0]),)
    y, x, z = parts[0], parts[1], -parts[2]
    if z == 0:
        first = sympy.atan2(-y, x) if y != 0 else sympy.Integer(0)
        return (first, first + sympy.pi)
    middle = sympy.atan2(x, y)
    return tuple(middle + sign * sympy.acos(z / sympy.sqrt(x**2 + y**2)) for sign in (1, -1))


def _rank_at(robot: Robot, j: int, values: Sequence[sympy.Expr]) -> int | None:
    """The largest rank at a few configurations with joint j at the given values."""
    import sympy

    rng = np.random.default_rng(5)
    lengths = {sympy.Symbol(name): value for name, value in letters(robot)}
    found = []
    for q in rng.uniform(-2.5, 2.5, (40, robot.n)):
        for value in values:
            own = {sympy.Symbol(f"q{k + 1}"): x for k, x in enumerate(q)}
            number = complex(value.xreplace(lengths).subs(own).evalf())
            if abs(number.imag) < 1e-12:
                at = q.copy()
                at[j] = number.real
                found.append(int(rank(jacobian(robot, at))[0]))
        if len(found) > 3:
            break
    return max(found) if found else None


def _without_singularities(robot: Robot, found: Determinant) -> str:
    """Why no singular configuration is listed."""
    minors = math.comb(6, found.full_rank) * math.comb(robot.n, found.full_rank)
    if minors == 1 or found.never:
        return "no singular configuration: the rank is the same everywhere"
    return (
        f"no singular configuration listed: the rank falls where all minors of order {found.full_rank} are zero"
        " together, and they share no factor to solve for; rank and manipulability give numbers"
    )


def symbolic_jacobian(robot: Robot, frame: int | None = None) -> SymbolicModel:
    """ⁱJ_n as entries J11 … J6n in joint variables; the frame in the middle of the chain if none is given."""
    frame = robot.n // 2 if frame is None else checked_frame(robot, frame)
    space = algebra(serial(robot))
    matrix = symbolic_matrix(robot, frame, None, space)
    names = {
        f"J{i + 1}{k + 1}" if robot.n < 10 else f"J{i + 1}_{k + 1}": (i, k) for i in range(6) for k in range(robot.n)
    }
    found = determinant(robot)
    notes = [
        f"Jacobian of R{robot.n} in the axes of R{frame}: rows velocity of O{robot.n}, then angular velocity",
        f"largest rank {found.full_rank}; " + ("redundant" if robot.n > found.full_rank else "not redundant"),
    ]
    if found.value is not None:
        notes.append(f"determinant = {found.value}")
    if not found.factored:
        notes.append("determinant not factored, its axes are at too many angles; rank and manipulability give numbers")
    for singular in found.singularities:
        where = (
            " or ".join(f"q{singular.joint + 1} = {v}" for v in singular.values) if singular.joint is not None else ""
        )
        notes.append(f"singular where {singular.factor} = 0" + (f": {where}" if where else ""))
    if found.factored and not found.singularities:
        notes.append(_without_singularities(robot, found))
    expressions = {name: space.to_joint_variables(matrix[i, k]) for name, (i, k) in names.items()}
    inputs = tuple(f"q{j + 1}" for j in range(robot.n))
    return SymbolicModel(robot.name, "jacobian", expressions, inputs, letters(robot), tuple(notes))
