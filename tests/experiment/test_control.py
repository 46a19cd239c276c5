"""A log tells how its motion was commanded, and the loop closed anew with the same arm gives the same motion."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from chains import random_chain, without

from identify.errors import UnsupportedLogError
from identify.experiment.control import control_of
from identify.experiment.simulation import record_experiment, simulate
from identify.experiment.trajectory import random_trajectory
from identify.logs.log import Log
from identify.logs.reading import read_log
from identify.logs.slicing import select, window
from identify.robot.payload import carrying
from identify.robot.robot import Limits, Link, Robot

WIDE = Limits((-2.0, 2.0), 3.0, 10.0, 400.0)
LOAD = Link(2.0, (0.1, -0.05, 0.2), (0.02, 0.001, 0.0, 0.03, 0.002, 0.025))


@lru_cache(maxsize=2)
def example(loaded: bool = False) -> tuple[Robot, Log]:
    robot = without(random_chain(np.random.default_rng(5), 3), limits=WIDE)
    motion = random_trajectory(robot, 1, fundamental_hz=0.5, periods=2)
    return robot, simulate(robot, motion, "none", load=LOAD if loaded else None)[0]


def off(arm: Robot, log: Log) -> float:
    """Largest distance between a log's positions and those of `arm` under the log's controller [rad]."""
    position, effort = control_of(log, arm.joint_names).simulated(arm, log.time)
    assert log.effort is not None
    assert position.shape == effort.shape == log.effort.shape
    return float(np.abs(position - select(log, arm.joint_names).position).max())


def test_the_same_arm_moves_as_it_did_and_another_does_not() -> None:
    robot, log = example()
    assert off(robot, log) < 1e-6
    assert off(carrying(robot, LOAD), log) > 1e-4


def test_its_effort_is_that_of_the_log() -> None:
    robot, log = example()
    assert log.effort is not None
    effort = control_of(log, robot.joint_names).simulated(robot, log.time)[1]
    assert np.abs(effort - log.effort).max() < 1e-3 * np.abs(log.effort).max()


def test_the_feedforward_is_the_controllers_whatever_the_arm_carries() -> None:
    robot, log = example(loaded=True)
    assert off(carrying(robot, LOAD), log) < 1e-6
    assert off(robot, log) > 1e-4


def test_files_parts_and_other_orders_tell_the_same(tmp_path: Path) -> None:
    robot, _ = example()
    motion = random_trajectory(robot, 1, fundamental_hz=0.5, periods=2)
    record_experiment(robot, motion, tmp_path / "run.mcap", "none")
    log = read_log(tmp_path / "run.mcap", joints=robot.joint_names[::-1])
    assert off(robot, log) < 1e-6
    part = window(window(log, 0.7), 0.1, 3.0)
    assert off(robot, part) < 1e-6
    part.save(tmp_path / "part.mcap")
    assert off(robot, read_log(tmp_path / "part.mcap")) < 1e-6


def test_what_can_not_be_used_is_refused_with_the_reason() -> None:
    robot, log = example()
    names = robot.joint_names
    shifted = replace(log, metadata=log.metadata | {"motion_start_s": "0.4"})
    twisted = replace(log, position=log.position[:, ::-1])
    text = log.metadata["position_gain"]
    for bad, message in (
        (replace(log, attachments={}), "does not tell its controller"),
        (replace(log, metadata={}), "does not tell its controller"),
        (replace(log, metadata=log.metadata | {"position_gain": "stiff"}), "can't be used"),
        (replace(log, metadata=log.metadata | {"position_gain": text.replace("joint_", "axis_")}), "can't be used"),
        (replace(log, metadata=log.metadata | {"position_gain": '{"joint_1": null}'}), "can't be used"),
        (replace(log, metadata=log.metadata | {"feedforward_rate_hz": "0"}), "can't be used"),
        (replace(log, attachments={**log.attachments, "feedforward.npy": b"\x93NUMPY"}), "can't be used"),
        (replace(log, attachments={**log.attachments, "trajectory.toml": b"\xff"}), "can't be used"),
        (shifted, "does not follow the trajectory"),
        (twisted, "does not follow the trajectory"),
    ):
        with pytest.raises(UnsupportedLogError, match=message):
            control_of(bad, names)
    with pytest.raises(UnsupportedLogError, match="can't be used"):
        control_of(log, names[:2])
