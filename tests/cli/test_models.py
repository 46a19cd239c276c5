"""`identify model` and `identify codegen`, as a user calls them."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from identify.cli.parser import FORMATS, WHAT
from identify.symbolic import rendering
from identify.symbolic.models import MODELS


def test_the_help_offers_what_there_is() -> None:
    assert set(WHAT) == {*MODELS, "operations"}
    assert FORMATS == rendering.FORMATS


@pytest.mark.parametrize("what", WHAT)
def test_every_model_is_printed(run, what: str) -> None:
    shown = run("model", "rx90", "--what", what)
    assert shown.status == 0
    assert "RX-90" in shown.out
    table = run("model", "rx90", "--what", what, "--format", "json")
    assert json.loads(table.out)["robot"] == "Stäubli RX-90"


def test_a_table_has_no_code(run) -> None:
    shown = run("model", "rx90", "--what", "operations", "--format", "c")
    assert shown.status == 2
    assert "choose text or json" in shown.err


def test_generated_files_test_themselves_and_are_not_overwritten(run, tmp_path: Path) -> None:
    folder = tmp_path / "controller"
    assert run("codegen", "rx90", "-o", folder).status == 0
    again = run("codegen", "rx90", "-o", folder)
    assert again.status == 2
    assert "--force" in again.err
    assert run("codegen", "rx90", "-o", folder, "--force").status == 0
    (source,) = folder.glob("*.c")
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler here")
    command = [compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-DSELF_TEST", source.name, "-o", "self", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    subprocess.run([folder / "self"], check=True)


def test_parameters_of_another_robot_are_refused(run, arm, tmp_path: Path) -> None:
    result = tmp_path / "result"
    assert run("fit", arm.train, "--robot", arm.robot, "-o", result).status == 0
    told = run("codegen", "rx90", "--parameters", result, "-o", tmp_path / "code")
    assert told.status == 2
    assert "not of Stäubli RX-90" in told.err
    assert not (tmp_path / "code").exists()
    assert (
        run("codegen", arm.robot, "--parameters", result, "-o", tmp_path / "code", "--language", "python").status == 0
    )
    assert list((tmp_path / "code").glob("*.py"))
