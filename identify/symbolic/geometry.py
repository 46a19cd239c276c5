"""Direct geometric model [2.3]–[2.4], [2.10]: exact in sympy, and in NumPy for many positions at once.

Runs of joints with parallel axes are multiplied as one, so that their angles appear as sums: cos(q2 + q3).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from identify.errors import InputError
from identify.robot.robot import Joint, Matrix, Robot
from identify.robot.transforms import placement
from identify.symbolic.model import SymbolicModel

if TYPE_CHECKING:
    import sympy

TWELFTH = math.pi / 12
TOLERANCE = 1e-9
"""Angles closer than this [rad] to a multiple of π/12 are taken to be it; sums of lengths this small [m] are zero."""

Angle = tuple[tuple[int, int], ...]
"""A sum of joint variables: (joint index, ±1) pairs by index, the first with sign +1."""

POSE = ("sx", "sy", "sz", "nx", "ny", "nz", "ax", "ay", "az", "Px", "Py", "Pz")
"""Entries of a pose [2.8], [2.13], column by column: s, n, a, P."""


def path(robot: Robot, link: int | None = None) -> list[int]:
    """Indices of the joints from the base to a link (the last one if not given), in this order."""
    j = robot.n - 1 if link is None else link
    if not -1 <= j < robot.n:
        raise InputError(f"{robot.name}: there is no link {link}; links are numbered 0 to {robot.n - 1}, -1 the base")
    way: list[int] = []
    while j >= 0:
        way.append(j)
        j = robot.joints[j].parent
    return way[::-1]


def serial(robot: Robot) -> Robot:
    """The robot, if its joints follow one another; a tree has no one end frame."""
    if any(joint.parent != j - 1 for j, joint in enumerate(robot.joints)):
        raise InputError(f"{robot.name}: its joints branch; keep the joints of one branch for this model")
    return robot


def exact_angle(angle: float) -> sympy.Expr:
    """The angle as a multiple of π where it is one of π/12, else as the rational number it prints as."""
    import sympy

    turns = round(angle / TWELFTH)
    if abs(angle - turns * TWELFTH) < TOLERANCE:
        return turns * sympy.pi / 12
    return exact_number(angle)


def exact_number(value: float) -> sympy.Expr:
    """The decimal number as a fraction: 0.45 becomes 9/20."""
    import sympy

    fraction = Fraction(repr(float(value)))
    return sympy.Rational(fraction.numerator, fraction.denominator)


def length(joint: Joint, key: str) -> sympy.Expr:
    """A length of the joint [m]: its letter where the robot names it, else its exact value."""
    import sympy

    value = getattr(joint, key)
    name = dict(joint.symbols).get(key)
    return sympy.Symbol(name) if name and value else exact_number(value)


def letters(robot: Robot) -> tuple[tuple[str, float], ...]:
    """(letter, value [m]) of every length that symbolic models keep as a letter."""
    found = {name: float(getattr(joint, key)) for joint in robot.joints for key, name in joint.symbols}
    return tuple(found.items())


@dataclass(frozen=True)
class Segment:
    """A run of joints with parallel axes as one transform, in symbols.

    rotation (3, 3) and position (3,) hold cosines and sines of `angle` sums as the symbols of `trigonometric`.
    """

    rotation: sympy.Matrix
    position: sympy.Matrix


def canonical(angle: dict[int, int]) -> tuple[Angle, int]:
    """The angle with its first sign +1, and the sign taken out."""
    pairs = tuple(sorted((j, s) for j, s in angle.items() if s))
    sign = pairs[0][1] if pairs else 1
    return tuple((j, s * sign) for j, s in pairs), sign


def trigonometric(angle: Angle) -> tuple[sympy.Symbol, sympy.Symbol]:
    """Symbols of the angle's cosine and sine: C23 for cos(q2 + q3), C2m3 for cos(q2 − q3), C10_11 from joint 10 on."""
    import sympy

    separator = "_" if any(j > 8 for j, _ in angle) else ""
    name = separator.join(("" if s > 0 else "m") + str(j + 1) for j, s in angle)
    return sympy.Symbol("C" + name), sympy.Symbol("S" + name)


