"""A load: a body fixed to the last link, beside what the robot's description says of it."""

from __future__ import annotations

import tomllib
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from identify.errors import RobotError
from identify.robot import checks
from identify.robot.files import read_text
from identify.robot.robot import Link, Robot
from identify.robot.transforms import merge_links

FORMS = "MASS, MASS,X,Y,Z or a .toml file with mass, com and inertia"


def carrying(robot: Robot, load: Link) -> Robot:
    """The robot with a load, given in R_n, on its last link."""
    *others, last = robot.joints
    return replace(robot, joints=(*others, replace(last, link=merge_links(last.link, load))))


def read_payload(text: str | Path) -> Link:
    """A load in R_n from "MASS" or "MASS,X,Y,Z" (a point mass, kg and m), or from a TOML file.

    The file has the keys of a link in a robot file: mass [kg], com [m] in R_n, inertia [kg·m²] about the centre of
    mass in the axes of R_n. RobotError, in one line, for anything else.
    """
    if str(text).lower().endswith(".toml"):
        return _from_file(Path(text))
    try:
        numbers = [float(word) for word in str(text).split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 4):
        raise RobotError(f"payload {str(text)!r}: can't be read; give {FORMS}")
    mass, *com = (checks.number(x, f"payload {text}") for x in numbers)
    x, y, z = com or (0.0, 0.0, 0.0)
    return Link(checks.positive(mass, f"payload {text}: mass"), (x, y, z))


def _from_file(path: Path) -> Link:
    try:
        data: dict[str, Any] = tomllib.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise RobotError(f"{path}: not valid TOML: {error}") from None
    checks.table(data, [f.name for f in fields(Link)], str(path))
    if "mass" not in data:
        raise RobotError(f"{path}: the load has no mass; add  mass = ...  [kg]")
    x, y, z = checks.numbers(data.get("com", [0.0, 0.0, 0.0]), 3, f"{path}: com")
    link = Link(
        checks.positive(checks.number(data["mass"], f"{path}: mass"), f"{path}: mass"),
        (x, y, z),
        checks.numbers(data.get("inertia", [0.0] * 6), 6, f"{path}: inertia"),
    )
    if problem := checks.inertia_problem(link):
        raise RobotError(f"{path}: inertia: impossible value: {problem}")
    return link
