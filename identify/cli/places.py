"""Where results go: looked at before any work is done, so that nothing is computed in vain or overwritten."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from identify.errors import OutputError
from identify.logs.files import refuse_existing
from identify.logs.folders import check_replaceable


def check_file(path: str, suffixes: Sequence[str], force: bool, inputs: Sequence[str] = ()) -> None:
    """Raise OutputError unless a file with one of the suffixes may be written to `path`.

    inputs: the files that the command reads, which it never overwrites.
    """
    target = Path(path)
    if target.is_dir():
        raise OutputError(f"{path}: is a folder; give the name of a file in it")
    if target.suffix.lower() not in suffixes:
        raise OutputError(f"{path}: must end in {' or '.join(suffixes)}, as that is what is written")
    _refuse_unwritable(target, path)
    if any(_same(target, Path(name)) for name in inputs):
        raise OutputError(f"{path}: is read by this very command; write to another name")
    refuse_existing(path, force)


def check_folder(path: str, mark: str, force: bool, inputs: Sequence[str] = ()) -> None:
    """Raise OutputError unless a result folder may be made at `path`.

    mark: the file, relative to the folder, by which an older result is known; a folder without it is somebody
    else's and is never replaced. inputs: files that the command reads, which are never deleted with the folder.
    """
    target = Path(path)
    _refuse_unwritable(target, path)
    if target.is_dir() and any(_inside(Path(name), target) for name in inputs):
        raise OutputError(f"{path}: holds files that this very command reads; write to another folder")
    check_replaceable(path, mark, force)


@contextmanager
def parents_of(path: str) -> Iterator[None]:
    """Make the folders above `path` that are missing; unmake them if what they were made for fails."""
    missing = [folder for folder in Path(path).absolute().parents if not folder.exists()]
    try:
        if missing:
            missing[0].mkdir(parents=True)
        yield
    except BaseException:
        for folder in missing:
            with suppress(OSError):
                folder.rmdir()
        raise


def _refuse_unwritable(target: Path, path: str) -> None:
    """Raise OutputError where the nearest folder above the target is none, or may not be written to."""
    above = next(folder for folder in target.absolute().parents if folder.exists())
    if not above.is_dir():
        raise OutputError(f"{path}: {above} is a file, so there can be nothing in it; give another name")
    if not os.access(above, os.W_OK | os.X_OK):
        raise OutputError(f"{path}: can't be written: no permission in {above}; give another place")


def _same(a: Path, b: Path) -> bool:
    return b.exists() and a.resolve() == b.resolve()


def _inside(path: Path, folder: Path) -> bool:
    return path.exists() and path.resolve().is_relative_to(folder.resolve())
