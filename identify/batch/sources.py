"""Which logs a folder holds, what is held out of which fit, and under which name each result stands."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from identify.errors import LogError

RESULT_MARKS = ("parameters.json", "summary.json")
"""Files by which a folder is known as a result, in which no logs are looked for."""

_RESERVED = ("summary.html", "summary.csv", "summary.json", "parameters.csv")
_TABLES = (".csv", ".tsv", ".npz")
_HELD_OUT = ".test"
_OWN_TABLE = b"t,q1"


@dataclass(frozen=True)
class Source:
    """One log to fit. name: of its result, with / below sub-folders; unit: its sub-folder, "" for the folder itself.

    test: logs held out of its fit. Paths as strings, so that a source travels to any process.
    """

    log: str
    name: str
    unit: str = ""
    test: tuple[str, ...] = ()


def find_sources(
    folder: str | os.PathLike[str], tables: bool = False, test: Sequence[str] = ()
) -> tuple[list[Source], list[str]]:
    """The logs of a folder and its sub-folders by name, and files that are neither log nor known company of one.

    A log is an MCAP file, a ROS 2 bag folder, a CSV that identify wrote, or with `tables` any CSV, TSV or NPZ.
    NAME.test.mcap beside NAME.mcap is held out of its fit, `test` of every fit. Hidden files, result folders and what
    links point to are left alone. LogError where there is no such folder, or no log in it.
    """
    top = Path(folder)
    if not top.is_dir():
        raise LogError(
            f"{folder}: is a file; a batch takes a folder of logs, `identify fit` takes a log"
            if top.exists()
            else f"{folder}: there is no such folder; check the name"
        )
    logs, others = _walk(top, tables)
    shared = {Path(name).resolve() for name in test}
    logs = [path for path in logs if path.resolve() not in shared]
    by_stem = {path.with_name(_stem(path)): path for path in logs if not _stem(path).endswith(_HELD_OUT)}
    held_out = {path: path.with_name(_stem(path).removesuffix(_HELD_OUT)) for path in logs}
    held_out = {path: of for path, of in held_out.items() if _stem(path).endswith(_HELD_OUT) and of in by_stem}
    fitted = [path for path in logs if path not in held_out]
    if not fitted:
        what = "MCAP, CSV, TSV or NPZ" if tables else "MCAP; for tables, pass --map MAP.toml"
        raise LogError(f"{folder}: holds no log to fit; logs may be {what}")
    names = _names(fitted, top)
    sources = []
    for path in fitted:
        own = sorted(str(p) for p, of in held_out.items() if by_stem[of] == path)
        unit = path.parent.relative_to(top).as_posix()
        sources.append(Source(str(path), names[path], "" if unit == "." else unit, (*own, *test)))
    return sorted(sources, key=lambda source: source.name), [str(path) for path in others]


def _walk(top: Path, tables: bool) -> tuple[list[Path], list[Path]]:
    """Logs and other files below a folder, each in the order of their paths."""
    from identify.logs.bag_folder import is_bag_folder

    logs, others = [], []
    for where, folders, files in os.walk(top):
        here = Path(where)
        if here != top and any(mark in files for mark in RESULT_MARKS):
            folders.clear()
            continue
        if is_bag_folder(here):
            if here == top:
                raise LogError(f"{top}: is a single bag; give the folder that holds it, or use `identify fit`")
            folders.clear()
            logs.append(here)
            continue
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for path in (here / name for name in sorted(files) if not name.startswith(".")):
            if _is_log(path, tables):
                logs.append(path)
            elif not path.name.endswith(".truth.json"):
                others.append(path)
    return logs, others


def _is_log(path: Path, tables: bool) -> bool:
    suffix = path.suffix.lower()
    if suffix == ".mcap" or (tables and suffix in _TABLES):
        return True
    if suffix != ".csv" or not path.is_file():
        return False
    try:
        with open(path, "rb") as stream:
            return stream.read(len(_OWN_TABLE)) == _OWN_TABLE
    except OSError:
        return False


def _stem(path: Path) -> str:
    """The name without the suffix of a log; a bag folder has none."""
    return path.stem if path.suffix.lower() in (".mcap", *_TABLES) and not path.is_dir() else path.name


def _names(logs: Sequence[Path], top: Path) -> dict[Path, str]:
    """A name for each log that no other has and that is no folder of others: its own without the suffix, or whole."""
    taken = {folder for path in logs for folder in path.relative_to(top).parents} | {Path(name) for name in _RESERVED}
    short = [path.relative_to(top).with_name(_stem(path)) for path in logs]
    found: dict[Path, str] = {}
    for path, name in zip(logs, short, strict=True):
        free = short.count(name) == 1 and name not in taken
        found[path] = (name if free else path.relative_to(top)).as_posix()
    return found
