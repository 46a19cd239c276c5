"""What does not change while an arm moves: inertial parameters and gravity, as symbols and with their values."""

from __future__ import annotations

from identify.errors import InputError
from identify.robot.robot import Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.chain import Vec
from identify.symbolic.expression import Graph, Scalar

PARAMETERS = ("standard", "base")
"""Sets of inertial parameters that models are written in."""


def inertial_parameters(robot: Robot, which: str) -> dict[str, tuple[int, float]]:
    """{name: (index of the standard parameter in whose place it stands, value)}, "standard" or "base" ones."""
    if which == "base":
        base = base_parameters(robot)
        values = base.matrix @ robot.standard
        return {name: (k, float(x)) for name, k, x in zip(base.names, base.kept, values, strict=True)}
    if which != "standard":
        raise InputError(f"parameters are {which!r}; choose one of {', '.join(PARAMETERS)}")
    return {name: (k, float(x)) for k, (name, x) in enumerate(zip(robot.standard_names, robot.standard, strict=True))}


def base_values(robot: Robot) -> dict[str, float]:
    """Base parameters by name with the values that the robot's description gives them."""
    return {name: value for name, (_, value) in inertial_parameters(robot, "base").items()}


def standard_symbols(graph: Graph, robot: Robot, which: str) -> list[Scalar]:
    """(11 n,) standard parameters as symbols; with "base", the base parameters for those kept and zero for others."""
    values: list[Scalar] = [graph.constant(0)] * (11 * robot.n)
    for name, (k, _) in inertial_parameters(robot, which).items():
        values[k] = graph.symbol(name)
    return values


def gravity_symbols(graph: Graph, robot: Robot) -> Vec:
    """0g as symbols G1 G2 G3, zero where it has no part."""
    return tuple(graph.symbol(f"G{i + 1}") if x else graph.constant(0) for i, x in enumerate(robot.gravity))  # type: ignore[return-value]


def gravity_values(robot: Robot) -> dict[str, float]:
    """Values of those symbols [m/s²]."""
    return {f"G{i + 1}": float(x) for i, x in enumerate(robot.gravity) if x}
