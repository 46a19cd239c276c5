"""Inverse dynamics as a controller carries it: Newton and Euler's recurrence [2.69]–[2.89], customised."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from identify.robot.robot import Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.chain import dot
from identify.symbolic.constants import base_values, gravity_symbols, gravity_values
from identify.symbolic.customised import customised_torque
from identify.symbolic.expression import Expression, Graph, Scalar
from identify.symbolic.form import Forms, turn_symbol, unit_letter
from identify.symbolic.geometry import letters
from identify.symbolic.joint_effort import friction, joint_parameters, shared_effort, signs
from identify.symbolic.link_motion import recurrence
from identify.symbolic.model import SymbolicModel, vector
from identify.symbolic.motion import Motion
from identify.symbolic.naming import exact, named, recognised
from identify.symbolic.operations import count, lifted
from identify.symbolic.representative import Representative, representative_name, written_with_letters
from identify.symbolic.second_moments import (
    MX,
    MY,
    MZ,
    XX,
    XY,
    XZ,
    YY,
    YZ,
    M,
    standard_from_second_moments,
)
from identify.symbolic.simplification import simplified

if TYPE_CHECKING:
    import sympy

AGREED = 1e-9


@dataclass(frozen=True)
class WrittenEffort:
    """Rigid-body effort (n,) with a wrench on the last link, as it is printed and counted, in the symbols of `chosen`.

    `arm` is the robot to write; where `upwards`, gravity is the acceleration Vp0 = -G of the base.
    """

    torque: list[Expression]
    arm: Robot
    chosen: Representative
    upwards: bool


def written_effort(robot: Robot) -> WrittenEffort:
    """The recurrence in the forms of the robot's representative, after `simplified`; of the two signs that gravity may
    have, the one that takes fewer operations."""
    arm, chosen = written_with_letters(robot)
    found = []
    for upwards in (False, True):
        graph = Graph()
        motion = Motion.of(graph, arm, gravity=False, wrench=True)
        unit = "u" if chosen.forms.unit != 1.0 else ""
        names = [f"Vp0_{i + 1}" if upwards else f"G{i + 1}{unit}" for i in range(3)]
        down = [graph.symbol(name) if g else graph.constant(0) for name, g in zip(names, robot.gravity, strict=True)]
        x, y, z = (-g if upwards else g for g in down)
        motion = replace(motion, gravity=(x, y, z))
        torque = customised_torque(graph, arm, chosen.symbols(graph, robot.n), motion, True, chosen.forms)
        found.append(WrittenEffort(simplified(lifted(graph, torque)), arm, chosen, upwards))
    return min(found, key=lambda effort: sum(_cost(effort.torque)))


def _cost(torque: list[Expression]) -> tuple[int, int]:
    counted = count(torque)
    return counted.multiplications, counted.additions


def customised_effort(graph: Graph, robot: Robot, motion: Motion) -> list[Expression]:
    """(n,) rigid-body effort in the second-moment parameters of `representative`, in metres, no frame turned."""
    arm, chosen = written_with_letters(robot)
    forms = in_metres(chosen.forms)
    return lifted(graph, customised_torque(graph, arm, chosen.symbols(graph, robot.n), motion, True, forms))


def in_metres(forms: Forms) -> Forms:
    """The forms with the metre as unit of length, and no frame turned."""
    return replace(forms, unit=1.0, turned=())


def customised_motion(graph: Graph, robot: Robot, *, ddq: bool = True, wrench: bool = False) -> Motion:
    """Every joint's motion and gravity as symbols; accelerations and the wrench on the last link if asked for."""
    moving = Motion.of(graph, robot, ddq=ddq, gravity=False, wrench=wrench)
    return Motion(moving.dq, moving.ddq, gravity_symbols(graph, robot), moving.force, moving.moment)


