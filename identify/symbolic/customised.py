"""Customised inverse dynamics: the recurrence of Newton and Euler with as few operations as the arm's structure allows.

The state of link j is its angular velocity, the acceleration of O_j less gravity, and U = ω̇^ + ω^ω^, the matrix that
takes a point of the link to its acceleration about O_j. Three facts make it cheap:

- a point on the axis z_j belongs to the link before it too, so that the third column of U_j is a column of the parent's
  U, turned: ω̇ is never propagated, and U33 = −ω1² − ω2² often comes for nothing;
- with the second moments Σ = ∫ r rᵀ dm for the inertia, the moment of a link is the skew part of U Σ and the force
  U·MS + M·V̇: products of entries of U that other terms need as well;
- links on parallel axes turn against the link before them by the sum of the joint angles: what is seen from there, and
  the moments across the axes on their way back, take one turn instead of several.

Parameters are the second-moment ones, `second_moments` (SXX = ∫x² dm …); which of them are zero is the choice of
`representative`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from identify.robot.robot import Joint, Robot
from identify.symbolic.chain import (
    Mat,
    Vec,
    add,
    cross,
    exact_cos_sin,
    matmul,
    matvec,
    rotation_x,
    rotation_z,
    transpose,
)
from identify.symbolic.expression import Expression, Graph, Scalar, cos, sin

SECOND_MOMENTS = ("SXX", "SXY", "SXZ", "SYY", "SYZ", "SZZ", "MX", "MY", "MZ", "M", "Ia")
"""Parameters of one link and its drive: ∫ r rᵀ dm, ∫ r dm and ∫ dm about O_j in R_j, and the actuator inertia."""

XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M, IA = range(11)


@dataclass(frozen=True)
class Motion:
    """What drives the recurrence: velocities and accelerations (n,) of the joints, 0g, and a wrench on the last link.

    force and moment (3,) that the last link exerts on its surroundings, in its frame at its origin [2.62].
    """

    dq: list[Scalar]
    ddq: list[Scalar]
    gravity: Vec
    force: Vec = (0, 0, 0)
    moment: Vec = (0, 0, 0)

    @staticmethod
    def of(
        graph: Graph, robot: Robot, *, dq: bool = True, ddq: bool = True, gravity: bool = True, wrench: bool = False
    ) -> Motion:
        """Symbols dq1 …, ddq1 …, and F1 F2 F3, N1 N2 N3 of the wrench; what is switched off is zero."""

        def symbols(prefix: str, count: int, there: bool) -> list[Scalar]:
            return [graph.symbol(f"{prefix}{j + 1}") if there else graph.constant(0) for j in range(count)]

        return Motion(
            symbols("dq", robot.n, dq),
            symbols("ddq", robot.n, ddq),
            tuple(graph.constant(x if gravity else 0.0) for x in robot.gravity),  # type: ignore[arg-type]
            tuple(symbols("F", 3, wrench)),  # type: ignore[arg-type]
            tuple(symbols("N", 3, wrench)),  # type: ignore[arg-type]
        )


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
        x, y, z = matvec(transpose(self.fixed), v)
        return (self.cosine * x + self.sine * y, self.cosine * y - self.sine * x, z)

    def about_axis(self, v: Vec) -> Vec:
        """A vector of R_j, turned back by the angle about z_j alone."""
        x, y, z = v
        return (self.cosine * x - self.sine * y, self.sine * x + self.cosine * y, z)

    def outwards(self, v: Vec) -> Vec:
        """A vector of R_j, in the frame of the link seen from."""
        return matvec(self.fixed, self.about_axis(v))


@dataclass(frozen=True)
class Form:
    """How one link is written. `shared_squares`: ω2² from U33 and ω1². `doubled_rate`: U31 and U32 through 2ω3, where
    ω̇ is not needed. `unturned`: the moment of the second moments in axes that do not turn with the joint, which
    pays where the link before hardly turns (the closed form of links on parallel axes behind a fixed one), and for the
    last link. `unturned_first`: the first moments and the mass likewise, for a link seen from the one before it."""

    shared_squares: bool = True
    doubled_rate: bool = False
    unturned: bool = False
    unturned_first: bool = False


@dataclass(frozen=True)
class Motions:
    """ω, ω̇, U = ω̇^ + ω^ω^ (rows), U33 − U22, U11 − U33, U22 − U11, and ω1·ω2 of a link."""

    omega: Vec
    alpha: Vec
    u: Mat
    differences: Vec
    p12: Scalar


def customised_torque(
    graph: Graph,
    robot: Robot,
    parameters: Sequence[Scalar],
    motion: Motion,
    letters: bool = False,
    forms: Sequence[Form] | None = None,
) -> list[Scalar]:
    """(n,) effort for second-moment parameters (11 n,), by the recurrence described above.

    `letters` keeps the lengths the robot names as symbols. `forms` (n,) says for each link which of several equal ways
    to write it; the count differs, the value does not.
    """
    zero = graph.constant(0)
    null: Vec = (zero, zero, zero)
    n, forms = robot.n, forms or [Form()] * robot.n
    lengths = _Lengths(graph, robot, letters)
    turns: list[tuple[Turn, Turn]] = []
    states: list[Motions] = []
    unturned: list[Motions] = []
    accelerations: list[tuple[Vec, Vec]] = []
    rest = Motions(null, null, (null, null, null), null, zero)
    pull: Vec = tuple(-x for x in motion.gravity)  # type: ignore[assignment]
    for j, joint in enumerate(robot.joints):
        turns.append(_turns(graph, robot, j, turns))
        step, sight = turns[j]
        parent = states[joint.parent] if joint.parent >= 0 else rest
        far = states[sight.seen_from] if sight.seen_from >= 0 else rest
        dq, ddq = (motion.dq[j], motion.ddq[j]) if joint.revolute else (zero, zero)
        back = transpose(step.fixed)
        rate, spin = matvec(back, parent.omega)[2] + dq, matvec(back, parent.alpha)[2] + ddq
        third = matvec(far.u, tuple(row[2] for row in sight.fixed))  # type: ignore[arg-type]
        seen = sight.inwards(far.omega)
        states.append(_matrix((seen[0], seen[1], rate), spin, sight.inwards(third), forms[j]))
        level = matvec(transpose(sight.fixed), far.omega)
        aslant = matvec(transpose(sight.fixed), third)
        unturned.append(_matrix((level[0], level[1], rate), spin, aslant, forms[j]))
        a = accelerations[joint.parent][0] if joint.parent >= 0 else pull
        accelerations.append(_acceleration(parent, a, states[j], step, lengths.of(j), joint, motion, j))
    force, moment = [null] * n, [null] * n
    force[-1], moment[-1] = motion.force, motion.moment
    torque: list[Scalar] = [zero] * n
    for j in reversed(range(n)):
        joint, k = robot.joints[j], parameters[11 * j : 11 * j + 11]
        step, sight = turns[j]
        f, m = force[j], moment[j]
        # What is computed in axes that do not turn with the joint: its moment across the axis waits for the way back.
        f_level, m_level = null, null
        if forms[j].unturned:
            m_level = _unturned_moment(unturned[j], k, sight.cosine, sight.sine)
        else:
            m = add(m, _inertial_moment(states[j], k))
        if forms[j].unturned_first and joint.revolute and sight is step:
            first = step.about_axis(tuple(k[MX : MZ + 1]))  # type: ignore[arg-type]
            f_level, m_first = _first_wrench(unturned[j].u, accelerations[j][1], first, k[M])
            m_level = add(m_level, m_first)
        else:
            own, m_first = _first_wrench(states[j].u, accelerations[j][0], tuple(k[MX : MZ + 1]), k[M])  # type: ignore[arg-type]
            f, m = add(f, own), add(m, m_first)
        m = add(m, (zero, zero, m_level[2]))
        f = add(f, (zero, zero, f_level[2]))
        torque[j] = (m if joint.revolute else f)[2] + k[IA] * motion.ddq[j]
        if joint.parent < 0:
            continue
        d, r, b = lengths.of(j)
        f = add(step.about_axis(f), (f_level[0], f_level[1], zero))
        lever = matvec(step.fixed, (-(r * f[1]), r * f[0] - d * f[2], d * f[1]))
        f = matvec(step.fixed, f)
        along = matvec(step.fixed, (zero, zero, m[2]))
        moment[joint.parent] = add(moment[joint.parent], along, lever, (-(b * f[1]), b * f[0], zero))
        force[joint.parent] = add(force[joint.parent], f)
        if sight.seen_from >= 0:
            # Across parallel axes the moment goes straight to the link before the first of them.
            across = add(sight.about_axis((m[0], m[1], zero)), (m_level[0], m_level[1], zero))
            moment[sight.seen_from] = add(moment[sight.seen_from], matvec(sight.fixed, across))
    return torque


def _first_wrench(u: Mat, a: Vec, first: Vec, mass: Scalar) -> tuple[Vec, Vec]:
    """Force U·MS + M·V̇ and moment MS×V̇ of the first moments and the mass."""
    force: Vec = tuple(  # type: ignore[assignment]
        u[i][0] * first[0] + u[i][1] * first[1] + u[i][2] * first[2] + a[i] * mass for i in range(3)
    )
    return force, cross(first, a)


def _acceleration(
    parent: Motions, a: Vec, own: Motions, step: Turn, lengths: Vec, joint: Joint, motion: Motion, j: int
) -> tuple[Vec, Vec]:
    """Acceleration of O_j less gravity: the parent's, and U times the offset of the frames; in R_j, and in axes that do
    not turn with the joint."""
    d, r, b = lengths
    offset = matvec(parent.u, tuple(row[0] for row in step.fixed))  # type: ignore[arg-type]
    pull = add(a, tuple(d * x for x in offset), tuple(b * row[2] for row in parent.u))  # type: ignore[arg-type]
    axis = matvec(parent.u, tuple(row[2] for row in step.fixed))  # type: ignore[arg-type]
    level = matvec(transpose(step.fixed), add(pull, tuple(r * x for x in axis)))  # type: ignore[arg-type]
    acceleration = add(step.inwards(pull), tuple(r * row[2] for row in own.u))  # type: ignore[arg-type]
    if joint.revolute:
        return acceleration, level
    twice = 2 * motion.dq[j]
    return add(acceleration, (twice * own.omega[1], -(twice * own.omega[0]), motion.ddq[j])), level


@dataclass(frozen=True)
class _Lengths:
    """Offsets d, r, b of the joints; a prismatic joint's r holds its variable."""

    graph: Graph
    robot: Robot
    letters: bool

    def of(self, j: int) -> Vec:
        joint = self.robot.joints[j]
        names = dict(joint.symbols) if self.letters else {}

        def length(key: str) -> Scalar:
            return self.graph.symbol(names[key]) if key in names else self.graph.constant(getattr(joint, key))

        r = length("r")
        return length("d"), r if joint.revolute else r + self.graph.symbol(f"q{j + 1}"), length("b")


