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
from identify.logs.files import digest, digest_of_several
from identify.logs.log import Log
from identify.logs.slicing import select, window
from identify.logs.table_map import TableMap
from identify.logs.wording import listed
from identify.side_by_side import meanwhile

__all__ = ["clean", "read_log", "select", "window"]

_TABLES = (".csv", ".tsv", ".txt", ".npz")
_OTHERS = (".parquet", ".feather", ".mat", ".h5", ".hdf5", ".xlsx")
"""Tables that other programs read, and write as CSV."""


def read_log(
    path: str | os.PathLike[str],
    map: str | os.PathLike[str] | TableMap | None = None,
    joints: Sequence[str] | None = None,
    topic: str | None = None,
    effort: bool = True,
    velocity: bool = True,
) -> Log:
    """Read a recording: MCAP, a ROS 2 bag folder of it, or with a map CSV, TSV, NPZ or a folder of them.

    map: what a table's columns mean, as a TOML file or a TableMap; a CSV that identify wrote needs none, and
    takes its joints' names from `joints`. joints: the joints wanted, in this order; all of the log's where
    None. A robot's joints are best named here, so that the faults of other joints cost no rows, and so that of
    several publishers the one that has them is read. topic: that of the joint states, by default
    /joint_states, else the one with the most messages. effort, velocity: whether they are read; a long log takes a
    third less memory without either. What was found wrong and what was done about it is in the log's findings.

    Raises LogError, in one line, where the file is missing, empty, of another kind, holds no joint states,
    lacks a joint, or more than 5 % of its rows can't be used.
    """
    path = Path(path)
    skip = tuple(name for name, read in (("effort", effort), ("velocity", velocity)) if not read)
    try:
        log = _read(path, map, joints, topic, skip)
    except OSError as error:
        raise LogError(f"{path}: can't be read: {error.strerror or error}") from error
    except MemoryError as error:
        raise LogError(f"{path}: does not fit into memory; read less of it, or on a larger machine") from error
    return clean(log) if joints is None else _whole(clean(select(log, joints)))


def _whole(log: Log) -> Log:
    """The log, if each of its joints has a position. Raises LogError otherwise."""
    blind = [name for name, values in zip(log.joints, log.position.T, strict=True) if not np.isfinite(values).all()]
    if blind:
        raise LogError(f"{log.source}: too many NaN: no position of {listed(blind)} is a number; record again")
    return log


def _read(
    path: Path,
    map: str | os.PathLike[str] | TableMap | None,
    joints: Sequence[str] | None,
    topic: str | None,
    skip: tuple[str, ...],
) -> Log:
    from identify.logs.bag_folder import bag_files, is_bag_folder
    from identify.logs.mcap_records import is_mcap

    if not path.exists():
        raise LogError(f"{path}: there is no such file; check the name of the log")
    bag = is_bag_folder(path) and map is None
    if path.is_dir() and map is None and not bag:
        inside = sorted(entry.name for entry in path.glob("*.mcap"))
        mend = f"name the file in it: {listed(inside[:3])}" if inside else "for a folder of tables, pass --map MAP.toml"
        raise LogError(f"{path}: is a folder; {mend}")
    if path.is_file() and path.stat().st_size == 0:
        raise LogError(f"{path}: is empty; record again, or check the name")
    if bag or (path.is_file() and (is_mcap(path) or path.suffix == ".mcap")):
        from identify.logs.mcap_reader import read_files

        if map is not None:
            raise LogError(f"{path}: is an MCAP file, and a map is for tables; leave the map out")
        files, findings = bag_files(path) if bag else ([path], [])
        names = tuple(file.name for file in files)
        sha256 = meanwhile(lambda: digest_of_several(path, names) if bag else digest(path))
        log = read_files(files, path, topic, joints, skip).log
        return replace(log, sha256=sha256(), findings=(*findings, *log.findings))
    if not path.is_file() and not path.is_dir():
        raise LogError(f"{path}: is neither a file nor a folder; logs may be MCAP, CSV, TSV or NPZ")
    if path.suffix.lower() in _OTHERS:
        raise LogError(f"{path}: tables of this kind are not read; convert it to CSV or NPZ")
    if map is None and path.suffix.lower() not in _TABLES and not zipfile.is_zipfile(path):
        raise LogError(f"{path}: is not an MCAP file, nor a table by its suffix; logs may be MCAP, CSV, TSV or NPZ")
    if topic is not None:
        raise LogError(f"{path}: is a table, and a topic is for MCAP files; leave the topic out")
    from identify.logs.tables import read_table

    log = read_table(path, map, joints, "effort" not in skip)
    return replace(log, velocity=None) if "velocity" in skip else log
