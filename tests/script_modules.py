"""Files as modules, for tests: no ordinary import finds a script without a suffix, or what lies elsewhere."""

from __future__ import annotations

import importlib.util
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType

SCRIPTS = Path(__file__).parents[1] / "scripts"


def script(name: str) -> ModuleType:
    """The script of this name in scripts/, loaded anew; modules beside it can be imported from then on."""
    return module(SCRIPTS / name)


def module(file: Path) -> ModuleType:
    """The file as a module, loaded anew."""
    loader = SourceFileLoader(file.stem, str(file))
    spec = importlib.util.spec_from_loader(file.stem, loader)
    assert spec is not None
    made = importlib.util.module_from_spec(spec)
    sys.modules[file.stem] = made  # dataclasses look their module up
    loader.exec_module(made)
    return made
