"""The package as a whole: what it is made of, what it needs, and what it hands on."""

from __future__ import annotations

import ast
import importlib.metadata
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import identify

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "identify"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DISTRIBUTIONS = {"pinocchio": "pin", "mcap_ros2": "mcap-ros2-support"}
"""Distributions that are not called like the module they bring."""
ROOMS = (
    "robot",
    "symbolic",
    "regressor",
    "codegen",
    "logs",
    "experiment",
    "estimation",
    "validation",
    "report",
    "fit_workflow",
    "workflow",
    "payload_record",
    "payload_workflow",
    "batch",
    "cli",
)
"""From the robot to the command line: a room may use those before it, and none after."""
SHELL = ("__init__", "__main__", "errors", "numbers", "record", "side_by_side")
"""Modules at the top that are no room of their own."""


def imports(path: Path) -> set[str]:
    """Every module that a file imports anywhere, by its full name."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are by full names"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def room(path: Path) -> str:
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def named(requirements: list[str]) -> set[str]:
    return {re.split(r"[<>=!~\[; ]", text)[0].lower().replace("_", "-") for text in requirements}


def test_requirements_are_what_is_imported_and_nothing_else() -> None:
    modules = {name.split(".")[0] for path in PACKAGE.rglob("*.py") for name in imports(path)}
    foreign = modules - set(sys.stdlib_module_names) - {"identify"}
    assert {DISTRIBUTIONS.get(name, name) for name in foreign} == named(PROJECT["dependencies"])


def test_constraints_pin_every_requirement_and_each_allows_its_pin() -> None:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = dict(line.split("==") for line in lines if line and not line.startswith("#"))
    pins = {name.lower().replace("_", "-"): version for name, version in pins.items()}
    requirements = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["test"]]
    assert named(requirements) <= set(pins)
    for text in requirements:
        name, least = text.split(">=")
        pinned = [int(part) for part in pins[name].split(".")[:2]]
        assert pinned >= [int(part) for part in least.split(".")[:2]], text


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_rooms_use_those_before_them_alone(path: Path) -> None:
    own = room(path)
    if own in SHELL:
        return
    assert own in ROOMS, f"{own} is a new room: say in ROOMS where it stands"
    for name in imports(path):
        parts = name.split(".")
        if parts[0] == "identify" and len(parts) > 1 and parts[1] in ROOMS:
            assert ROOMS.index(parts[1]) <= ROOMS.index(own), f"{path} imports {name}"


def test_the_version_is_said_once_more_and_the_same() -> None:
    assert PROJECT["version"] == identify.__version__
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## [{identify.__version__}]" in changelog


def test_every_public_name_is_there() -> None:
    for name in identify.__all__:
        assert getattr(identify, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = identify.nothing


def test_the_command_is_installed() -> None:
    (script,) = importlib.metadata.entry_points(group="console_scripts", name="identify")
    assert script.value == "identify.cli.main:main"


def test_the_readme_lists_the_commands_there_are_and_the_keys_of_a_map() -> None:
    from identify.cli.commands import COMMANDS
    from identify.logs.table_map import _KEYS

    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `identify (\w+)", text, flags=re.MULTILINE) == list(COMMANDS)
    section = text.split("## Maps of tables")[1].split("\n## ")[0]
    assert set(_KEYS) <= set(re.findall(r"`\[?(\w+)\]?`", section))
    assert len(re.findall(r"^## ", text, flags=re.MULTILINE)) > 5


def test_an_installed_copy_knows_its_robots(tmp_path: Path) -> None:
    mapped = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]
    assert mapped["targets"]["wheel"]["force-include"] == {"robots": "identify/robots"}
    site = tmp_path / "site"
    shutil.copytree(PACKAGE, site / "identify", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "robots", site / "identify" / "robots")
    code = (
        f"import sys; sys.path.insert(0, {str(site)!r}); import identify; from identify.robot.library import built_in; "
        f"assert identify.__file__.startswith({str(site)!r}); "
        "print(*built_in(), *(identify.load_robot(name).n for name in built_in()))"
    )
    told = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert told.stdout == "rx90 tx40 6 6\n"
