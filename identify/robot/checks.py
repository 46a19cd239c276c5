"""What a value in a robot description must be: each check returns the value or says in one line what is wrong.

`where` names the file, the joint and the key, as in  arm.toml: joint 'elbow': link.mass.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from identify.errors import RobotError
from identify.robot.robot import Link

ROUNDING = 1e-9
"""Share of the largest principal moment by which an inertia may miss a condition for lack of digits."""

LARGEST = 1e10
"""Largest number of a description, in SI, apart from limits: beyond it squares and products lose all meaning."""

LONGEST = 200
"""Characters of a name."""


def found(value: Any) -> str:
    """How a value read from a file is shown in a message: short, on one line."""
    try:
        shown = " ".join(repr(value).split())
    except (RecursionError, ValueError):  # nested without end; an integer of thousands of digits
        shown = f"a {type(value).__name__} out of all proportion"
    return shown if len(shown) <= 60 else shown[:57] + "..."


def suggestion(word: str, choices: Iterable[str]) -> str:
    """'did you mean …?' for the choice nearest to a word, or the list of choices."""
    choices = list(choices)
    near = difflib.get_close_matches(word, choices, n=1)
    return f"did you mean {near[0]!r}?" if near else f"expected one of {', '.join(choices)}"


def table(value: Any, keys: Iterable[str], where: str) -> dict[str, Any]:
    """A table that holds no key outside `keys`."""
    if not isinstance(value, dict):
        raise RobotError(f"{where}: expected a table {{ key = value }}, found {found(value)}")
    keys = list(keys)
    for key in value:
        if key not in keys:
            raise RobotError(f"{where}: unknown key {key!r}; {suggestion(key, keys)}")
    return value


def text(value: Any, where: str, longest: int = LONGEST) -> str:
    """A string that is not empty, of at most `longest` characters."""
    if not isinstance(value, str):
        raise RobotError(f"{where}: expected text in quotes, found {found(value)}")
    if not value.strip():
        raise RobotError(f"{where}: expected text, found an empty string")
    if len(value) > longest:
        raise RobotError(f"{where}: longer than {longest:,} characters: {found(value)}")
    return value


def number(value: Any, where: str, infinite: bool = False) -> float:
    """A number as float; finite and no larger than LARGEST, unless `infinite` allows ±inf and all below."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RobotError(f"{where}: expected a number, found {found(value)}")
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if math.isnan(result) or (math.isinf(result) and not infinite):
        raise RobotError(f"{where}: expected a finite number, found {found(value)}")
    if abs(result) > LARGEST and not infinite:
        raise RobotError(f"{where}: expected a number up to {LARGEST:g}, found {found(value)}")
    return result


def numbers(value: Any, count: int, where: str, infinite: bool = False) -> tuple[float, ...]:
    """A list of exactly `count` numbers, finite unless `infinite` allows ±inf."""
    if not isinstance(value, list):
        raise RobotError(f"{where}: expected a list of {count} numbers, found {found(value)}")
    if len(value) != count:
        raise RobotError(f"{where}: expected {count} numbers, found {len(value)}")
    return tuple(number(item, f"{where}[{i}]", infinite) for i, item in enumerate(value))


def not_negative(value: float, where: str) -> float:
    """A number that is 0 or more."""
    if value < 0:
        raise RobotError(f"{where}: expected 0 or more, found {value:g}")
    return value


def positive(value: float, where: str) -> float:
    """A number above 0."""
    if value <= 0:
        raise RobotError(f"{where}: expected more than 0, found {value:g}")
    return value


def inertia_problem(link: Link) -> str | None:
    """Why no body has this mass and inertia, or None if one may. An all-zero link counts as "not known".

    Conditions on the inertia about the centre of mass: positive semidefinite, and no principal moment
    above the sum of the other two (Traversaro et al. 2016); both up to a share `ROUNDING`.
    """
    if link.mass < 0:
        return f"the mass {link.mass:g} kg is negative"
    moments = link.principal_moments
    slack = ROUNDING * float(np.abs(moments).max())
    listed = ", ".join(f"{moment:.6g}" for moment in moments)
    if link.mass == 0 and np.any(moments):
        return f"the inertia is not zero (principal moments {listed} kg·m²) although the mass is"
    if moments[0] < -slack:
        return f"the inertia about the centre of mass is not positive: its principal moments are {listed} kg·m²"
    if moments[2] > moments[0] + moments[1] + slack:
        return f"no body has the principal moments of inertia {listed} kg·m²: the largest exceeds the sum of the others"
    return None
