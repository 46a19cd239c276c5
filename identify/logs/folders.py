"""Folders on disk: written whole or not at all, and what a killed run leaves is cleared by the next one."""

from __future__ import annotations

import fcntl
import glob
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from identify.errors import OutputError
from identify.logs.files import refuse_existing


def check_replaceable(path: str | os.PathLike[str], mark: str, force: bool) -> None:
    """Raise OutputError unless a folder may be made at `path`, or an older one of its kind replaced there.

    mark: the file in it, relative to the folder, by which an older one is known; a folder without it is somebody
    else's and is never replaced. What killed runs left beside `path` is cleared first.
    """
    target = Path(path)
    clear_leftovers(target)
    if os.path.lexists(target) and not target.is_dir():
        raise OutputError(f"{path}: is a file; give the name of a folder that is not there yet")
    if target.is_dir() and any(target.iterdir()) and not (target / mark).is_file():
        raise OutputError(f"{path}: holds something else than results of this command; give the name of a new folder")
    refuse_existing(path, force)


@contextmanager
def replacing_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A new folder beside `path` to fill, renamed to `path` once it is whole.

    Whatever goes wrong, `path` is the old folder or the new one, never part of one, and nothing else is left. A
    process that is killed leaves `.NAME.PID.part`, which nobody reads and the next run removes. Raises OutputError
    where it can't be written.
    """
    target = Path(path)
    part, old = (target.with_name(f".{target.name}.{os.getpid()}.{end}") for end in ("part", "old"))
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        clear_leftovers(target)
        part.mkdir()
        with _held(part):
            yield part
            if not target.exists():
                os.replace(part, target)
                return
            with _held(target):
                os.replace(target, old)
                try:
                    os.replace(part, target)
                except OSError:
                    os.replace(old, target)
                    raise
            shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        raise OutputError(f"{target}: can't be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def clear_leftovers(target: Path) -> None:
    """Remove what killed runs left beside `target`; an older `target` that one had just set aside is put back."""
    hidden = f".{glob.escape(target.name)}.*"
    for old in sorted(target.parent.glob(f"{hidden}.old")):
        if _abandoned(old):
            if target.exists():
                shutil.rmtree(old, ignore_errors=True)
            else:
                os.replace(old, target)
    for part in sorted(target.parent.glob(f"{hidden}.part")):
        if part.is_dir() and _abandoned(part):
            shutil.rmtree(part, ignore_errors=True)


@contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Show other processes that this one is at work on the folder, until it ends, however it ends."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        _lock(descriptor)
        yield
    finally:
        os.close(descriptor)


def _abandoned(folder: Path) -> bool:
    """Whether no process is at work on the folder. False where the file system has no locks to tell it by."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        return False
    try:
        return _lock(descriptor)
    finally:
        os.close(descriptor)


def _lock(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
