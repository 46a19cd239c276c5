"""A simulated arm that carries a load: the plant has it, the controller and the log know nothing of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from chains import random_chain, random_link, without
from oracle import inverse_dynamics

from identify.experiment.plant import TIMESTEP, run_plant
from identify.experiment.simulation import record_experiment, simulate, truth_path
from identify.experiment.trajectory import Trajectory, random_trajectory
from identify.logs.mcap_reader import read_mcap
from identify.robot.payload import carrying
from identify.robot.robot import Drive, Limits, Link, Robot


def example() -> tuple[Robot, Trajectory, Link]:
    rng = np.random.default_rng(6)
    robot = without(random_chain(rng, 4), limits=Limits((-2.0, 2.0), 3.0, 10.0, 400.0), drive=Drive(inertia=0.7))
    return robot, random_trajectory(robot, 1, fundamental_hz=0.5, periods=1, rest=0.1), random_link(rng)


def test_the_plants_effort_is_that_of_the_loaded_arm() -> None:
    robot, motion, load = example()
    run = run_plant(robot, motion, every=1, load=load)
    acceleration = np.diff(run.velocity, axis=0) / TIMESTEP
    force = (run.effort + run.step_correction)[:-1]
    rigid = inverse_dynamics(carrying(robot, load), run.position[:-1], run.velocity[:-1], acceleration)
    assert np.abs(force - rigid).max() < 1e-9 * np.abs(rigid).max()
    bare = inverse_dynamics(robot, run.position[:-1], run.velocity[:-1], acceleration)
    assert np.abs(force - bare).max() > 0.01 * np.abs(rigid).max()


def test_the_controller_does_not_know_the_load() -> None:
    """It strays further from its reference than an arm without a load, and than one whose description has the load."""
    robot, motion, load = example()

    def strays(arm: Robot, carried: Link | None) -> float:
        run = run_plant(arm, motion, load=carried)
        return float(np.abs(run.position - run.reference).max())

    unknown = strays(robot, load)
    assert unknown > 3 * strays(robot, None)
    assert unknown > 3 * strays(carrying(robot, load), None)


def test_the_truth_has_the_load_and_the_log_has_not(tmp_path: Path) -> None:
    robot, motion, load = example()
    path = tmp_path / "loaded.mcap"
    record_experiment(robot, motion, path, "standard", 3, load=load)
    truth = json.loads(truth_path(path).read_text(encoding="utf-8"))
    assert truth["payload"] == [float(value) for value in load.standard]
    assert truth["standard"] == [float(value) for value in carrying(robot, load).standard]
    content = read_mcap(path)
    texts = [data.decode() for name, data in content.attachments.items() if name.endswith(".toml")]
    told = " ".join([*content.log.metadata.values(), *texts])
    assert all(f"{value:.4g}" not in told for value in (load.mass, *load.com, *load.inertia))
    log, _ = simulate(robot, motion, "standard", 3, load=load)
    np.testing.assert_array_equal(content.log.effort, log.effort)


def test_without_a_load_nothing_changes() -> None:
    robot, motion, _ = example()
    log, truth = simulate(robot, motion, "standard", 2)
    assert truth["payload"] is None
    assert truth["standard"] == [float(value) for value in robot.standard]
    weightless, _ = simulate(robot, motion, "standard", 2, load=Link())
    np.testing.assert_array_equal(weightless.effort, log.effort)


def test_limits_that_a_load_breaks_are_told() -> None:
    robot, motion, load = example()
    robot = without(
        robot, limits=Limits((-2.0, 2.0), 3.0, 10.0, 1.1 * float(np.abs(run_plant(robot, motion).effort).max()))
    )
    assert not run_plant(robot, motion).saturated.any()
    loaded = run_plant(robot, motion, load=replace(load, mass=10 * load.mass))
    assert loaded.saturated.any()
    assert any("a real drive would saturate" in text for text in loaded.findings)
