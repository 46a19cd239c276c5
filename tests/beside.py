"""What tests need and the repository does not hold: the folder `shared` beside it, programs, optional packages.

A test that lacks one is left out and says loudly what is then not known. One that has it is run, whatever comes of it:
whether the package finds or can use the thing is never asked here.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"
UNKNOWN = {
    "data": "what becomes of a measured recording",
    "facts": "agreement with the public facts of the RX-90",
    "oracles": "agreement with values of other tools",
    "score.py": "agreement with the common rule of scoring",
}
"""What is not known without a part of `shared`."""


def shared(*parts: str) -> Path:
    """The file of these parts in `shared`."""
    __tracebackhide__ = True  # so that the summary names the test that is left out
    unknown, file = UNKNOWN[parts[0]], SHARED.joinpath(*parts)
    if not file.is_file():
        missing = "/".join(("shared", *parts))
        pytest.skip(f"LEFT OUT: {missing} is not beside the repository, so that {unknown} is not known")
    return file


def tx40_recording() -> Path:
    """The folder of the TX40's measured log, both tables that datasets/tx40.toml names in it."""
    __tracebackhide__ = True
    for table in ("motor_position.csv", "motor_torque.csv"):
        file = shared("data", "tx40", table)
    return file.parent


def stored_values(name: str) -> dict[str, Any]:
    """Values computed elsewhere: a file of shared/oracles, where a README names the tools that made it."""
    __tracebackhide__ = True
    return json.loads(shared("oracles", name).read_text(encoding="utf-8"))


def program(*names: str, unknown: str) -> str:
    """Path of the first of these programs that is installed; `unknown` is not known without any."""
    __tracebackhide__ = True
    for name in names:
        if path := shutil.which(name):
            return path
    pytest.skip(f"LEFT OUT: {' or '.join(names)} is not installed, so that {unknown} is not known")


def c_compiler() -> str:
    """Path of a C compiler."""
    __tracebackhide__ = True
    return program("cc", "gcc", "clang", unknown="what the C code gives")


def optional_module(name: str, extra: str, unknown: str) -> ModuleType:
    """The module of a package that pip installs with this extra."""
    __tracebackhide__ = True
    reason = f"LEFT OUT: {name} is not installed, so that {unknown} is not known; pip install '.[{extra}]'"
    return pytest.importorskip(name, reason=reason)
