"""Inverse dynamics as a controller carries it: Newton and Euler's recurrence [2.69]–[2.89], customised."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from identify.robot.robot import Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.chain import dot
from identify.symbolic.constants import base_values, gravity_symbols, gravity_values
from identify.symbolic.customised import customised_torque
from identify.symbolic.expression import Expression, Graph, Scalar
from identify.symbolic.geometry import letters
from identify.symbolic.joint_effort import friction, joint_parameters, shared_effort, signs
from identify.symbolic.link_motion import recurrence
from identify.symbolic.model import SymbolicModel, vector
from identify.symbolic.motion import Motion
from identify.symbolic.naming import exact, short_statements
from identify.symbolic.operations import lifted
from identify.symbolic.representative import representative
from identify.symbolic.second_moments import parameter_name, standard_from_second_moments

if TYPE_CHECKING:
    import sympy

AGREED = 1e-9


def customised_effort(graph: Graph, robot: Robot, motion: Motion) -> list[Expression]:
    """(n,) rigid-body effort in the second-moment parameters of `representative`, lengths and gravity as letters."""
    chosen = representative(robot)
    return lifted(graph, customised_torque(graph, robot, chosen.symbols(graph, robot.n), motion, True, chosen.forms))


def customised_motion(graph: Graph, robot: Robot, *, ddq: bool = True, wrench: bool = False) -> Motion:
    """Every joint's motion and gravity as symbols; accelerations and the wrench on the last link if asked for."""
    moving = Motion.of(graph, robot, ddq=ddq, gravity=False, wrench=wrench)
    return Motion(moving.dq, moving.ddq, gravity_symbols(graph, robot), moving.force, moving.moment)


def carried_parameters(robot: Robot) -> dict[str, sympy.Expr]:
    """{SXX2: its formula in base parameters and lengths …}: the parameters that the customised model reads."""
    import sympy

    base, chosen = base_parameters(robot), representative(robot)
    names = [sympy.Symbol(name) for name in base.names]
    entries = _with_letters(robot, base.grouping, chosen.kept)
    if entries is not None:
        lengths = {sympy.Symbol(name): value for name, value in letters(robot)}
        numbers = np.array(entries.xreplace(lengths), dtype=float)
        if np.abs(numbers - chosen.matrix).max() > AGREED * np.abs(chosen.matrix).max():
            entries = None
    if entries is None:
        entries = sympy.Matrix(len(chosen.kept), len(names), lambda i, k: exact(float(chosen.matrix[i, k])))
    formulas = entries * sympy.Matrix(names)
    return {parameter_name(k): formula for k, formula in zip(chosen.kept, formulas, strict=True)}


def _with_letters(robot: Robot, grouping: dict[str, sympy.Expr], kept: tuple[int, ...]) -> sympy.Matrix | None:
    """(k, p) values matrix of the kept parameters with lengths as letters; None for a robot without any."""
    import sympy
    from sympy.polys.matrices import DomainMatrix

    if not letters(robot) or len(kept) != len(grouping):
        return None
    standard = {sympy.Symbol(name): k for k, name in enumerate(robot.standard_names)}
    change = standard_from_second_moments(robot.n)[:, list(kept)]
    rows = []
    for formula in grouping.values():
        row = [sympy.Integer(0)] * len(kept)
        expanded = sympy.expand(formula)
        for symbol in expanded.free_symbols & standard.keys():
            for k in np.flatnonzero(change[standard[symbol]]):
                row[k] += expanded.coeff(symbol) * int(change[standard[symbol], k])
        rows.append(row)
    return DomainMatrix.from_Matrix(sympy.Matrix(rows)).to_field().inv().to_Matrix()


def assembled(
    robot: Robot, statements: dict[str, sympy.Expr]
) -> tuple[dict[str, sympy.Expr], tuple[tuple[str, float], ...]]:
    """Statements with those of carried parameters and signs before them, and the constants that they read."""
    import sympy

    values = gravity_values(robot) | base_values(robot) | joint_parameters(robot)
    carried = carried_parameters(robot)
    # A body that stands for others may have a first moment other than the base parameter of that name.
    other = {sympy.Symbol(k): sympy.Symbol(f"{k}_") for k, e in carried.items() if k in values and str(e) != k}
    statements = {name: e.xreplace(other) for name, e in statements.items()}
    own = {other.get(sympy.Symbol(k), sympy.Symbol(k)).name: e for k, e in carried.items() if str(e) != k}
    read = {s.name for e in statements.values() for s in e.free_symbols}
    first = {name: e for name, e in (own | signs(robot)).items() if name in read}
    read |= {s.name for e in first.values() for s in e.free_symbols}
    return first | statements, tuple((k, v) for k, v in values.items() if k in read)


def symbolic_newton_euler(robot: Robot) -> SymbolicModel:
    """tau for q, dq, ddq and a wrench, with the base parameters, friction and actuator inertia, in few operations."""
    n, graph = robot.n, Graph()
    rigid = customised_effort(graph, robot, customised_motion(graph, robot, wrench=True))
    parts = zip(rigid, friction(graph, robot), shared_effort(graph, robot), strict=True)
    torque = lifted(graph, (a + b + c for a, b, c in parts))
    outputs = {f"tau{j + 1}": torque[j] for j in reversed(range(n))}
    statements, parameters = assembled(robot, short_statements(outputs, _quantities(robot)))
    notes = (
        "tau by a forward recurrence for the motion of the links, a backward one for their wrenches [2.69]-[2.89]",
        "with base parameters, actuator inertia Ia and friction Fv dq + Fs sign(dq) + off",
        f"(F, N): force and moment that link {n} exerts on its surroundings, at O{n} in R{n}; gravity G1 G2 G3 in R0",
        "in R_j: w angular velocity, wp its derivative, Vp acceleration of O_j less gravity, U = wp^ + w^w^, f and m",
        "SXX, SXY ...: second moments of bodies with these base parameters, XX = SYY + SZZ, XY = -SXY",
    )
    inputs = tuple(f"{p}{j + 1}" for p in ("q", "dq", "ddq") for j in range(n))
    return SymbolicModel(
        robot.name, "newton-euler", statements, inputs + tuple(f"{p}{i}" for p in "FN" for i in (1, 2, 3)),
        letters(robot), notes, parameters, (vector("tau", n),),
    )  # fmt: skip


def _quantities(robot: Robot) -> dict[str, Scalar]:
    """What the recurrence passes on, for the bodies of `representative`, of a graph of its own."""
    graph = Graph()
    kept = representative(robot).symbols(graph, robot.n)
    rows = standard_from_second_moments(robot.n)
    standard = [dot([float(row[k]) for k in row.nonzero()[0]], [kept[k] for k in row.nonzero()[0]]) for row in rows]
    return recurrence(graph, robot, standard)
