"""Energy functions of the links [2.93] and how they pass from link to link [2.94]–[2.96]."""

from __future__ import annotations

from dataclasses import replace

from identify.robot.robot import Robot
from identify.symbolic.chain import Mat, SymbolicLink, Vec, add, dot, symbolic_links
from identify.symbolic.expression import Graph, Scalar


def energy_functions(link: SymbolicLink) -> tuple[Scalar, ...]:
    """(10,) h_j [2.93]: the link's kinetic plus potential energy is h_j · (XX XY XZ YY YZ ZZ MX MY MZ M)."""
    w, v, g = link.omega, link.velocity, link.gravity
    return (
        0.5 * w[0] * w[0],
        w[0] * w[1],
        w[0] * w[2],
        0.5 * w[1] * w[1],
        w[1] * w[2],
        0.5 * w[2] * w[2],
        w[2] * v[1] - w[1] * v[2] - g[0],
        w[0] * v[2] - w[2] * v[0] - g[1],
        w[1] * v[0] - w[0] * v[1] - g[2],
        0.5 * dot(v, v) + link.height,
    )


def energy_regressor(graph: Graph, robot: Robot, letters: bool = False) -> list[Scalar]:
    """(11 n,) energy functions of every standard parameter, ½·q̇_j² for Ia_j, in the order of standard_names.

    `letters`: lengths the robot names stay symbols, and gravity is G1 G2 G3.
    """
    rows: list[Scalar] = []
    for j, link in enumerate(_lettered_links(graph, robot) if letters else symbolic_links(graph, robot)):
        dq = graph.symbol(f"dq{j + 1}")
        rows += [*energy_functions(link), 0.5 * dq * dq]
    return rows


def _lettered_links(graph: Graph, robot: Robot) -> list[SymbolicLink]:
    """The links with letters for lengths and gravity: what is linear in 0g, from one unit of it along each axis."""
    links = symbolic_links(graph, replace(robot, gravity=(0.0, 0.0, 0.0)), letters=True)
    for axis, present in enumerate(robot.gravity):
        if present:
            unit = (float(axis == 0), float(axis == 1), float(axis == 2))
            letter = graph.symbol(f"G{axis + 1}")
            for j, part in enumerate(symbolic_links(graph, replace(robot, gravity=unit), letters=True)):
                down = add(links[j].gravity, tuple(letter * x for x in part.gravity))  # type: ignore[arg-type]
                links[j] = replace(links[j], gravity=down, height=links[j].height + letter * part.height)
    return links


def inertia_transform(rotation: Mat, position: Vec) -> list[list[Scalar]]:
    """(10, 10) ʲ⁻¹λ_j: standard parameters of a body in R_{j−1} from those in R_j [2.95], in any arithmetic.

    With S = A·MS: J' = A J Aᵀ + 2(P·S)·1 − P Sᵀ − S Pᵀ + M((P·P)·1 − P Pᵀ), MS' = S + M P, M' = M.
    """
    upper = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    p = position
    columns: list[list[Scalar]] = []
    for i, k in upper:
        a = [row[i] for row in rotation]
        b = [row[k] for row in rotation]
        columns.append([a[r] * b[s] + (a[s] * b[r] if i != k else 0) for r, s in upper] + [0, 0, 0, 0])
    for k in range(3):
        shift = [row[k] for row in rotation]
        trace = 2 * dot(p, shift)
        columns.append([(trace if r == s else 0) - p[r] * shift[s] - shift[r] * p[s] for r, s in upper] + [*shift, 0])
    square = dot(p, p)
    columns.append([(square if r == s else 0) - p[r] * p[s] for r, s in upper] + [*p, 1])
    return [list(row) for row in zip(*columns, strict=True)]


def velocity_term(revolute: bool, omega: Vec, velocity: Vec, dq: Scalar) -> tuple[Scalar, ...]:
    """(10,) η_j [2.96] from the velocities of link j in its own frame."""
    if revolute:
        return (0, 0, omega[0], 0, omega[1], omega[2] - 0.5 * dq, velocity[1], -velocity[0], 0, 0)
    return (0, 0, 0, 0, 0, 0, -omega[1], omega[0], 0, velocity[2] - 0.5 * dq)
