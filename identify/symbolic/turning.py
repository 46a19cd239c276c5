"""How links turn and move, seen from themselves and from the link before the parallel axes that they turn on."""

from __future__ import annotations

from dataclasses import dataclass

from identify.robot.robot import Robot
from identify.symbolic.chain import (
    Mat,
    Vec,
    exact_cos_sin,
    is_zero,
    matmul,
    matvec,
    rotation_x,
    rotation_z,
    transpose,
)
from identify.symbolic.expression import Expression, Graph, Scalar, cos, sin
from identify.symbolic.form import Form, turn_symbol


@dataclass(frozen=True)
class Turn:
    """Rotation of R_j against link `seen_from`: a constant one, then an angle about z_j given by cosine and sine.

    `angle` is its variable part, to which the angles of further parallel axes add; 0 where there is none.
    """

    seen_from: int
    fixed: Mat
    cosine: Scalar
    sine: Scalar
    angle: Scalar

    def inwards(self, v: Vec) -> Vec:
        """A vector of the link seen from, in R_j."""
        return self.turned_back(matvec(transpose(self.fixed), v))

    def turned_back(self, v: Vec) -> Vec:
        """A vector in axes that do not turn with the joint, in R_j."""
        x, y, z = v
        return (self.cosine * x + self.sine * y, self.cosine * y - self.sine * x, z)

    def about_axis(self, v: Vec) -> Vec:
        """A vector of R_j, turned back by the angle about z_j alone."""
        x, y, z = v
        return (self.cosine * x - self.sine * y, self.sine * x + self.cosine * y, z)


@dataclass(frozen=True)
class Motions:
    """ω, ω̇, U = ω̇^ + ω^ω^ (rows), U33 − U22, U11 − U33, U22 − U11, the squares of ω, and ω1·ω2 of a link."""

    omega: Vec
    alpha: Vec
    u: Mat
    differences: Vec
    squares: Vec
    p12: Scalar

    def turned(self, x: Scalar, y: Scalar) -> tuple[Scalar, Scalar]:
        """What the turning about z alone makes of a point (x, y): its acceleration."""
        s3, spin = self.squares[2], self.alpha[2]
        return -(s3 * x + spin * y), spin * x - s3 * y


@dataclass(frozen=True)
class Lengths:
    """Offsets d, r, b of the joints in a unit [m]; a prismatic joint's r holds its variable.

    With `letters`, a length that the robot names, D3, is that symbol, and in a unit other than the metre D3u, its ratio
    to the unit; D3i is the inverse of that. `named` is the name of the unit, the length that is 1 without a symbol.
    """

    graph: Graph
    robot: Robot
    letters: bool
    unit: float = 1.0
    named: str | None = None

    def of(self, j: int) -> Vec:
        joint = self.robot.joints[j]
        r = self._length(j, "r")
        return self._length(j, "d"), r if joint.revolute else r + self.graph.symbol(f"q{j + 1}"), self._length(j, "b")

    def inverse(self, j: int) -> Scalar:
        """1/d of joint j, which is not zero."""
        d = self._length(j, "d")
        if d.value is not None:
            return 1 / d.value
        return self.graph.symbol(f"{dict(self.robot.joints[j].symbols).get('d', f'd{j + 1}')}i")

    def _length(self, j: int, key: str) -> Expression:
        joint = self.robot.joints[j]
        name, value = dict(joint.symbols).get(key), getattr(joint, key)
        if self.letters and value:
            if name is not None and name == self.named:
                return self.graph.constant(1)
            if name is not None:
                return self.graph.symbol(name if self.unit == 1.0 else f"{name}u")
            if self.named is not None:
                return self.graph.symbol(f"{key}{j + 1}u")
        return self.graph.constant(value / self.unit)


def turns_of(
    graph: Graph, robot: Robot, j: int, turns: list[tuple[Turn, Turn]], by_constant: bool
) -> tuple[Turn, Turn]:
    """Rotation of R_j against its parent, and against the furthest link that it turns on parallel axes to;
    `by_constant`: of the frame turned about z_j by `turn_symbol`."""
    joint = robot.joints[j]

    def constants(angle: float) -> tuple[Scalar, Scalar]:
        c, s = exact_cos_sin(angle)
        return graph.constant(c), graph.constant(s)

    def turned(angle: Scalar, offset: float) -> tuple[Scalar, Scalar]:
        """Cosine and sine of the variable angle plus a constant; right angles only swap and sign them."""
        c, s = constants(offset)
        if not isinstance(angle, Expression):
            return c, s
        return cos(angle) * c - sin(angle) * s, sin(angle) * c + cos(angle) * s

    cg, sg = constants(joint.gamma)
    ca, sa = constants(joint.alpha)
    fixed = matmul(rotation_z(cg, sg), rotation_x(ca, sa))
    variable: Scalar = graph.symbol(f"q{j + 1}") if joint.revolute else 0
    if by_constant:
        variable = variable + graph.symbol(turn_symbol(j))
    step = Turn(joint.parent, fixed, *turned(variable, joint.theta), variable)
    if joint.parent < 0 or not joint.revolute:
        return step, step
    before = turns[joint.parent][1]
    parallel = sa.value == 0 and sg.value == 0 and cg.value == 1  # type: ignore[union-attr]
    if not parallel or not isinstance(before.angle, Expression):
        return step, step
    # Rot(z,a) Rot(x,α) Rot(z,b) = Rot(x,α) Rot(z, b ± a) for α = 0 or π.
    chain = joint.parent
    offset, total = joint.theta, variable
    along = before.angle if ca.value == 1 else -before.angle  # type: ignore[union-attr]
    constant = robot.joints[chain].theta
    while turns[chain][1].seen_from != robot.joints[chain].parent:
        flipped = exact_cos_sin(robot.joints[chain].alpha)[0]
        chain = robot.joints[chain].parent
        constant += flipped * robot.joints[chain].theta
    offset += constant if ca.value == 1 else -constant  # type: ignore[union-attr]
    total = total + along
    sight = Turn(before.seen_from, matmul(before.fixed, rotation_x(ca, sa)), *turned(total, offset), total)
    return step, sight


def motions_of(
    omega: Vec, spin: Scalar, third: Vec, form: Form, read: tuple[bool, bool], row: Vec | None = None
) -> Motions:
    """U and what else the moments read, from ω, ω̇3 and the third column of U; `row`: another way to U31 and U32."""
    u13, u23, u33 = third
    p12, p13, p23 = omega[0] * omega[1], omega[0] * omega[2], omega[1] * omega[2]
    alpha = (p23 - u23, u13 - p13, spin)
    u31, u32 = p13 - alpha[1], p23 + alpha[0]
    if form.doubled_rate or row:
        # Where one of ω1 and ω2 is zero, doubling the other serves all links on parallel axes.
        twice = [2 * omega[2] * omega[i] if not is_zero(omega[1 - i]) else 2 * omega[i] * omega[2] for i in (0, 1)]
        others = row or (twice[0] - u13, twice[1] - u23)
        u31, u32 = u31 if read[1] else others[0], u32 if read[0] else others[1]
    s1, s2, s3 = (rate * rate for rate in omega)
    u22 = -(s1 + s3)
    if form.shared_squares:
        d13 = s1 - s3
        u11 = d13 + u33
        differences = (u33 - u22, d13, u22 - u11)
    else:
        u11 = -(s2 + s3)
        differences = (s3 - s2, s1 - s3, s2 - s1)
    u = ((u11, p12 - spin, u13), (p12 + spin, u22, u23), (u31, u32, u33))
    return Motions(omega, alpha, u, differences, (s1, s2, s3), p12)
