"""Files on disk: written whole or not at all, and known by their digest."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from identify.errors import OutputError


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a file beside `path` for writing and rename it to `path` once all of it is on the disk.

    Whatever goes wrong, `path` is the old file or the new one, never part of one. Raises OutputError
    where the folder is missing or can't be written to.
    """
    target = Path(path)
    if target.is_dir():
        raise OutputError(f"{target}: is a folder; give the name of a file")
    if not target.parent.is_dir():
        raise OutputError(f"{target}: the folder {target.parent} does not exist; make it first")
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


def digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def digest_of_several(folder: Path, names: tuple[str, ...]) -> str:
    """SHA-256 over the names and digests of several files of a folder, in the order given."""
    lines = "".join(f"{name}\0{digest(folder / name)}\n" for name in names)
    return hashlib.sha256(lines.encode()).hexdigest()
