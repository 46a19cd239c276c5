"""identify export: a robot file from a result folder, what it leaves out on stdout, bad input in one line."""

from __future__ import annotations

from pathlib import Path

import pytest
from exact_logs import fitted

from identify.cli.main import main
from identify.robot.library import load_robot


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fitted().save(tmp_path_factory.mktemp("export") / "result")


@pytest.mark.parametrize(("form", "ending"), [("toml", "toml"), ("urdf", "urdf"), ("mjcf", "xml")])
def test_every_format_is_written_and_loads(
    form: str, ending: str, result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "new" / f"arm.{ending}"
    assert main(["export", str(result), "--format", form, "-o", str(path)]) == 0
    said = capsys.readouterr().out
    assert said.splitlines()[0] == str(path)
    assert ("not carried: actuator inertias" in said) == (form == "urdf")
    assert load_robot(path).joint_names == fitted().robot.joint_names
    assert main(["export", str(result), "--format", form, "-o", str(path)]) == 2
    assert "--force" in capsys.readouterr().err
    assert main(["export", str(result), "--format", form, "-o", str(path), "--force"]) == 0


def test_a_robot_is_written_as_it_is_described(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "arm.toml"
    assert main(["export", "rx90", "--format", "toml", "--joints", "joint_1,joint_3", "-o", str(path)]) == 0
    assert capsys.readouterr().out == f"{path}\n"
    assert load_robot(path).joint_names == ("joint_1", "joint_3")
    assert main(["export", str(path), "--format", "toml", "-o", str(path), "--force"]) == 2
    assert "is read by this very command" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["{result}", "--format", "urdf", "-o", "arm.toml"], "must end in .urdf or .xml"),
        (["{result}", "--format", "sdf", "-o", "arm.sdf"], "invalid choice"),
        (["{result}", "-o", "arm.urdf"], "--format"),
        (["nowhere", "--format", "toml", "-o", "arm.toml"], "unknown robot 'nowhere'"),
        ([".", "--format", "toml", "-o", "arm.toml"], ".: is no result folder"),
        (["nowhere.urdf", "--format", "toml", "-o", "arm.toml"], "nowhere.urdf: no such file"),
        (["rx90", "--format", "toml", "--joints", "elbow", "-o", "arm.toml"], "elbow"),
        (["tx40", "--format", "mjcf", "-o", "arm.xml"], "joint_1"),
        (["{result}", "--format", "toml", "--joints", "a", "-o", "arm.toml"], "leave --joints and --gravity out"),
    ],
)
def test_what_can_not_be_is_told_in_one_line(
    arguments: list[str],
    told: str,
    result: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["export", *(argument.format(result=result) for argument in arguments)]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert len(error.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
