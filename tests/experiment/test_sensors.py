"""Sensors: the noise that was asked for, on the channel it belongs to, the same for the same seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from chains import random_chain, without

from identify import load_robot
from identify.errors import InputError
from identify.experiment.plant import PlantRun, run_plant
from identify.experiment.sensors import measure
from identify.experiment.trajectory import random_trajectory
from identify.robot.robot import Limits, Robot


@pytest.fixture(scope="module")
def experiment() -> tuple[Robot, PlantRun]:
    robot = load_robot("rx90")
    robot = replace(robot, joints=(*robot.joints[:3],))
    return robot, run_plant(robot, random_trajectory(robot, 0, periods=1))


def test_without_noise_the_log_is_the_plant(experiment: tuple[Robot, PlantRun]) -> None:
    robot, run = experiment
    log = measure(run, "none", 0, robot)
    assert np.array_equal(log.position, run.position)
    assert np.array_equal(log.effort, run.effort)
    assert np.array_equal(log.time, run.time)
    assert log.joints == robot.joint_names
    assert log.position is not run.position


@pytest.mark.parametrize(("noise", "degrees", "share"), [("standard", 1e-3, 1e-3), ("high", 1e-2, 1e-2)])
def test_noise_is_white_and_of_the_stated_size(
    experiment: tuple[Robot, PlantRun], noise: str, degrees: float, share: float
) -> None:
    robot, run = experiment
    log = measure(run, noise, 3, robot)
    limits = np.array([320.0, 320.0, 160.0])  # rx90.toml
    position = (log.position - run.position) / np.deg2rad(degrees)
    effort = (log.effort - run.effort) / (share * limits)
    samples = len(run.time)
    for white in (*position.T, *effort.T):
        # five standard errors of mean, standard deviation and lag-one correlation
        assert abs(white.mean()) < 5 / np.sqrt(samples)
        assert abs(white.std() - 1) < 5 / np.sqrt(2 * samples)
        assert abs(np.mean(white[1:] * white[:-1])) < 5 / np.sqrt(samples)
    every = np.corrcoef(np.hstack([position, effort]).T) - np.eye(6)
    assert np.abs(every).max() < 5 / np.sqrt(samples)


def test_slides_and_unlimited_efforts_have_their_own_scale() -> None:
    robot = without(random_chain(np.random.default_rng(2), 4), limits=Limits())
    slides = [j for j, joint in enumerate(robot.joints) if not joint.revolute]
    assert 0 < len(slides) < 4
    run = run_plant(robot, random_trajectory(robot, 0, fundamental_hz=0.5, periods=2))
    log = measure(run, "high", 0, robot)
    position = (log.position - run.position).std(axis=0)
    for j, sigma in enumerate(position):
        assert sigma == pytest.approx(1e-4 if j in slides else np.deg2rad(1e-2), rel=0.08)
    assert (log.effort - run.effort).std(axis=0) == pytest.approx(0.01 * np.abs(run.effort).max(axis=0), rel=0.08)


def test_same_seed_same_bits_and_channels_do_not_touch_each_other(experiment: tuple[Robot, PlantRun]) -> None:
    robot, run = experiment
    log, again, other = (measure(run, "standard", seed, robot) for seed in (5, 5, 6))
    assert log.position.tobytes() == again.position.tobytes()
    assert log.velocity.tobytes() == again.velocity.tobytes()
    assert log.effort.tobytes() == again.effort.tobytes()
    assert np.all(log.position != other.position)
    assert np.all(log.effort != other.effort)
    # a shorter run of fewer joints with another effort scale has the same position noise
    part = PlantRun(
        **{
            name: getattr(run, name)[:400, :2]
            for name in ("position", "velocity", "effort", "step_correction", "reference")
        },
        time=run.time[:400],
        joints=run.joints[:2],
        saturated=run.saturated[:2],
        findings=(),
        facts={},
    )
    fewer = replace(robot, joints=tuple(replace(joint, limits=Limits()) for joint in robot.joints[:2]))
    assert np.array_equal(measure(part, "standard", 5, fewer).position, log.position[:400, :2])


def test_velocity_is_that_of_a_drive(experiment: tuple[Robot, PlantRun]) -> None:
    robot, run = experiment
    clean, noisy = (measure(run, noise, 0, robot).velocity for noise in ("none", "high"))
    assert not clean[0].any()
    # a first-order low-pass at 100 Hz is 1/(2π·100 Hz) late at low frequency (by the bilinear transform, exactly
    # half a step of cot(π·100/1000)), the difference half a step
    late = 0.0005 / np.tan(np.pi * 100 / 1000) + 0.0005 - 0.00025  # the plant's own velocity: 0.25 ms late itself
    expected = np.column_stack([np.interp(run.time - late, run.time, column) for column in run.velocity.T])
    assert np.abs(clean - expected).max() < 2e-3 * np.abs(run.velocity).max()
    raw = np.deg2rad(1e-2) * np.sqrt(2) / 1e-3  # [rad/s] of a bare difference
    assert 0.1 * raw < (noisy - clean).std() < 0.4 * raw
    # causal: what comes later leaves the past as it was
    cut = replace(run, **{name: getattr(run, name)[:500] for name in ("time", "position", "velocity", "effort")})
    assert np.allclose(measure(cut, "none", 0, robot).velocity, clean[:500], rtol=0, atol=1e-9)


def test_provenance_is_in_the_metadata_and_the_truth_is_not(experiment: tuple[Robot, PlantRun]) -> None:
    robot, run = experiment
    log = measure(run, "standard", 12, robot)
    assert log.simulated
    assert log.metadata["noise"] == "standard"
    assert log.metadata["seed"] == "12"
    assert log.metadata["rate_hz"] == "1000"
    assert "MuJoCo" in log.metadata["plant"]
    assert "100 Hz" in log.metadata["velocity"]
    assert all(isinstance(value, str) for value in log.metadata.values())
    told = replace(run, findings=("joint_1: too fast",))
    assert measure(told, "none", 0, robot).findings == ("joint_1: too fast",)
    assert measure(told, "none", 0, robot).metadata["findings"] == "joint_1: too fast"


def test_unknown_noise_or_seed_is_refused(experiment: tuple[Robot, PlantRun]) -> None:
    robot, run = experiment
    with pytest.raises(InputError, match="none, standard, high"):
        measure(run, "loud", 0, robot)
    with pytest.raises(InputError, match="seed"):
        measure(run, "none", -1, robot)
