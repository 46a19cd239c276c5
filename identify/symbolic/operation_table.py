"""What every model of a robot costs, beside the chapter's figures."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING

from identify.robot.robot import Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.customised import customised_torque
from identify.symbolic.direct_dynamics import equations, solution
from identify.symbolic.energy import energy_regressor
from identify.symbolic.expression import Expression, Graph, Scalar
from identify.symbolic.form import with_unequal_lengths
from identify.symbolic.geometry import symbolic_direct_geometry
from identify.symbolic.inverse_dynamics import written_effort
from identify.symbolic.jacobian import symbolic_matrix
from identify.symbolic.lagrange import lagrange
from identify.symbolic.model import entry_name
from identify.symbolic.motion import Motion
from identify.symbolic.naming import graph_of
from identify.symbolic.newton_euler import torque_regressor
from identify.symbolic.operations import Operations, count, lifted
from identify.symbolic.operations import written as written_out
from identify.symbolic.polarisation import bilinear_in_rates
from identify.symbolic.representative import customised_model, representative
from identify.symbolic.simplification import simplified
from identify.symbolic.trigonometry import algebra

if TYPE_CHECKING:
    import sympy

SYMMETRIC_MOMENTS = ("MXR2", "MY2", "MYR3", "MYR5")
"""First moments that the chapter's RX-90 with symmetric links keeps, beside diagonal and actuator inertias."""

CHAPTER = {"general": Operations(253, 238, 0), "symmetric": Operations(160, 113, 0)}
"""Inverse dynamics of the RX-90 with its 40 base parameters, and with symmetric links (section 2.5)."""


@dataclass(frozen=True)
class Row:
    """A model, what it costs, and what the chapter's program needed for it, where it says so."""

    model: str
    operations: Operations
    chapter: Operations | None = None


def operations(robot: Robot) -> tuple[Row, ...]:
    """Operations of the robot's models: lengths and parameters are constants, base parameters unless said otherwise.

    Inverse dynamics is counted without friction, and with a wrench on the last link as in the chapter; direct dynamics
    with friction. The symmetric-link row is there for the chapter's robot alone, geometry for robots without branches.
    """
    written = written_effort(robot).torque
    robot = with_unequal_lengths(robot)
    kept = base_parameters(robot).kept
    known = is_chapters_robot(robot)
    branches = any(joint.parent != j - 1 for j, joint in enumerate(robot.joints))
    rows = [Row("inverse dynamics, wrench", count(written), CHAPTER["general"] if known else None)]
    if known:
        symmetric = _customised(robot, wrench=True, absent=symmetric_absent(robot))
        rows.append(Row("inverse dynamics, wrench, symmetric links", symmetric, CHAPTER["symmetric"]))
    graph = Graph()
    torque = lifted(graph, torque_regressor(graph, robot, kept).values())
    energy = energy_regressor(graph, robot)
    both = Graph()
    terms = lagrange(both, robot)
    system = equations(both, robot)
    solved = solution(*_symbols(robot, system))
    return (
        *rows,
        Row("inverse dynamics", _customised(robot)),
        Row("Coriolis and centrifugal effort", _customised(robot, ddq=False, gravity=False)),
        Row("gravity effort", _customised(robot, dq=False, ddq=False)),
        Row("inertia matrix", _count(inertia_matrix(graph, robot))),
        Row("direct dynamics, friction", _sum(_count(list(system.values())), written_out(solved.values()))),
        Row("Lagrange, standard parameters: A", _count(list(terms.inertia.values()))),
        Row("Lagrange, standard parameters: C", _count(list(terms.coriolis.values()))),
        Row("Lagrange, standard parameters: Q", _count(terms.gravity)),
        Row("torque regressor", _count(torque)),
        Row("Slotine-Li regressor", _count(bilinear_in_rates(torque, robot.n))),
        Row("energy regressor", _count(lifted(graph, (energy[c] for c in kept)))),
        *([] if branches else _geometry(robot)),
    )


