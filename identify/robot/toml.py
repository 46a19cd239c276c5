"""Robot descriptions as TOML, the form of robots/: reading checks everything, writing loses nothing."""

from __future__ import annotations

import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from identify.errors import RobotError
from identify.robot import checks
from identify.robot.files import read_text
from identify.robot.fixed import Entry, merge_fixed
from identify.robot.length_names import length_name_problem
from identify.robot.robot import (
    GEOMETRY,
    PRISMATIC,
    REVOLUTE,
    Drive,
    Joint,
    Limits,
    Link,
    Matrix,
    Robot,
    Transmission,
)
from identify.robot.toml_writing import write_toml
from identify.robot.transforms import from_roll_pitch_yaw, to_matrix

__all__ = ["read_toml", "write_toml"]

LONGEST_NOTE = 100_000
DEEPEST_KEY = 100
"""Parts of a key, a.b.c: the parser takes memory with the square of their number."""

FIXED = "fixed"
TYPES = (REVOLUTE, PRISMATIC, FIXED)
LENGTHS = ("b", "d", "r")
BASE = "base"
ROBOT_KEYS = ("name", "note", "gravity", "base", "tool", "floor", "joint", "transmission")
FIXED_KEYS = ("name", "type", "parent", *GEOMETRY, "link")
JOINT_KEYS = (*FIXED_KEYS, "symbols", "limits", "drive", "radius")


def read_toml(text: str | Path, source: str = "") -> Robot:
    """Robot from TOML text, or from the file at a `Path`.

    `source` names the text in messages and becomes `Robot.source`; by default the path. Fixed joints are
    merged away: their link joins the parent's, their placement goes into the child's.
    Raises RobotError, one line that names the source, the joint and the key, for anything that is not as
    the README tabulates it.
    """
    if isinstance(text, Path):
        source = source or str(text)
        text = read_text(text)
    source = source or "robot"
    if _dotted(text) > DEEPEST_KEY:
        raise RobotError(f"{source}: a key of more than {DEEPEST_KEY} parts; no robot description needs that")
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise RobotError(f"{source}: not valid TOML: brackets nested too deeply") from None
    except ValueError as error:  # TOMLDecodeError, and integers of thousands of digits
        raise RobotError(f"{source}: not valid TOML: {error}") from None
    checks.table(data, ROBOT_KEYS, source)
    if "name" not in data:
        raise RobotError(f'{source}: the robot has no name; add  name = "..."  at the top')
    entries = _entries(data, source)
    joints, tail = merge_fixed(entries)
    if not joints:
        raise RobotError(f"{source}: no moving joint; a robot needs at least one of type revolute or prismatic")
    _check_symbols(joints, source)
    return Robot(
        name=checks.text(data["name"], f"{source}: name"),
        joints=joints,
        gravity=_three(data.get("gravity", [0.0, 0.0, -9.81]), f"{source}: gravity"),
        base=to_matrix(_placement(data.get("base", {}), f"{source}: base")),
        tool=to_matrix(tail @ _placement(data.get("tool", {}), f"{source}: tool")),
        transmission=_transmission(data["transmission"], joints, source) if "transmission" in data else None,
        source=source,
        note=checks.text(data["note"], f"{source}: note", LONGEST_NOTE) if "note" in data else "",
        floor=checks.number(data["floor"], f"{source}: floor") if "floor" in data else None,
    )


def _dotted(text: str) -> int:
    """The most words in a row that dots hold together."""
    longest = run = 0
    for piece in text.split("."):
        # A space or a line's end inside a piece ends the run, around it not.
        run = run + 1 if len(piece) <= checks.LONGEST and len(piece.split()) == 1 else 0
        longest = max(longest, run)
    return longest


