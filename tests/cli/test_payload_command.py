"""identify payload and simulate --payload: the result folder, exit statuses, and every bad input in one line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from carried import LOAD, currents, loaded_log, one_joint_moving
from exact_logs import arm, exact_log, fitted

import identify
from identify.experiment.plant import reference_effort
from identify.experiment.trajectory import random_trajectory
from identify.robot.payload import carrying
from identify.robot.robot import Link
from identify.robot.toml_writing import write_toml


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a fit and logs of the arm with its load."""
    folder = tmp_path_factory.mktemp("carried")
    fitted().save(folder / "fit")
    loaded_log().save(folder / "loaded.mcap")
    loaded_log(3).save(folder / "other.csv")
    one_joint_moving(2).save(folder / "last.mcap")
    replace(loaded_log(), effort=None).save(folder / "blind.mcap")
    replace(loaded_log(), joints=("a", "b", "c")).save(folder / "strange.mcap")
    return folder


def test_a_load_is_identified_and_told(run, files: Path) -> None:
    outcome = run("payload", files / "fit", files / "loaded.mcap", "--test", files / "other.csv", "-o", "new/load")
    assert (outcome.status, outcome.err) == (0, "")
    assert {path.name for path in Path("new/load").iterdir()} == {"payload.json", "curves.npz", "report.html"}
    record = json.loads(Path("new/load/payload.json").read_text(encoding="utf-8"))
    assert record["command"].startswith("identify payload ")
    assert record["load"]["body"][0]["estimate"] == pytest.approx(LOAD.mass, rel=0.01)
    assert [log["role"] for log in record["logs"]] == ["loaded", "test"]
    for words in ("The load has a mass of", "mm in R₃", "without load", "Ixx", "new/load/report.html"):
        assert words in outcome.out
    again = run("payload", files / "fit", files / "loaded.mcap", "-o", "new/load")
    assert again.status == 2
    assert "--force" in again.err
    printed = run("payload", files / "fit", files / "loaded.mcap", "-o", "new/load", "--force", "--json")
    assert printed.json == json.loads(Path("new/load/payload.json").read_text(encoding="utf-8"))
    page = Path("new/load/report.html")
    before = page.read_bytes()
    page.unlink()
    assert run("report", "new/load").out.strip() == "new/load/report.html"
    assert page.read_bytes() == before
    held = run("payload", files / "fit", files / "loaded.mcap", "-o", "held", "--friction", "same", "--json")
    assert held.json["settings"]["friction_may_change"] is False


def test_a_known_mass_gives_the_gains_from_the_logs_of_the_fit(run, tmp_path: Path) -> None:
    gains = np.array([12.0, 7.5, 0.4])
    robot = tmp_path / "arm.toml"
    robot.write_text(write_toml(arm(1)), encoding="utf-8")
    currents(exact_log(arm(1), noise=0.02), gains).save(tmp_path / "bare.mcap")
    currents(loaded_log(), gains).save(tmp_path / "loaded.mcap")
    assert run("fit", "bare.mcap", "--robot", robot, "-o", "fit", "--friction", "plain").status == 0
    found = run("payload", "fit", "loaded.mcap", "--mass", LOAD.mass, "-o", "load", "--json")
    assert found.status == 0
    np.testing.assert_allclose([row["estimate"] for row in found.json["gains"]], gains, rtol=0.01)
    named = run("payload", "fit", "loaded.mcap", "--mass", LOAD.mass, "--unloaded", "bare.mcap", "-o", "same", "--json")
    assert named.json["gains"] == found.json["gains"]
    (tmp_path / "bare.mcap").rename(tmp_path / "moved.mcap")
    lost = run("payload", "fit", "loaded.mcap", "--mass", LOAD.mass, "-o", "third")
    assert lost.status == 2
    assert "bare.mcap: the log that fit was made of is not there; name the logs" in lost.err
    (tmp_path / "loaded.mcap").rename(tmp_path / "bare.mcap")
    other = run("payload", "fit", "moved.mcap", "--mass", LOAD.mass, "-o", "third")
    assert "bare.mcap: is not the log that fit was made of" in other.err
    assert not Path("third").exists()