def carried_parameters(robot: Robot, forms: Forms | None = None) -> dict[str, sympy.Expr]:
    """{rSXX2: its formula in base parameters and lengths …}: the parameters that the customised model reads, in the
    unit of length and the turned frames of the forms; by default in metres and no frame turned."""
    import sympy

    base, (arm, chosen) = base_parameters(robot), written_with_letters(robot)
    forms = forms or in_metres(chosen.forms)
    names = [sympy.Symbol(name) for name in base.names]
    entries = _with_letters(arm, base.grouping, chosen.kept)
    if entries is not None:
        lengths = {sympy.Symbol(name): value for name, value in letters(robot)}
        numbers = np.array(entries.xreplace(lengths), dtype=float)
        if np.abs(numbers - chosen.matrix).max() > AGREED * np.abs(chosen.matrix).max():
            entries = None
    if entries is None:
        entries = sympy.Matrix(len(chosen.kept), len(names), lambda i, k: exact(float(chosen.matrix[i, k])))
    formulas = dict(zip(chosen.kept, entries * sympy.Matrix(names), strict=True))
    turned: dict[str, sympy.Expr] = {}
    for j in forms.turned:
        turned[turn_symbol(j)] = sympy.atan2(*(formulas[11 * j + k] for k in (MY, MX)))
        formulas |= _turned(j, formulas)
    unit = _unit(arm, forms)
    scale = {MX: unit, MY: unit, MZ: unit, M: unit**2}
    return turned | {
        representative_name(k): sympy.expand(scale[k % 11] * e) if k % 11 in scale else e for k, e in formulas.items()
    }


def _unit(arm: Robot, forms: Forms) -> sympy.Expr:
    import sympy

    name = unit_letter(arm, forms.unit)
    return sympy.Symbol(name) if name else exact(forms.unit)


def _turned(j: int, formulas: dict[int, sympy.Expr]) -> dict[int, sympy.Expr]:
    """Parameters of link j that are there, in its frame turned about z by `turn_symbol`, where MY is zero."""
    import sympy

    angle = sympy.Symbol(turn_symbol(j))
    c, s = sympy.cos(angle), sympy.sin(angle)
    xx, xy, xz, yy, yz, mx, my = (formulas.get(11 * j + k, sympy.Integer(0)) for k in (XX, XY, XZ, YY, YZ, MX, MY))
    found = {
        XX: c**2 * xx + 2 * c * s * xy + s**2 * yy, XY: c * s * (yy - xx) + (c**2 - s**2) * xy,
        YY: s**2 * xx - 2 * c * s * xy + c**2 * yy, XZ: c * xz + s * yz, YZ: c * yz - s * xz, MX: c * mx + s * my,
        MY: sympy.Integer(0),
    }  # fmt: skip
    return {11 * j + k: e for k, e in found.items() if 11 * j + k in formulas}


def in_units(robot: Robot, arm: Robot, forms: Forms) -> dict[str, sympy.Expr]:
    """{D3u: D3/RL4, D3i: RL4/D3, G3u: G3/RL4, Vp0_3: -G3/RL4 …}: lengths and gravity in the unit of length."""
    import sympy

    unit = _unit(arm, forms)
    found: dict[str, sympy.Expr] = {}
    for j, joint in enumerate(arm.joints):
        for key in "drb":
            if getattr(joint, key):
                name = dict(joint.symbols).get(key)
                length = sympy.Symbol(name) if name else exact(getattr(joint, key))
                own = name or f"{key}{j + 1}"
                found |= {f"{own}u": length / unit, f"{own}i": unit / length}
    for name in gravity_values(robot):
        found |= {f"{name}u": sympy.Symbol(name) / unit, f"Vp0_{name[1:]}": -sympy.Symbol(name) / unit}
    return found


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
    robot: Robot, statements: dict[str, sympy.Expr], forms: Forms | None = None
) -> tuple[dict[str, sympy.Expr], tuple[tuple[str, float], ...]]:
    """Statements with those of carried parameters and signs before them, and the constants that they read."""
    import sympy

    arm, chosen = written_with_letters(robot)
    forms = forms or in_metres(chosen.forms)
    values = gravity_values(robot) | base_values(robot) | joint_parameters(robot)
    carried = carried_parameters(robot, forms)
    same = {sympy.Symbol(name): e for name, e in carried.items() if e.is_Symbol}
    statements = {name: e.xreplace(same) for name, e in statements.items()}
    read = {s.name for e in statements.values() for s in e.free_symbols}
    first: dict[str, sympy.Expr] = {}
    own = in_units(robot, arm, forms) | carried | signs(robot)
    for name in reversed(own):
        if name in read and sympy.Symbol(name) not in same:
            first = {name: own[name]} | first
            read |= {s.name for s in own[name].free_symbols}
    return first | statements, tuple((k, v) for k, v in values.items() if k in read)


