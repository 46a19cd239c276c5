"""Customised inverse dynamics: the recurrence of Newton and Euler with as few operations as the arm's structure allows.

The state of link j is its angular velocity, the acceleration of O_j less gravity, and U = ω̇^ + ω^ω^, the matrix that
takes a point of the link to its acceleration about O_j. Five facts make it cheap:

- a point on the axis z_j belongs to the link before it too, so that the third column of U_j is a column of the parent's
  U, turned: ω̇ is never propagated, and U33 = −ω1² − ω2² often comes for nothing;
- with the second moments Σ = ∫ r rᵀ dm for the inertia, the moment of a link is the skew part of U Σ and the force
  U·MS + M·V̇: products of entries of U that other terms need as well;
- links on parallel axes turn against the link before them by the sum of the joint angles: what is seen from there,
  velocities, accelerations and, on their way back, forces and moments, takes one turn instead of several;
- in axes that do not turn with joint j, U_j differs from the parent's U by what q̇_j and q̈_j add: four numbers. A last
  link can be carried as part of its parent's body, and only these four act on it alone;
- the unit of length is free: in units of one of them, this length takes no multiplication.

Parameters are the second-moment ones, `second_moments` (SXX = ∫x² dm …); which of them are zero is the choice of
`representative`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from identify.robot.robot import Robot
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
        return self.turned_back(matvec(transpose(self.fixed), v))

    def turned_back(self, v: Vec) -> Vec:
        """A vector in axes that do not turn with the joint, in R_j."""
        x, y, z = v
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
    """How one link is written; the count differs, the value does not.

    `shared_squares`: ω2² from U33 and ω1². `doubled_rate`: U31 and U32 through 2ω3 where no child reads that entry of
    ω̇; `turned_row`: there, from the row in axes that do not turn with the joint. `unturned`: the moment of the second
    moments in axes that do not turn with the joint, which pays where the link before hardly turns. `unturned_first`:
    the first moments and the mass likewise, for a link seen from the one before it. `level`: for a link behind a
    parallel axis, acceleration and force go through the axes that none of the parallel joints turns; `levered`: the
    parent's first moments and SXZ, SYZ then act as forces at this link's axis; `stepped`: the force's lever about the
    parent's axis is taken in the parent's axes. `merged`: a last link without offsets
    and with axes at right angles to its parent's as part of the parent's body.
    """

    shared_squares: bool = True
    doubled_rate: bool = False
    turned_row: bool = False
    unturned: bool = False
    unturned_first: bool = False
    level: bool = False
    levered: bool = False
    stepped: bool = False
    merged: bool = False


@dataclass(frozen=True)
class Forms:
    """Forms of the links (n,), the unit of length that the recurrence works in [m], and the merged links whose frame
    is turned about z by a constant, the symbol `turn_symbol`, so that MY is zero: their parameters are the turned
    frame's, a wrench on them is still in the robot's.
    """

    links: tuple[Form, ...]
    unit: float = 1.0
    turned: tuple[int, ...] = ()


def turn_symbol(j: int) -> str:
    """Name of the constant angle by which the frame of link j is turned."""
    return f"PHI{j + 1}"


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


def customised_torque(
    graph: Graph,
    robot: Robot,
    parameters: Sequence[Scalar],
    motion: Motion,
    letters: bool = False,
    forms: Forms | None = None,
) -> list[Scalar]:
    """(n,) effort for second-moment parameters (11 n,), by the recurrence described above.

    `letters` keeps the lengths the robot names as symbols; then their unit is the metre and no frame is turned. `forms`
    says which of several equal ways to write it is taken.
    """
    forms = forms or Forms((Form(),) * robot.n)
    if letters:
        forms = replace(forms, unit=1.0, turned=())
    unit = forms.unit if all(joint.revolute for joint in robot.joints) else 1.0
    if unit != 1.0:
        # In units of length other than the metre, moments and second moments stay in SI.
        scale = (*(1.0,) * 6, *(unit,) * 3, unit * unit, 1.0)
        parameters = [k * scale[i % 11] for i, k in enumerate(parameters)]
        joints = tuple(replace(joint, d=joint.d / unit, r=joint.r / unit, b=joint.b / unit) for joint in robot.joints)
        robot = replace(robot, joints=joints)
        motion = replace(motion, gravity=_times(1 / unit, motion.gravity), force=_times(unit, motion.force))
    if forms.turned:
        zero = graph.constant(0)
        parameters = [zero if i // 11 in forms.turned and i % 11 == MY else k for i, k in enumerate(parameters)]
    lengths = _Lengths(graph, robot, letters)
    forward = _forward(graph, robot, motion, lengths, forms)
    return _backward(graph, robot, parameters, motion, lengths, forms.links, forward)


@dataclass(frozen=True)
class _Forward:
    """Of every link: its turns against the parent and against the link it is seen from; motions in its own axes and in
    those that do not turn with it (`level`); accelerations of its origin in both."""

    turns: list[tuple[Turn, Turn]]
    own: list[Motions]
    level: list[Motions]
    acceleration: list[Vec]
    level_acceleration: list[Vec]


def _forward(graph: Graph, robot: Robot, motion: Motion, lengths: _Lengths, whole: Forms) -> _Forward:
    forms = whole.links
    zero = graph.constant(0)
    null: Vec = (zero, zero, zero)
    rest = Motions(null, null, (null, null, null), null, null, zero)
    pull0: Vec = _times(-1.0, motion.gravity)
    found = _Forward([], [], [], [], [])
    for j, joint in enumerate(robot.joints):
        found.turns.append(_turns(graph, robot, j, found.turns, j in whole.turned))
        step, sight = found.turns[j]
        parent = found.own[joint.parent] if joint.parent >= 0 else rest
        far = found.own[sight.seen_from] if sight.seen_from >= 0 else rest
        dq, ddq = (motion.dq[j], motion.ddq[j]) if joint.revolute else (zero, zero)
        back = transpose(step.fixed)
        rate, spin = matvec(back, parent.omega)[2] + dq, matvec(back, parent.alpha)[2] + ddq
        third = matvec(far.u, _column(sight.fixed, 2))
        seen, level = sight.inwards(far.omega), matvec(transpose(sight.fixed), far.omega)
        aslant = matvec(transpose(sight.fixed), third)
        read = _rates_read(robot, j, forms)
        flat = _matrix((level[0], level[1], rate), spin, aslant, forms[j], (False, False))
        row = sight.turned_back((flat.u[2][0], flat.u[2][1], zero)) if forms[j].turned_row else None
        found.level.append(flat)
        found.own.append(_matrix((seen[0], seen[1], rate), spin, sight.inwards(third), forms[j], read, row))
        d, r, b = lengths.of(j)
        if forms[j].level and sight is not step:
            inner, before = found.level[joint.parent], found.turns[joint.parent][1]
            x, y = d * before.cosine, d * before.sine
            offset = tuple(row[0] * x + row[1] * y + row[2] * b for row in inner.u)
            if forms[j].levered:
                (s1, s2, _), (tx, ty), p12 = inner.squares, inner.turned(x, y), inner.p12
                flat_x, flat_y = tx + (p12 * y - s2 * x), ty + (p12 * x - s1 * y)
                offset = (flat_x + b * inner.u[0][2], flat_y + b * inner.u[1][2], offset[2])
            there = matvec(back, add(found.level_acceleration[joint.parent], offset))  # type: ignore[arg-type]
            there = add(there, _times(r, _column(flat.u, 2)))
            found.level_acceleration.append(there)
            found.acceleration.append(sight.turned_back(there))
            continue
        a = found.acceleration[joint.parent] if joint.parent >= 0 else pull0
        offset = matvec(parent.u, _column(step.fixed, 0))
        pull = add(a, _times(d, offset), _times(b, _column(parent.u, 2)))
        own = add(step.inwards(pull), _times(r, _column(found.own[j].u, 2)))
        axis = matvec(back, matvec(parent.u, _column(step.fixed, 2)))
        there = add(matvec(back, pull), _times(r, axis)) if sight is step else sight.about_axis(own)
        if not joint.revolute:
            twice, omega = 2 * motion.dq[j], found.own[j].omega
            own = add(own, (twice * omega[1], -(twice * omega[0]), motion.ddq[j]))
        found.acceleration.append(own)
        found.level_acceleration.append(there)
    return found


def _rates_read(robot: Robot, j: int, forms: Sequence[Form]) -> tuple[bool, bool]:
    """Whether a child's turning reads ω̇1 and ω̇2 of link j."""
    read = [False, False]
    for i, joint in enumerate(robot.joints):
        if joint.parent == j and joint.revolute and not (forms[i].merged and can_merge(robot, i)):
            (cg, sg), (_, sa) = exact_cos_sin(joint.gamma), exact_cos_sin(joint.alpha)
            read = [read[0] or sg * sa != 0, read[1] or cg * sa != 0]
    return read[0], read[1]


