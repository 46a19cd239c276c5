"""The energy model's rows: work is what energy and friction account for, window by window, none of it twice."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from exact_logs import arm, effort, exact_log, friction, motion
from scipy.integrate import simpson

from identify.errors import UnsupportedLogError
from identify.estimation.energy import (
    EnergyObservation,
    energy_least_squares,
    energy_observation,
    energy_residual_percent,
    stacked_energy,
)
from identify.estimation.observation import END_S
from identify.estimation.settings import Settings
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot

RATE = 400.0
WINDOW = 0.2
SETTINGS = Settings(energy_cutoff_hz=40.0, window_s=WINDOW)
ARMS = (arm(1), arm(2))
"""Three revolute joints; prismatic, revolute, prismatic, whose first offset can't be told from gravity."""


def exact_work(robot: Robot, edges: np.ndarray, fine: int = 400) -> np.ndarray:
    """(windows, 2) ∫ q̇ᵀΓ dt between edges, whole and friction's part, by Simpson's rule on the analytic motion."""
    work = []
    for start, stop in pairwise(edges):
        t = np.linspace(start, stop, fine + 1)
        q, dq, ddq = motion(robot).sample(t)
        work.append(
            [
                simpson((dq * effort(robot, q, dq, ddq)).sum(axis=1), x=t),
                simpson((dq * friction(robot, dq)).sum(axis=1), x=t),
            ]
        )
    return np.array(work)


@pytest.mark.parametrize("robot", ARMS)
def test_energy_and_friction_account_for_the_work(robot: Robot) -> None:
    """Against torques by Pinocchio and the integral of their power, over 0.1 + 0.2 k … 0.1 + 0.2 (k + 1) seconds."""
    regressor = Regressor(robot)
    rows = energy_observation(regressor, exact_log(robot, rate=RATE), SETTINGS)
    edges = END_S + WINDOW * np.arange(len(rows.work) + 1)
    assert motion(robot).duration - END_S - WINDOW < edges[-1] <= motion(robot).duration - END_S
    expected, lost = exact_work(robot, edges).T
    size = np.abs(expected).max()
    np.testing.assert_allclose(rows.work, expected, rtol=0, atol=2e-4 * size)
    np.testing.assert_allclose(rows.matrix @ regressor.parameters, expected, rtol=0, atol=2e-4 * size)
    if not regressor.dropped:  # otherwise an inertia holds a part of the offset
        taken = np.array([name[:2] in ("Fv", "Fs", "of") for name in regressor.names])
        friction_rows = rows.matrix[:, taken] @ regressor.parameters[taken]
        np.testing.assert_allclose(friction_rows, lost, rtol=0, atol=2e-4 * np.abs(lost).max())
    assert np.abs(expected - lost).max() > 0.2 * size  # energy has its share in the balance
    assert energy_residual_percent(rows, regressor.parameters) < 0.02
    assert rows.rate == pytest.approx(1 / WINDOW)


def test_action_is_the_integral_of_squared_speed() -> None:
    robot = ARMS[0]
    rows = energy_observation(Regressor(robot), exact_log(robot, rate=RATE), SETTINGS)
    first = np.linspace(END_S + 4 * WINDOW, END_S + 5 * WINDOW, 401)
    dq = motion(robot).sample(first)[1]
    np.testing.assert_allclose(rows.action[4], simpson(dq**2, x=first, axis=0), rtol=1e-3)


def test_windows_do_not_overlap() -> None:
    """Extra effort inside one window shows in its row alone, on an edge in two; all rows together hold it once."""
    robot = ARMS[0]
    regressor, log = Regressor(robot), exact_log(robot, rate=RATE)
    plain = energy_observation(regressor, log, SETTINGS).work
    width, first = round(WINDOW * RATE), round(END_S * RATE)
    speed = motion(robot).sample(log.time)[1]
    for at, rows in ((first + 20 * width + 30, [20]), (first + 21 * width, [20, 21])):
        pushed = log.effort.copy()
        pushed[at] += [50.0, -70.0, 90.0]
        change = energy_observation(regressor, replace(log, effort=pushed), SETTINGS).work - plain
        assert list(np.flatnonzero(np.abs(change) > 1e-9)) == rows
        assert change.sum() == pytest.approx(speed[at] @ [50.0, -70.0, 90.0] / RATE, rel=1e-3)