def test_a_log_that_can_not_tell_the_mass_gives_a_folder_that_says_why(run, files: Path) -> None:
    outcome = run("payload", files / "fit", files / "last.mcap", "-o", "load")
    assert outcome.status == 1
    assert "joint_1, joint_2 stand still" in outcome.out
    record = json.loads(Path("load/payload.json").read_text(encoding="utf-8"))
    assert record["verdict"]["status"] == "reject"
    assert record["load"] is None
    assert run("payload", files / "fit", files / "last.mcap", "-o", "load", "--force", "--json").json["gains"] is None


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["{files}/loaded.mcap", "{files}/loaded.mcap"], "is no result folder"),
        (["{files}", "{files}/loaded.mcap"], "is no result folder, parameters.json is missing"),
        (["{files}/fit", "none.mcap"], "none.mcap"),
        (["{files}/fit", "{files}/strange.mcap"], "has no joint 'joint_1'"),
        (["{files}/fit", "{files}/blind.mcap"], "holds no effort"),
        (["{files}/fit", "{files}/loaded.mcap", "--mass", "0"], "not a mass above 0 kg"),
        (["{files}/fit", "{files}/loaded.mcap", "--unloaded", "{files}/last.mcap"], "says nothing without --mass"),
        (["{files}/fit", "{files}/loaded.mcap", "--friction", "more"], "invalid choice"),
        (["{files}/fit"], "LOG"),
    ],
)
def test_what_can_not_be_used_is_told_in_one_line(run, files: Path, arguments: list[str], told: str) -> None:
    outcome = run("payload", *(argument.format(files=files) for argument in arguments), "-o", "load")
    assert outcome.status == 2
    assert told in outcome.err
    assert len(outcome.err.strip().splitlines()) == 1
    assert list(Path().iterdir()) == []


def test_a_simulated_arm_carries_what_is_asked_for(run, arm) -> None:
    random_trajectory(identify.load_robot(arm.robot), 3, fundamental_hz=0.5, periods=1).save("motion.toml")
    Path("load.toml").write_text("mass = 2.0\ncom = [0.1, 0.02, -0.03]\n", encoding="utf-8")
    command = ("simulate", arm.robot, "--trajectory", "motion.toml")
    for name, load in (("a.mcap", "2,0.1,0.02,-0.03"), ("b.mcap", "load.toml")):
        assert run(*command, "--payload", load, "-o", name).status == 0
    assert run(*command, "-o", "bare.mcap").status == 0
    assert Path("a.mcap").read_bytes() == Path("b.mcap").read_bytes() != Path("bare.mcap").read_bytes()
    truth = json.loads(Path("a.truth.json").read_text(encoding="utf-8"))
    assert truth["payload"][6:] == pytest.approx([0.2, 0.04, -0.06, 2.0])
    refused = run(*command, "--payload", "heavy", "-o", "c.mcap")
    assert refused.status == 2
    assert "payload 'heavy': can't be read; give MASS" in refused.err
    assert not Path("c.mcap").exists()


def test_a_load_does_not_start_with_work_that_is_lost(run, arm) -> None:
    """A payload that can't be read is refused before anything is simulated."""
    refused = run("simulate", arm.robot, "--payload", "none.toml", "-o", "c.mcap")
    assert refused.status == 2
    assert "none.toml: no such file" in refused.err


def test_a_motion_for_a_load_is_slower_than_one_without(run, arm) -> None:
    """The small arm's elbow has effort to spare for itself, and none for 26 kg at a third of a metre."""
    command = ("excite", arm.robot, "--duration", "4", "--starts", "1", "--harmonics", "3", "--no-collision")
    assert run(*command, "-o", "bare.toml").status == 0
    assert run(*command, "-o", "loaded.toml", "--payload", "26,0.3,0,0").status == 0
    robot, load = identify.load_robot(arm.robot), Link(26.0, (0.3, 0.0, 0.0))
    limits = np.array([joint.limits.effort for joint in robot.joints])
    largest = {}
    for name in ("bare", "loaded"):
        motion = identify.Trajectory.load(f"{name}.toml")
        effort = reference_effort(carrying(robot, load), *motion.sample(np.arange(0.0, 5.0, 0.01)))
        largest[name] = float((np.abs(effort).max(axis=0) / limits).max())
    assert largest["loaded"] <= 1.0 < largest["bare"]
    both = run(*command, "-o", "c.toml", "--payload", "20", "--from", "fit")
    assert both.status == 2
    assert "leave one of them out" in both.err


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "can't be read"),
        ('{"format": "other"}', 'is not of format "identify/payload/1"'),
        ("[]", "is not of format"),
    ],
)
def test_a_damaged_folder_is_told_in_one_line(run, files: Path, text: str, told: str) -> None:
    assert run("payload", files / "fit", files / "last.mcap", "-o", "load").status == 1
    Path("load/payload.json").write_text(text, encoding="utf-8")
    outcome = run("report", "load")
    assert outcome.status == 2
    assert told in outcome.err
    assert len(outcome.err.strip().splitlines()) == 1
