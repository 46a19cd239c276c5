"""A fit that explains nothing is refused, and reversals between two samples count as rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify import workflow
from identify.errors import UnsupportedLogError
from identify.estimation.observation import STILL, moving
from identify.experiment.simulation import simulate
from identify.experiment.trajectory import random_trajectory
from identify.robot.library import load_robot


def test_noise_and_mixed_up_joints_are_no_effort() -> None:
    robot = load_robot("rx90")
    log, _ = simulate(robot, random_trajectory(robot, 1, periods=1), "standard", 0)
    noise = np.random.default_rng(0).normal(size=log.position.shape)
    with pytest.raises(UnsupportedLogError, match="better than chance"):
        workflow.fit(replace(log, effort=noise), robot)
    with pytest.raises(UnsupportedLogError, match="better than chance"):
        workflow.fit(replace(log, effort=noise + 50.0), robot)
    assert workflow.fit(log, robot).record["fit"]["moving_relative_residual_percent"] < 1


def test_a_fast_reversal_between_two_samples_is_rest() -> None:
    rate, acceleration = 400.0, 40.0
    time = np.arange(200) / rate
    speed = acceleration * (time - time[100] - 0.4 / rate)
    assert np.abs(speed).min() > STILL
    found = moving(speed[:, None], guard=4)[:, 0]
    assert not found[96:105].any()
    assert found[:90].all()
    assert found[112:].all()
