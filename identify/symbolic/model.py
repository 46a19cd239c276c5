"""A symbolic model as named expressions, in the order in which they may be computed: what every printer takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sympy


CORIOLIS = "Cc"
"""Letters of the entries of C(q,q̇): C12 would be the cosine of q1 + q2."""


@dataclass(frozen=True)
class Result:
    """What a model is asked for: names of expressions, row by row.

    columns: of a matrix; 0 for a vector, and for a number, which has one entry of its own name.
    """

    name: str
    entries: tuple[str, ...]
    columns: int = 0

    @property
    def number(self) -> bool:
        """Whether it is one number."""
        return self.entries == (self.name,)


@dataclass(frozen=True)
class SymbolicModel:
    """Named sympy expressions of one model of one robot.

    `expressions` maps a name (a valid identifier) to its expression; an expression may use the names of
    earlier ones as symbols. `inputs` are the symbols given from outside (q1 …, the entries of a pose,
    signs of branches); lengths that the robot keeps as letters stand in `lengths` with their values [m], gravity and
    inertial parameters in `parameters` with theirs [SI].
    `results` are what the model is for; without them, every expression is one. `notes` are sentences and equations for
    a reader.
    """

    robot: str
    what: str
    expressions: dict[str, sympy.Expr]
    inputs: tuple[str, ...] = ()
    lengths: tuple[tuple[str, float], ...] = ()
    notes: tuple[str, ...] = ()
    parameters: tuple[tuple[str, float], ...] = ()
    results: tuple[Result, ...] = ()

    @property
    def constants(self) -> tuple[tuple[str, float], ...]:
        """Lengths and parameters that an expression reads, with their values."""
        read = {s.name for e in self.expressions.values() for s in e.free_symbols}
        return tuple((name, value) for name, value in (*self.lengths, *self.parameters) if name in read)


def entry_name(letter: str, n: int, i: int, k: int) -> str:
    """Name of entry (i, k), from 0, of a matrix of a robot of n joints: A12, from ten joints on A1_2."""
    return f"{letter}{i + 1}{k + 1}" if n < 10 else f"{letter}{i + 1}_{k + 1}"


def vector(name: str, n: int) -> Result:
    """The result name1 … namen."""
    return Result(name, tuple(f"{name}{j + 1}" for j in range(n)))


def matrix(name: str, n: int, letter: str = "", symmetric: bool = False) -> Result:
    """The (n, n) result of entries A11 … Ann, or with another letter; `symmetric`: A12 serves for A21 too."""
    pairs = ((i, k) if i <= k or not symmetric else (k, i) for i in range(n) for k in range(n))
    return Result(name, tuple(entry_name(letter or name, n, i, k) for i, k in pairs), n)
