"""`identify model` and `identify codegen`, as a user calls them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from beside import c_compiler
from conftest import SLIDE

import identify
from identify.cli.parser import FORMATS, ORIENTATIONS, PARAMETERS, WHAT
from identify.symbolic import constants, orientation_model, rendering
from identify.symbolic.models import MODELS


def test_the_help_offers_what_there_is() -> None:
    assert set(WHAT) == {*MODELS, "operations"}
    assert FORMATS == rendering.FORMATS
    assert PARAMETERS == constants.PARAMETERS
    assert ORIENTATIONS == orientation_model.ORIENTATIONS


@pytest.mark.parametrize("what", WHAT)
def test_every_model_is_printed(run, what: str) -> None:
    shown = run("model", "rx90", "--what", what)
    assert shown.status == 0
    assert "RX-90" in shown.out
    table = run("model", "rx90", "--what", what, "--format", "json")
    assert json.loads(table.out)["robot"] == "Stäubli RX-90"


TURN = """
name = "two branches"
gravity = [0.0, 0.0, -9.81]
[[joint]]
name = "turn"
type = "revolute"
link = { mass = 4.0, com = [0.1, 0.02, 0.05], inertia = [0.1, 0.01, 0.0, 0.2, 0.0, 0.15] }
"""
BRANCH = """
[[joint]]
name = "arm"
type = "revolute"
parent = "turn"
alpha = -0.9
d = -0.2
r = 0.1
link = { mass = 1.0, com = [0.2, 0.0, 0.1], inertia = [0.01, 0.002, 0.0, 0.02, 0.0, 0.012] }
"""
SLIDE_AND_BRANCH = TURN + SLIDE + BRANCH


@pytest.mark.parametrize("what", ["lagrange", "newton-euler", "direct-dynamics", "energy", "operations"])
def test_dynamics_of_a_robot_with_branches(run, tmp_path: Path, what: str) -> None:
    file = tmp_path / "branches.toml"
    file.write_text(SLIDE_AND_BRANCH)
    shown = run("model", file, "--what", what)
    assert shown.status == 0, shown.err
    assert "two branches" in shown.out


@pytest.mark.parametrize("what", ["direct-geometry", "inverse-geometry", "jacobian", "inverse-kinematics"])
def test_geometry_of_a_robot_with_branches_is_refused_in_one_line(run, tmp_path: Path, what: str) -> None:
    file = tmp_path / "branches.toml"
    file.write_text(SLIDE_AND_BRANCH)
    shown = run("model", file, "--what", what)
    assert shown.status == 2
    assert shown.err.count("\n") == 1
    assert "its joints branch; keep the joints of one branch" in shown.err


@pytest.fixture
def slide_between(tmp_path: Path) -> Path:
    """A serial arm of three joints, the second of which slides."""
    file = tmp_path / "short.toml"
    file.write_text(SLIDE_AND_BRANCH.replace('parent = "turn"\n', ""))
    return file


@pytest.fixture
def oblique(tmp_path: Path) -> Path:
    """Six joints with axes at any angle and offsets throughout: no equation of Paul's method fits."""
    text = 'name = "oblique"\n'
    for j in range(6):
        text += (
            f'[[joint]]\nname = "axis {j + 1}"\nalpha = {0.3 + 0.2 * j}\nd = {0.1 + 0.03 * j}\nr = {0.2 - 0.02 * j}\n'
        )
    file = tmp_path / "oblique.toml"
    file.write_text(text)
    return file


def test_models_without_a_formula_are_refused_alike_in_every_form(run, slide_between: Path, oblique: Path) -> None:
    cases = (
        (slide_between, "inverse-kinematics", "J is 6 x 3 and has no inverse to print; joint_velocity gives numbers"),
        (oblique, "inverse-kinematics", "no point gives J the form"),
        (oblique, "inverse-geometry", "no known type of equation gives q1, q2, q3, q4, q5, q6"),
    )
    for file, what, reason in cases:
        for form in FORMATS if file is slide_between else ("text", "c"):
            told = run("model", file, "--what", what, "--format", form)
            assert (told.status, told.out) == (2, ""), form
            assert told.err.count("\n") == 1
            assert reason in told.err


def test_a_defect_is_not_taken_for_bad_input(run, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_robot: object) -> None:
        raise ValueError("an index went wrong")

    monkeypatch.setitem(MODELS, "energy", broken)
    told = run("model", "rx90", "--what", "energy")
    assert told.status == 3
    assert "this is a defect of identify" in told.err


def test_numbers_of_joints_are_told_by_name(run) -> None:
    shown = run("model", "rx90", "--what", "direct-geometry", "--joints", "joint_3=0")
    assert "q1 … q5: joint_1, joint_2, joint_4, joint_5, joint_6" in shown.out
    table = run("model", "rx90", "--what", "energy", "--format", "json").json
    assert table["notes"][0] == "q1 … q6: joint_1, joint_2, joint_3, joint_4, joint_5, joint_6"


def test_the_package_runs_as_the_command() -> None:
    command = [sys.executable, "-m", "identify", "--version"]
    shown = subprocess.run(command, check=True, capture_output=True, text=True)
    assert shown.stdout == f"identify {identify.__version__}\n"


def test_lagrange_in_base_parameters_and_no_other_model(run) -> None:
    shown = run("model", "rx90", "--what", "lagrange", "--parameters", "base")
    assert shown.status == 0
    assert "ZZR1" in shown.out
    assert "base inertial parameters" in shown.out
    other = run("model", "rx90", "--what", "energy", "--parameters", "base")
    assert other.status == 2
    assert "energy has no choice of this, lagrange has" in other.err


def test_a_length_with_the_name_of_a_variable_is_refused(run, tmp_path: Path) -> None:
    file = tmp_path / "names.toml"
    file.write_text(SLIDE_AND_BRANCH.replace("d = 0.3\n", 'd = 0.3\nsymbols = { d = "U" }\n'))
    told = run("model", file, "--what", "energy")
    assert told.status == 2
    assert told.err.count("\n") == 1
    assert "joint 'slide': symbols.d: 'U' can't be a symbol; printed models use it" in told.err


@pytest.mark.parametrize(
    ("what", "option", "owner"),
    [
        ("energy", "--decomposed", "jacobian has"),
        ("operations", "--frame=2", "jacobian or inverse-kinematics has"),
        ("jacobian", "--orientation=euler", "direct-geometry has"),
    ],
)
def test_options_of_other_models_are_refused(run, what: str, option: str, owner: str) -> None:
    told = run("model", "rx90", "--what", what, option)
    assert (told.status, told.out, told.err.count("\n")) == (2, "", 1)
    assert f"{option.split('=')[0]}: {what} has no choice of this, {owner}" in told.err


def test_frames_there_are_not_are_refused(run) -> None:
    for what in ("jacobian", "inverse-kinematics"):
        assert "frames are numbered 0 to 6" in run("model", "rx90", "--what", what, "--frame", "7").err
        assert "in the axes of R0" in run("model", "rx90", "--what", what, "--frame", "0").out
        assert "is no frame" in run("model", "rx90", "--what", what, "--frame=-1").err
    assert "frames are numbered 0 to 6" in run("model", "rx90", "--what", "jacobian", "--frame=9", "--decomposed").err
    assert run("model", "rx90", "--what", "jacobian", "--frame=tool", "--decomposed").status == 2
    assert run("model", "rx90", "--what", "inverse-kinematics", "--frame=tool").status == 2


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
    command = [c_compiler(), "-std=c99", "-Wall", "-Wextra", "-Werror", "-DSELF_TEST", source.name, "-o", "self", "-lm"]
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
