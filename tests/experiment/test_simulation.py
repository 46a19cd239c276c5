"""A simulated experiment on disk: log and truth apart, reproducible, never over an old one unasked."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chains import random_chain, without

from identify.errors import InputError, OutputError
from identify.experiment.simulation import save_experiment, simulate, truth_path
from identify.experiment.trajectory import Trajectory, random_trajectory
from identify.logs.files import digest
from identify.robot.robot import Limits, Robot, Transmission
from identify.robot.toml_writing import write_toml


def example() -> tuple[Robot, Trajectory]:
    robot = without(random_chain(np.random.default_rng(11), 3), limits=Limits((-2.0, 2.0), 3.0, 10.0, 400.0))
    return robot, random_trajectory(robot, 2, fundamental_hz=0.5, periods=1)


def test_truth_holds_the_robots_parameters_and_the_log_does_not(tmp_path: Path) -> None:
    robot, motion = example()
    log, truth = simulate(robot, motion, "standard", 4)
    assert truth["format"] == "identify/truth/1"
    assert truth["standard_names"] == list(robot.standard_names)
    assert np.array_equal(truth["standard"], robot.standard)
    for joint, friction, drive in zip(robot.joints, truth["friction"], truth["drives"], strict=True):
        assert friction["joint"] == drive["joint"] == joint.name
        assert (friction["viscous"], friction["coulomb"], friction["offset"]) == (
            joint.drive.viscous,
            joint.drive.coulomb,
            joint.drive.offset,
        )
        assert drive["inertia"] == joint.drive.inertia
    told = " ".join(log.metadata.values())
    assert not any(f"{value:.5g}" in told for value in robot.standard if abs(value) > 1e-3)
    assert log.samples == 3001
    assert log.effort is not None


def test_coupled_motors_have_no_extra_inertia_or_friction_in_the_plant() -> None:
    robot, motion = example()
    coupled = replace(robot, transmission=Transmission(((40.0, 0, 0), (0, 30.0, 0), (0, 32.0, 32.0))))
    _, truth = simulate(coupled, motion)
    assert truth["transmission"] == [{"name": name, "value": 0.0} for name in ("Iam3", "Fvm3", "Fsm3")]
    assert simulate(robot, motion)[1]["transmission"] == []


def test_files_are_reproducible_bit_by_bit_and_belong_together(tmp_path: Path) -> None:
    robot, motion = example()
    for name in ("one.mcap", "two.mcap"):
        log, truth = simulate(robot, motion, "high", 7)
        save_experiment(log, truth, write_toml(robot), motion.to_toml(), tmp_path / name)
    one, two = tmp_path / "one.mcap", tmp_path / "two.mcap"
    assert one.read_bytes() == two.read_bytes()
    assert truth_path(one).read_bytes() == truth_path(two).read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "one.mcap",
        "one.truth.json",
        "two.mcap",
        "two.truth.json",
    ]
    stored = json.loads(truth_path(one).read_text(encoding="utf-8"))
    assert stored.pop("log_sha256") == digest(one)
    assert stored == truth


def test_log_comes_back_from_disk_with_its_attachments(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    from identify.logs.reading import read_log

    robot, motion = example()
    log, truth = simulate(robot, motion, "standard", 7)
    path = tmp_path / "run.mcap"
    save_experiment(log, truth, write_toml(robot), motion.to_toml(), path)
    back = read_log(path)
    for name in ("position", "velocity", "effort"):
        assert np.array_equal(getattr(back, name), getattr(log, name))
    assert np.allclose(back.time, log.time, rtol=0, atol=1e-9)
    assert back.joints == log.joints
    assert back.simulated
    assert back.metadata["velocity"] == log.metadata["velocity"]
    with open(path, "rb") as stream:
        attached = {x.name: x.data for x in make_reader(stream).iter_attachments()}
    assert attached["robot.toml"] == write_toml(robot).encode()
    assert Trajectory.from_toml(attached["trajectory.toml"].decode()).to_toml() == motion.to_toml()


def test_nothing_is_replaced_unasked(tmp_path: Path) -> None:
    robot, motion = example()
    log, truth = simulate(robot, motion)
    path = tmp_path / "run.mcap"
    truth_path(path).write_text("{}")
    with pytest.raises(OutputError, match=r"run\.truth\.json: exists already"):
        save_experiment(log, truth, "", "", path)
    assert not path.exists()
    save_experiment(log, truth, "", "", path, force=True)
    assert json.loads(truth_path(path).read_text())["format"] == "identify/truth/1"
    with pytest.raises(OutputError, match=r"run\.mcap: exists already"):
        save_experiment(log, truth, "", "", path)
    with pytest.raises(OutputError, match="absent"):
        save_experiment(log, truth, "", "", tmp_path / "absent" / "run.mcap")


def test_progress_rises_from_nought_to_one() -> None:
    robot, motion = example()
    heard: list[float] = []
    simulate(robot, motion, progress=lambda fraction, text: heard.append(fraction))
    assert heard == sorted(heard)
    assert heard[0] == 0.0
    assert heard[-1] == 1.0


def test_unknown_noise_is_refused_before_anything_runs() -> None:
    robot, motion = example()
    heard: list[float] = []
    with pytest.raises(InputError, match="noise"):
        simulate(robot, motion, "loud", progress=lambda fraction, text: heard.append(fraction))
    with pytest.raises(InputError, match="seed"):
        simulate(robot, motion, "none", -2, progress=lambda fraction, text: heard.append(fraction))
    assert heard == []