def test_no_row_needs_an_acceleration() -> None:
    """Ripple of 1e-5 rad at 30 Hz is 0.36 rad/s² of acceleration, and changes no row by more than its speed does."""
    robot = ARMS[0]
    regressor, log = Regressor(robot), exact_log(robot, rate=RATE)
    ripple = 1e-5 * np.sin(2 * np.pi * 30 * log.time)[:, None]
    plain = energy_observation(regressor, log, SETTINGS)
    rippled = energy_observation(regressor, replace(log, position=log.position + ripple), SETTINGS)
    inertial = slice(0, len(regressor.base.names))
    change = np.abs(rippled.matrix - plain.matrix)[:, inertial].max(axis=0)
    assert (change < 0.02 * np.abs(plain.matrix[:, inertial]).max(axis=0)).all()


def synthetic(noise: float, seed: int = 0, rows: int = 400) -> tuple[EnergyObservation, np.ndarray]:
    """Random rows whose variance is c0 + Σ c_j·action_j, and what they are rows of."""
    rng = np.random.default_rng(7)
    matrix = rng.normal(size=(rows, 4)) * [1.0, 20.0, 0.1, 3.0]
    action = rng.uniform(0, 1, size=(rows, 2)) ** 4
    truth = np.array([2.0, -0.3, 15.0, 0.7])
    spread = noise * np.sqrt(0.01 + action @ [4.0, 25.0])
    work = matrix @ truth + spread * np.random.default_rng(seed).standard_normal(rows)
    return EnergyObservation(matrix, work, action, 10.0, ("a", "b", "c", "d")), truth


def test_exact_rows_give_exact_parameters() -> None:
    rows, truth = synthetic(0.0)
    np.testing.assert_allclose(energy_least_squares(rows).parameters, truth, rtol=1e-12)
    robot = ARMS[0]
    regressor = Regressor(robot)
    measured = energy_observation(regressor, exact_log(robot, rate=RATE), SETTINGS)
    balanced = replace(measured, work=measured.matrix @ regressor.parameters)
    np.testing.assert_allclose(energy_least_squares(balanced).parameters, regressor.parameters, rtol=1e-8)
    found = energy_least_squares(measured)  # what the filter and the trapezoidal rule leave
    np.testing.assert_allclose(found.parameters, regressor.parameters, rtol=0.05, atol=0.05)


def test_rows_with_little_noise_weigh_more() -> None:
    """Spread over 400 draws: close to that of the true weights, well below that of equal ones; and as stated."""
    draws = [synthetic(0.3, seed)[0] for seed in range(400)]
    estimates = [energy_least_squares(rows) for rows in draws]
    seen = np.std([e.parameters for e in estimates], axis=0)
    matrix, variance = draws[0].matrix, 0.3**2 * (0.01 + draws[0].action @ [4.0, 25.0])
    best = np.sqrt(np.diag(np.linalg.inv(matrix.T @ (matrix / variance[:, None]))))
    equal = np.linalg.pinv(matrix) * np.sqrt(variance)
    assert (seen < 1.25 * best).all()
    assert (seen < 0.6 * np.linalg.norm(equal, axis=1)).all()
    np.testing.assert_allclose(np.mean([e.std for e in estimates], axis=0) / seen, 1.0, atol=0.2)


def test_rows_of_several_logs_are_stacked() -> None:
    robot = ARMS[0]
    regressor = Regressor(robot)
    parts = [energy_observation(regressor, exact_log(robot, seed, RATE), SETTINGS) for seed in (1, 2)]
    both = stacked_energy(parts)
    for name in ("matrix", "work", "action"):
        np.testing.assert_array_equal(getattr(both, name), np.concatenate([getattr(part, name) for part in parts]))


def test_too_few_windows_are_refused() -> None:
    robot = ARMS[0]
    with pytest.raises(UnsupportedLogError, match="5 equations are left for 28 parameters"):
        energy_least_squares(energy_observation(Regressor(robot), exact_log(robot), replace(SETTINGS, window_s=2.0)))
