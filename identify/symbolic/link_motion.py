"""Velocities, accelerations and wrenches of the links under the names that printed models give them."""

from __future__ import annotations

from collections.abc import Sequence

from identify.robot.robot import Robot
from identify.symbolic.chain import symbolic_links
from identify.symbolic.expression import Graph, Scalar
from identify.symbolic.newton_euler import link_wrenches


def velocities(robot: Robot) -> dict[str, Scalar]:
    """Components in R_j: w3_1 of ω_3 [2.59], V3_1 of V_3 [2.60]."""
    found: dict[str, Scalar] = {}
    for j, link in enumerate(symbolic_links(Graph(), robot, letters=True), start=1):
        found |= {f"w{j}_{i}": x for i, x in enumerate(link.omega, start=1)}
        found |= {f"V{j}_{i}": x for i, x in enumerate(link.velocity, start=1)}
    return found


def recurrence(graph: Graph, robot: Robot, standard: Sequence[Scalar]) -> dict[str, Scalar]:
    """Components in R_j of what Newton and Euler's recurrence passes on, for standard parameters (11 n,).

    w3_1 of ω_3, wp3_1 of its derivative, Vp3_1 of the acceleration of O_3 less gravity, U3_12 of ω̇^ + ω^ω^
    [2.79]–[2.83]; f3_1 and m3_1 of the wrench that link 2 exerts on link 3 [2.86], [2.88].
    """
    found: dict[str, Scalar] = {}
    links = symbolic_links(graph, robot, letters=True)
    for j, link in enumerate(links, start=1):
        w, a = link.omega, link.alpha
        squares = -sum((x * x for x in w), graph.constant(0))
        skew = ((0, -a[2], a[1]), (a[2], 0, -a[0]), (-a[1], a[0], 0))
        for name, v in (("w", w), ("wp", a), ("Vp", link.acceleration)):
            found |= {f"{name}{j}_{i}": x for i, x in enumerate(v, start=1)}
        for i in range(3):
            for k in range(3):
                found[f"U{j}_{i + 1}{k + 1}"] = skew[i][k] + w[i] * w[k] + (squares if i == k else 0)
    for j, (force, moment) in enumerate(link_wrenches(robot, links, standard), start=1):
        found |= {f"f{j}_{i}": x for i, x in enumerate(force, start=1)}
        found |= {f"m{j}_{i}": x for i, x in enumerate(moment, start=1)}
    return found