def can_merge(robot: Robot, j: int) -> bool:
    """Whether link j can be carried as part of its parent's body: nothing hangs on it, it turns about the parent's
    origin, and its axes are the parent's but for right angles."""
    joint = robot.joints[j]
    exact = all(x in (-1, 0, 1) for angle in (joint.alpha, joint.gamma) for x in exact_cos_sin(angle))
    last = joint.parent >= 0 and all(other.parent != j for other in robot.joints)
    return (
        last and joint.revolute and exact and not (joint.d or joint.r or joint.b) and exact_cos_sin(joint.alpha)[1] != 0
    )


@dataclass
class _Load:
    """What acts on a link from outside, by the links behind it: force and moment at its origin in its own axes and in
    those that do not turn with it; bodies carried with it (second moments, first moments, mass), each with the row of
    the moment that it does not enter."""

    force: Vec
    moment: Vec
    level_force: Vec
    level_moment: Vec
    bodies: list[tuple[list[Scalar], int]]


def _backward(
    graph: Graph,
    robot: Robot,
    parameters: Sequence[Scalar],
    motion: Motion,
    lengths: _Lengths,
    forms: Sequence[Form],
    forward: _Forward,
) -> list[Scalar]:
    zero = graph.constant(0)
    null: Vec = (zero, zero, zero)
    loads = [_Load(null, null, null, null, []) for _ in robot.joints]
    loads[-1].force, loads[-1].moment = motion.force, motion.moment
    levered = {robot.joints[j].parent: j for j in range(robot.n) if _is_levered(robot, j, forms, forward, lengths)}
    torque: list[Scalar] = [zero] * robot.n
    for j in reversed(range(robot.n)):
        joint, k, load = robot.joints[j], parameters[11 * j : 11 * j + 11], loads[j]
        step, sight = forward.turns[j]
        outer = loads[joint.parent] if joint.parent >= 0 else _Load(null, null, null, null, [])
        if forms[j].merged and can_merge(robot, j):
            parent, a = forward.own[joint.parent], forward.acceleration[joint.parent]
            ends = (step, _turns(graph, robot, j, forward.turns, False)[0])
            axial = _merged(parent, a, ends, k, load, outer, motion.dq[j], motion.ddq[j])
            torque[j] = axial + k[IA] * motion.ddq[j]
            continue
        own, flat, a = forward.own[j], forward.level[j], forward.acceleration[j]
        body = list(k[:IA])
        if forms[j].unturned:
            moved = [*k[:XZ], zero, k[YY], zero, *k[ZZ:IA]] if j in levered else k
            across = _unturned_moment(flat, moved, sight.cosine, sight.sine)
            load.level_moment = add(load.level_moment, across)
            body[:MX] = [zero] * 6
        if forms[j].unturned_first and joint.revolute and sight is step:
            first = step.about_axis(tuple(k[MX:M]))  # type: ignore[arg-type]
            f, m = _first_wrench(flat.u, forward.level_acceleration[j], first, k[M])
            load.level_force, load.level_moment = add(load.level_force, f), add(load.level_moment, m)
            body[MX:] = [zero] * 4
        total = [sum((other[i] for other, _ in load.bodies), body[i]) for i in range(10)]
        if j in levered:
            body[MX] = body[MY] = zero
        rows = []
        for i in range(3):
            bodies = [other for other, row in load.bodies if row != i]
            part = [sum((other[c] for other in bodies), body[c]) for c in range(10)]
            rows.append(add(_inertial_moment(own, part), cross(tuple(part[MX:M]), a))[i])  # type: ignore[arg-type]
        f = add(load.force, _first_wrench(own.u, a, tuple(total[MX:M]), total[M])[0])  # type: ignore[arg-type]
        m = add(load.moment, (rows[0], rows[1], rows[2]))
        f_level, m_level = load.level_force, load.level_moment
        m = (m[0], m[1], m[2] + m_level[2])
        if sight is not step and not forms[j].level:
            f, f_level = add(f, sight.turned_back(f_level)), null
        else:
            f = (f[0], f[1], f[2] + f_level[2])
        torque[j] = (m if joint.revolute else f)[2] + k[IA] * motion.ddq[j]
        if joint.parent < 0:
            continue
        d, r, b = lengths.of(j)
        if sight is not step and forms[j].level:
            before = forward.turns[joint.parent][1]
            x, y, z = d * before.cosine, d * before.sine, b + r * step.fixed[2][2]
            eff = matvec(step.fixed, (f_level[0], f_level[1], zero))
            near = matvec(step.fixed, step.about_axis(f))
            f = add(eff, matvec(step.fixed, sight.about_axis(f)))
            if not forms[j].stepped:
                eff, near = f, null
            if levered.get(joint.parent) == j:
                eff = add(eff, _as_forces(forward, joint.parent, parameters, lengths.value(j, "d")))
            outer.level_force = add(outer.level_force, f)
            lever = (y * f[2] - z * f[1], z * f[0] - x * f[2], x * eff[1] - y * eff[0] + d * near[1])
            across = add(sight.about_axis((m[0], m[1], zero)), (m_level[0], m_level[1], zero))
            through = matvec(step.fixed, add(across, (zero, zero, m[2])))
            outer.level_moment = add(outer.level_moment, through, lever)
            if levered.get(joint.parent) == j:
                rest = _levered_moment(forward, joint.parent, parameters, lengths.value(j, "d"), x, y)
                outer.level_moment = add(outer.level_moment, rest)
            continue
        f = add(step.about_axis(f), (f_level[0], f_level[1], zero))
        lever = matvec(step.fixed, (-(r * f[1]), r * f[0] - d * f[2], d * f[1]))
        f = matvec(step.fixed, f)
        along = matvec(step.fixed, (zero, zero, m[2]))
        outer.moment = add(outer.moment, along, lever, (-(b * f[1]), b * f[0], zero))
        outer.force = add(outer.force, f)
        if sight.seen_from >= 0:
            # Across parallel axes the moment goes straight to the link before the first of them.
            across = add(sight.about_axis((m[0], m[1], zero)), (m_level[0], m_level[1], zero))
            far = loads[sight.seen_from]
            far.moment = add(far.moment, matvec(sight.fixed, across))
    return torque


