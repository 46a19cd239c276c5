"""CSV, TSV and NPZ tables as a Log: columns by a map, motor side or joint side."""

from __future__ import annotations

import os
import re
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identify.errors import LogError
from identify.logs.files import digest, digest_of_several
from identify.logs.log import Log
from identify.logs.table_map import EXAMPLE, Column, Signal, TableMap, load_map
from identify.logs.text_table import read_columns, read_shape
from identify.logs.wording import counted, printable

_MOST_LOST = 0.05
_UNREADABLE = (
    ValueError,
    TypeError,
    KeyError,
    OSError,
    EOFError,
    RuntimeError,
    MemoryError,
    OverflowError,
    SyntaxError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)


def read_table(
    path: str | os.PathLike[str],
    map: str | os.PathLike[str] | TableMap | None = None,
    joints: Sequence[str] | None = None,
    effort: bool = True,
) -> Log:
    """Read a table, or a folder of tables, by its map (a TOML file or a TableMap).

    A CSV with the header t,q1,…,[dq1,…],[tau1,…] needs no map: joint side, SI. Its joints are named as
    `joints` says where the number fits, else joint_1, joint_2 … Rows that can't be used become NaN and are
    counted in the findings; the log is not yet cleaned. Raises LogError where the map and the table do not fit.
    """
    path = Path(path)
    mapping = map if isinstance(map, TableMap) else _own_map(path, joints) if map is None else load_map(map)
    if not effort:
        mapping = replace(mapping, effort=None)
    findings: list[str] = []
    columns = _columns(path, mapping, findings)
    time, position = columns.get("time"), columns["position"]
    seconds = np.arange(len(position)) / mapping.rate_hz if time is None else time[:, 0]
    velocity, torque = columns.get("velocity"), columns.get("effort")
    with np.errstate(over="ignore", invalid="ignore"):
        if mapping.matrix is not None:
            matrix = np.array(mapping.matrix)
            position = np.linalg.solve(matrix, position.T).T
            velocity = None if velocity is None else np.linalg.solve(matrix, velocity.T).T
            torque = None if torque is None else torque @ matrix
        position = position + np.array(mapping.offset)
    sha256 = digest_of_several(path, mapping.files) if path.is_dir() else digest(path)
    return Log(seconds, position, velocity, torque, mapping.joints, str(path), sha256, tuple(findings))


def _own_map(path: Path, names: Sequence[str] | None) -> TableMap:
    """The map of a table in our own format; LogError for any other."""
    advice = f"{path}: a table needs a map that says what its columns mean; pass --map MAP.toml with, say: {EXAMPLE}"
    if path.is_dir() or zipfile.is_zipfile(path):
        raise LogError(advice)
    header = read_shape(path).header
    groups = {name: [c for c in header if re.fullmatch(rf"{name}\d+", c)] for name in ("q", "dq", "tau")}
    n = len(groups["q"])
    present = [name for name in ("q", "dq", "tau") if groups[name]]
    if not n or list(header) != ["t", *(f"{name}{j}" for name in present for j in range(1, n + 1))]:
        raise LogError(advice)
    position, velocity, effort = (
        Signal(tuple(groups[name]), (1.0,) * n) if name in present else None for name in ("q", "dq", "tau")
    )
    if position is None:
        raise LogError(advice)
    joints = tuple(f"joint_{j}" for j in range(1, n + 1))
    # The same names in another order are a choice of columns, not new names.
    if names is not None and len(names) == n and set(names) != set(joints):
        joints = tuple(names)
    return TableMap(joints, position, velocity, effort, Signal(("t",), (1.0,)), offset=(0.0,) * n)


