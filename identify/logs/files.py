"""Files on disk: written whole or not at all, and known by their digest."""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from identify.errors import OutputError


def refuse_existing(path: str | os.PathLike[str], force: bool) -> None:
    """Raise OutputError where there is something at `path` already and `force` is not set."""
    if os.path.lexists(path) and not force:
        raise OutputError(f"{path}: exists already; pass --force to replace it, or give another name")


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a file beside `path` for writing and rename it to `path` once all of it is on the disk.

    Whatever goes wrong, `path` is the old file or the new one, never part of one. Raises OutputError
    where the folder is missing or can't be written to.
    """
    target = _writable(path)
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        with open(part, "wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(part, target)
    except OSError as error:
        raise OutputError(f"{target}: can't be written: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def growing(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open `path` + ".partial" for writing and rename it to `path` once all of it is on the disk.

    For files that can be read while they grow: a process that is killed leaves the partial file, and an older
    `path` as it was. The next one to write `path` starts the partial file anew. An error removes it. Raises
    OutputError where it can't be written, or another process is writing it.
    """
    target = _writable(path)
    part = partial_path(target)
    try:
        # Opened without emptying it: it may be another's.
        with open(os.open(part, os.O_RDWR | os.O_CREAT, 0o666), "wb") as stream:
            _lock(stream, part, target)
            try:
                stream.truncate()
                yield stream
                stream.flush()
                os.fsync(stream.fileno())
                os.replace(part, target)
            except BaseException:
                part.unlink(missing_ok=True)
                raise
    except OSError as error:
        raise OutputError(f"{target}: can't be written: {error.strerror or error}") from error


def partial_path(path: str | os.PathLike[str]) -> Path:
    """Where `growing` writes before the file is whole."""
    return Path(f"{path}.partial")


def _writable(path: str | os.PathLike[str]) -> Path:
    target = Path(path)
    if target.is_dir():
        raise OutputError(f"{target}: is a folder; give the name of a file")
    if not target.parent.is_dir():
        raise OutputError(f"{target}: the folder {target.parent} does not exist; make it first")
    return target


def _lock(stream: BinaryIO, part: Path, target: Path) -> None:
    """Make the open file ours alone; OutputError where another process writes it, or has just made it whole."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        mine = part.exists() and os.path.samestat(os.fstat(stream.fileno()), part.stat())
    except BlockingIOError:
        mine = False
    except OSError:
        # Some network file systems have no locks.
        mine = True
    if not mine:
        raise OutputError(f"{target}: another process is writing it ({part.name}); wait for it, or give another name")


def digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def digest_of_several(folder: Path, names: tuple[str, ...]) -> str:
    """SHA-256 over the names and digests of several files of a folder, in the order given."""
    lines = "".join(f"{name}\0{digest(folder / name)}\n" for name in names)
    return hashlib.sha256(lines.encode()).hexdigest()