def _entries(data: dict[str, Any], source: str) -> list[Entry]:
    """Every [[joint]] of the file, moving and fixed, with the index of its parent entry."""
    listed = data.get("joint", [])
    if not isinstance(listed, list):
        raise RobotError(f"{source}: joint: expected an array of tables; write [[joint]], with two brackets")
    entries: list[Entry] = []
    index: dict[str, int] = {}
    for i, item in enumerate(listed):
        where = f"{source}: joint {i + 1}"
        if not isinstance(item, dict):
            raise RobotError(f"{where}: expected a table; write [[joint]], found {checks.found(item)}")
        if "name" not in item:
            raise RobotError(f'{where}: the joint has no name; add  name = "..."')
        name = checks.text(item["name"], f"{where}: name")
        where = f"{source}: joint {name!r}"
        if name in index:
            raise RobotError(f"{where}: a second joint of this name; every joint needs a name of its own")
        kind = checks.text(item.get("type", REVOLUTE), f"{where}: type")
        if kind not in TYPES:
            raise RobotError(f"{where}: type: unknown joint type {kind!r}; {checks.suggestion(kind, TYPES)}")
        if kind == FIXED and (extra := [key for key in item if key in JOINT_KEYS and key not in FIXED_KEYS]):
            raise RobotError(f"{where}: {extra[0]}: a fixed joint has none; remove it or change the type")
        checks.table(item, JOINT_KEYS, where)
        parent = _parent(item["parent"], name, listed, index, where) if "parent" in item else i - 1
        index[name] = i
        entries.append(Entry(_joint(item, name, kind, where), parent))
    return entries


def _parent(value: Any, name: str, listed: list[Any], index: dict[str, int], where: str) -> int:
    """Index of the parent entry, -1 for the base; `index` holds the entries so far by name."""
    if value == "" or (value == BASE and BASE not in index):
        return -1
    parent = checks.text(value, f"{where}: parent")
    if parent in index:
        return index[parent]
    if parent == name:
        raise RobotError(f"{where}: parent: a joint can't be its own parent")
    if any(isinstance(item, dict) and item.get("name") == parent for item in listed):
        raise RobotError(f"{where}: parent: {parent!r} comes later in the file; put a parent before its children")
    raise RobotError(f"{where}: parent: no joint {parent!r}; {checks.suggestion(parent, [*index, BASE])}")


def _joint(item: dict[str, Any], name: str, kind: str, where: str) -> Joint:
    """One joint with its own geometry; `parent` is set when fixed joints are merged."""
    gamma, b, alpha, d, theta, r = (checks.number(item.get(key, 0.0), f"{where}: {key}") for key in GEOMETRY)
    symbols = checks.table(item.get("symbols", {}), LENGTHS, f"{where}: symbols")
    for key, letter in symbols.items():
        if problem := length_name_problem(checks.text(letter, f"{where}: symbols.{key}")):
            raise RobotError(f"{where}: symbols.{key}: {letter!r} can't be a symbol; {problem}")
    return Joint(
        name=name,
        type=kind,
        alpha=alpha,
        d=d,
        theta=theta,
        r=r,
        gamma=gamma,
        b=b,
        symbols=tuple(symbols.items()),
        limits=_limits(item.get("limits", {}), f"{where}: limits"),
        link=_link(item.get("link", {}), f"{where}: link"),
        drive=_drive(item.get("drive", {}), f"{where}: drive"),
        radius=_radius(item, f"{where}: radius"),
    )


def _limits(value: Any, where: str) -> Limits:
    given = dict(checks.table(value, [f.name for f in fields(Limits)], where))
    if "position" in given:
        low, high = checks.numbers(given["position"], 2, f"{where}.position", infinite=True)
        if low >= high:
            raise RobotError(f"{where}.position: the low limit comes first, found [{low:g}, {high:g}]")
        given["position"] = (low, high)
    if "mass" in given:
        low, high = checks.numbers(given["mass"], 2, f"{where}.mass", infinite=True)
        if not 0 <= low <= high or high == 0 or np.isinf(low):
            raise RobotError(f"{where}.mass: expected a lowest and a highest mass [kg], found [{low:g}, {high:g}]")
        given["mass"] = (low, high)
    for key in ("velocity", "acceleration", "effort"):
        if key in given:
            read = checks.number(given[key], f"{where}.{key}", infinite=True)
            given[key] = checks.positive(read, f"{where}.{key}")
    return Limits(**given)


def _link(value: Any, where: str) -> Link:
    given = dict(checks.table(value, [f.name for f in fields(Link)], where))
    if "mass" in given:
        given["mass"] = checks.not_negative(checks.number(given["mass"], f"{where}.mass"), f"{where}.mass")
    if "com" in given:
        given["com"] = checks.numbers(given["com"], 3, f"{where}.com")
    if "inertia" in given:
        given["inertia"] = checks.numbers(given["inertia"], 6, f"{where}.inertia")
    link = Link(**given)
    if problem := checks.inertia_problem(link):
        raise RobotError(f"{where}.inertia: impossible value: {problem}")
    return link