def _columns(path: Path, mapping: TableMap, findings: list[str]) -> dict[str, np.ndarray]:
    """Every signal (N, its columns) in SI, before the transmission; NaN rows where the table is corrupt."""
    apart = mapping.files != ("",)
    if apart and not path.is_dir():
        raise LogError(f"{path}: the map names files, so the table must be the folder that holds them")
    if not apart and path.is_dir():
        raise LogError(f"{path}: is a folder and the map names no files; add `file` to every signal, or give the file")
    columns: dict[str, np.ndarray] = {}
    for name in mapping.files:
        signals = {key: signal for key, signal in mapping.signals.items() if signal.file == name}
        columns.update(_read_file(path / name if apart else path, signals, len(mapping.joints), findings))
    lengths = {name: len(values) for name, values in columns.items()}
    shortest, longest = min(lengths.values()), max(lengths.values())
    if shortest < (1.0 - _MOST_LOST) * longest:
        listed = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise LogError(f"{path}: its files do not hold the same motion: rows of {listed}; record them together")
    if shortest < longest:
        findings.append(f"{counted(longest - shortest, 'row')} at the end not used, as not every file has them")
    return {name: values[:shortest] for name, values in columns.items()}


def _read_file(path: Path, signals: dict[str, Signal], n: int, findings: list[str]) -> dict[str, np.ndarray]:
    """The signals that lie in one file."""
    if not path.is_file():
        raise LogError(f"{path}: there is no such file; the map names it, relative to the folder of the table")
    if path.stat().st_size == 0:
        raise LogError(f"{path}: is empty; record again, or check the name")
    archive = zipfile.is_zipfile(path)
    raw = _read_archive(path, signals, n) if archive else _read_text(path, signals, n, findings)
    # Garbage may be as large as a number can be; the cleaning takes it out.
    with np.errstate(over="ignore"):
        return {name: values * np.array(signals[name].scale) for name, values in raw.items()}


def _read_text(path: Path, signals: dict[str, Signal], n: int, findings: list[str]) -> dict[str, np.ndarray]:
    wanted: list[Column] = []
    for name, signal in signals.items():
        if name != "time" and len(signal.columns) != n:
            raise LogError(
                f"{path}: the map names {len(signal.columns)} columns of {name} for {n} joints; name one each"
            )
        wanted.extend(signal.columns)
    values, faults = read_columns(path, read_shape(path), wanted)
    findings.extend(f"{path.name}: {counted(count, 'row')} {reason} not used" for reason, count in faults.items())
    ends = np.cumsum([len(signal.columns) for signal in signals.values()])[:-1]
    return dict(zip(signals, np.split(values, ends, axis=1), strict=True))


def _read_archive(path: Path, signals: dict[str, Signal], n: int) -> dict[str, np.ndarray]:
    """Signals of an NPZ file: one array (N,) a column, or one array (N, n) for them all."""
    try:
        # numpy warns of a damaged header before it gives up on it.
        with (
            warnings.catch_warnings(action="ignore"),
            open(path, "rb") as stream,
            np.load(stream, allow_pickle=False) as archive,
        ):
            names = sorted(archive.files)
            found = {}
            for name, signal in signals.items():
                missing = [column for column in signal.columns if column not in names]
                if missing:
                    raise LogError(f"{path}: has no array {missing[0]!r}; its arrays are {printable(', '.join(names))}")
                found[name] = [np.atleast_1d(archive[str(column)]) for column in signal.columns]
    except _UNREADABLE as error:
        raise LogError(f"{path}: can't be read as NPZ: {printable(str(error))}") from error
    for name, arrays in found.items():
        if any(array.dtype.kind not in "fiu" for array in arrays):
            raise LogError(f"{path}: the arrays of {name} hold something else than numbers")
    if len({len(array) for arrays in found.values() for array in arrays}) != 1:
        raise LogError(f"{path}: its arrays differ in length; every one needs a row a sample")
    stacked = {name: np.column_stack(arrays).astype(float) for name, arrays in found.items()}
    for name, values in stacked.items():
        width = 1 if name == "time" else n
        if values.ndim != 2 or values.shape[1] != width:
            raise LogError(f"{path}: {name} has {values.shape[1]} columns and the map needs {width}")
    return stacked


def own_header(joints: Sequence[str], velocity: bool, effort: bool) -> list[str]:
    """The header of a table in our own format: t, q1 …, [dq1 …], [tau1 …]."""
    names = ["q", *["dq"] * velocity, *["tau"] * effort]
    return ["t", *(f"{name}{j}" for name in names for j in range(1, len(joints) + 1))]
