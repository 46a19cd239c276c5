"""The robot as symbols: transforms, velocities, accelerations and gravity of every link, in its own frame.

Vectors are triples and matrices triples of rows, of expressions of one graph; symbols are q1 …, dq1 …, ddq1 ….
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from identify.robot.robot import Joint, Robot
from identify.symbolic.expression import Expression, Graph, Scalar, cos, sin

Vec = tuple[Scalar, Scalar, Scalar]
Mat = tuple[Vec, Vec, Vec]

ANGLE_TOLERANCE = 1e-9
"""Angles closer than this [rad] to a multiple of π/2 are taken to be it: nine decimals of π/2 are meant exactly."""


def quarter_turns(angle: float) -> int | None:
    """The angle in quarter turns modulo 4 where it is a whole number of them, else None."""
    turns = round(angle / (math.pi / 2))
    return turns % 4 if abs(angle - turns * math.pi / 2) < ANGLE_TOLERANCE else None


def exact_cos_sin(angle: float) -> tuple[float, float]:
    """(cos, sin), exactly 0 and ±1 at multiples of π/2."""
    k = quarter_turns(angle)
    return (math.cos(angle), math.sin(angle)) if k is None else ((1, 0), (0, 1), (-1, 0), (0, -1))[k]


def cross(a: Vec, b: Vec) -> Vec:
    """a × b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a: Sequence, b: Sequence) -> Scalar:
    """Σ a·b, of any length."""
    total: Scalar = 0
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


def add(*vectors: Vec) -> Vec:
    """The sum of one vector or more."""
    x, y, z = vectors[0]
    for v in vectors[1:]:
        x, y, z = x + v[0], y + v[1], z + v[2]
    return (x, y, z)


def times(x: Scalar, v: Vec) -> Vec:
    """x·v."""
    return (x * v[0], x * v[1], x * v[2])


def column(a: Mat, i: int) -> Vec:
    """Column i of A."""
    return (a[0][i], a[1][i], a[2][i])


def is_zero(x: Scalar) -> bool:
    """Whether it is the number zero, or the constant."""
    return (x.value if isinstance(x, Expression) else x) == 0


def number(x: Scalar) -> float:
    """Its value where it is a number or a constant; 0 for any other expression."""
    return x.value or 0.0 if isinstance(x, Expression) else x


def transpose(a: Mat) -> Mat:
    """Aᵀ."""
    return ((a[0][0], a[1][0], a[2][0]), (a[0][1], a[1][1], a[2][1]), (a[0][2], a[1][2], a[2][2]))


def matvec(a: Mat, v: Vec) -> Vec:
    """A·v."""
    return (dot(a[0], v), dot(a[1], v), dot(a[2], v))


def matmul(a: Mat, b: Mat) -> Mat:
    """A·B."""
    columns = transpose(b)
    return tuple(tuple(dot(row, column) for column in columns) for row in a)  # type: ignore[return-value]


def rotation_z(c: Scalar, s: Scalar) -> Mat:
    """Rot(z, θ) from cos θ and sin θ."""
    return ((c, -s, 0), (s, c, 0), (0, 0, 1))


def rotation_x(c: Scalar, s: Scalar) -> Mat:
    """Rot(x, α) from cos α and sin α."""
    return ((1, 0, 0), (0, c, -s), (0, s, c))


def place(cs_gamma: tuple, b: Scalar, cs_alpha: tuple, d: Scalar, cs_theta: tuple, r: Scalar) -> tuple[Mat, Vec]:
    """Rotation A and translation P of Rot(z,γ) Trans(z,b) Rot(x,α) Trans(x,d) Rot(z,θ) Trans(z,r) [2.3].

    Angles come as (cos, sin), in whatever arithmetic the caller works.
    """
    before = matmul(rotation_z(*cs_gamma), rotation_x(*cs_alpha))
    rotation = matmul(before, rotation_z(*cs_theta))
    position = add((0, 0, b), matvec(before, (d, 0, r)))
    return rotation, position


