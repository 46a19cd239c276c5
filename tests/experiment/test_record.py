"""A simulated experiment is logged while it runs: the same bits, and readable when it is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from chains import random_chain, without

from identify.errors import OutputError
from identify.experiment.simulation import record_experiment, simulate, truth_path
from identify.experiment.trajectory import Trajectory, random_trajectory
from identify.logs.files import digest, partial_path
from identify.logs.mcap_reader import read_mcap
from identify.logs.reading import read_log
from identify.robot.robot import Limits, Robot
from identify.robot.toml_writing import write_toml


def example(effort: float = 400.0, periods: int = 1) -> tuple[Robot, Trajectory]:
    robot = without(random_chain(np.random.default_rng(11), 3), limits=Limits((-2.0, 2.0), 3.0, 10.0, effort))
    return robot, random_trajectory(robot, 2, fundamental_hz=0.5, periods=periods)


@pytest.mark.parametrize(("effort", "findings"), [(4000.0, False), (0.5, True), (np.inf, False)])
@pytest.mark.parametrize("noise", ["none", "high"])
def test_the_log_written_on_the_way_is_the_one_made_at_the_end(
    tmp_path: Path, effort: float, findings: bool, noise: str
) -> None:
    robot, motion = example(effort)
    path = tmp_path / "run.mcap"
    record_experiment(robot, motion, path, noise, 5)
    log, _ = simulate(robot, motion, noise, 5)
    back = read_log(path)
    for name in ("time", "position", "velocity", "effort"):
        assert np.array_equal(getattr(back, name), getattr(log, name))
    assert {key: value for key, value in back.metadata.items() if key != "start_time_ns"} == log.metadata
    assert ("findings" in back.metadata) == findings
    assert back.attachments == log.attachments
    assert read_mcap(path).attachments == {
        "robot.toml": write_toml(robot).encode(),
        "trajectory.toml": motion.to_toml().encode(),
        "feedforward.npy": log.attachments["feedforward.npy"],
    }
    assert digest(path) in truth_path(path).read_text(encoding="utf-8")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["run.mcap", "run.truth.json"]
    before = path.read_bytes()
    with pytest.raises(OutputError, match="exists already"):
        record_experiment(robot, motion, path, noise, 5)
    record_experiment(robot, motion, path, noise, 5, force=True)
    assert path.read_bytes() == before


def test_a_simulation_that_is_killed_leaves_what_it_had_and_the_old_log(tmp_path: Path) -> None:
    robot, short = example()
    motion = random_trajectory(robot, 2, fundamental_hz=0.5, periods=12)
    (tmp_path / "robot.toml").write_text(write_toml(robot), encoding="utf-8")
    motion.save(tmp_path / "motion.toml")
    path = tmp_path / "run.mcap"
    record_experiment(robot, short, path, "standard", 3)
    old = {name.name: name.read_bytes() for name in tmp_path.iterdir()}
    arguments = ["simulate", "robot.toml", "--trajectory", "motion.toml", "-o", "run.mcap", "--force", "--seed", "3"]
    with subprocess.Popen([sys.executable, "-m", "identify.cli.main", *arguments], cwd=tmp_path) as run:
        while run.poll() is None and not (partial_path(path).exists() and partial_path(path).stat().st_size > 900_000):
            time.sleep(0.001)
        os.kill(run.pid, signal.SIGKILL)
    assert run.returncode == -signal.SIGKILL
    left = {entry.name: entry.read_bytes() for entry in tmp_path.iterdir()}
    partial = left.pop(partial_path(path).name)
    assert left == old
    assert len(partial) > 900_000
    log = read_log(partial_path(path))
    assert 700 < log.samples < 24_000
    assert log.simulated
    assert "is cut" in log.findings[0]
    whole, _ = simulate(robot, motion, "standard", 3)
    assert np.array_equal(log.position, whole.position[: log.samples])
    assert np.array_equal(log.effort, whole.effort[: log.samples])