def _drive(value: Any, where: str) -> Drive:
    given = dict(checks.table(value, [f.name for f in fields(Drive)], where))
    for key, raw in given.items():
        read = checks.number(raw, f"{where}.{key}")
        given[key] = read if key == "offset" else checks.not_negative(read, f"{where}.{key}")
    return Drive(**given)


def _radius(item: dict[str, Any], where: str) -> float | None:
    return checks.positive(checks.number(item["radius"], where), where) if "radius" in item else None


def _three(value: Any, where: str) -> tuple[float, float, float]:
    x, y, z = checks.numbers(value, 3, where)
    return x, y, z


def _placement(value: Any, where: str) -> np.ndarray:
    """(4, 4) from { xyz = [...], rpy = [...] } or { matrix = four rows }."""
    given = checks.table(value, ("xyz", "rpy", "matrix"), where)
    if "matrix" not in given:
        zero = [0.0, 0.0, 0.0]
        return from_roll_pitch_yaw(
            _three(given.get("xyz", zero), f"{where}.xyz"), _three(given.get("rpy", zero), f"{where}.rpy")
        )
    if len(given) > 1:
        raise RobotError(f"{where}: give either matrix, or xyz and rpy, not both")
    matrix = np.array(_rows(given["matrix"], 4, f"{where}.matrix"))
    rotation = matrix[:3, :3]
    if not np.array_equal(matrix[3], [0, 0, 0, 1]) or not np.allclose(
        rotation @ rotation.T, np.eye(3), rtol=0, atol=1e-6
    ):
        raise RobotError(f"{where}.matrix: expected a rigid transform, rotation and translation above the row 0 0 0 1")
    if np.linalg.det(rotation) < 0:
        raise RobotError(f"{where}.matrix: expected a right-handed rotation, found a mirror image")
    return matrix


def _rows(value: Any, n: int, where: str) -> Matrix:
    if not isinstance(value, list) or len(value) != n:
        size = f"{len(value)} row{'s' * (len(value) != 1)}" if isinstance(value, list) else checks.found(value)
        raise RobotError(f"{where}: expected a matrix of {n} × {n}, found {size}")
    return tuple(checks.numbers(row, n, f"{where}[{i}]") for i, row in enumerate(value))


def _transmission(value: Any, joints: tuple[Joint, ...], source: str) -> Transmission:
    where = f"{source}: transmission"
    given = checks.table(value, ("matrix", "motors"), where)
    if "matrix" not in given:
        raise RobotError(
            f"{where}: no matrix; add  matrix = [[...], ...]  with motor position = matrix × joint position"
        )
    matrix = _rows(given["matrix"], len(joints), f"{where}.matrix")
    for k, row in enumerate(matrix):
        if row[k] == 0:
            raise RobotError(
                f"{where}.matrix[{k}]: motor {k + 1} must move joint {joints[k].name!r}: found 0 on the diagonal"
            )
    array = np.array(matrix)
    if np.linalg.matrix_rank(array / np.abs(array).max(axis=1, keepdims=True)) < len(joints):
        raise RobotError(
            f"{where}.matrix: singular: two motors turn alike, so joint positions can't be told from theirs"
        )
    motors = given.get("motors", [])
    if not isinstance(motors, list) or len(motors) not in (0, len(joints)):
        raise RobotError(
            f"{where}.motors: expected a list of {len(joints)} tables, {{}} for a motor that is not coupled"
        )
    return Transmission(matrix, tuple(_drive(motor, f"{where}.motors[{k}]") for k, motor in enumerate(motors)))


def _check_symbols(joints: tuple[Joint, ...], source: str) -> None:
    """One letter stands for one length."""
    meaning: dict[str, tuple[float, str]] = {}
    for joint in joints:
        for key, letter in joint.symbols:
            length = getattr(joint, key)
            first, owner = meaning.setdefault(letter, (length, joint.name))
            if first != length:
                raise RobotError(
                    f"{source}: joint {joint.name!r}: symbols.{key}: {letter} is {length:g} here and {first:g} in"
                    f" {owner!r}; give each length a letter of its own"
                )
