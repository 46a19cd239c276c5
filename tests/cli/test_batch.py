"""`identify batch` as a user meets it: good logs and bad ones, kills, and what stands in the tables."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import Arm

from identify.estimation.identification import Identification
from identify.logs.folders import clear_leftovers

KILLED = -signal.SIGKILL


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def logs(arm: Arm, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two good logs, of one the held-out one beside it, and three that give no model."""
    folder = tmp_path_factory.mktemp("logs")
    shutil.copy(arm.train, folder / "a.mcap")
    shutil.copy(arm.test, folder / "a.test.mcap")
    (folder / "second").mkdir()
    shutil.copy(arm.test, folder / "second" / "run & <one>.mcap")
    still = replace(arm.log, position=np.tile(arm.log.position[:1], (arm.log.samples, 1)), velocity=None)
    still.save(folder / "still.mcap")
    (folder / "garbage.mcap").write_bytes(bytes(range(256)) * 40)
    replace(arm.log, joints=("x", "y")).save(folder / "other.mcap")
    (folder / "notes.txt").write_text("to be left alone")
    return folder


def start(logs: Path, arm: Arm, target: Path, *more: str) -> subprocess.Popen:
    """The batch in a process group of its own."""
    command = [sys.executable, "-m", "identify.cli.main", "batch", str(logs), "--robot", str(arm.robot)]
    return subprocess.Popen(
        [*command, "-o", str(target), *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    )


def part_of(process: subprocess.Popen, target: Path) -> Path:
    """The folder that the batch fills, once it is there."""
    part = target.with_name(f".{target.name}.{process.pid}.part")
    patience = time.monotonic() + 60
    while not part.is_dir():
        assert process.poll() is None
        assert time.monotonic() < patience
        time.sleep(0.01)
    return part


def test_one_bad_log_does_not_stop_the_others(logs: Path, arm: Arm, result: Path, tmp_path: Path) -> None:
    """A batch that is killed with SIGKILL leaves no folder; the next one clears what it left, and is whole."""
    target = tmp_path / "out"
    killed = start(logs, arm, target, "--jobs", "1")
    part = part_of(killed, target)
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    assert killed.returncode == KILLED
    assert not target.exists()
    assert part.is_dir()

    done = start(logs, arm, target, "--json", "--jobs", "2")
    out, err = done.communicate(timeout=120)
    assert (done.returncode, err) == (1, b"")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    summary = json.loads(out)
    assert summary == json.loads((target / "summary.json").read_text(encoding="utf-8"))
    states = {fit["name"]: fit["status"] for fit in summary["fits"]}
    assert states == {
        "a": "accept",
        "garbage": "failed",
        "other": "failed",
        "second/run & <one>": "warn",
        "still": "reject",
    }
    assert summary["counts"] == {"accept": 1, "warn": 1, "reject": 1, "failed": 2}
    reasons = {fit["name"]: " ".join(fit["reasons"]) for fit in summary["fits"]}
    assert "is not an MCAP file" in reasons["garbage"]
    assert "has no joint 'shoulder'" in reasons["other"]
    assert "static" in reasons["still"]
    assert [Path(other).name for other in summary["others"]] == ["notes.txt"]

    # Each result is what `identify fit` writes.
    for fit in summary["fits"]:
        if fit["status"] == "failed":
            assert fit["folder"] is None
            continue
        record = json.loads((target / fit["folder"] / "parameters.json").read_text(encoding="utf-8"))
        assert (target / fit["folder"] / "report.html").is_file()
        assert record["verdict"]["status"] == fit["status"]
        assert [p["name"] for p in fit["parameters"]] == record["names"]
    own, batch = Identification.load(result), Identification.load(target / "a")
    assert own.parameters.tobytes() == batch.parameters.tobytes()
    assert own.covariance.tobytes() == batch.covariance.tobytes()

    with open(target / "summary.csv", encoding="utf-8", newline="") as stream:
        rows = {row["log"]: row for row in csv.DictReader(stream)}
    assert {name: row["status"] for name, row in rows.items()} == states
    assert (
        float(rows["a"]["moving_relative_residual_percent"]) == summary["fits"][0]["moving_relative_residual_percent"]
    )
    assert rows["a"]["test_moving_relative_residual_percent"] != ""
    assert rows["garbage"]["samples"] == ""
    assert rows["a"]["worst_parameters"].split()[0] == summary["fits"][0]["worst"][0]["name"]
    with open(target / "parameters.csv", encoding="utf-8", newline="") as stream:
        columns = list(csv.DictReader(stream))
    assert [row["name"] for row in columns] == list(own.names)
    assert [float(row["a"]) for row in columns] == own.parameters.tolist()
    assert [float(row["a std"]) for row in columns] == pytest.approx(own.std.tolist())
    assert summary["logs"] == 2

    page = (target / "summary.html").read_text(encoding="utf-8")
    assert "2 of 5 logs gave a model; 1 can’t support one; 2 could not be used." in page
    assert 'href="second/run%20%26%20%3Cone%3E/report.html"' in page
    assert "run &amp; &lt;one&gt;" in page
    assert "http" not in page.replace("http-equiv", "")

    # With --force an interrupted run leaves the old folder as it was, and nothing else.
    before = contents(target)
    interrupted = start(logs, arm, target, "--force", "--jobs", "1")
    part_of(interrupted, target)
    os.killpg(interrupted.pid, signal.SIGINT)
    _, err = interrupted.communicate(timeout=60)
    assert (interrupted.returncode, err) == (130, b"identify: error: interrupted\n")
    assert contents(target) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nowhere", "-o", "out"), "nowhere: there is no such folder"),
        (("{logs}", "-o", "{logs}"), "holds files that this very command reads"),
        (("{logs}", "-o", "there"), "there: exists already; pass --force"),
        (("{logs}", "-o", "mine", "--force"), "mine: holds something else"),
        (("{logs}", "-o", "out", "--jobs", "0"), "'0' is not a number of at least 1"),
        (("{logs}", "-o", "out", "--joints", "wrist"), "wrist"),
    ],
)
def test_what_can_not_be_begun_writes_nothing(
    run, arm: Arm, logs: Path, arguments: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    for name, inside in (("there", "summary.json"), ("mine", "cat.jpg")):
        (tmp_path / name).mkdir()
        (tmp_path / name / inside).write_text("{}")
    before = contents(tmp_path)
    outcome = run("batch", *(word.replace("{logs}", str(logs)) for word in arguments), "--robot", arm.robot)
    assert outcome.status == 2
    assert outcome.out == ""
    assert message in outcome.err
    assert outcome.err.count("\n") == 1
    assert contents(tmp_path) == before


STOPPED = """
import os, sys, time
import numpy as np
from identify.cli.main import main
if sys.argv[1] == "writing":
    def half(stream, **arrays):
        stream.write(b"half of it")
        stream.flush()
        print("now", flush=True)
        time.sleep(60)
    np.savez_compressed = half
else:
    rename = os.replace
    def once(old, new):
        rename(old, new)
        if str(new).endswith(".old"):
            print("now", flush=True)
            time.sleep(60)
    os.replace = once
    from identify.estimation.identification import Identification
    Identification.load(sys.argv[2]).save(sys.argv[3], force=True)
if sys.argv[1] == "writing":
    main(["fit", *sys.argv[2:]])
"""


@pytest.mark.parametrize("when", ["writing", "between renames"])
def test_a_fit_that_is_killed_leaves_the_old_result_or_none(
    when: str, arm: Arm, result: Path, run, tmp_path: Path
) -> None:
    """SIGKILL while the arrays are written, or with the old folder set aside and the new one not yet in its place."""
    target = tmp_path / "result"
    shutil.copytree(result, target)
    before = contents(target)
    arguments = [str(result), str(target)]
    if when == "writing":
        arguments = [str(arm.train), "--robot", str(arm.robot), "-o", str(target), "--force"]
    process = subprocess.Popen([sys.executable, "-c", STOPPED, when, *arguments], stdout=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stdout.readline() == b"now\n"

    # Another run beside it leaves what it is at work on alone.
    at_work = sorted(path.name for path in tmp_path.iterdir())
    clear_leftovers(target)
    assert sorted(path.name for path in tmp_path.iterdir()) == at_work

    process.kill()
    process.wait()
    process.stdout.close()
    left = sorted(path.name for path in tmp_path.iterdir())
    ends = ["part"] if when == "writing" else ["old", "part"]
    assert [name for name in left if name.startswith(".")] == [f".result.{process.pid}.{end}" for end in ends]
    if when == "writing":
        assert contents(target) == before
        Identification.load(result).save(target, force=True)
        before.pop("report.html")
    else:
        # The next run without --force finds the old result back in its place.
        assert not target.exists()
        outcome = run("fit", arm.train, "--robot", arm.robot, "-o", target)
        assert outcome.status == 2
        assert "exists" in outcome.err
    assert contents(target) == before
    assert [path.name for path in tmp_path.iterdir()] == ["result"]
