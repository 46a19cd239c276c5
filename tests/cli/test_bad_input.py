"""Every kind of bad input: one line that names the file, the thing and the mend; the right status; nothing written."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from mcap.writer import Writer

from identify.logs.log import Log
from identify.logs.slicing import select, window


def refused(run, arm, log: Path | str, robot: Path | str | None = None, *options: str | Path) -> str:
    """The one line with which `fit` refuses its input; nothing is left of the result."""
    before = sorted(Path.cwd().iterdir())
    outcome = run("fit", log, "--robot", robot or arm.robot, "-o", "new/result", *options)
    assert outcome.status == 2
    assert outcome.out == ""
    assert outcome.err.startswith("identify: error: ")
    assert outcome.err.count("\n") == 1
    assert "Traceback" not in outcome.err
    assert sorted(Path.cwd().iterdir()) == before
    return outcome.err.removeprefix("identify: error: ").rstrip()


def rejected(run, arm, log: Log) -> list[str]:
    """The reasons for which `fit` rejects a log, from a result folder without parameters."""
    log.save("poor.mcap")
    outcome = run("fit", "poor.mcap", "--robot", arm.robot, "-o", "result")
    assert outcome.status == 1
    assert "Traceback" not in outcome.err
    record = json.loads(Path("result/parameters.json").read_text(encoding="utf-8"))
    assert record["format"] == "identify/parameters/1"
    assert record["verdict"]["status"] == "reject"
    assert record["base_parameters"] == []
    assert record["fit"] is None
    for reason in record["verdict"]["reasons"]:
        assert reason in outcome.out
    assert "<html" in Path("result/report.html").read_text(encoding="utf-8")
    assert sorted(entry.name for entry in Path.cwd().iterdir()) == ["poor.mcap", "result"]
    return record["verdict"]["reasons"]


def test_a_missing_file(run, arm) -> None:
    assert refused(run, arm, "nowhere.mcap") == "nowhere.mcap: there is no such file; check the name of the log"


def test_an_empty_file(run, arm) -> None:
    Path("empty.mcap").touch()
    assert refused(run, arm, "empty.mcap") == "empty.mcap: is empty; record again, or check the name"


def test_not_an_mcap(run, arm) -> None:
    Path("notes.mcap").write_text("to do: record the log\n", encoding="utf-8")
    assert refused(run, arm, "notes.mcap").startswith("notes.mcap: is not an MCAP file")


def test_an_mcap_without_joint_states(run, arm) -> None:
    with open("camera.mcap", "wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/Image", "ros2msg", b"uint32 height")
        channel = writer.register_channel("/camera", "cdr", schema)
        writer.add_message(channel, 0, bytes(8), 0)
        writer.finish()
    message = refused(run, arm, "camera.mcap")
    assert message.startswith("camera.mcap: holds no sensor_msgs/msg/JointState")
    assert "/camera (sensor_msgs/msg/Image)" in message


def test_a_truncated_mcap_is_read_with_a_warning_that_counts(run, arm) -> None:
    whole = arm.train.read_bytes()
    Path("cut.mcap").write_bytes(whole[: int(0.7 * len(whole))])
    outcome = run("inspect", "cut.mcap", "--robot", arm.robot, "--json")
    assert outcome.status == 0
    found = outcome.json
    assert 0.5 * arm.log.samples < found["samples"] < 0.8 * arm.log.samples
    (warning,) = found["findings"]
    assert "the file is cut" in warning
    assert f"{found['samples']:,} samples before that recovered" in warning
    assert "bytes lost" in warning
    assert run("fit", "cut.mcap", "--robot", arm.robot, "-o", "result").status == 0
    record = json.loads(Path("result/parameters.json").read_text(encoding="utf-8"))
    assert record["logs"][0]["findings"] == [warning]


def test_a_log_cut_before_its_first_joint_state(run, arm) -> None:
    Path("stub.mcap").write_bytes(arm.train.read_bytes()[:200])
    assert refused(run, arm, "stub.mcap").startswith("stub.mcap: ")


def test_an_unknown_robot(run, arm) -> None:
    message = refused(run, arm, arm.train, "rx9")
    assert message.startswith("unknown robot 'rx9'")
    assert "rx90" in message
    assert "tx40" in message
    assert refused(run, arm, arm.train, "missing.toml").startswith("missing.toml: no such file")


def test_a_robot_file_with_a_syntax_error(run, arm) -> None:
    Path("typo.toml").write_text('name = "arm"\n[[joint]\nname = "a"\n', encoding="utf-8")
    message = refused(run, arm, arm.train, "typo.toml")
    assert message.startswith("typo.toml: ")
    assert "line 2" in message


def test_a_robot_file_with_an_impossible_value(run, arm) -> None:
    text = arm.robot.read_text(encoding="utf-8")
    Path("negative.toml").write_text(text.replace("mass = 3.5", "mass = -3.5"), encoding="utf-8")
    message = refused(run, arm, arm.train, "negative.toml")
    assert message.startswith("negative.toml: ")
    assert "elbow" in message
    assert "mass" in message
    Path("swapped.toml").write_text(text.replace("[-1.8, 1.6]", "[1.6, -1.8]"), encoding="utf-8")
    message = refused(run, arm, arm.train, "swapped.toml")
    assert "elbow" in message
    assert "position" in message


def test_a_joint_missing_from_the_log(run, arm) -> None:
    select(arm.log, ["shoulder"]).save("short.mcap")
    message = refused(run, arm, "short.mcap")
    assert message.startswith("short.mcap: has no joint 'elbow'; it has shoulder")
    message = refused(run, arm, arm.train, None, "--test", "short.mcap")
    assert message.startswith("short.mcap: has no joint 'elbow'")


def test_no_effort(run, arm) -> None:
    (reason,) = rejected(run, arm, replace(arm.log, effort=None))
    assert reason.startswith("the log holds no effort")


def test_dead_effort(run, arm) -> None:
    dead = arm.log.effort.copy()
    dead[:, 1] = 0.25
    (reason,) = rejected(run, arm, replace(arm.log, effort=dead))
    assert "the effort of elbow never changes" in reason


def test_too_many_nan(run, arm) -> None:
    effort = arm.log.effort.copy()
    effort[500:1000, 1] = np.nan
    replace(arm.log, effort=effort).save("holes.mcap")
    message = refused(run, arm, "holes.mcap")
    assert message.startswith("holes.mcap: too many NaN: 8.3 %")
    assert "effort of elbow" in message


def test_a_table_of_another_width(run, arm) -> None:
    Path("map.toml").write_text(
        'rate_hz = 1000\nside = "joint"\njoints = ["shoulder", "elbow"]\nposition = { columns = ["q1", "q2"] }\n'
        'effort = { columns = ["tau1", "tau2"] }\n',
        encoding="utf-8",
    )
    Path("narrow.csv").write_text("q1,tau1\n" + "0.1,2.0\n" * 500, encoding="utf-8")
    message = refused(run, arm, "narrow.csv", None, "--map", "map.toml")
    assert message == "narrow.csv: has no column 'q2'; its 2 columns are q1, tau1"
    Path("ragged.csv").write_text("q1,q2,tau1,tau2\n" + "0.1,2.0\n" * 500, encoding="utf-8")
    message = refused(run, arm, "ragged.csv", None, "--map", "map.toml")
    assert message.startswith("ragged.csv: its header names 4 columns and its rows hold 2")


def test_a_static_log(run, arm) -> None:
    still = replace(arm.log, position=np.full_like(arm.log.position, 0.3), velocity=None)
    (reason,) = rejected(run, arm, still)
    assert "the log is static" in reason


def test_a_log_that_is_too_short(run, arm) -> None:
    reasons = rejected(run, arm, window(arm.log, 2.0, 2.15))
    assert any("too short: 150 samples" in reason for reason in reasons)


def test_a_rejected_log_with_json_is_one_object_and_status_1(run, arm) -> None:
    window(arm.log, 2.0, 2.15).save("short.mcap")
    outcome = run("fit", "short.mcap", "--robot", arm.robot, "-o", "result", "--json")
    assert outcome.status == 1
    assert outcome.json["verdict"]["status"] == "reject"


def test_a_result_without_parameters_predicts_nothing_and_its_report_can_be_written(run, arm) -> None:
    rejected(run, arm, window(arm.log, 2.0, 2.15))
    outcome = run("predict", "result", arm.test, "-o", "torque.csv")
    assert outcome.status == 2
    assert outcome.err.startswith("identify: error: result: ")
    assert outcome.err.count("\n") == 1
    assert not Path("torque.csv").exists()
    Path("result/report.html").unlink()
    assert run("report", "result").status == 0
    assert Path("result/report.html").is_file()


def test_a_folder_that_is_no_result(run, arm) -> None:
    Path("empty").mkdir()
    Path("broken").mkdir()
    Path("broken/parameters.json").write_text('{"format": "identify/parameters/1"', encoding="utf-8")
    for folder in ("nowhere", "empty", "broken"):
        for command in (("predict", folder, arm.test, "-o", "torque.csv"), ("report", folder)):
            outcome = run(*command)
            assert outcome.status == 2
            assert outcome.err.startswith(f"identify: error: {folder}")
            assert outcome.err.count("\n") == 1
    assert not Path("torque.csv").exists()
    assert not Path("nowhere").exists()


def test_a_trajectory_of_another_robot(run, arm) -> None:
    Path("motion.toml").write_text("name = 1\n", encoding="utf-8")
    for trajectory in ("none.toml", "motion.toml"):
        outcome = run("simulate", arm.robot, "--trajectory", trajectory, "-o", "run.mcap")
        assert outcome.status == 2
        assert outcome.err.startswith(f"identify: error: {trajectory}: ")
        assert outcome.err.count("\n") == 1
    assert not list(Path.cwd().glob("run*"))


def test_an_output_that_is_there_is_found_before_any_work(run, arm) -> None:
    Path("result").mkdir()
    Path("result/parameters.json").write_text("{}", encoding="utf-8")
    Path("run.mcap").write_text("mine", encoding="utf-8")
    for command in (
        ("fit", "nowhere.mcap", "--robot", "nobody", "-o", "result"),
        ("simulate", "nobody", "-o", "run.mcap"),
        ("import", "nowhere.csv", "-o", "run.mcap"),
    ):
        outcome = run(*command)
        assert outcome.status == 2
        assert "exists already; pass --force" in outcome.err
    assert Path("result/parameters.json").read_text(encoding="utf-8") == "{}"
    assert Path("run.mcap").read_text(encoding="utf-8") == "mine"
