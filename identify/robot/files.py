"""The text of a robot file, whatever its form."""

from __future__ import annotations

from pathlib import Path

from identify.errors import RobotError

LARGEST_FILE = 50_000_000
"""Bytes of a robot file."""


def read_text(path: Path) -> str:
    """The text of a robot file; RobotError for a file that is missing, unreadable, too large or no UTF-8 text."""
    try:
        if path.exists() and not path.is_file():
            raise RobotError(f"{path}: is no file that can be read twice; give the name of a robot file")
        with path.open("rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
        if len(data) > LARGEST_FILE:
            raise RobotError(f"{path}: larger than {LARGEST_FILE // 1_000_000} MB; is it a robot description?")
        return data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except FileNotFoundError:
        raise RobotError(f"{path}: no such file") from None
    except UnicodeDecodeError as error:
        raise RobotError(f"{path}: not a text file in UTF-8 (byte {error.start}); is it a robot description?") from None
    except OSError as error:
        raise RobotError(f"{path}: can't be read: {error.strerror}") from None
