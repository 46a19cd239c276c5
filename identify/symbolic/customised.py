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
    column,
    cross,
    exact_cos_sin,
    matmul,
    matvec,
    number,
    times,
    transpose,
)
from identify.symbolic.expression import Expression, Graph, Scalar
from identify.symbolic.form import Form, Forms, can_merge, unit_letter
from identify.symbolic.motion import Motion
from identify.symbolic.second_moments import (
    IA,
    MX,
    MY,
    MZ,
    XX,
    XZ,
    YY,
    ZZ,
    M,
    as_forces,
    difference,
    first_wrench,
    inertial_moment,
    levered_moment,
    turned_body,
    unturned_moment,
)
from identify.symbolic.turning import Lengths, Motions, Turn, motions_of, turns_of


def customised_torque(
    graph: Graph,
    robot: Robot,
    parameters: Sequence[Scalar],
    motion: Motion,
    letters: bool = False,
    forms: Forms | None = None,
) -> list[Scalar]:
    """(n,) effort for second-moment parameters (11 n,), by the recurrence described above.

    `letters` keeps the lengths the robot names as symbols. `forms` says which of several equal ways to write it is
    taken; where it has a unit of length, symbols for parameters and gravity stand for what they are in that unit,
    numbers and the wrench are in SI.
    """
    forms = forms or Forms((Form(),) * robot.n)
    unit = forms.unit if all(joint.revolute for joint in robot.joints) else 1.0
    named = unit_letter(robot, unit) if letters else None
    if unit != 1.0:
        parameters = [in_unit(k, scale_of(i % 11, unit)) for i, k in enumerate(parameters)]
        x, y, z = (in_unit(g, 1 / unit) for g in motion.gravity)
        own = graph.symbol(named) if named else unit
        motion = replace(motion, gravity=(x, y, z), force=times(own, motion.force))
    if forms.turned:
        zero = graph.constant(0)
        parameters = [zero if i // 11 in forms.turned and i % 11 == MY else k for i, k in enumerate(parameters)]
    lengths = Lengths(graph, robot, letters, unit, named)
    forward = _forward(graph, robot, motion, lengths, forms)
    return _backward(graph, robot, parameters, motion, lengths, forms.links, forward)


def scale_of(kind: int, unit: float) -> float:
    """Factor that brings a parameter of this kind to a unit of length; moments and second moments stay in SI."""
    return unit if kind in (MX, MY, MZ) else unit * unit if kind == M else 1.0


def in_unit(x: Scalar, factor: float) -> Scalar:
    """A number times the factor; a symbol as it is."""
    return x * factor if not isinstance(x, Expression) or x.value is not None else x


@dataclass(frozen=True)
class _Forward:
    """Of every link: its turns against the parent and against the link it is seen from; motions in its own axes and in
    those that do not turn with it (`level`); accelerations of its origin in both."""

    turns: list[tuple[Turn, Turn]]
    own: list[Motions]
    level: list[Motions]
    acceleration: list[Vec]
    level_acceleration: list[Vec]


def _forward(graph: Graph, robot: Robot, motion: Motion, lengths: Lengths, whole: Forms) -> _Forward:
    forms = whole.links
    zero = graph.constant(0)
    null: Vec = (zero, zero, zero)
    rest = Motions(null, null, (null, null, null), null, null, zero)
    pull0: Vec = times(-1.0, motion.gravity)
    found = _Forward([], [], [], [], [])
    for j, joint in enumerate(robot.joints):
        found.turns.append(turns_of(graph, robot, j, found.turns, j in whole.turned))
        step, sight = found.turns[j]
        parent = found.own[joint.parent] if joint.parent >= 0 else rest
        far = found.own[sight.seen_from] if sight.seen_from >= 0 else rest
        dq, ddq = (motion.dq[j], motion.ddq[j]) if joint.revolute else (zero, zero)
        back = transpose(step.fixed)
        rate, spin = matvec(back, parent.omega)[2] + dq, matvec(back, parent.alpha)[2] + ddq
        third = matvec(far.u, column(sight.fixed, 2))
        seen, level = sight.inwards(far.omega), matvec(transpose(sight.fixed), far.omega)
        aslant = matvec(transpose(sight.fixed), third)
        read = _rates_read(robot, j, forms)
        flat = motions_of((level[0], level[1], rate), spin, aslant, forms[j], (False, False))
        row = sight.turned_back((flat.u[2][0], flat.u[2][1], zero)) if forms[j].turned_row else None
        found.level.append(flat)
        found.own.append(motions_of((seen[0], seen[1], rate), spin, sight.inwards(third), forms[j], read, row))
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
            there = add(there, times(r, column(flat.u, 2)))
            found.level_acceleration.append(there)
            found.acceleration.append(sight.turned_back(there))
            continue
        a = found.acceleration[joint.parent] if joint.parent >= 0 else pull0
        offset = matvec(parent.u, column(step.fixed, 0))
        pull = add(a, times(d, offset), times(b, column(parent.u, 2)))
        own = add(step.inwards(pull), times(r, column(found.own[j].u, 2)))
        axis = matvec(back, matvec(parent.u, column(step.fixed, 2)))
        there = add(matvec(back, pull), times(r, axis)) if sight is step else sight.about_axis(own)
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
    lengths: Lengths,
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
            ends = (step, turns_of(graph, robot, j, forward.turns, False)[0])
            axial = _merged(parent, a, ends, k, load, outer, motion.dq[j], motion.ddq[j])
            torque[j] = axial + k[IA] * motion.ddq[j]
            continue
        own, flat, a = forward.own[j], forward.level[j], forward.acceleration[j]
        body = list(k[:IA])
        if forms[j].unturned:
            moved = [*k[:XZ], zero, k[YY], zero, *k[ZZ:IA]] if j in levered else k
            across = unturned_moment(flat, moved, sight.cosine, sight.sine)
            load.level_moment = add(load.level_moment, across)
            body[:MX] = [zero] * 6
        if forms[j].unturned_first and joint.revolute and sight is step:
            first = step.about_axis(tuple(k[MX:M]))  # type: ignore[arg-type]
            f, m = first_wrench(flat.u, forward.level_acceleration[j], first, k[M])
            load.level_force, load.level_moment = add(load.level_force, f), add(load.level_moment, m)
            body[MX:] = [zero] * 4
        total = [sum((other[i] for other, _ in load.bodies), body[i]) for i in range(10)]
        if j in levered:
            body[MX] = body[MY] = zero
        rows = []
        for i in range(3):
            bodies = [other for other, row in load.bodies if row != i]
            part = [sum((other[c] for other in bodies), body[c]) for c in range(10)]
            rows.append(add(inertial_moment(own, part), cross(tuple(part[MX:M]), a))[i])  # type: ignore[arg-type]
        f = add(load.force, first_wrench(own.u, a, tuple(total[MX:M]), total[M])[0])  # type: ignore[arg-type]
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
            p = joint.parent
            inner = (forward.level[p], forward.level_acceleration[p], parameters[11 * p : 11 * p + 11])
            eff = matvec(step.fixed, (f_level[0], f_level[1], zero))
            near = matvec(step.fixed, step.about_axis(f))
            f = add(eff, matvec(step.fixed, sight.about_axis(f)))
            if not forms[j].stepped:
                eff, near = f, null
            if levered.get(joint.parent) == j:
                eff = add(eff, as_forces(*inner, lengths.inverse(j)))
            outer.level_force = add(outer.level_force, f)
            lever = (y * f[2] - z * f[1], z * f[0] - x * f[2], x * eff[1] - y * eff[0] + d * near[1])
            across = add(sight.about_axis((m[0], m[1], zero)), (m_level[0], m_level[1], zero))
            through = matvec(step.fixed, add(across, (zero, zero, m[2])))
            outer.level_moment = add(outer.level_moment, through, lever)
            if levered.get(joint.parent) == j:
                rest = levered_moment(*inner, lengths.inverse(j), x, y)
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
    body = turned_body(k, c, s)
    xx, xy, xz, yy, yz, _, mx, my, _, _ = body
    twice = 2 * dq
    rho = (twice * omega[0], twice * omega[1])
    delta = (omega[2] + omega[2] + dq) * dq
    m, f = load.moment, load.force
    axial = (
        (2 * omega[1]) * omega[0] * xx - (k[XX] + k[YY]) * (u[0][1] - ddq) + difference(parent, fixed) * xy
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
    outer.bodies.append((moved, max(range(3), key=lambda i: abs(number(fixed[i][2])))))
    return axial


def _is_levered(robot: Robot, j: int, forms: Sequence[Form], forward: _Forward, lengths: Lengths) -> bool:
    step, sight = forward.turns[j]
    if not forms[j].level or not forms[j].levered or sight is step or not robot.joints[j].d:
        return False
    parent = robot.joints[j].parent
    siblings = [i for i in range(j) if robot.joints[i].parent == parent and forms[i].level and forms[i].levered]
    return forms[parent].unturned and not forms[parent].unturned_first and not siblings
