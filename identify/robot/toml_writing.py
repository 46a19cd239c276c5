"""A Robot written as TOML with every digit, so that it reads back equal."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from identify.robot.robot import GEOMETRY, IDENTITY, Joint, Limits, Matrix, Robot
from identify.robot.transforms import from_roll_pitch_yaw, to_matrix, to_roll_pitch_yaw


def write_toml(robot: Robot) -> str:
    """TOML text that `read_toml` turns into an equal Robot, `source` apart, which belongs to the reader."""
    lines = [f"name = {_value(robot.name)}"]
    if robot.note:
        lines.append(f"note = {_value(robot.note)}")
    lines.append(f"gravity = {_value(robot.gravity)}")
    lines += [f"{key} = {_placed(getattr(robot, key))}" for key in ("base", "tool") if getattr(robot, key) != IDENTITY]
    if robot.floor is not None:
        lines.append(f"floor = {_value(robot.floor)}")
    for i, joint in enumerate(robot.joints):
        lines += ["", "[[joint]]", *_joint(robot, i, joint)]
    if robot.transmission:
        lines += [
            "",
            "[transmission]",
            "matrix = [",
            *(f"    {_value(row)}," for row in robot.transmission.matrix),
            "]",
        ]
        if robot.transmission.motors:
            motors = (
                f"    {_inline(_given(motor)) if _given(motor) else '{}'}," for motor in robot.transmission.motors
            )
            lines += ["motors = [", *motors, "]"]
    return "\n".join(lines) + "\n"


def _joint(robot: Robot, i: int, joint: Joint) -> Iterable[str]:
    yield f"name = {_value(joint.name)}"
    yield f"type = {_value(joint.type)}"
    if joint.parent != i - 1:
        named = joint.parent >= 0
        free = "base" not in robot.joint_names[:i]
        yield f"parent = {_value(robot.joint_names[joint.parent] if named else 'base' if free else '')}"
    for key in GEOMETRY:
        if getattr(joint, key) or key not in ("gamma", "b"):
            yield f"{key} = {_value(getattr(joint, key))}"
    if joint.symbols:
        yield f"symbols = {_inline(joint.symbols)}"
    for key in ("limits", "link", "drive"):
        if given := _given(getattr(joint, key)):
            yield f"{key} = {_inline(given)}"
    if joint.radius is not None:
        yield f"radius = {_value(joint.radius)}"


def _given(part: Any) -> list[tuple[str, Any]]:
    """The fields of a part that differ from their default."""
    default = type(part)()
    differ = [f.name for f in fields(part) if getattr(part, f.name) != getattr(default, f.name)]
    if not isinstance(part, Limits) and differ:
        differ = [f.name for f in fields(part)]
    return [(name, getattr(part, name)) for name in differ]


def _placed(matrix: Matrix) -> str:
    """xyz and rpy where they give the very same matrix back, its four rows otherwise."""
    xyz, rpy = to_roll_pitch_yaw(np.array(matrix))
    if to_matrix(from_roll_pitch_yaw(xyz, rpy)) == matrix:
        return _inline([("xyz", xyz), ("rpy", rpy)])
    return _inline([("matrix", matrix)])


def _inline(pairs: Iterable[tuple[str, Any]]) -> str:
    return "{ " + ", ".join(f"{key} = {_value(value)}" for key, value in pairs) + " }"


def _value(value: str | float | Sequence[Any]) -> str:
    """A TOML value: text, a float in its shortest exact form, or a list."""
    if isinstance(value, str):
        # JSON's escapes are TOML's, but TOML also wants DEL escaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, int | float):
        return repr(float(value))
    return "[" + ", ".join(_value(item) for item in value) + "]"
