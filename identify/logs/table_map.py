"""What the columns of a table mean: a small TOML map, read and checked."""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identify.errors import LogError
from identify.logs.wording import printable

EXAMPLE = (
    'rate_hz = 1000; side = "joint"; joints = ["joint_1"]; position = { columns = ["q1"], unit = "rad" }; '
    'effort = { columns = ["tau1"] } (one entry a line)'
)
"""The shortest map, for messages."""

_LETTERS = 200
MOTOR, JOINT = "motor", "joint"
_KEYS = ("rate_hz", "time", "side", "joints", "position", "velocity", "effort", "offset", "transmission")
_UNITS = {"rad": 1.0, "deg": math.pi / 180.0, "m": 1.0}
_SPEED_UNITS = {**_UNITS, "rad/s": 1.0, "deg/s": math.pi / 180.0, "m/s": 1.0}
_TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_EFFORT_UNITS = ("N·m", "Nm", "N.m", "N")
Column = str | int


@dataclass(frozen=True)
class Signal:
    """Columns of one signal, by name or by number from 0; scale: what each is multiplied by to be SI; its file."""

    columns: tuple[Column, ...]
    scale: tuple[float, ...]
    file: str = ""


@dataclass(frozen=True)
class TableMap:
    """What a table's columns mean.

    joints: n names. time: the column of time, or rate_hz [Hz] where the table has none. position, velocity,
    effort: their columns. matrix (n, n): motor position = matrix × joint position, where the side is the
    motors'; None where it is the joints'. offset (n,): added to the joint position, after the transmission.
    """

    joints: tuple[str, ...]
    position: Signal
    velocity: Signal | None = None
    effort: Signal | None = None
    time: Signal | None = None
    rate_hz: float = 0.0
    matrix: tuple[tuple[float, ...], ...] | None = None
    offset: tuple[float, ...] = ()

    @property
    def signals(self) -> dict[str, Signal]:
        """Time, position, velocity and effort: those that there are."""
        named = {"time": self.time, "position": self.position, "velocity": self.velocity, "effort": self.effort}
        return {name: signal for name, signal in named.items() if signal is not None}

    @property
    def files(self) -> tuple[str, ...]:
        """The files named, each once; ("",) where the table is a single file."""
        return tuple(dict.fromkeys(signal.file for signal in self.signals.values()))


