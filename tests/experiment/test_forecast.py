"""Expected standard deviations: against plain NumPy, against what fits state, and what earlier experiments add."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from chains import random_chain
from numpy.testing import assert_allclose

from identify import load_robot
from identify.estimation.fitting import fit_torque
from identify.estimation.settings import Settings
from identify.experiment.excitation import designed_excitation
from identify.experiment.forecast import Forecast, experiment_information, forecast
from identify.experiment.knowledge import Knowledge, assumed, standard_deviations
from identify.experiment.simulation import simulate
from identify.experiment.trajectory import Trajectory, random_trajectory
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot


@pytest.fixture(scope="module")
def rx90() -> Robot:
    return load_robot("rx90")


def test_information_is_that_of_all_samples_with_white_noise() -> None:
    robot = random_chain(np.random.default_rng(4), 3)
    regressor = Regressor(robot)
    trajectory = random_trajectory(robot, 1, fundamental_hz=0.5, periods=2)
    sigma, rate = np.array([0.3, 0.05, 1.1]), 500.0
    t = trajectory.rest + np.arange(0, 2 * trajectory.period, 1 / rate)
    rows = regressor.torque(*trajectory.sample(t)) / sigma[:, None]
    plain = np.einsum("kip,kir->pr", rows, rows)
    found = experiment_information(regressor, trajectory, sigma**2 / rate, "torque", 1000, 1)
    # Where a period begins, the sign of a speed that is zero but for rounding is a matter of chance.
    size = np.sqrt(np.diag(plain))
    assert_allclose(found / np.outer(size, size), plain / np.outer(size, size), atol=4e-3)


def test_work_over_windows_has_the_variance_of_the_noise_it_gathers() -> None:
    """Work measured many times with noise on the effort scatters as the windows' rows are weighted."""
    robot = random_chain(np.random.default_rng(4), 3)
    regressor = Regressor(robot)
    trajectory = random_trajectory(robot, 1, fundamental_hz=0.5, periods=3)
    sigma, rate, every = np.array([0.3, 0.05, 1.1]), 500.0, 50
    t = trajectory.rest + np.arange(0, trajectory.period + 0.5 / rate, 1 / rate)
    q, dq, _ = trajectory.sample(t)
    noise = sigma * np.random.default_rng(0).standard_normal((4000, len(t), 3))
    power = np.sum(noise * dq, axis=2)
    ends = np.arange(0, len(t), every)
    work = np.array([np.trapezoid(power[:, a : b + 1], dx=1 / rate) for a, b in pairwise(ends)])
    stored = np.diff(regressor.energy(q, dq)[ends], axis=0)
    taken = regressor.power(dq)
    rows = stored + [np.trapezoid(taken[a : b + 1], dx=1 / rate, axis=0) for a, b in pairwise(ends)]
    weighted = rows / work.std(axis=1)[:, None]
    plain = 3 * weighted.T @ weighted
    found = experiment_information(regressor, trajectory, sigma**2 / rate, "energy", 1000, every)
    assert_allclose(np.diag(found), np.diag(plain), rtol=0.05)


def test_standard_deviations_are_infinite_where_parameters_cannot_be_told_apart() -> None:
    rng = np.random.default_rng(1)
    rows = rng.standard_normal((50, 4)) * [1.0, 1e3, 1e-3, 1.0]
    inverse = np.linalg.inv(rows.T @ rows)
    assert_allclose(standard_deviations(rows.T @ rows), np.sqrt(np.diag(inverse)), rtol=1e-6)
    rows = np.column_stack([rows, rows[:, 0] - 2 * rows[:, 3], np.zeros(50)])
    found = standard_deviations(rows.T @ rows)
    assert np.isinf(found[[0, 3, 4, 5]]).all()
    assert np.isfinite(found[[1, 2]]).all()