def symbolic_newton_euler(robot: Robot) -> SymbolicModel:
    """tau for q, dq, ddq and a wrench, with the base parameters, friction and actuator inertia, in few operations."""
    n, rigid = robot.n, written_effort(robot)
    graph = rigid.torque[0].graph
    parts = zip(rigid.torque, friction(graph, robot), shared_effort(graph, robot), strict=True)
    torque = lifted(graph, (a + b + c for a, b, c in parts))
    outputs = {f"tau{j + 1}": torque[j] for j in reversed(range(n))}
    forms = rigid.chosen.forms
    whole = named(outputs, recognised(torque, _quantities(rigid)), as_counted=True)
    statements, parameters = assembled(robot, whole, forms)
    notes = (
        "tau by a forward recurrence for the motion of the links, a backward one for their wrenches [2.69]-[2.89]",
        "with base parameters, actuator inertia Ia and friction Fv dq + Fs sign(dq) + off",
        f"(F, N): force and moment that link {n} exerts on its surroundings, at O{n} in R{n}; gravity G1 G2 G3 in R0",
        "in R_j: w angular velocity, wp its derivative, U = wp^ + w^w^; where they have a name, Vp, f and m:",
        "acceleration of O_j less gravity, force and moment that link j-1 exerts on link j",
        *about_parameters(robot, forms),
    )
    inputs = tuple(f"{p}{j + 1}" for p in ("q", "dq", "ddq") for j in range(n))
    return SymbolicModel(
        robot.name, "newton-euler", statements, inputs + tuple(f"{p}{i}" for p in "FN" for i in (1, 2, 3)),
        letters(robot), notes, parameters, (vector("tau", n),),
    )  # fmt: skip


def about_parameters(robot: Robot, forms: Forms | None = None) -> list[str]:
    """What a reader must know of the named constants of a model in these forms."""
    arm, chosen = written_with_letters(robot)
    forms = forms or in_metres(chosen.forms)
    found = [
        "rSXX2, rMX2 ...: not the robot's own, but parameters of bodies with the same base parameters and so the same",
        "effort: second moments (XX = SYY + SZZ, XY = -SXY), first moments, mass, actuator inertia; some are negative",
    ]
    if forms.unit != 1.0:
        unit = unit_letter(arm, forms.unit) or f"{forms.unit!r} m"
        found.append(f"lengths, gravity, first moments and masses in units of {unit}: G3u = G3/unit, Vp0 = -G/unit;")
        found.append("D3u: a length over the unit, D3i: the unit over a length; the wrench and tau are in SI")
    for j in forms.turned:
        angle = turn_symbol(j)
        found.append(f"parameters of link {j + 1} in R{j + 1} turned about z by {angle}, where MY is 0;")
        found.append(f"CP{j + 1}, SP{j + 1}: cos and sin of q{j + 1} + {angle}; the wrench is in R{j + 1} all the same")
    return found


def _quantities(effort: WrittenEffort) -> dict[str, Scalar]:
    """What the recurrence passes on, for the bodies of `representative`, of a graph of its own; angular velocities and
    accelerations alone where lengths are not in metres or a frame is turned."""
    graph, arm, chosen = Graph(), effort.arm, effort.chosen
    kept = chosen.symbols(graph, arm.n)
    rows = standard_from_second_moments(arm.n)
    standard = [dot([float(row[k]) for k in row.nonzero()[0]], [kept[k] for k in row.nonzero()[0]]) for row in rows]
    found = recurrence(graph, arm, standard)
    if in_metres(chosen.forms) == chosen.forms and not effort.upwards:
        return found
    return {name: x for name, x in found.items() if name.startswith(("w", "U"))}
