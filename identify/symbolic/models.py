"""The models that can be shown, by the names that users give them."""

from __future__ import annotations

from collections.abc import Callable

import sympy

from identify.errors import InputError
from identify.robot.robot import Robot
from identify.symbolic.model import SymbolicModel


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
            f"{len(base.names)} base parameters: {', '.join(base.names)}",
            f"no effect: {', '.join(base.no_effect) or 'none'}",
            f"regrouped: {', '.join(base.regrouped) or 'none'}",
            "parameters that are not listed below are themselves",
        ),
    )


def _direct_geometry(robot: Robot) -> SymbolicModel:
    from identify.symbolic.geometry import symbolic_direct_geometry

    return symbolic_direct_geometry(robot, placed=True)


def _inverse_geometry(robot: Robot) -> SymbolicModel:
    from identify.symbolic.inverse_model import symbolic_inverse_geometry

    return symbolic_inverse_geometry(robot)


def _jacobian(robot: Robot) -> SymbolicModel:
    from identify.symbolic.jacobian import symbolic_jacobian

    return symbolic_jacobian(robot)


MODELS: dict[str, Callable[[Robot], SymbolicModel]] = {
    "base-parameters": base_parameter_model,
    "direct-geometry": _direct_geometry,
    "inverse-geometry": _inverse_geometry,
    "jacobian": _jacobian,
}
"""What `identify model --what` offers as named expressions; the table of operations is apart."""


def symbolic_model(robot: Robot, what: str) -> SymbolicModel:
    """The model of that name. InputError for a name that there is not, or a robot that the model is not for."""
    if what not in MODELS:
        raise InputError(f"what is {what!r}; choose one of {', '.join(MODELS)}")
    try:
        return MODELS[what](robot)
    except ValueError as error:
        raise InputError(f"{robot.name}: {what}: {error}") from error