def test_a_fit_states_what_was_expected_of_it(rx90: Robot) -> None:
    """White effort noise alone makes the forecast; a fit's deviations also count that of positions."""
    regressor, motion = Regressor(rx90), random_trajectory(rx90, 5, periods=2)
    expected = forecast(regressor, motion, assumed(rx90), "torque", 2000, 1)
    log, _ = simulate(rx90, motion, "standard", 0)
    stated = fit_torque(regressor, [log], Settings()).estimate
    assert stated.names == expected.names
    ratio = stated.std / expected.std
    assert np.mean((ratio > 0.5) & (ratio < 2.0)) > 0.95
    assert 0.8 < np.median(ratio) < 1.5


def told(robot: Robot, trajectory: Trajectory) -> Knowledge:
    known = assumed(robot)
    information = experiment_information(Regressor(robot), trajectory, known.density, "torque", 500, 1)
    return replace(known, information=information)


def test_the_next_motion_helps_the_worst_parameters_more_than_a_fresh_one(rx90: Robot) -> None:
    """After a random motion in which the fifth axis barely moves."""
    robot, motion = rx90, random_trajectory(rx90, 3)
    scale = np.array([1.0, 1.0, 1.0, 1.0, 0.03, 1.0])[:, None]
    known = told(robot, replace(motion, a=scale * motion.a, b=scale * motion.b))
    ours = designed_excitation(robot, known=known, periods=1, starts=1).forecast
    fresh = designed_excitation(robot, periods=1, starts=1).trajectory
    with_fresh = forecast(Regressor(robot), fresh, known, "torque", 500, 1)
    assert ours.before is not None
    assert_allclose(ours.before, standard_deviations(known.information))
    assert (ours.std < ours.before * (1 + 1e-9)).all()
    size, worst = ours.sizes, ours.order[0]
    assert ours.before[worst] / size[worst] == (ours.before / size).max()
    assert (ours.std / size).max() < 0.8 * (with_fresh.std / size).max() < 0.2 * (ours.before / size).max()
    assert np.log(ours.std).mean() < np.log(with_fresh.std).mean()


def test_informations_of_experiments_add_up(rx90: Robot) -> None:
    regressor, known = Regressor(rx90), assumed(rx90)
    motion = random_trajectory(rx90, 0)
    once = forecast(regressor, motion, known, "torque", 500, 1)
    twice = forecast(regressor, motion, told(rx90, motion), "torque", 500, 1)
    assert_allclose(twice.std, once.std / np.sqrt(2), rtol=1e-6)
    assert_allclose(twice.before, once.std, rtol=1e-6)
    longer = forecast(regressor, replace(motion, periods=12), known, "torque", 500, 1)
    assert_allclose(longer.std, once.std / 2, rtol=1e-9)


def test_the_table_shows_the_worst_ten_and_counts_the_rest(rx90: Robot) -> None:
    found = forecast(Regressor(rx90), random_trajectory(rx90, 0), assumed(rx90), "torque", 500, 1)
    lines = found.table().splitlines()
    assert lines[0] == "expected of a fit of the torque model, noise 0.1 % of the effort limits, white at 1000 Hz:"
    assert len(lines) == 13
    percent = found.relative_percent
    worst = int(np.nanargmax(percent))
    assert lines[2].split()[0] == found.names[worst]
    assert lines[12].startswith("  and 48 more at ")
    # offsets are zero here: they count in shares of Coulomb friction
    at = found.names.index("off2")
    assert percent[at] == pytest.approx(100 * found.std[at] / 13.4)
    rows = found.as_dict()["parameters"]
    assert [row["name"] for row in rows] == list(found.names)
    assert rows[worst]["relative_std_percent"] == pytest.approx(percent[worst])
    assert rows[worst]["std_before"] is None


def test_robots_of_unknown_inertia_get_deviations_without_percentages() -> None:
    robot = load_robot("tx40")
    found = forecast(Regressor(robot), random_trajectory(robot, 0, harmonics=7), assumed(robot), "torque", 500, 1)
    assert isinstance(found, Forecast)
    assert np.isnan(found.relative_percent).all()
    assert np.isfinite(found.std).all()
    assert "not known" in found.table()
    assert found.order[0] == int(np.argmax(found.blur))
    assert found.as_dict()["parameters"][0]["value"] is None
