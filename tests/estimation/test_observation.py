"""Observation matrices: one linear filter on both sides, rest left out, built in pieces, thinned."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from exact_logs import arm, exact_log

from identify.estimation import observation as module
from identify.estimation.observation import END_S, Observation, moving, signals, stacked, torque_blocks, torque_residual
from identify.estimation.reduction import reduced
from identify.estimation.settings import STILL, Settings
from identify.logs.log import Log
from identify.regressor.columns import smooth_sign
from identify.regressor.regressor import Regressor

ARM = arm(2)
"""Prismatic, revolute, prismatic."""

REGRESSOR = Regressor(ARM)
THETA = REGRESSOR.parameters
SETTINGS = Settings(position_cutoff_hz=20.0)
SMOOTH = replace(SETTINGS, coulomb_velocity=0.05, rest_counted=True)


@pytest.fixture(scope="module")
def log() -> Log:
    """Effort exactly that of the filtered motion: what is left is the filter of the rows."""
    made = exact_log(ARM)
    s = signals(made, SETTINGS)
    return replace(made, effort=REGRESSOR.inverse_dynamics(s.q, s.dq, s.ddq, THETA))


def torque_observation(regressor: Regressor, log: Log, settings: Settings) -> Observation:
    """All rows of a log."""
    return stacked(torque_blocks(regressor, [log], settings))


def same(a: Observation, b: Observation, tolerance: float) -> None:
    for ours, theirs in zip((*a.matrix, *a.effort), (*b.matrix, *b.effort), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * np.abs(theirs).max())
    np.testing.assert_allclose(a.weight, b.weight, rtol=0, atol=tolerance)
    np.testing.assert_array_equal(a.time, b.time)


def test_filtered_columns_times_theta_are_the_filtered_effort(log: Log) -> None:
    observation = torque_observation(REGRESSOR, log, SETTINGS)
    for matrix, effort in zip(observation.matrix, observation.effort, strict=True):
        assert np.abs(effort).max() > 1.0
        np.testing.assert_allclose(matrix @ THETA, effort, rtol=0, atol=1e-11 * np.abs(effort).max())
    assert observation.names == REGRESSOR.names


def test_so_they_are_with_a_smoothed_sign_and_rows_at_rest(log: Log) -> None:
    s = signals(log, SMOOTH)
    made = replace(log, effort=REGRESSOR.inverse_dynamics(s.q, s.dq, s.ddq, THETA, smooth_sign(0.05)))
    observation = torque_observation(REGRESSOR, made, SMOOTH)
    for matrix, effort in zip(observation.matrix, observation.effort, strict=True):
        np.testing.assert_allclose(matrix @ THETA, effort, rtol=0, atol=1e-11 * np.abs(effort).max())
    np.testing.assert_allclose(observation.weight, 1.0, rtol=1e-11)


@pytest.mark.parametrize("settings", [SETTINGS, SMOOTH])
@pytest.mark.parametrize("chunk", [2.0, 3.7])
def test_pieces_make_the_whole(log: Log, settings: Settings, chunk: float, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = torque_observation(REGRESSOR, log, settings)
    monkeypatch.setattr(module, "PIECE_S", chunk)
    same(torque_observation(REGRESSOR, log, settings), whole, 1e-8)


def test_effort_of_a_joint_at_rest_is_never_looked_at(log: Log) -> None:
    """At rest, and as near to it as guard_s, friction is unknown: any effort there gives the same rows."""
    s = signals(log, SETTINGS)
    still = np.abs(s.dq) <= STILL
    guard = round(SETTINGS.guard_s * s.rate)
    near = np.array([still[max(0, k - guard) : k + guard + 1].any(axis=0) for k in range(len(still))])
    assert 0.03 < near.mean() < 0.5
    assert (near & ~still).any(axis=0).all()
    disturbed = replace(log, effort=np.where(near, 1e3, log.effort))
    first, second = (torque_observation(REGRESSOR, x, SETTINGS) for x in (log, disturbed))
    for ours, theirs in zip(first.effort, second.effort, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    counted = [torque_observation(REGRESSOR, x, SMOOTH).effort[0] for x in (log, disturbed)]
    assert np.abs(counted[0] - counted[1]).max() > 100
    beyond = replace(log, effort=log.effort + ~near * [1.0, 0.0, 0.0])
    assert np.abs(torque_observation(REGRESSOR, beyond, SETTINGS).effort[0] - first.effort[0]).max() > 0.9


def test_each_joint_rests_on_its_own() -> None:
    dq = np.zeros((9, 2))
    dq[:, 0] = [1, 1, 1, 0.5 * STILL, 1, 1, 1, 1, 1]
    dq[:, 1] = -1.0
    expected = np.ones((9, 2), dtype=bool)
    expected[2:5, 0] = False
    np.testing.assert_array_equal(moving(dq, 1), expected)
    np.testing.assert_array_equal(moving(np.full((3, 1), STILL), 0), False)


def test_weight_is_the_share_of_a_row_that_moves(log: Log) -> None:
    observation = torque_observation(REGRESSOR, log, SETTINGS)
    rest = observation.time < 0.3  # the trajectory rests for half a second first
    assert rest.sum() >= 3
    np.testing.assert_allclose(observation.weight[rest], 0.0, atol=0.01)
    assert np.median(observation.weight) > 0.99
    assert (observation.weight >= 0).all()
    assert (observation.weight <= 1).all()


@pytest.mark.parametrize(("rate", "expected"), [(250.0, 250 / 12), (1000.0, 20.0), (5000.0, 5000 / 12 / 21)])
def test_rows_come_at_about_the_decimated_rate(rate: float, expected: float) -> None:
    """From the middle of the log alone; 5 kHz is first brought down to 417 Hz."""
    log = exact_log(ARM, rate=rate)
    observation = torque_observation(REGRESSOR, log, SETTINGS)
    assert observation.rate == pytest.approx(expected, rel=1e-6)
    np.testing.assert_allclose(np.diff(observation.time), 1 / expected, rtol=1e-6)
    assert observation.time[0] == pytest.approx(END_S, abs=1 / 400)
    assert log.duration - END_S - 1.01 / expected < observation.time[-1] <= log.duration - END_S
    assert {len(x) for x in (*observation.matrix, *observation.effort, observation.weight)} == {len(observation.time)}


def test_logs_are_stacked_joint_by_joint(log: Log) -> None:
    other = exact_log(ARM, seed=3)
    parts = [torque_observation(REGRESSOR, x, SETTINGS) for x in (log, other)]
    both = stacked(parts)
    rows = len(parts[0].time)
    for j in range(ARM.n):
        np.testing.assert_array_equal(both.matrix[j][rows:], parts[1].matrix[j])
        np.testing.assert_array_equal(both.effort[j][:rows], parts[0].effort[j])
    assert len(both.time) == len(both.weight) == rows + len(parts[1].time)


def test_residual_needs_no_matrix(log: Log) -> None:
    """Filtering is linear: the rows' residual is the filtered residual, with rest left out of both, log after log."""
    logs = [log, exact_log(ARM, seed=3, noise=0.1)]
    theta = np.random.default_rng(0).normal(size=REGRESSOR.p)
    rows = stacked(torque_blocks(REGRESSOR, logs, SETTINGS))
    expected = np.transpose([b - a @ theta for a, b in zip(rows.matrix, rows.effort, strict=True)])
    found = torque_residual(REGRESSOR, logs, SETTINGS, theta)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_memory_does_not_grow_with_the_log(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reduced as they come, rows of a log four times as long take what is kept of each row: effort and weight."""
    monkeypatch.setattr(module, "PIECE_S", 5.0)
    regressor = Regressor(arm(0, 5))
    samples, peaks = [], []
    for periods in (2, 8):
        log = exact_log(regressor.robot, rate=100.0, periods=periods)
        reduced(
            torque_blocks(regressor, [exact_log(regressor.robot, rate=100.0)], SETTINGS)
        )  # code made, modules loaded
        tracemalloc.start()
        reduction = reduced(torque_blocks(regressor, [log], SETTINGS))
        torque_residual(regressor, [log], SETTINGS, np.ones(regressor.p))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        samples.append(log.samples)
        assert reduction.equations == pytest.approx(regressor.robot.n * log.duration * 20, rel=0.05)
    clock_and_rows = 8 * (6 + 3 * regressor.robot.n)
    assert np.diff(peaks)[0] / np.diff(samples)[0] < clock_and_rows < 8 * regressor.p
