"""Estimators that close the loop anew: on logs of a small arm in MuJoCo, whose controller knows or does not know it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from chains import random_chain, without
from exact_logs import exact_log, unknown

from identify.errors import UnsupportedLogError
from identify.estimation.estimators.problem import Problem
from identify.estimation.estimators.registry import ESTIMATORS
from identify.estimation.fitting import fitted
from identify.estimation.least_squares import Estimate
from identify.estimation.settings import Settings
from identify.experiment.plant import PlantRun, run_plant
from identify.experiment.sensors import measure
from identify.experiment.trajectory import random_trajectory
from identify.logs.log import Log
from identify.logs.slicing import window
from identify.regressor.regressor import Regressor
from identify.robot.payload import carrying
from identify.robot.robot import Limits, Link
from identify.validation.estimators import compared

NAMES = ("idim-iv", "didim")
ARM = without(random_chain(np.random.default_rng(6), 2), limits=Limits((-2.5, 2.5), 4.0, 15.0, 150.0))
REGRESSOR = Regressor(ARM)
LOAD = Link(2.0, (0.1, -0.05, 0.2), (0.02, 0.001, 0.0, 0.03, 0.002, 0.025))


@lru_cache(maxsize=2)
def run(loaded: bool = False) -> PlantRun:
    motion = random_trajectory(ARM, 3, fundamental_hz=0.25, periods=2)
    return run_plant(ARM, motion, load=LOAD if loaded else None)


def estimated(name: str, *logs: Log, regressor: Regressor = REGRESSOR, settings: Settings | None = None) -> Estimate:
    return fitted(
        Problem(regressor, logs, settings or Settings(), regressor, None, "not asked for"), ESTIMATORS[name]
    ).estimate


def distances(estimates: Sequence[Estimate]) -> np.ndarray:
    """(logs, p) errors in standard deviations."""
    return np.array([(found.parameters - REGRESSOR.parameters) / found.std for found in estimates])


@pytest.mark.parametrize("name", NAMES)
def test_each_finds_the_parameters_of_exact_logs_in_parts_too(name: str) -> None:
    log = measure(run(), "none", 0, ARM)
    whole = estimated(name, log).parameters
    parts = estimated(name, window(log, None, 5.0), window(log, 4.0)).parameters
    for found in (whole, parts):
        np.testing.assert_allclose(found, REGRESSOR.parameters, rtol=0, atol=1e-3 * np.abs(REGRESSOR.parameters).max())


@pytest.mark.parametrize("name", NAMES)
def test_errors_under_noise_are_of_the_size_that_is_stated(name: str) -> None:
    z = distances([estimated(name, measure(run(), "high", seed, ARM)) for seed in range(4)])
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.5


@pytest.mark.parametrize("name", NAMES)
def test_a_load_that_the_controller_knows_nothing_of_is_found(name: str) -> None:
    """So it is not the feed-forward that the estimate comes from."""
    found = estimated(name, measure(run(loaded=True), "none", 0, ARM)).parameters
    truth = Regressor(carrying(ARM, LOAD)).parameters
    assert np.abs(truth - REGRESSOR.parameters).max() > 0.1
    np.testing.assert_allclose(found, truth, rtol=0, atol=1e-3 * np.abs(truth).max())


@pytest.mark.parametrize("name", NAMES)
def test_inertias_and_friction_of_the_description_are_never_read(name: str) -> None:
    log = measure(run(), "standard", 0, ARM)
    other = without(random_chain(np.random.default_rng(6), 2), limits=ARM.joints[0].limits)
    heavy = replace(other, joints=tuple(replace(joint, link=replace(joint.link, mass=7.0)) for joint in other.joints))
    expected = estimated(name, log)
    for robot in (unknown(ARM), heavy):
        found = estimated(name, log, regressor=Regressor(robot))
        np.testing.assert_array_equal(found.parameters, expected.parameters)
        np.testing.assert_array_equal(found.covariance, expected.covariance)


def test_instruments_take_away_the_bias_of_noisy_positions() -> None:
    """Accelerations that are noise for a good part: least squares takes the arm for lighter than it is, IV does not."""
    settings = Settings(position_cutoff_hz=50.0, effort_cutoff_hz=40.0, decimated_rate_hz=100.0)
    log = measure(run(), "none", 0, ARM)
    errors: dict[str, list[np.ndarray]] = {"wls": [], "idim-iv": []}
    for seed in range(3):
        shake = 2e-4 * np.random.default_rng(seed).standard_normal(log.position.shape)
        noisy = replace(log, position=log.position + shake)
        for name, found in errors.items():
            found.append(estimated(name, noisy, settings=settings).parameters - REGRESSOR.parameters)
    bias = {name: np.linalg.norm(np.mean(found, axis=0)) for name, found in errors.items()}
    assert bias["wls"] > 1.0
    assert bias["idim-iv"] < bias["wls"] / 10


def test_positions_hardly_count_where_simulated_ones_stand_in() -> None:
    log = measure(run(), "standard", 0, ARM)
    shake = 2e-4 * np.random.default_rng(0).standard_normal(log.position.shape)
    clean, noisy = (estimated("didim", x) for x in (log, replace(log, position=log.position + shake)))
    assert np.abs((clean.parameters - noisy.parameters) / clean.std).max() < 0.1


def test_logs_without_a_controller_are_refused_in_one_line() -> None:
    problem = Problem(REGRESSOR, [exact_log(ARM)], Settings(), REGRESSOR, None, "not asked for")
    rows = {row["estimator"]: row for row in compared(problem, [])}
    for name in NAMES:
        assert rows[name]["train"] is None
        assert "does not tell its controller" in rows[name]["reason"]
        assert "\n" not in rows[name]["reason"]
    assert rows["wls"]["train"] is not None


def test_logs_too_long_to_simulate_are_refused() -> None:
    log = measure(run(), "none", 0, ARM)
    with pytest.raises(UnsupportedLogError, match="more than 600 s"):
        estimated("didim", *[log] * 70)


def test_a_robot_of_other_joints_can_not_close_the_loop() -> None:
    three = random_chain(np.random.default_rng(5), 3)
    with pytest.raises(UnsupportedLogError, match="can't be used"):
        _ = estimated("didim", replace(exact_log(three), **_told()), regressor=Regressor(three))


def _told() -> dict[str, object]:
    log = measure(run(), "none", 0, ARM)
    return {"metadata": log.metadata, "attachments": log.attachments}