def _merged(
    parent: Motions,
    a: Vec,
    turns: tuple[Turn, Turn],
    k: Sequence[Scalar],
    load: _Load,
    outer: _Load,
    dq: Scalar,
    ddq: Scalar,
) -> Scalar:
    """Effort, but for the drive, of a link carried as part of its parent's body; hands body, force and moment on.

    With the parent's U in axes that do not turn with the joint, the link's own is U + [[−δ, −q̈], [q̈, −δ], [ρ1, ρ2]].
    `turns`: of the frame of the link's parameters, and of the frame that the load is given in.
    """
    zero = 0.0
    step, outside = turns
    c, s, fixed = step.cosine, step.sine, step.fixed
    back = transpose(fixed)
    omega, there = matvec(back, parent.omega), matvec(back, a)
    u = matmul(matmul(back, parent.u), fixed)
    body = _turned_body(k, c, s)
    xx, xy, xz, yy, yz, _, mx, my, _, _ = body
    twice = 2 * dq
    rho = (twice * omega[0], twice * omega[1])
    delta = (omega[2] + omega[2] + dq) * dq
    m, f = load.moment, load.force
    axial = (
        (2 * omega[1]) * omega[0] * xx - (k[XX] + k[YY]) * (u[0][1] - ddq) + _difference(parent, fixed) * xy
        + u[1][2] * xz - u[0][2] * yz + mx * there[1] - my * there[0] + m[2]
    )  # fmt: skip
    across: Vec = (
        delta * yz - ddq * xz + rho[0] * xy + rho[1] * yy,
        -(delta * xz) - ddq * yz - (rho[0] * xx + rho[1] * xy),
        zero,
    )
    across = add(outside.about_axis((m[0], m[1], zero)), across, (zero, zero, axial))
    extra: Vec = (-(delta * mx) - ddq * my, ddq * mx - delta * my, rho[0] * mx + rho[1] * my)
    extra = add(outside.about_axis(f), extra)
    outer.moment = add(outer.moment, matvec(fixed, across))
    outer.force = add(outer.force, matvec(fixed, extra))
    sigma: Mat = ((xx, xy, xz), (xy, yy, yz), (xz, yz, body[ZZ]))
    sigma = matmul(matmul(fixed, sigma), back)
    first = matvec(fixed, (mx, my, body[MZ]))
    moved = [sigma[0][0], sigma[0][1], sigma[0][2], sigma[1][1], sigma[1][2], sigma[2][2], *first, k[M]]
    outer.bodies.append((moved, max(range(3), key=lambda i: abs(_number(fixed[i][2])))))
    return axial