def _turns(graph: Graph, robot: Robot, j: int, turns: list[tuple[Turn, Turn]]) -> tuple[Turn, Turn]:
    """Rotation of R_j against its parent, and against the furthest link that it turns on parallel axes to."""
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


def _matrix(omega: Vec, spin: Scalar, third: Vec, form: Form) -> Motions:
    """U and what else the moments read, from ω, ω̇3 and the third column of U."""
    u13, u23, u33 = third
    p12, p13, p23 = omega[0] * omega[1], omega[0] * omega[2], omega[1] * omega[2]
    alpha = (p23 - u23, u13 - p13, spin)
    if form.doubled_rate:
        twice = 2 * omega[2]
        u31, u32 = twice * omega[0] - u13, twice * omega[1] - u23
    else:
        u31, u32 = p13 - alpha[1], p23 + alpha[0]
    s1, s3 = omega[0] * omega[0], omega[2] * omega[2]
    u22 = -(s1 + s3)
    if form.shared_squares:
        d13 = s1 - s3
        u11 = d13 + u33
        differences = (u33 - u22, d13, u22 - u11)
    else:
        s2 = omega[1] * omega[1]
        u11 = -(s2 + s3)
        differences = (s3 - s2, s1 - s3, s2 - s1)
    u = ((u11, p12 - spin, u13), (p12 + spin, u22, u23), (u31, u32, u33))
    return Motions(omega, alpha, u, differences, p12)


