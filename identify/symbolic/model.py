"""A symbolic model as named expressions, in the order in which they may be computed: what every printer takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sympy


@dataclass(frozen=True)
class SymbolicModel:
    """Named sympy expressions of one model of one robot.

    `expressions` maps a name (a valid identifier) to its expression; an expression may use the names of
    earlier ones as symbols. `inputs` are the symbols given from outside (q1 …, the entries of a pose,
    signs of branches); lengths that the robot keeps as letters stand in `lengths` with their values [m].
    `notes` are sentences and equations for a reader.
    """

    robot: str
    what: str
    expressions: dict[str, sympy.Expr]
    inputs: tuple[str, ...] = ()
    lengths: tuple[tuple[str, float], ...] = ()
    notes: tuple[str, ...] = ()
