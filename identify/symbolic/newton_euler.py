"""Newton-Euler linear in the inertial parameters [2.69], [2.70], column by column."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from identify.robot.robot import Robot
from identify.symbolic.chain import SymbolicLink, Vec, add, cross, dot, symbolic_links
from identify.symbolic.expression import Graph, Scalar


def wrench_columns(link: SymbolicLink) -> tuple[tuple[Vec, Vec], ...]:
    """Ten pairs (F, M): force [2.84] and moment about O_j [2.85] that one unit of each standard parameter asks for."""
    w, a, v = link.omega, link.alpha, link.acceleration
    ww = {(i, k): w[i] * w[k] for i in range(3) for k in range(i, 3)}
    u12, u21 = ww[0, 1] - a[2], ww[0, 1] + a[2]
    u13, u31 = ww[0, 2] + a[1], ww[0, 2] - a[1]
    u23, u32 = ww[1, 2] - a[0], ww[1, 2] + a[0]
    none: Vec = (0, 0, 0)
    inertia: tuple[Vec, ...] = (
        (a[0], ww[0, 2], -ww[0, 1]),
        (-u31, u32, ww[0, 0] - ww[1, 1]),
        (u21, ww[2, 2] - ww[0, 0], -u23),
        (-ww[1, 2], a[1], ww[0, 1]),
        (ww[1, 1] - ww[2, 2], -u12, u13),
        (ww[1, 2], -ww[0, 2], a[2]),
    )
    u: tuple[Vec, ...] = (
        (-ww[1, 1] - ww[2, 2], u21, u31),
        (u12, -ww[0, 0] - ww[2, 2], u32),
        (u13, u23, -ww[0, 0] - ww[1, 1]),
    )
    moments: tuple[Vec, ...] = ((0, -v[2], v[1]), (v[2], 0, -v[0]), (-v[1], v[0], 0))
    return (
        *((none, m) for m in inertia),
        *zip(u, moments, strict=True),
        (v, none),
    )  # fmt: skip


def torque_regressor(graph: Graph, robot: Robot, columns: Iterable[int]) -> dict[tuple[int, int], Scalar]:
    """Entries of the torque regressor Y of Γ = Y·K: {(joint, standard parameter): expression}, for the columns
    asked for (indices into Robot.standard_names). Γ_i is the wrench's power along ∂(velocity of link j)/∂q̇_i."""
    links = symbolic_links(graph, robot)
    entries: dict[tuple[int, int], Scalar] = {}
    wrenches = {}
    for column in columns:
        j, k = divmod(column, 11)
        if k == 10:
            entries[j, column] = graph.symbol(f"ddq{j + 1}")
            continue
        if j not in wrenches:
            wrenches[j] = wrench_columns(links[j])
        force, moment = wrenches[j][k]
        for i, (turning, moving) in links[j].partial.items():
            entries[i, column] = dot(turning, moment) + dot(moving, force)
    return entries


def link_wrenches(robot: Robot, links: Sequence[SymbolicLink], standard: Sequence[Scalar]) -> list[tuple[Vec, Vec]]:
    """Force f_j and moment m_j about O_j that each link gets from the one before it, in R_j, for the (11 n,) standard
    parameters, by the backward recurrence [2.86]–[2.88]."""
    force: list[Vec] = []
    moment: list[Vec] = []
    for j, link in enumerate(links):
        f: Vec = (0, 0, 0)
        m: Vec = (0, 0, 0)
        for k, (column_f, column_m) in enumerate(wrench_columns(link)):
            p = standard[11 * j + k]
            f = add(f, tuple(p * x for x in column_f))  # type: ignore[arg-type]
            m = add(m, tuple(p * x for x in column_m))  # type: ignore[arg-type]
        force.append(f)
        moment.append(m)
    for j in reversed(range(robot.n)):
        link, parent = links[j], robot.joints[j].parent
        if parent >= 0:
            f = tuple(dot(row, force[j]) for row in link.rotation)  # type: ignore[assignment]
            m = tuple(dot(row, moment[j]) for row in link.rotation)  # type: ignore[assignment]
            force[parent] = add(force[parent], f)
            moment[parent] = add(moment[parent], m, cross(link.position, f))
    return list(zip(force, moment, strict=True))


def direct_torque(graph: Graph, robot: Robot, standard: list[Scalar]) -> list[Scalar]:
    """(n,) rigid-body torque Γ for the (11 n,) standard parameters [2.89]."""
    wrenches = link_wrenches(robot, symbolic_links(graph, robot), standard)
    return [
        (moment if joint.revolute else force)[2] + standard[11 * j + 10] * graph.symbol(f"ddq{j + 1}")
        for j, (joint, (force, moment)) in enumerate(zip(robot.joints, wrenches, strict=True))
    ]
