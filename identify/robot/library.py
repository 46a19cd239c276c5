"""Robots by name or by file: the built-in ones of robots/, TOML and URDF files."""

from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path

from identify.errors import RobotError
from identify.robot.checks import suggestion
from identify.robot.robot import Robot
from identify.robot.toml import read_text, read_toml, write_toml

SUFFIXES = (".toml", ".urdf", ".xml")


def load_robot(name_or_path: str | Path) -> Robot:
    """The robot of a built-in name (`built_in()`), or of a .toml, .urdf or URDF .xml file.

    A built-in name wins over a file of the same name. `Robot.source` is "built-in NAME" or the path as given.
    Raises RobotError, in one line, for a name or file that is unknown, unreadable or describes no robot.
    """
    given = str(name_or_path)
    if given in built_in():
        return read_toml(read_text(_folder() / f"{given}.toml"), f"built-in {given}")
    if not given.strip():
        raise RobotError(f"no robot given: expected a robot file, or a built-in robot: {_names()}")
    path = Path(name_or_path)
    suffix = path.suffix.lower()
    if os.path.isdir(path):
        raise RobotError(
            f"{given}: is a folder; give a {_one_of(SUFFIXES)} file in it, or a built-in robot: {_names()}"
        )
    if suffix not in SUFFIXES:
        if os.path.exists(path):
            raise RobotError(f"{given}: can't tell the format; a robot file ends in {_one_of(SUFFIXES)}")
        near = suggestion(given, built_in()) if not suffix and path.name == given else "no such file"
        raise RobotError(f"unknown robot {given!r}: {near}; built-in robots: {_names()}, or give a robot file")
    if not os.path.exists(path):
        raise RobotError(f"{given}: no such file; give a robot file, or a built-in robot: {_names()}")
    text = read_text(path)
    if suffix == ".toml":
        return read_toml(text, given)
    if re.search(r"<mujoco[\s>]", text) and not re.search(r"<robot[\s>]", text):
        raise RobotError(f"{given}: an MJCF model, which is not read; give the arm's URDF or describe it in TOML")
    from identify.robot.urdf import read_urdf

    return read_urdf(text, given)


def built_in() -> tuple[str, ...]:
    """Names of the robots that come with the package, sorted."""
    return tuple(sorted(path.stem for path in _folder().glob("*.toml")))


def robot_digest(robot: Robot) -> str:
    """SHA-256 (hex) of the robot written as TOML: equal for equal robots, wherever they were read from."""
    return hashlib.sha256(write_toml(robot).encode()).hexdigest()


def _folder() -> Path:
    """robots/ beside the modules in an installed package, or at the top of a source checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "robots"
    return installed if installed.is_dir() else package.parent / "robots"


def _names() -> str:
    return ", ".join(built_in())


def _one_of(words: tuple[str, ...]) -> str:
    return f"{', '.join(words[:-1])} or {words[-1]}"
