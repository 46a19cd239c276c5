"""What the commands do when all is well."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import MAP, table

import identify
from identify.logs.mcap_reader import read_mcap
from identify.logs.reading import read_log


def test_inspect_shows_every_joint_and_holds_the_robots_limits_against_it(run, arm) -> None:
    outcome = run("inspect", arm.train)
    assert outcome.status == 0
    for words in (f"{arm.log.samples:,} samples", "shoulder", "elbow", "nothing here speaks against a fit"):
        assert words in outcome.out
    slow = arm.robot.read_text(encoding="utf-8").replace("velocity = 4.0", "velocity = 0.01")
    Path("slow.toml").write_text(slow, encoding="utf-8")
    found = run("inspect", arm.train, "--robot", "slow.toml", "--json").json
    assert any("elbow reaches a speed of" in finding for finding in found["findings"])
    assert found["can_support_a_fit"] is True
    assert found["reasons"] == []


def test_inspect_says_what_speaks_against_a_fit(run, arm) -> None:
    replace(arm.log, effort=None).save("blind.mcap")
    outcome = run("inspect", "blind.mcap")
    assert outcome.status == 0
    assert "can't support a fit:\n- the log holds no effort" in outcome.out
    assert run("inspect", "blind.mcap", "--json").json["can_support_a_fit"] is False


def test_import_turns_a_log_into_a_table_and_back(run, arm) -> None:
    assert run("import", arm.train, "-o", "new/run.csv").status == 0
    header, rows = table(Path("new/run.csv"))
    assert header == ["t", "q1", "q2", "dq1", "dq2", "tau1", "tau2"]
    np.testing.assert_array_equal(rows[:, 1:3], arm.log.position)
    np.testing.assert_array_equal(rows[:, 5:], arm.log.effort)
    Path("map.toml").write_text(MAP, encoding="utf-8")
    assert (
        run("import", "new/run.csv", "--map", "map.toml", "-o", "part.mcap", "--start", "1", "--stop", "3").status == 0
    )
    part = read_log("part.mcap")
    np.testing.assert_array_equal(part.effort, arm.log.effort[1000:3000])
    assert part.time[0] == 0
    assert part.joints == ("shoulder", "elbow")
    assert part.metadata["imported_from"] == "run.csv"
    assert part.metadata["imported_sha256"] == hashlib.sha256(Path("new/run.csv").read_bytes()).hexdigest()
    assert part.metadata["imported_seconds"] == "1 to 3"
    assert read_mcap("part.mcap").attachments["map.toml"] == MAP.encode()


def test_import_keeps_the_old_file_unless_forced(run, arm) -> None:
    Path("run.csv").write_text("mine", encoding="utf-8")
    assert run("import", arm.train, "-o", "run.csv").status == 2
    assert Path("run.csv").read_text(encoding="utf-8") == "mine"
    assert run("import", arm.train, "-o", "run.csv", "--force").status == 0
    assert len(table(Path("run.csv"))[1]) == arm.log.samples


def test_fit_leaves_a_whole_result_folder(result: Path) -> None:
    names = {entry.name for entry in result.iterdir()}
    assert names >= {"parameters.json", "report.html"}
    record = json.loads((result / "parameters.json").read_text(encoding="utf-8"))
    assert record["format"] == "identify/parameters/1"
    assert record["verdict"]["status"] != "reject"
    assert record["command"].startswith("identify fit ")
    assert [log["role"] for log in record["logs"]] == ["train", "test"]
    assert len(record["test"]) == 1
    page = (result / "report.html").read_text(encoding="utf-8")
    assert "two-joint arm" in page
    assert "<script" not in page
    assert not re.search(r"(src|href|url\()\W*https?:", page)
    assert [entry.name for entry in result.parent.iterdir()] == [result.name]


def test_fit_prints_a_summary_and_where_the_report_is(run, arm) -> None:
    outcome = run("fit", arm.train, "--robot", arm.robot, "-o", "result")
    assert outcome.status == 0
    assert outcome.err == ""
    assert identify.Identification.load("result").summary() in outcome.out
    assert str(Path("result/report.html")) in outcome.out


def test_fit_with_json_prints_what_the_file_holds(run, arm) -> None:
    outcome = run("fit", arm.train, "--robot", arm.robot, "-o", "result", "--estimator", "ols", "--json")
    assert outcome.status == 0
    assert outcome.json == json.loads(Path("result/parameters.json").read_text(encoding="utf-8"))


def test_fit_takes_several_logs_and_tables_by_a_map(run, arm) -> None:
    arm.unseen.save("unseen.csv")
    Path("map.toml").write_text(MAP, encoding="utf-8")
    outcome = run("fit", arm.train, "unseen.csv", "--map", "map.toml", "--robot", arm.robot, "-o", "result", "--json")
    assert outcome.status == 0
    logs = outcome.json["logs"]
    assert [log["samples"] for log in logs] == [arm.log.samples, arm.unseen.samples]
    assert [log["role"] for log in logs] == ["train", "train"]


def test_a_result_is_replaced_by_force_and_as_a_whole(run, arm) -> None:
    command = ("fit", arm.train, "--robot", arm.robot, "-o", "result")
    assert run(*command).status == 0
    Path("result/notes.txt").write_text("from the first fit", encoding="utf-8")
    first = Path("result/parameters.json").read_bytes()
    refused = run(*command)
    assert refused.status == 2
    assert "result: exists already; pass --force" in refused.err
    assert Path("result/parameters.json").read_bytes() == first
    assert run(*command[:-2], "--test", arm.test, "-o", "result", "--force").status == 0
    assert Path("result/parameters.json").read_bytes() != first
    assert not Path("result/notes.txt").exists()
    assert [entry.name for entry in Path.cwd().iterdir()] == ["result"]


def test_the_truth_is_read_for_the_comparison_alone(run, arm) -> None:
    for name in ("train.mcap", "train.truth.json"):
        (Path.cwd() / name).write_bytes((arm.train.parent / name).read_bytes())
    command = ("fit", "train.mcap", "--robot", arm.robot, "--json", "-o")
    with_truth = run(*command, "a").json["base_parameters"]
    Path("train.truth.json").unlink()
    without = run(*command, "b").json["base_parameters"]
    assert [row["estimate"] for row in with_truth] == [row["estimate"] for row in without]
    assert all(row["truth"] is not None for row in with_truth)
    assert all(row["truth"] is None for row in without)


def test_predict_writes_a_finite_row_for_every_sample(run, arm, result) -> None:
    outcome = run("predict", result, arm.test, "-o", "torque.csv", "--json")
    assert outcome.status == 0
    header, rows = table(Path("torque.csv"))
    assert header == ["t", "tau1", "tau2"]
    assert np.isfinite(rows).all()
    np.testing.assert_array_equal(rows[:, 0], arm.unseen.time)
    assert outcome.json["samples"] == len(rows) == arm.unseen.samples
    decimals = [line.split(",")[0].partition(".")[2] for line in Path("torque.csv").read_text().splitlines()[1:]]
    assert min(map(len, decimals)) >= 9
    error = np.linalg.norm(rows[:, 1:] - arm.unseen.effort) / np.linalg.norm(arm.unseen.effort)
    assert error < 0.1


@pytest.mark.parametrize("fault", ["absent", "nan", "wrong", "first rows"])
def test_predict_never_reads_effort(run, arm, result, fault: str) -> None:
    effort = {
        "absent": None,
        "nan": np.full_like(arm.unseen.effort, np.nan),
        "wrong": -7 * arm.unseen.effort,
        "first rows": np.where(np.arange(arm.unseen.samples)[:, None] < 900, np.nan, arm.unseen.effort),
    }[fault]
    replace(arm.unseen, effort=effort).save("faulty.mcap")
    assert run("predict", result, "faulty.mcap", "-o", "faulty.csv").status == 0
    assert run("predict", result, arm.test, "-o", "sound.csv").status == 0
    assert Path("faulty.csv").read_bytes() == Path("sound.csv").read_bytes()


def test_predict_takes_a_table_whose_map_names_an_effort_that_is_not_there(run, arm, result) -> None:
    replace(arm.unseen, velocity=None, effort=None).save("bare.csv")
    Path("map.toml").write_text(MAP, encoding="utf-8")
    assert run("predict", result, "bare.csv", "--map", "map.toml", "-o", "torque.csv").status == 0
    assert len(table(Path("torque.csv"))[1]) == arm.unseen.samples


def test_import_and_predict_share_a_clock(run, arm, result) -> None:
    effort = arm.unseen.effort.copy()
    effort[:5] = np.nan
    replace(arm.unseen, effort=effort).save("late.mcap")
    assert run("import", "late.mcap", "-o", "late.csv").status == 0
    assert run("predict", result, "late.mcap", "-o", "torque.csv").status == 0
    measured, predicted = table(Path("late.csv"))[1], table(Path("torque.csv"))[1]
    np.testing.assert_allclose(measured[:, 0], predicted[5:, 0], atol=1e-9)


def test_report_writes_the_page_anew_and_identical(run, result) -> None:
    page = (result / "report.html").read_bytes()
    (result / "report.html").write_text("", encoding="utf-8")
    outcome = run("report", result)
    assert outcome.status == 0
    assert outcome.out == f"{result / 'report.html'}\n"
    assert (result / "report.html").read_bytes() == page


def test_check_holds_a_robot_against_two_engines(run, arm) -> None:
    found = run("check", arm.robot, "--json")
    assert found.status == 0
    assert found.json["agree"] is True
    assert found.json["base_parameters"] == found.json["rank"]
    assert found.json["pinocchio"]["max_abs_error"] < 1e-10
    assert found.json["mujoco"]["max_abs_error"] < 1e-10
    text = run("check", arm.robot)
    assert "two-joint arm" in text.out
    assert "all agree" in text.out


def test_simulate_and_excite_write_what_the_next_command_reads(run, arm) -> None:
    designed = run("excite", arm.robot, "-o", "motion.toml", "--duration", "2", "--seed", "3")
    assert designed.status == 0
    assert "2 joints" in designed.out
    first = Path("motion.toml").read_bytes()
    assert run("excite", arm.robot, "-o", "motion.toml").status == 2
    assert run("excite", arm.robot, "-o", "motion.toml", "--duration", "2", "--seed", "3", "--force").status == 0
    assert Path("motion.toml").read_bytes() == first
    done = run("simulate", arm.robot, "--trajectory", "motion.toml", "--noise", "none", "-o", "run.mcap")
    assert done.status == 0
    assert "run.truth.json" in done.out
    assert json.loads(Path("run.truth.json").read_text(encoding="utf-8"))["noise"] == "none"
    log = read_log("run.mcap")
    assert log.simulated
    assert log.rate_hz == pytest.approx(1000)
    Path("run.mcap").unlink()
    again = run("simulate", arm.robot, "--trajectory", "motion.toml", "-o", "run.mcap")
    assert again.status == 2
    assert "run.truth.json: exists already" in again.err


def test_a_whole_session_in_processes_of_their_own(arm, tmp_path: Path) -> None:
    def call(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "identify.cli.main", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=os.environ, check=False)

    fitted = call("fit", arm.train, "--robot", arm.robot, "-o", "result", "--json")
    assert (fitted.returncode, fitted.stderr) == (0, "")
    assert json.loads(fitted.stdout)["verdict"]["status"] != "reject"
    predicted = call("predict", "result", arm.test, "-o", "torque.csv")
    assert (predicted.returncode, predicted.stderr) == (0, "")
    refused = call("predict", "result", "nowhere.mcap", "-o", "other.csv")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr == "identify: error: nowhere.mcap: there is no such file; check the name of the log\n"
    assert sorted(os.listdir(tmp_path)) == ["result", "torque.csv"]


def test_excite_says_what_to_expect_and_starts_from_earlier_results(run, arm, result) -> None:
    options = ("--duration", "2", "--starts", "1", "--periods", "2", "--harmonics", "4")
    first = run("excite", arm.robot, "-o", "motion.toml", *options)
    assert first.status == 0, first.err
    assert "4 harmonics of 0.5 Hz, 2 periods of 2 s" in first.out
    assert "expected of a fit of the torque model, noise 0.1 % of the effort limits" in first.out
    assert "σ expected" in first.out
    again = run("excite", arm.robot, "-o", "next.toml", *options, "--from", result, "--from", result, "--json")
    assert again.status == 0, again.err
    rows = again.json["forecast"]["parameters"]
    assert all(0 < row["std"] < row["std_before"] for row in rows)
    assert again.json["earlier"] == [str(result), str(result)]
    assert again.json["assessment"]["torque_condition"] > 1
    assert set(again.json["assessment"]["gaps_m"]) <= {"links", "floor"}
    refused = run("excite", "rx90", "-o", "other.toml", "--from", result)
    assert refused.status == 2
    assert "another robot" in refused.err
    assert refused.err.count("\n") == 1
    nowhere = run("excite", arm.robot, "-o", "other.toml", "--from", "nowhere")
    assert (nowhere.status, "no result folder" in nowhere.err) == (2, True)
    assert run("excite", arm.robot, "-o", "other.toml", "--harmonics", "1").status == 2
    free = run("excite", arm.robot, "-o", "free.toml", *options, "--no-collision", "--json")
    assert free.json["assessment"]["gaps_m"] == {}
