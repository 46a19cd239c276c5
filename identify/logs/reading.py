"""A log from a file of any kind that is known, cleaned and ready to be computed with."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identify.errors import LogError
from identify.logs.cleaning import clean
from identify.logs.files import digest
from identify.logs.log import Log
from identify.logs.slicing import select, window
from identify.logs.table_map import TableMap

__all__ = ["clean", "read_log", "select", "window"]

_TABLES = (".csv", ".tsv", ".txt", ".npz")


def read_log(
    path: str | os.PathLike[str],
    map: str | os.PathLike[str] | TableMap | None = None,
    joints: Sequence[str] | None = None,
    topic: str | None = None,
    effort: bool = True,
) -> Log:
    """Read a recording: MCAP, or with a map CSV, TSV, NPZ or a folder of them.

    map: what a table's columns mean, as a TOML file or a TableMap; a CSV that identify wrote needs none, and
    takes its joints' names from `joints`. joints: the joints wanted, in this order; all of the log's where
    None. A robot's joints are best named here, so that the faults of other joints cost no rows. topic: that of
    the joint states, by default /joint_states. What was found wrong and what was done about it is in the
    log's findings.

    Raises LogError, in one line, where the file is missing, empty, of another kind, holds no joint states,
    lacks a joint, or more than 5 % of its rows can't be used.
    """
    path = Path(path)
    try:
        log = _read(path, map, joints, topic, effort)
    except OSError as error:
        raise LogError(f"{path}: can't be read: {error.strerror or error}") from error
    return clean(log) if joints is None else _whole(clean(select(log, joints)))


def _whole(log: Log) -> Log:
    """The log, if each of its joints has a position. Raises LogError otherwise."""
    blind = [name for name, finite in zip(log.joints, np.isfinite(log.position).all(axis=0), strict=True) if not finite]
    if blind:
        raise LogError(f"{log.source}: too many NaN: no position of {', '.join(blind)} is a number; record again")
    return log


def _read(
    path: Path,
    map: str | os.PathLike[str] | TableMap | None,
    joints: Sequence[str] | None,
    topic: str | None,
    effort: bool,
) -> Log:
    from identify.logs.mcap_records import is_mcap

    if not path.exists():
        raise LogError(f"{path}: there is no such file; check the name of the log")
    if path.is_dir() and map is None:
        inside = sorted(entry.name for entry in path.glob("*.mcap"))
        mend = (
            f"name the file in it: {', '.join(inside[:3])}" if inside else "for a folder of tables, pass --map MAP.toml"
        )
        raise LogError(f"{path}: is a folder; {mend}")
    if path.is_file() and path.stat().st_size == 0:
        raise LogError(f"{path}: is empty; record again, or check the name")
    if path.is_file() and (is_mcap(path) or path.suffix == ".mcap"):
        from identify.logs.mcap_reader import read_mcap

        if map is not None:
            raise LogError(f"{path}: is an MCAP file, and a map is for tables; leave the map out")
        log = replace(read_mcap(path, topic, joints).log, sha256=digest(path))
        return log if effort else replace(log, effort=None)
    if map is None and path.suffix.lower() not in _TABLES and not zipfile.is_zipfile(path):
        raise LogError(f"{path}: is not an MCAP file, nor a table by its suffix; logs may be MCAP, CSV, TSV or NPZ")
    from identify.logs.tables import read_table

    return read_table(path, map, joints, effort)