def _turned_body(k: Sequence[Scalar], c: Scalar, s: Scalar) -> list[Scalar]:
    """Second and first moments and mass in axes turned back by the angle of cosine c and sine s about z."""
    e = (k[XX] - k[YY]) * s + (2 * k[XY]) * c
    return [
        k[XX] - s * e, c * e - k[XY], c * k[XZ] - s * k[YZ], k[YY] + s * e, s * k[XZ] + c * k[YZ], k[ZZ],
        c * k[MX] - s * k[MY], s * k[MX] + c * k[MY], k[MZ], k[M],
    ]  # fmt: skip


def _difference(parent: Motions, fixed: Mat) -> Scalar:
    """U22 − U11 in axes that are the parent's but for right angles, of the parent's differences."""
    x, y = (max(range(3), key=lambda i: abs(_number(fixed[i][c]))) for c in (0, 1))
    d32, d13, d21 = parent.differences
    return {(0, 1): d21, (1, 0): -d21, (1, 2): d32, (2, 1): -d32, (2, 0): d13, (0, 2): -d13}[x, y]


def _is_levered(robot: Robot, j: int, forms: Sequence[Form], forward: _Forward, lengths: _Lengths) -> bool:
    step, sight = forward.turns[j]
    if not forms[j].level or not forms[j].levered or sight is step or lengths.value(j, "d") is None:
        return False
    parent = robot.joints[j].parent
    siblings = [i for i in range(j) if robot.joints[i].parent == parent and forms[i].level and forms[i].levered]
    return forms[parent].unturned and not forms[parent].unturned_first and not siblings


