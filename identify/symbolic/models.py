"""The models that can be shown, by the names that users give them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import sympy

from identify.errors import InputError
from identify.robot.robot import Robot
from identify.symbolic.model import Result, SymbolicModel


def base_parameter_model(robot: Robot) -> SymbolicModel:
    """Base parameters as functions of the standard ones, with what has no effect and what is regrouped."""
    from identify.symbolic.base_parameters import base_parameters
    from identify.symbolic.geometry import letters

    base = base_parameters(robot)
    expressions: dict[str, sympy.Expr] = {
        name: formula for name, formula in base.grouping.items() if str(formula) != name
    }
    lengths = letters(robot)
    used = {s.name for e in expressions.values() for s in e.free_symbols} - {name for name, _ in lengths}
    return SymbolicModel(
        robot.name,
        "base-parameters",
        expressions,
        tuple(name for name in robot.standard_names if name in used),
        lengths,
        (
            f"{len(base.names)} base parameter{'s' * (len(base.names) != 1)}: {', '.join(base.names)}",
            f"no effect: {', '.join(base.no_effect) or 'none'}",
            f"regrouped: {', '.join(base.regrouped) or 'none'}",
            "parameters that are not listed below are themselves",
        ),
    )


LONG = 1500
"""Operations beyond which a model's expressions get intermediate variables."""


def _in_statements(model: SymbolicModel) -> SymbolicModel:
    """The model with intermediate variables for what its expressions share, where they fill pages."""
    from identify.symbolic.expression import Graph
    from identify.symbolic.naming import graph_of, short_statements

    if sum(int(e.count_ops()) for e in model.expressions.values()) <= LONG:
        return model
    graph = Graph()
    outputs = {name: graph_of(graph, e) for name, e in model.expressions.items()}
    results = model.results or tuple(Result(name, (name,)) for name in outputs)
    return replace(model, expressions=short_statements(outputs, {}), results=results)


def _direct_geometry(robot: Robot, orientation: str = "cosines") -> SymbolicModel:
    from identify.symbolic.geometry import symbolic_direct_geometry
    from identify.symbolic.orientation_model import with_orientation

    return with_orientation(_in_statements(symbolic_direct_geometry(robot, placed=True)), orientation)


def _inverse_geometry(robot: Robot) -> SymbolicModel:
    from identify.symbolic.inverse_model import symbolic_inverse_geometry

    return symbolic_inverse_geometry(robot)


def _jacobian(robot: Robot, frame: int | str | None = None, decomposed: bool = False) -> SymbolicModel:
    from identify.symbolic.jacobian import symbolic_jacobian
    from identify.symbolic.jacobian_forms import symbolic_decomposed_jacobian, symbolic_tool_jacobian

    if isinstance(frame, str):
        if decomposed:
            raise InputError(f"{robot.name}: the three matrices are for a frame by number, not for the {frame}")
        return _in_statements(symbolic_tool_jacobian(robot))
    if decomposed:
        return _in_statements(symbolic_decomposed_jacobian(robot, frame or 0))
    return _in_statements(symbolic_jacobian(robot, frame))


def _inverse_kinematics(robot: Robot, frame: int | str | None = None) -> SymbolicModel:
    from identify.symbolic.inverse_kinematics import symbolic_inverse_kinematics

    if isinstance(frame, str):
        raise InputError(f"{robot.name}: the inverse is in the axes of a frame by number, not of the {frame}")
    return symbolic_inverse_kinematics(robot, frame)


def _lagrange(robot: Robot, parameters: str = "standard") -> SymbolicModel:
    from identify.symbolic.lagrange import symbolic_lagrange

    return symbolic_lagrange(robot, parameters)


def _newton_euler(robot: Robot) -> SymbolicModel:
    from identify.symbolic.inverse_dynamics import symbolic_newton_euler

    return symbolic_newton_euler(robot)


def _direct_dynamics(robot: Robot) -> SymbolicModel:
    from identify.symbolic.direct_dynamics import symbolic_direct_dynamics

    return symbolic_direct_dynamics(robot)


def _energy(robot: Robot) -> SymbolicModel:
    from identify.symbolic.energy_model import symbolic_energy

    return symbolic_energy(robot)


MODELS: dict[str, Callable[..., SymbolicModel]] = {
    "base-parameters": base_parameter_model,
    "direct-geometry": _direct_geometry,
    "inverse-geometry": _inverse_geometry,
    "jacobian": _jacobian,
    "inverse-kinematics": _inverse_kinematics,
    "lagrange": _lagrange,
    "newton-euler": _newton_euler,
    "direct-dynamics": _direct_dynamics,
    "energy": _energy,
}
"""What `identify model --what` offers as named expressions; the table of operations is apart."""


OPTIONS: dict[str, tuple[str, ...]] = {
    "direct-geometry": ("orientation",),
    "jacobian": ("frame", "decomposed"),
    "inverse-kinematics": ("frame",),
    "lagrange": ("parameters",),
}
"""Which options each model has."""


def symbolic_model(robot: Robot, what: str, **options: Any) -> SymbolicModel:
    """The model of that name. InputError for a name that there is not, or a robot or option that it is not for.

    parameters: "standard" (if not given) or "base" ones in Lagrange's equations. orientation: one of ORIENTATIONS, in
    direct geometry. frame: number of the frame in whose axes Jacobian or inverse kinematics are (the middle of the
    chain), "tool" for the Jacobian of the tool in its own axes. decomposed: the Jacobian as three matrices [2.30], in
    R0 if no frame is given.
    """
    if what not in MODELS:
        raise InputError(f"what is {what!r}; choose one of {', '.join(MODELS)}")
    model = MODELS[what](robot, **given_options(what, options))
    twice = sorted({*model.expressions, *model.inputs} & {name for name, _ in model.lengths})
    if twice:
        raise InputError(f"{robot.name}: {what} has a variable {twice[0]}; give the length of that name another letter")
    return replace(model, notes=(_legend(robot), *model.notes))


def given_options(what: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """The options that are given, neither None nor False. InputError for one that is not for this model."""
    given = {name: value for name, value in options.items() if value is not None and value is not False}
    for name in given:
        if name not in OPTIONS.get(what, ()):
            those = " or ".join(model for model in OPTIONS if name in OPTIONS[model])
            raise InputError(f"--{name}: {what} has no choice of this, {those} has; leave it out")
    return given


def _legend(robot: Robot) -> str:
    """Which joint each number stands for: they count the joints that are kept."""
    names = ", ".join(joint.name for joint in robot.joints)
    return f"q1 … q{robot.n}: {names}" if robot.n > 1 else f"q1: {names}"
