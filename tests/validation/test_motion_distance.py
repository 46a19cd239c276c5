"""Repeats of the training motion are found, whatever their noise, shift, rate or length; other motions are not."""

from __future__ import annotations

import numpy as np
import pytest
from exact_logs import arm

from identify.experiment.trajectory import random_trajectory
from identify.robot.robot import Robot
from identify.validation.motion_distance import States, motion_distance

ARM = arm(1)


def states(
    robot: Robot, seed: int, rate: float = 40.0, start: float = 0.0, stop: float = 11.0, noise: int = 0
) -> States:
    """A random motion from `start` to `stop` [s], with half a second of rest before and after; noise: its seed, on q of
    1e-4, on dq of 1e-2, on ddq of 0.3, SI."""
    t = np.arange(start, stop, 1 / rate)
    q, dq, ddq = random_trajectory(robot, seed, periods=1).sample(t)
    if noise:
        rng = np.random.default_rng(noise)
        q, dq, ddq = (x + s * rng.standard_normal(x.shape) for x, s in ((q, 1e-4), (dq, 1e-2), (ddq, 0.3)))
    return States(q, dq, ddq, rate)


def found(test: States, *training: States) -> dict:
    return motion_distance(test, training, [f"train{k}.mcap" for k in range(len(training))])


@pytest.mark.parametrize(
    "test",
    [
        states(ARM, 1, noise=3),
        states(ARM, 1, start=0.1234, noise=4),
        states(ARM, 1, rate=27.7, noise=5),
        states(ARM, 1, start=3.01, stop=8.2, noise=6),
    ],
    ids=["other noise", "shifted", "another rate", "cut out"],
)
def test_a_repeat_is_found(test: States) -> None:
    row = found(test, states(ARM, 7), states(ARM, 1, noise=2))
    assert row["repeat"]["share_percent"] > 90  # beside rest, which state is the nearest is up to noise
    assert row["repeat"]["repeats"] is True
    assert row["repeat"]["training_log"] == "train1.mcap"
    assert row["distance"]["median"] < 0.1
    assert "repeats the training motion" in row["told"]


def test_a_partial_repeat_is_found_with_its_share() -> None:
    again, new = states(ARM, 1, start=1.0, stop=4.0, noise=7), states(ARM, 5, start=0.5, stop=10.5, noise=8)
    mixed = States(*(np.concatenate([getattr(s, k) for s in (again, new)]) for k in ("q", "dq", "ddq")), 40.0)
    row = found(mixed, states(ARM, 1, noise=2))
    assert row["repeat"]["share_percent"] == pytest.approx(100 * 3 / 13, abs=6)
    assert row["repeat"]["repeats"] is False
    assert row["repeat"]["seconds"] == pytest.approx(3.0, abs=0.7)


@pytest.mark.parametrize("robot", [arm(1), arm(2), arm(1, n=1), arm(3, n=6)])
def test_another_motion_is_no_repeat(robot: Robot) -> None:
    for seed in (2, 3, 4):
        row = found(states(robot, seed, noise=seed), states(robot, 1, noise=9))
        assert row["repeat"]["share_percent"] < 5
        assert row["repeat"]["repeats"] is False
        assert row["distance"]["median"] > (0.2 if robot.n > 1 else 0.02)


def test_the_same_path_at_another_speed_is_no_repeat() -> None:
    t = np.arange(0.5, 10.5, 1 / 40)
    q, dq, ddq = random_trajectory(ARM, 1, periods=1).sample(t)
    slow = States(q, 0.7 * dq, 0.49 * ddq, 40.0 / 0.7)
    assert found(slow, states(ARM, 1))["repeat"]["share_percent"] < 15


def test_distance_is_that_of_the_nearest_state_in_spreads_of_the_training() -> None:
    """A training motion moved by two spreads of one joint of three: √(4/9) of its spread away at most, as every state
    has itself in the training."""
    train = states(ARM, 1)
    spread = train.q.std(axis=0)
    moved = States(train.q + 2 * spread * [0.0, 1.0, 0.0], train.dq, train.ddq, 40.0)
    row = found(moved, train)
    assert row["repeat"]["share_percent"] == 0
    assert row["repeat"]["training_log_reason"]
    assert 0.3 < row["distance"]["median"] <= row["distance"]["largest"] <= 2 / 3 + 1e-9
    same = found(train, train)
    assert same["distance"]["largest"] < 1e-6


def test_a_log_at_rest_has_reasons_in_place_of_figures() -> None:
    still = States(np.ones((50, 3)), np.zeros((50, 3)), np.zeros((50, 3)), 40.0)
    row = found(still, states(ARM, 1))
    for key in ("repeat", "distance", "told"):
        assert row[key] is None
        assert row[f"{key}_reason"] == "no joint moves in it"


def test_an_hour_is_compared_in_little_time_and_memory() -> None:
    import time

    pieces = [states(ARM, seed, noise=1) for seed in range(20, 40)]
    hour = States(
        *(np.tile(np.concatenate([getattr(s, k) for s in pieces]), (16, 1)) for k in ("q", "dq", "ddq")), 40.0
    )
    assert len(hour.q) > 140_000
    start = time.process_time()
    found(states(ARM, 3), hour)
    assert time.process_time() - start < 5.0