def load_map(path: str | os.PathLike[str]) -> TableMap:
    """Read the map of a table from TOML. Raises LogError where it is missing, no TOML, or says nothing sensible."""
    path = Path(path)
    try:
        with open(path, "rb") as stream:
            entries = tomllib.load(stream)
    except FileNotFoundError as error:
        raise LogError(f"{path}: there is no such map of a table; check the name given with --map") from error
    except OSError as error:
        raise LogError(f"{path}: the map can't be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise LogError(f"{path}: the map is not valid TOML: {printable(str(error))[:_LETTERS]}") from error
    return parse_map(entries, str(path))


def parse_map(entries: Mapping[str, Any], source: str = "map") -> TableMap:
    """A map from its entries, as TOML gives them; `source` names it in errors."""
    unknown = sorted(set(entries) - set(_KEYS))
    if unknown:
        raise LogError(f"{source}: unknown key {unknown[0]!r} in the map; its keys are {', '.join(_KEYS)}")
    joints = tuple(_strings(entries.get("joints"), f"{source}: joints"))
    if not joints or len(set(joints)) != len(joints):
        raise LogError(f"{source}: joints must be a list of different names, one a joint")
    if "position" not in entries:
        raise LogError(f"{source}: the map has no position; the shortest map: {EXAMPLE}")
    n = len(joints)
    position = _signal(entries, "position", n, source)
    if position is None:
        raise LogError(f"{source}: position must name its columns")
    velocity, effort = _signal(entries, "velocity", n, source), _signal(entries, "effort", n, source)
    time = _time(entries, position, source)
    rate = 0.0 if time else _rate(entries, source)
    offset = _numbers(entries.get("offset", [0.0] * n), n, f"{source}: offset")
    mapping = TableMap(joints, position, velocity, effort, time, rate, _matrix(entries, n, source), offset)
    if "" in mapping.files and len(mapping.files) > 1:
        raise LogError(f"{source}: either every signal has its `file` (and the table is a folder) or none has")
    return mapping


def _signal(entries: Mapping[str, Any], name: str, n: int, source: str) -> Signal | None:
    if name not in entries:
        return None
    entry, where = entries[name], f"{source}: {name}"
    if not isinstance(entry, Mapping) or set(entry) - {"columns", "unit", "gain", "file"}:
        raise LogError(f'{where} must look like {{ columns = ["c1"], unit = "rad", gain = [1.0], file = "x.csv" }}')
    columns = entry.get("columns")
    if not isinstance(columns, list) or not columns or not all(_is_column(column) for column in columns):
        raise LogError(f"{where} needs columns: a list of names, or of numbers counted from 0")
    if len(columns) not in (1, n) or len(set(columns)) != len(columns):
        raise LogError(f"{where} names {len(columns)} columns for {n} joints; give one a joint, each once")
    gain = np.array(_numbers(entry.get("gain", [1.0] * n), n, f"{where}.gain"))
    unit = entry.get("unit", "" if name == "effort" else _position_unit(entries))
    if name == "effort":
        if unit not in (*_EFFORT_UNITS, "") and "gain" not in entry:
            raise LogError(f"{where} is in {unit!r}; give the gain from it to N·m (or N), one number a joint")
        factor = np.ones(n)
    else:
        known = _UNITS if name == "position" else _SPEED_UNITS
        units = unit if isinstance(unit, list) else [unit] * n
        if len(units) != n or not all(isinstance(u, str) and u in known for u in units):
            raise LogError(f"{where} has the unit {unit!r}; it may be {', '.join(known)}, or a list with one a joint")
        factor = np.array([known[u] for u in units])
    return Signal(tuple(columns), tuple((gain * factor).tolist()), _file(entry, where))


def _position_unit(entries: Mapping[str, Any]) -> Any:
    position = entries.get("position")
    return position.get("unit", "rad") if isinstance(position, Mapping) else "rad"


def _time(entries: Mapping[str, Any], position: Signal, source: str) -> Signal | None:
    entry, where = entries.get("time"), f"{source}: time"
    if entry is None:
        return None
    if "rate_hz" in entries:
        raise LogError(f"{source}: give rate_hz or time, not both")
    if _is_column(entry):
        return Signal((entry,), (1.0,), position.file)
    if not isinstance(entry, Mapping) or set(entry) - {"column", "unit", "file"} or not _is_column(entry.get("column")):
        raise LogError(f'{where} must be a column, as "t" or {{ column = "t", unit = "ms" }}')
    unit = entry.get("unit", "s")
    if unit not in _TIME_UNITS:
        raise LogError(f"{where} has the unit {unit!r}; it may be {', '.join(_TIME_UNITS)}")
    return Signal((entry["column"],), (_TIME_UNITS[unit],), _file(entry, where) or position.file)


def _rate(entries: Mapping[str, Any], source: str) -> float:
    rate = entries.get("rate_hz")
    if rate is None:
        raise LogError(f'{source}: the map says nothing of time; give rate_hz = 1000 or time = "t"')
    if not _is_number(rate) or not 0 < rate < 1e9:
        raise LogError(f"{source}: rate_hz must be a positive number of samples a second, not {rate!r}")
    return float(rate)


def _matrix(entries: Mapping[str, Any], n: int, source: str) -> tuple[tuple[float, ...], ...] | None:
    """The transmission; None on the joint side."""
    side = entries.get("side")
    if side not in (MOTOR, JOINT):
        raise LogError(f'{source}: side must be "motor" or "joint", not {side!r}')
    entry = entries.get("transmission")
    if entry is None and side == JOINT:
        return None
    if side == JOINT:
        raise LogError(f'{source}: a transmission is of use with side = "motor" alone; leave one of them out')
    rows = entry.get("matrix") if isinstance(entry, Mapping) else None
    if not isinstance(rows, list) or len(rows) != n:
        raise LogError(
            f'{source}: side = "motor" needs a [transmission] with matrix = [[32, 0], [32, 32]]: '
            f"{n} rows for {n} joints, motor position = matrix × joint position"
        )
    matrix = tuple(_numbers(row, n, f"{source}: transmission.matrix") for row in rows)
    if np.linalg.matrix_rank(np.array(matrix)) < n:
        raise LogError(f"{source}: transmission.matrix is singular, so motors do not tell the joints; check its rows")
    return matrix


def _file(entry: Mapping[str, Any], where: str) -> str:
    file = entry.get("file", "")
    if not isinstance(file, str):
        raise LogError(f"{where}.file must be the name of a file in the table's folder")
    return file


def _strings(value: Any, where: str) -> Sequence[str]:
    if not isinstance(value, list) or not all(isinstance(item, str) and item for item in value):
        raise LogError(f"{where} must be a list of names")
    return value


def _numbers(value: Any, n: int, where: str) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != n or not all(_is_number(item) for item in value):
        raise LogError(f"{where} must be a list of {n} finite numbers, one a joint")
    return tuple(float(item) for item in value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_column(value: Any) -> bool:
    return (isinstance(value, str) and value != "") or (
        isinstance(value, int) and not isinstance(value, bool) and value >= 0
    )
