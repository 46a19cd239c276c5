"""What `identify model --what inverse-geometry --pose` prints: the joint positions that bring the tool to a pose."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np

from identify.errors import InputError
from identify.logs.wording import printable
from identify.robot.robot import Robot
from identify.symbolic.inverse_geometry import Solutions, inverse_geometries
from identify.symbolic.undetermined import undetermined

SKEW = 1e-3
"""How far from a rotation the upper left of a pose may be for lack of digits; the nearest rotation is taken."""

LARGEST_FILE = 100_000
ROUNDED = 1e-9
WANTED = "give 16 or 12 numbers, row by row, or a file that holds them"


def solutions_text(robot: Robot, pose: str, current: str | None, form: str) -> str:
    """Every solution of the inverse geometric model as a table (form "text") or one JSON object ("json")."""
    wanted, shift = _pose(pose)
    now = np.zeros(robot.n) if current is None else _numbers(current, "--current")
    if len(now) != robot.n:
        raise InputError(f"--current: {len(now)} numbers; give one position for each of the {robot.n} joints (rad, m)")
    found = inverse_geometries(robot, wanted[None], now)
    free = undetermined(robot, found.q)
    if form == "json":
        return _json(robot, wanted, found, free)
    return _table(robot, found, free, shift)


def _pose(given: str) -> tuple[np.ndarray, float]:
    """(4, 4) pose from numbers or a file, with the nearest rotation, and the largest change that took."""
    where, text = "--pose", given
    if re.search(r"[^\d\s.,;eE+\[\]-]", given) or Path(given).is_file():
        where, text = given, _text(given)
    values = _numbers(text, where)
    if len(values) not in (12, 16):
        raise InputError(f"{where}: {len(values)} numbers; {WANTED}")
    pose = np.vstack([values[:12].reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
    if len(values) == 16 and not np.array_equal(values[12:], pose[3]):
        raise InputError(f"{where}: the last row is not 0 0 0 1; {WANTED}")
    u, _, vt = np.linalg.svd(pose[:3, :3])
    rotation = u @ vt
    shift = float(np.abs(rotation - pose[:3, :3]).max())
    if shift > SKEW or np.linalg.det(rotation) < 0:
        raise InputError(
            f"{where}: the upper left 3 x 3 is no rotation; {WANTED}: orthonormal right-handed columns s, n, a, then P"
        )
    pose[:3, :3] = rotation
    return pose, shift


def _text(name: str) -> str:
    try:
        with Path(name).open("rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        raise InputError(f"--pose: {name}: {getattr(error, 'strerror', None) or error}; {WANTED}") from error
    if len(data) > LARGEST_FILE:
        raise InputError(f"{name}: more than {LARGEST_FILE:,} bytes; {WANTED}")
    return data.decode(errors="replace")


def _numbers(text: str, where: str) -> np.ndarray:
    """The numbers of a text, with spaces, commas, semicolons or brackets between."""
    values = []
    for word in re.sub(r"[\[\],;]", " ", text).split():
        try:
            values.append(float(word))
        except ValueError:
            raise InputError(f"{where}: {word[:40]!r} is no number") from None
    if not np.all(np.isfinite(values)) or np.abs(values).max(initial=0.0) > 1e6:
        raise InputError(f"{where}: a number is not finite, or above 1e6")
    return np.array(values)


def _outside(robot: Robot, q: np.ndarray) -> list[str]:
    """Names of the joints that are outside their limits."""
    bounds = [(joint.name, *joint.limits.position) for joint in robot.joints]
    return [name for (name, low, high), x in zip(bounds, q, strict=True) if not low - ROUNDED <= x <= high + ROUNDED]


def _named(robot: Robot, which: np.ndarray) -> list[str]:
    return [joint.name for joint, is_so in zip(robot.joints, which, strict=True) if is_so]


def _json(robot: Robot, pose: np.ndarray, found: Solutions, free: np.ndarray) -> str:
    rows = [
        {
            "q": q.tolist(),
            "degrees": [float(np.degrees(x)) if j.revolute else None for j, x in zip(robot.joints, q, strict=True)],
            "inside_limits": bool(inside),
            "outside": _outside(robot, q),
            "undetermined": _named(robot, own),
            "residual": float(residual),
        }
        for q, inside, residual, own in zip(found.q, found.inside_limits, found.residual, free, strict=True)
    ]
    table = {
        "robot": robot.name,
        "what": "inverse-geometry",
        "joints": [joint.name for joint in robot.joints],
        "units": ["rad" if joint.revolute else "m" for joint in robot.joints],
        "pose": pose.tolist(),
        "method": found.method,
        "solutions": rows,
    }
    return json.dumps(table, ensure_ascii=False)


def _table(robot: Robot, found: Solutions, free: np.ndarray, shift: float) -> str:
    count = len(found.q)
    method = "Paul's method" if found.method == "Paul" else "numerical search, which may miss some"
    lines = [f"{robot.name}: inverse geometry: {count} solution{'s' * (count != 1)} ({method})"]
    if shift > ROUNDED:
        lines.append(f"  the rotation of the pose was brought to the nearest orthonormal one, by {shift:.1g}")
    if not count:
        few = ", or this arm of fewer than six joints can't take its orientation" * (robot.n < 6)
        maybe = "perhaps " * (found.method != "Paul")
        return "\n".join([*lines, f"  {maybe}the pose is out of reach{few}"])
    names = [printable(" ".join(joint.name.split())) for joint in robot.joints]
    width = max(11, *(len(name) for name in names)) + 2
    lines.append(f"{'':<8}" + "".join(f"{name:>{width}}" for name in names) + "   limits")
    for k, (q, own) in enumerate(zip(found.q, free, strict=True), start=1):
        outside = _outside(robot, q)
        limits = f"outside: {', '.join(outside)}" if outside else "inside"
        values = [f"{x:.6f}" + ("" if joint.revolute else " m") for joint, x in zip(robot.joints, q, strict=True)]
        degrees = [f"{np.degrees(x):.4f}" if joint.revolute else "" for joint, x in zip(robot.joints, q, strict=True)]
        lines.append(f"{k:>3} rad " + "".join(f"{x:>{width}}" for x in values) + f"   {limits}")
        row = f"{'':>3} deg " + "".join(f"{x:>{width}}" for x in degrees) + f"   residual {found.residual[k - 1]:.1e}"
        lines.append(row)
        if own.any():
            moving = ", ".join(_named(robot, own))
            lines.append(f"        singular: {moving} undetermined; shown is one of a family, by --current")
    return "\n".join(lines)
