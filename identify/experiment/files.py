"""Writing a text file whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from identify.errors import OutputError


def replace_text(path: str | Path, text: str) -> None:
    """Write `text` (UTF-8) beside `path`, then move it there in one step. OutputError where that can't be."""
    path = Path(path)
    draft = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        draft.write_text(text, encoding="utf-8", newline="\n")
        draft.replace(path)
    except OSError as error:
        draft.unlink(missing_ok=True)
        reason = error.strerror or str(error)
        raise OutputError(f"{path}: can't be written ({reason}); choose a folder that exists and is yours") from error
