"""Observation matrices and the criterion, against the run-time regressor, plain NumPy and finite differences."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from chains import random_chain
from numpy.testing import assert_allclose

from identify.experiment.entries import Motion
from identify.experiment.fourier import one_period
from identify.experiment.information import (
    EnergyModel,
    TorqueModel,
    log_variance,
    reference_factor,
    scaled_condition,
)
from identify.experiment.knowledge import assumed, noise_scale
from identify.experiment.trajectory import random_trajectory
from identify.regressor.regressor import Regressor
from identify.robot.robot import Limits, Robot, Transmission

SAMPLES, EVERY = 120, 3
NOISE = np.array([100.0, 60.0, 100.0])


def coupled_robot(effort: float = 60.0) -> Robot:
    """Three joints, one sliding, the last motor coupled to the axes before it: every kind of column at once."""
    robot = random_chain(np.random.default_rng(11), 3)
    joints = [
        replace(joint, type=kind)
        for joint, kind in zip(robot.joints, ("revolute", "prismatic", "revolute"), strict=True)
    ]
    joints[1] = replace(joints[1], limits=replace(joints[1].limits, effort=effort))
    matrix = ((30.0, 0.0, 0.0), (0.0, 200.0, 0.0), (12.0, -40.0, 25.0))
    return replace(robot, joints=tuple(joints), transmission=Transmission(matrix))


def motion_of(robot: Robot, samples: int = SAMPLES) -> tuple[Motion, float]:
    trajectory = random_trajectory(robot, 4, fundamental_hz=0.2)
    return one_period(trajectory, samples), trajectory.period / samples


def test_columns_are_those_of_the_run_time_regressor_but_for_the_sign() -> None:
    robot = coupled_robot()
    regressor = Regressor(robot)
    assert {"Iam3", "Fvm3", "Fsm3", "off1"} <= set(regressor.names)
    (q, dq, ddq), step = motion_of(robot)
    width = np.array([0.3, 0.05, 0.4])
    torque = TorqueModel(regressor, SAMPLES, width, NOISE).columns((q, dq, ddq))
    energy = EnergyModel(regressor, SAMPLES, EVERY, step, width, np.ones(3), NOISE).unweighted((q, dq, ddq))[0]
    ratios = np.array([12.0, -40.0, 25.0]) / 25.0

    def smooth(speed: np.ndarray) -> np.ndarray:
        # the speeds of joints, then of motors: each by its own width
        if speed.ndim == 2:
            return np.column_stack([smooth(column) for column in speed.T])
        for values, scale in (*zip(dq, width, strict=True), (ratios @ dq, np.abs(ratios) @ width)):
            if np.array_equal(values, speed) or np.allclose(values, speed, rtol=1e-12):
                return np.tanh(speed / scale)
        raise AssertionError("a speed that is no joint's and no motor's")

    expected = regressor.torque(q.T, dq.T, ddq.T, sign=smooth)
    assert_allclose(torque, expected.transpose(2, 1, 0), rtol=1e-10, atol=1e-10)
    stored, power = regressor.energy(q.T, dq.T), regressor.power(dq.T, sign=smooth)
    # a period is closed: after the last sample comes the first
    stored, power = np.vstack([stored, stored[:1]]), np.vstack([power, power[:1]])
    edges = np.arange(0, SAMPLES + 1, EVERY)
    rows = [stored[b] - stored[a] + np.trapezoid(power[a : b + 1], dx=step, axis=0) for a, b in pairwise(edges)]
    assert_allclose(energy, np.array(rows).T, rtol=1e-9, atol=1e-9)


def test_energy_rows_are_weighted_by_the_noise_that_the_work_takes_from_the_effort() -> None:
    robot = coupled_robot(effort=60.0)
    regressor = Regressor(robot)
    motion, step = motion_of(robot)
    fastest = np.array([3.0, 2.0, 4.0])
    model = EnergyModel(regressor, SAMPLES, EVERY, step, np.full(3, 0.1), fastest, NOISE)
    columns, variance = model.unweighted(motion)
    assert_allclose(model.columns(motion) * np.sqrt(variance), columns, rtol=1e-12)
    closed = np.concatenate([motion[1], motion[1][:, :1]], axis=1)
    heat = [NOISE**2 @ np.trapezoid(closed[:, a : a + EVERY + 1] ** 2, dx=step) for a in range(0, SAMPLES, EVERY)]
    assert_allclose(variance, 0.01 + np.array(heat) / (NOISE**2 @ fastest**2 * EVERY * step), rtol=1e-12)


def test_effort_noise_follows_the_effort_limits_where_there_are_any() -> None:
    assert_allclose(noise_scale(coupled_robot(effort=60.0)), [100.0, 60.0, 100.0])
    assert_allclose(noise_scale(coupled_robot(effort=float("inf"))), [100.0, 1.0, 100.0])
    # a thousandth of the limit at 1 kHz: what is left of it averaged over a second
    assert_allclose(np.sqrt(assumed(coupled_robot()).density), np.array([0.1, 0.06, 0.1]) / np.sqrt(1000))


@pytest.mark.parametrize("model", ["torque", "energy"])
def test_what_is_pulled_back_is_the_derivative(model: str) -> None:
    robot = coupled_robot()
    motion, step = motion_of(robot)
    regressor, width = Regressor(robot), np.array([0.3, 0.1, 0.4])
    made: TorqueModel | EnergyModel = (
        TorqueModel(regressor, SAMPLES, width, NOISE)
        if model == "torque"
        else EnergyModel(regressor, SAMPLES, EVERY, step, width, np.array([3.0, 2.0, 4.0]), NOISE)
    )
    rng = np.random.default_rng(0)
    adjoint = rng.standard_normal(made.columns(motion).shape)
    pulled = made.pull_back(motion, adjoint)
    for at in range(3):
        along = rng.standard_normal(motion[at].shape)

        def moved(by: float, at: int = at, along: np.ndarray = along) -> float:
            signals = list(motion)
            signals[at] = signals[at] + by * along
            return float(np.sum(adjoint * made.columns((signals[0], signals[1], signals[2]))))

        numeric = central(moved, 1e-4)
        assert np.sum(pulled[at] * along) == pytest.approx(numeric, rel=1e-8, abs=1e-8)


def test_criterion_is_log_determinant_plus_log_predicted_variance_with_its_derivative() -> None:
    rng = np.random.default_rng(1)
    rows, other = rng.standard_normal((40, 7)), rng.standard_normal((7, 90)) * np.arange(1.0, 8.0)[:, None]
    reference = reference_factor(other)
    assert_allclose(reference.T @ reference, other @ other.T / 90, rtol=1e-12, atol=1e-12)
    value, turn = log_variance(rows, reference)
    information = rows.T @ rows
    predicted = np.mean([r @ np.linalg.solve(information, r) for r in other.T])
    assert value == pytest.approx(-np.linalg.slogdet(information)[1] / 7 + np.log(predicted / 7), rel=1e-9)
    along = rng.standard_normal(rows.shape)
    numeric = central(lambda by: log_variance(rows + by * along, reference)[0], 1e-4)
    assert np.sum(rows @ turn * along) == pytest.approx(numeric, rel=1e-8)


def test_what_is_known_counts_as_so_many_more_rows() -> None:
    rng = np.random.default_rng(5)
    rows, earlier, reference = rng.standard_normal((30, 6)), rng.standard_normal((12, 6)), np.eye(6)
    value, turn = log_variance(rows, reference, earlier)
    together, its = log_variance(np.concatenate([rows, earlier]), reference)
    assert value == pytest.approx(together, rel=1e-12)
    assert_allclose(turn, its, rtol=1e-9, atol=1e-12)


def test_joints_triangles_have_the_products_of_all_weighted_rows() -> None:
    robot = coupled_robot()
    regressor = Regressor(robot)
    motion, _ = motion_of(robot)
    model = TorqueModel(regressor, SAMPLES, np.full(3, 0.2), NOISE)
    columns = model.columns(motion)
    rows = (columns / NOISE[:, None]).reshape(regressor.p, -1)
    factors = np.concatenate(list(model.factors(columns)))
    assert len(factors) <= 3 * regressor.p < rows.shape[1]
    assert_allclose(factors.T @ factors, rows @ rows.T, rtol=1e-9, atol=1e-9 * np.abs(rows @ rows.T).max())


def test_units_of_the_parameters_only_shift_the_criterion() -> None:
    rng = np.random.default_rng(2)
    reference = reference_factor(rng.standard_normal((5, 30)))
    units = np.array([1.0, 7.0, 0.3, 20.0, 0.05])
    first, second = rng.standard_normal((2, 25, 5))
    shifts = [
        log_variance(rows * units, reference * units)[0] - log_variance(rows, reference)[0] for rows in (first, second)
    ]
    assert shifts[0] == pytest.approx(shifts[1], abs=1e-9)
    assert shifts[0] == pytest.approx(-2 * np.log(units).mean(), abs=1e-9)


def test_a_column_that_nothing_excites_costs_a_constant_and_no_derivative() -> None:
    rng = np.random.default_rng(3)
    rows = rng.standard_normal((40, 6))
    rows[:, 4] = rows[:, 1] - 2 * rows[:, 2]
    reference = rng.standard_normal((6, 6))
    reference[:, 4] = reference[:, 1] - 2 * reference[:, 2]
    value, turn = log_variance(rows, reference)
    assert np.isfinite(value)
    # the whole matrix stretched: the five directions that are told lose 2·log of variance each, the sixth nothing
    stretched, _ = log_variance(1.1 * rows, reference)
    assert stretched - value == pytest.approx(-(5 / 6 + 1) * 2 * np.log(1.1), abs=1e-6)
    assert np.isfinite(rows @ turn).all()


def test_condition_number_is_of_scaled_columns_and_names_those_that_cannot_be_told_apart() -> None:
    rng = np.random.default_rng(4)
    rows = rng.standard_normal((50, 4)) * [1.0, 1e4, 1e-3, 1.0]
    condition, lost = scaled_condition(rows.T)
    size = np.linalg.svd(rows / np.linalg.norm(rows, axis=0), compute_uv=False)
    assert condition == pytest.approx(size[0] / size[-1], rel=1e-9)
    assert not lost.any()
    rows = np.column_stack([rows, rows[:, 0] + rows[:, 3], np.zeros(50)])
    condition, lost = scaled_condition(rows.T)
    assert condition == float("inf")
    assert lost.tolist() == [True, False, False, True, True, True]
    assert scaled_condition(rows[:3, :4].T)[0] == float("inf")


def test_limits_of_the_example_are_what_the_tests_above_rely_on() -> None:
    assert [joint.limits for joint in coupled_robot().joints][1] == Limits((-2.0, 2.0), 3.0, 10.0, 60.0)


def central(function, step: float) -> float:  # type: ignore[no-untyped-def]
    """Derivative at 0 by central differences, extrapolated once: of fourth order."""
    single, double = ((function(h) - function(-h)) / (2 * h) for h in (step, 2 * step))
    return (4 * single - double) / 3