def _as_forces(forward: _Forward, j: int, parameters: Sequence[Scalar], d: float | None) -> Vec:
    """Forces at the distance d along x_j that have the moment about z_j of MX, MY, SXZ and SYZ of link j; in axes that
    do not turn with it."""
    k, u, a = parameters[11 * j : 11 * j + 11], forward.level[j].u, forward.level_acceleration[j]
    inverse = 1 / d  # type: ignore[operator]
    mx, my, xz, yz = (k[i] * inverse for i in (MX, MY, XZ, YZ))
    x = mx * a[0] + my * a[1] + xz * u[0][2] + yz * u[1][2]
    y = mx * a[1] - my * a[0] + xz * u[1][2] - yz * u[0][2]
    return (x, y, 0.0)


def _levered_moment(
    forward: _Forward, j: int, parameters: Sequence[Scalar], d: float | None, x: Scalar, y: Scalar
) -> Vec:
    """Moment across z_j of the same parameters; (x, y) is the lever that turns with the link."""
    k, flat = parameters[11 * j : 11 * j + 11], forward.level[j]
    a, inverse = forward.level_acceleration[j], 1 / d  # type: ignore[operator]
    mx, my, xz, yz = (k[i] * inverse for i in (MX, MY, XZ, YZ))
    hx, hy = mx * x - my * y, mx * y + my * x
    (s1, s2, _), p12, (tx, ty) = flat.squares, flat.p12, flat.turned(x, y)
    return (
        xz * (-ty - s2 * y - p12 * x) + yz * (-tx - s2 * x + p12 * y) + hy * a[2],
        xz * (tx + s1 * x + p12 * y) + yz * (p12 * x - s1 * y - ty) - hx * a[2],
        0.0,
    )