def _inertial_moment(m: Motions, k: Sequence[Scalar]) -> Vec:
    """The skew part of U Σ."""
    u, (d32, d13, d21) = m.u, m.differences
    return (
        u[2][0] * k[XY] + u[2][1] * k[YY] - u[1][0] * k[XZ] + d32 * k[YZ] - u[1][2] * k[ZZ],
        d13 * k[XZ] + u[0][1] * k[YZ] - u[2][0] * k[XX] - u[2][1] * k[XY] + u[0][2] * k[ZZ],
        u[1][0] * k[XX] - u[0][1] * k[YY] + d21 * k[XY] + u[1][2] * k[XZ] - u[0][2] * k[YZ],
    )


def _unturned_moment(m: Motions, k: Sequence[Scalar], c: Scalar, s: Scalar) -> Vec:
    """The same in axes that do not turn with the joint: second moments turn instead, SXX + SYY does not."""
    u, (d32, d13, d21) = m.u, m.differences
    e = (k[XX] - k[YY]) * s + (2 * k[XY]) * c
    xx, yy, xy = k[XX] - s * e, k[YY] + s * e, c * e - k[XY]
    xz, yz = c * k[XZ] - s * k[YZ], s * k[XZ] + c * k[YZ]
    return (
        u[2][0] * xy + u[2][1] * yy - u[1][0] * xz + d32 * yz - u[1][2] * k[ZZ],
        d13 * xz + u[0][1] * yz - u[2][0] * xx - u[2][1] * xy + u[0][2] * k[ZZ],
        m.p12 * (xx - yy) + m.alpha[2] * (k[XX] + k[YY]) + d21 * xy + u[1][2] * xz - u[0][2] * yz,
    )
