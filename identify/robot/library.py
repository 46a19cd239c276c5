"""Robots by name or by file: the built-in ones of robots/, TOML, URDF and MJCF files."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identify.errors import RobotError
from identify.robot.checks import suggestion
from identify.robot.files import read_text
from identify.robot.robot import Robot
from identify.robot.selection import Selection, parse_selection, sub_chain
from identify.robot.toml import read_toml, write_toml

SUFFIXES = (".toml", ".urdf", ".xml")


def load_robot(
    name_or_path: str | Path, joints: str | Sequence[str] = (), gravity: Sequence[float] | None = None
) -> Robot:
    """The robot of a built-in name (`built_in()`), or of a .toml, .urdf, or URDF or MJCF .xml file.

    joints: those to keep, and "name=position" [rad or m] for others, which are held there instead of at 0, as
    "a,b,c=0.3" or a sequence; by default all. gravity (3,): acceleration [m/s²] in place of the file's, in the frame
    of the root link (URDF), of the world (MJCF and TOML, whose `base` places R_0 in it).
    A built-in name wins over a file of the same name. `Robot.source` is "built-in NAME" or the path as given.
    Raises RobotError, in one line, for a name or file that is unknown, unreadable or describes no robot.
    """
    given = str(name_or_path)
    selection = parse_selection(joints) if joints else None
    if given in built_in():
        return _fitted(read_toml(read_text(_folder() / f"{given}.toml"), f"built-in {given}"), selection, gravity)
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
        return _fitted(read_toml(text, given), selection, gravity)
    if re.search(r"<mujoco[\s>/]", text) and not re.search(r"<robot[\s>]", text):
        from identify.robot.mjcf_reading import read_mjcf

        return read_mjcf(text, given, selection, gravity, path.parent)
    from identify.robot.urdf import GRAVITY, read_urdf

    return read_urdf(text, given, selection, GRAVITY if gravity is None else gravity)


def _fitted(robot: Robot, selection: Selection | None, gravity: Sequence[float] | None) -> Robot:
    """The robot with the joints that are to be kept, under the gravity (3,) of the world [m/s²]."""
    if selection is not None:
        robot = sub_chain(robot, selection.keep, selection.held)
    if gravity is not None:
        x, y, z = (float(value) + 0.0 for value in np.array(robot.base)[:3, :3].T @ np.asarray(gravity, dtype=float))
        robot = replace(robot, gravity=(x, y, z))
    return robot


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