def _number(x: Scalar) -> float:
    return x.value or 0.0 if isinstance(x, Expression) else x


def _column(a: Mat, i: int) -> Vec:
    return (a[0][i], a[1][i], a[2][i])


def _times(x: Scalar, v: Vec) -> Vec:
    return (x * v[0], x * v[1], x * v[2])


def _first_wrench(u: Mat, a: Vec, first: Vec, mass: Scalar) -> tuple[Vec, Vec]:
    """Force U·MS + M·V̇ and moment MS×V̇ of the first moments and the mass."""
    force: Vec = tuple(  # type: ignore[assignment]
        u[i][0] * first[0] + u[i][1] * first[1] + u[i][2] * first[2] + a[i] * mass for i in range(3)
    )
    return force, cross(first, a)


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

    def value(self, j: int, key: str) -> float | None:
        """The offset as a number other than zero, None where it is a letter or zero."""
        joint = self.robot.joints[j]
        return None if self.letters and key in dict(joint.symbols) else getattr(joint, key) or None


def _turns(graph: Graph, robot: Robot, j: int, turns: list[tuple[Turn, Turn]], turned_frame: bool) -> tuple[Turn, Turn]:
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
    if turned_frame:
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


def _matrix(
    omega: Vec, spin: Scalar, third: Vec, form: Form, read: tuple[bool, bool], row: Vec | None = None
) -> Motions:
    """U and what else the moments read, from ω, ω̇3 and the third column of U; `row`: another way to U31 and U32."""
    u13, u23, u33 = third
    p12, p13, p23 = omega[0] * omega[1], omega[0] * omega[2], omega[1] * omega[2]
    alpha = (p23 - u23, u13 - p13, spin)
    u31, u32 = p13 - alpha[1], p23 + alpha[0]
    if form.doubled_rate or row:
        twice, rates = 2 * omega[2], (omega[0], omega[1])
        double = [twice * rate for rate in rates]
        for i in (0, 1):
            if _number(rates[1 - i]) == 0 and not (isinstance(rates[1 - i], Expression) and rates[1 - i].value is None):  # type: ignore[union-attr]
                double[i] = (2 * rates[i]) * omega[2]
        others = row or (double[0] - u13, double[1] - u23)
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
    xx, xy, xz, yy, yz, zz, *_ = _turned_body(k, c, s)
    return (
        u[2][0] * xy + u[2][1] * yy - u[1][0] * xz + d32 * yz - u[1][2] * zz,
        d13 * xz + u[0][1] * yz - u[2][0] * xx - u[2][1] * xy + u[0][2] * zz,
        m.p12 * (xx - yy) + m.alpha[2] * (k[XX] + k[YY]) + d21 * xy + u[1][2] * xz - u[0][2] * yz,
    )
