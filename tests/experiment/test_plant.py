"""The plant's log means what it says: effort, state and step are aligned to rounding, friction included."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chains import random_chain, without
from oracle import inertia_matrix, inverse_dynamics

from identify import load_robot
from identify.errors import InputError, RobotError
from identify.experiment.plant import TIMESTEP, PlantRun, inertia_matrices, reference_effort, run_plant
from identify.experiment.trajectory import random_trajectory
from identify.robot.robot import Drive, Limits, Robot

WIDE = Limits((-2.0, 2.0), 3.0, 10.0, float("inf"))


def short_run(robot: Robot, seed: int = 0, every: int = 1) -> PlantRun:
    return run_plant(robot, random_trajectory(robot, seed, fundamental_hz=0.5, periods=1, rest=0.1), every=every)


def step_acceleration(run: PlantRun) -> np.ndarray:
    """(N − 1, n) acceleration held over each step."""
    return np.diff(run.velocity, axis=0) / TIMESTEP


@pytest.mark.parametrize(("seed", "tree"), [(0, False), (1, True), (8, True)])
def test_effort_is_the_inverse_dynamics_of_the_step_that_follows(seed: int, tree: bool) -> None:
    robot = random_chain(np.random.default_rng(seed), 5, tree=tree)
    robot = without(robot, limits=WIDE, drive=Drive(inertia=0.7))
    run = short_run(robot)
    rigid = inverse_dynamics(robot, run.position[:-1], run.velocity[:-1], step_acceleration(run))
    scale = np.abs(rigid).max()
    force = run.effort + run.step_correction
    assert np.abs(force[:-1] - rigid).max() < 1e-9 * scale
    # one step late or early is far outside that: the law can tell
    assert np.abs(force[1:] - rigid).max() > 1e-5 * scale


@pytest.mark.parametrize("tree", [False, True])
def test_effort_alone_is_the_inverse_dynamics_at_the_slope_of_the_positions(tree: bool) -> None:
    """MuJoCo takes Coriolis effort half a step old; the step correction leaves next to nothing of that in the log."""
    robot = random_chain(np.random.default_rng(7), 5, tree=tree)
    robot = without(robot, limits=WIDE, drive=Drive(inertia=0.7))
    run = short_run(robot)
    q = run.position
    slope = (q[2:] - q[:-2]) / (2 * TIMESTEP)
    rigid = inverse_dynamics(robot, q[1:-1], slope, (q[2:] - 2 * q[1:-1] + q[:-2]) / TIMESTEP**2)
    left = np.abs(run.effort[1:-1] - rigid).max()
    uncorrected = np.abs(run.effort[1:-1] + run.step_correction[1:-1] - rigid).max()
    assert left < 0.02 * uncorrected


@pytest.mark.parametrize("tree", [False, True])
def test_friction_is_the_description_at_the_slope_of_the_positions(tree: bool) -> None:
    robot = replace(random_chain(np.random.default_rng(2), 4, tree=tree))
    robot = without(robot, limits=WIDE)
    run = short_run(robot)
    drives = [joint.drive for joint in robot.joints]
    viscous, coulomb, offset = (
        np.array([getattr(drive, name) for drive in drives]) for name in ("viscous", "coulomb", "offset")
    )
    q = run.position
    slope = (q[2:] - q[:-2]) / (2 * TIMESTEP)  # central differences: all that a log's reader has
    curvature = (q[2:] - 2 * q[1:-1] + q[:-2]) / TIMESTEP**2
    rigid = inverse_dynamics(robot, q[1:-1], run.velocity[1:-1], curvature)
    expected = rigid - run.step_correction[1:-1] + viscous * slope + coulomb * np.sign(slope) + offset
    sliding = (np.abs(run.velocity[1:-1]) > 0.02) & (np.abs(run.velocity[2:]) > 0.02)
    gap = np.where(sliding, run.effort[1:-1] - expected, 0.0)
    assert sliding.mean() > 0.5
    # positions differenced twice at 0.5 ms lose nine digits
    assert np.abs(gap).max() < 1e-6 * np.abs(run.effort).max()


def test_a_joint_at_rest_sticks_under_its_friction() -> None:
    robot = random_chain(np.random.default_rng(3), 3)
    robot = without(robot, limits=WIDE, drive=Drive(0.5, 1.0, 2.0, 0.3))
    run = short_run(robot)
    still = run.time < 0.09
    assert np.ptp(run.position[still], axis=0).max() < 1e-9
    rigid = inverse_dynamics(robot, run.position[still], 0 * run.velocity[still], 0 * run.velocity[still])
    assert np.all(np.abs(run.effort[still] - rigid - 0.3) <= 2.0)


def test_logged_rows_are_every_second_step() -> None:
    robot = without(random_chain(np.random.default_rng(4), 3), limits=WIDE)
    steps, rows = short_run(robot, every=1), short_run(robot, every=2)
    for name in ("time", "position", "velocity", "effort", "reference"):
        assert np.array_equal(getattr(steps, name)[::2], getattr(rows, name))
    assert np.allclose(np.diff(rows.time), 1e-3, rtol=0, atol=1e-12)
    assert rows.time[0] == 0.0
    assert rows.time[-1] == pytest.approx(2.2)
    assert rows.time[17] == 0.017  # stamps are the nearest floats, not sums of steps


def test_feed_forward_is_the_description_along_the_reference() -> None:
    rng = np.random.default_rng(5)
    robot = random_chain(rng, 6, tree=True)
    q, dq, ddq = rng.uniform(-2, 2, (3, 40, 6))
    drives = [joint.drive for joint in robot.joints]
    expected = inverse_dynamics(robot, q, dq, ddq)
    for j, drive in enumerate(drives):
        expected[:, j] += drive.viscous * dq[:, j] + drive.coulomb * np.tanh(dq[:, j] / 0.01) + drive.offset
    assert np.allclose(reference_effort(robot, q, dq, ddq), expected, rtol=1e-10, atol=1e-10)
    for matrix, row in zip(inertia_matrices(robot, q[:5]), q, strict=False):
        assert np.allclose(matrix, inertia_matrix(robot, row), rtol=1e-10, atol=1e-12)


def test_rx90_follows_thirty_seconds_closely_and_within_its_limits() -> None:
    robot = load_robot("rx90")
    run = run_plant(robot, random_trajectory(robot, 0))
    assert len(run.time) == 31_001
    assert run.findings == ()
    assert not run.saturated.any()
    assert np.abs(run.position - run.reference).max() < 2e-3
    assert np.ptp(run.position, axis=0).min() > 2.0


def test_broken_limits_become_findings_and_nothing_is_clipped() -> None:
    robot = without(random_chain(np.random.default_rng(7), 2), limits=WIDE)
    motion = random_trajectory(robot, 0, fundamental_hz=0.5, periods=1)
    free = run_plant(robot, motion)
    peak, speed = np.abs(free.effort).max(axis=0), np.abs(free.velocity).max(axis=0)
    weak = replace(
        robot,
        joints=(
            replace(robot.joints[0], limits=Limits(effort=0.5 * peak[0])),
            replace(robot.joints[1], limits=Limits(velocity=0.5 * speed[1])),
        ),
    )
    run = run_plant(weak, motion)
    assert np.array_equal(run.effort, free.effort)
    assert run.saturated[0] > 0
    assert run.saturated[1] == 0
    effort, velocity = run.findings
    assert effort.startswith("joint_1: effort beyond its limit")
    assert str(run.saturated[0]) in effort
    assert velocity.startswith("joint_2: faster than its limit")
    low, high = free.position[:, 0].min(), free.position[:, 0].max()
    narrow = replace(robot.joints[0], limits=Limits((low + 0.2 * (high - low), high + 1)))
    stopped = run_plant(replace(robot, joints=(narrow, robot.joints[1])), motion)
    assert any("joint_1: pressed against its stop" in finding for finding in stopped.findings)


def test_a_loop_too_fast_for_the_step_is_slowed_until_it_is_stable() -> None:
    # light drives on coupled axes: M⁻¹·diag(M) is large, so these gains would diverge
    robot = without(random_chain(np.random.default_rng(9), 6), limits=WIDE, drive=Drive(inertia=1e-4))
    motion = random_trajectory(robot, 0, fundamental_hz=0.5, periods=1)
    run = run_plant(robot, motion, bandwidth_hz=500.0)
    assert np.abs(run.position - run.reference).max() < 1e-2
    assert "500" not in run.facts["controller"]


def test_a_diverging_loop_is_refused_without_leaving_a_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    robot = without(random_chain(np.random.default_rng(9), 6), limits=WIDE, drive=Drive(inertia=1e-4))
    motion = random_trajectory(robot, 0, fundamental_hz=0.5, periods=1)
    monkeypatch.setattr("identify.experiment.plant.STEP_DAMPING", 10.0)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="unstable"):
        run_plant(robot, motion, bandwidth_hz=500.0)
    assert list(tmp_path.iterdir()) == []


def test_unusable_inputs_are_refused() -> None:
    arm, other = random_chain(np.random.default_rng(0), 3), random_chain(np.random.default_rng(0), 2)
    with pytest.raises(InputError, match="design one for this robot"):
        run_plant(arm, random_trajectory(other, 0))
    bare = load_robot("tx40")
    with pytest.raises(RobotError, match="mass 0 kg"):
        run_plant(bare, random_trajectory(bare, 0))