def angle_sum(angle: Angle) -> sympy.Expr:
    """The angle in joint variables: q2 + q3."""
    import sympy

    return sympy.Add(*(s * sympy.Symbol(f"q{j + 1}") for j, s in angle))


def cosine_sine(angle: dict[int, int], constant: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
    """Cosine and sine of a sum of joint variables and a constant angle, in the symbols of `trigonometric`."""
    import sympy

    c0, s0 = sympy.cos(constant), sympy.sin(constant)
    key, sign = canonical(angle)
    if not key:
        return c0, s0
    c, s = trigonometric(key)
    s = sign * s
    return c * c0 - s * s0, s * c0 + c * s0


def segments(robot: Robot, first: int, last: int, start: bool = True) -> Iterator[tuple[Segment, list[Angle]]]:
    """The transform from R_{first-1} to R_last (joint indices from 0) as segments, with the angles they use.

    start=False leaves out the constant screw that leads to the axis of joint `first`.
    """
    import sympy

    j = first
    while j <= last:
        joint = robot.joints[j]
        lead, p = sympy.eye(3), sympy.zeros(3, 1)
        if start or j > first:
            gamma, alpha = exact_angle(joint.gamma), exact_angle(joint.alpha)
            cg, sg, ca, sa = sympy.cos(gamma), sympy.sin(gamma), sympy.cos(alpha), sympy.sin(alpha)
            turn = sympy.Matrix([[cg, -sg, 0], [sg, cg, 0], [0, 0, 1]])
            lead = turn * sympy.Matrix([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
            p = turn * sympy.Matrix([length(joint, "d"), 0, length(joint, "b")])
        inner, used = [sympy.Integer(0)] * 3, []
        angle: dict[int, int] = {}
        constant, sense = sympy.Integer(0), 1
        while True:
            constant += sense * exact_angle(joint.theta)
            r = length(joint, "r")
            if joint.revolute:
                angle[j] = sense
                used.append(canonical(angle)[0])
            else:
                r += sympy.Symbol(f"q{j + 1}")
            inner[2] += sense * r
            j += 1
            if j > last or sympy.sin(exact_angle(robot.joints[j].alpha)) != 0:
                break
            joint = robot.joints[j]
            constant += sense * exact_angle(joint.gamma)
            inner[2] += sense * length(joint, "b")
            c, s = cosine_sine(angle, constant)
            inner[0] += c * length(joint, "d")
            inner[1] += s * length(joint, "d")
            sense *= int(sympy.cos(exact_angle(joint.alpha)))
        c, s = cosine_sine(angle, constant)
        turned = sympy.Matrix([[c, -s * sense, 0], [s, c * sense, 0], [0, 0, sense]])
        yield Segment(lead * turned, p + lead * sympy.Matrix(inner)), used


def to_joint_variables(robot: Robot, expression: sympy.Basic) -> sympy.Basic:
    """Symbols C23, S23 … replaced by cos(q2 + q3), sin(q2 + q3) …."""
    import sympy

    replace: dict[sympy.Symbol, sympy.Expr] = {}
    for _, used in segments(robot, 0, robot.n - 1):
        for i in range(len(used)):
            for key in (used[i], *differences(used, i)):
                c, s = trigonometric(key)
                replace[c], replace[s] = sympy.cos(angle_sum(key)), sympy.sin(angle_sum(key))
    return expression.xreplace(replace)


def differences(used: Sequence[Angle], i: int) -> Iterator[Angle]:
    """The angles from a later joint of a run to joint i of it."""
    for k in range(i):
        left = dict(used[i])
        for j, _ in used[k]:
            left.pop(j)
        yield canonical(left)[0]


def transform(robot: Robot, first: int, last: int) -> sympy.Matrix:
    """(4, 4) from R_first to R_last in the symbols of `trigonometric`; frames by their number, 0 the base.

    Nested as the chapter writes it (example 2.2): products are taken from the right and left unexpanded.
    """
    import sympy

    serial(robot)
    rotation, position = sympy.eye(3), sympy.zeros(3, 1)
    if last < first:
        back = transform(robot, last, first)
        rotation = back[:3, :3].T
        position = -rotation * back[:3, 3]
    for segment, _ in reversed(list(segments(robot, first, last - 1))):
        rotation, position = segment.rotation * rotation, segment.position + segment.rotation * position
    result = sympy.eye(4)
    result[:3, :3], result[:3, 3] = rotation, position
    return result


def exact_matrix(matrix: Matrix) -> sympy.Matrix:
    """A (4, 4) transform as exact numbers."""
    import sympy

    return sympy.Matrix(4, 4, lambda i, j: exact_number(matrix[i][j]))


def symbolic_direct_geometry(robot: Robot, placed: bool = False) -> SymbolicModel:
    """Direct geometric model ⁰T_n, as the twelve named entries of [2.8].

    placed: between world and tool instead, Z ⁰T_n E of [2.10].
    """
    matrix = transform(robot, 0, robot.n)
    frames = f"pose of R{robot.n} in R0"
    if placed:
        matrix = exact_matrix(robot.base) * matrix * exact_matrix(robot.tool)
        frames = "pose of the tool in the world: Z · 0Tn · E"
    entries = [to_joint_variables(robot, matrix[i, k]) for k in range(4) for i in range(3)]
    return SymbolicModel(
        robot.name,
        "direct-geometry",
        dict(zip(POSE, entries, strict=True)),  # type: ignore[arg-type]
        tuple(f"q{j + 1}" for j in range(robot.n)),
        letters(robot),
        (f"{frames}; columns s, n, a are its axes, P its origin",),
    )


def joint_transforms(joint: Joint, q: np.ndarray) -> np.ndarray:
    """(N, 4, 4) parent frame to R_j at joint positions q (N,) [rad or m]."""
    constant = placement(joint.gamma, joint.b, joint.alpha, joint.d, joint.theta, joint.r)
    result = np.empty((len(q), 4, 4))
    result[:] = constant
    if joint.revolute:
        c, s = np.cos(q)[:, None], np.sin(q)[:, None]
        result[:, :, 0] = c * constant[:, 0] + s * constant[:, 1]
        result[:, :, 1] = c * constant[:, 1] - s * constant[:, 0]
    else:
        result[:, :, 3] += q[:, None] * constant[:, 2]
    return result


def frames(robot: Robot, q: np.ndarray) -> np.ndarray:
    """(N, n, 4, 4) frames R_1 … R_n in R_0 at joint positions q (N, n) [rad or m]."""
    q = positions(robot, q)
    result = np.empty((len(q), robot.n, 4, 4))
    for j, joint in enumerate(robot.joints):
        own = joint_transforms(joint, q[:, j])
        result[:, j] = result[:, joint.parent] @ own if joint.parent >= 0 else own
    return result


def positions(robot: Robot, q: np.ndarray) -> np.ndarray:
    """(N, n) joint positions, of one sample (n,) or of many."""
    q = np.atleast_2d(np.asarray(q, dtype=float))
    if q.ndim != 2 or q.shape[1] != robot.n:
        raise InputError(f"{robot.name}: q has shape {q.shape}; give (n,) or (N, n) with n = {robot.n}")
    return q


def direct_geometry(robot: Robot, q: np.ndarray, link: int | None = None) -> np.ndarray:
    """(N, 4, 4) pose of the tool in the world, Z ⁰T_n E [2.10], at q (n,) or (N, n) [rad or m].

    link: index of another link, whose own frame in the world is then given (Z ⁰T_j), -1 for the base.
    """
    q = positions(robot, q)
    base = np.array(robot.base)
    way = path(robot, link)
    result = np.broadcast_to(base, (len(q), 4, 4))
    for j in way:
        result = result @ joint_transforms(robot.joints[j], q[:, j])
    return result @ np.array(robot.tool) if link is None else np.array(result)