def _geometry(robot: Robot) -> list[Row]:
    """Direct geometric model and Jacobian in the frame in the middle, as they are printed."""
    pose = symbolic_direct_geometry(robot, placed=True).expressions.values()
    space = algebra(robot)
    velocity = space.to_joint_variables(symbolic_matrix(robot, robot.n // 2, None, space))
    graph = Graph()
    return [
        Row("direct geometry", _count([graph_of(graph, e) for e in pose])),
        Row("Jacobian, frame in the middle", _count([graph_of(graph, e) for e in velocity])),
    ]


def _symbols(robot: Robot, equations: dict[str, Expression]) -> tuple[list[list[sympy.Expr]], list[sympy.Expr]]:
    """Names for what is not zero in A, and for the effort that is left when H is taken off."""
    import sympy

    n = robot.n
    names = [[entry_name("A", n, min(i, k), max(i, k)) for k in range(n)] for i in range(n)]
    a = [[sympy.Integer(0) if equations[x].value == 0 else sympy.Symbol(x) for x in row] for row in names]
    return a, [sympy.Symbol(f"tau{j + 1}") - sympy.Symbol(f"H{j + 1}") for j in range(n)]


def _sum(a: Operations, b: Operations) -> Operations:
    return Operations(a.multiplications + b.multiplications, a.additions + b.additions, a.functions + b.functions)


def table(rows: Sequence[Row]) -> str:
    """The rows as text, one a line under a heading."""
    width = max(len(row.model) for row in rows)
    lines = [f"{'model':{width}}  {'×':>5} {'+':>5}   {'chapter: ×':>10} {'+':>5}"]
    for row in rows:
        line = f"{row.model:{width}}  {row.operations.multiplications:5d} {row.operations.additions:5d}"
        if row.chapter:
            line += f"   {row.chapter.multiplications:10d} {row.chapter.additions:5d}"
        lines.append(line)
    return "\n".join(lines)


def inertia_matrix(graph: Graph, robot: Robot) -> list[Expression]:
    """The upper triangle of A(q), column by column: A_ik is the effort at i for unit acceleration of k at rest."""
    zero, chosen = graph.constant(0), representative(robot)
    entries: list[Scalar] = []
    for k in range(robot.n):
        unit: list[Scalar] = [graph.constant(float(i == k)) for i in range(robot.n)]
        motion = Motion([zero] * robot.n, unit, (zero, zero, zero))
        torque = customised_torque(graph, robot, chosen.symbols(graph, robot.n), motion, forms=chosen.forms)
        entries += torque[: k + 1]
    return lifted(graph, entries)


def is_chapters_robot(robot: Robot) -> bool:
    """Whether the arm has the RX-90's geometry: table 2.1, whatever the lengths."""
    turns = (0.0, pi / 2, 0.0, -pi / 2, pi / 2, -pi / 2)
    lengths = tuple((j.d != 0, j.r != 0, j.b != 0 or j.gamma != 0) for j in robot.joints)
    none = (False, False, False)
    return (
        lengths == (none, none, (True, False, False), (False, True, False), none, none)
        and all(j.revolute and abs(j.alpha - a) < 1e-9 for j, a in zip(robot.joints, turns, strict=True))
        and robot.gravity[:2] == (0.0, 0.0)
    )


def symmetric_absent(robot: Robot) -> set[str]:
    """Base parameters that are zero for the chapter's symmetric links."""
    names = base_parameters(robot).names
    return {name for name in names if not name.startswith(("XX", "YY", "ZZ", "Ia")) and name not in SYMMETRIC_MOMENTS}


def _count(outputs: list[Expression]) -> Operations:
    return count(simplified(outputs))


def _customised(robot: Robot, wrench: bool = False, absent: Collection[str] = (), **parts: bool) -> Operations:
    return count(customised_model(robot, wrench, absent=absent, **parts).torque)