@dataclass(frozen=True)
class SymbolicLink:
    """State of link j in its own frame R_j.

    rotation ʲ⁻¹A_j and position ʲ⁻¹P_j of R_j in its parent's frame; omega, alpha angular velocity and
    acceleration; velocity of O_j; acceleration of O_j less gravity [2.83], [2.75]; gravity 0g in R_j;
    height: −0g·⁰P_j. `partial[i]` holds (∂ω_j/∂q̇_i, ∂V_j/∂q̇_i) for every joint i on the way to the base.
    """

    rotation: Mat
    position: Vec
    omega: Vec
    velocity: Vec
    alpha: Vec
    acceleration: Vec
    gravity: Vec
    height: Scalar
    partial: dict[int, tuple[Vec, Vec]]


def joint_transform(graph: Graph, joint: Joint, j: int, letters: bool) -> tuple[Mat, Vec]:
    """A_j and P_j with the variable q{j+1}; lengths stay letters where the robot names them and `letters` is set."""
    names = dict(joint.symbols) if letters else {}

    def length(key: str) -> Scalar:
        return graph.symbol(names[key]) if key in names else graph.constant(getattr(joint, key))

    def turn(angle: float) -> tuple[Scalar, Scalar]:
        c, s = exact_cos_sin(angle)
        return graph.constant(c), graph.constant(s)

    q = graph.symbol(f"q{j + 1}")
    theta, r = turn(joint.theta), length("r")
    if joint.revolute:
        # A constant offset of a multiple of π/2 only swaps and signs cos q and sin q.
        c, s = cos(q), sin(q)
        theta = (c * theta[0] - s * theta[1], s * theta[0] + c * theta[1])
    else:
        r = r + q
    return place(turn(joint.gamma), length("b"), turn(joint.alpha), length("d"), theta, r)


def symbolic_links(graph: Graph, robot: Robot, letters: bool = False) -> list[SymbolicLink]:
    """Forward recurrence over the robot's links [2.79]–[2.83], with 0g folded into the acceleration of the base."""
    zero: Scalar = graph.constant(0)
    one: Scalar = graph.constant(1)
    null: Vec = (zero, zero, zero)
    g: Vec = tuple(graph.constant(x) for x in robot.gravity)  # type: ignore[assignment]
    minus_g: Vec = tuple(graph.constant(-x) for x in robot.gravity)  # type: ignore[assignment]
    links: list[SymbolicLink] = []
    for j, joint in enumerate(robot.joints):
        rotation, position = joint_transform(graph, joint, j, letters)
        if joint.parent < 0:
            omega0, v0, alpha0, a0, g0, height0, partial0 = null, null, null, minus_g, g, zero, {}
        else:
            p = links[joint.parent]
            omega0, v0, alpha0, a0, g0 = p.omega, p.velocity, p.alpha, p.acceleration, p.gravity
            height0, partial0 = p.height, p.partial
        back = transpose(rotation)
        dq, ddq = graph.symbol(f"dq{j + 1}"), graph.symbol(f"ddq{j + 1}")
        omega = matvec(back, omega0)
        velocity = matvec(back, add(v0, cross(omega0, position)))
        alpha = matvec(back, alpha0)
        pull = add(a0, cross(alpha0, position), cross(omega0, cross(omega0, position)))
        acceleration = matvec(back, pull)
        partial = {i: (matvec(back, a), matvec(back, add(v, cross(a, position)))) for i, (a, v) in partial0.items()}
        if joint.revolute:
            alpha = add(alpha, (omega[1] * dq, -(omega[0] * dq), ddq))
            omega = add(omega, (zero, zero, dq))
            partial[j] = ((zero, zero, one), null)
        else:
            coriolis = (2 * (omega[1] * dq), -(2 * (omega[0] * dq)), ddq)
            acceleration = add(acceleration, coriolis)
            velocity = add(velocity, (zero, zero, dq))
            partial[j] = (null, (zero, zero, one))
        links.append(
            SymbolicLink(
                rotation, position, omega, velocity, alpha, acceleration,
                matvec(back, g0), height0 - dot(g0, position), partial,
            )
        )  # fmt: skip
    return links


def input_symbols(graph: Graph, n: int, *prefixes: str) -> list[Expression]:
    """Symbols prefix1 … prefixn of every prefix, in order."""
    return [graph.symbol(f"{prefix}{j + 1}") for prefix in prefixes for j in range(n)]
