"""Every estimator finds the parameters of exact logs, and stands by its stated uncertainty under noise."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from exact_logs import arm, exact_log

from identify.cli import options
from identify.errors import InputError, UnsupportedLogError
from identify.estimation.energy import energy_observation
from identify.estimation.estimators.power import power_observation
from identify.estimation.estimators.problem import Problem
from identify.estimation.estimators.registry import DEFAULTS, ESTIMATORS, MODELS, choice
from identify.estimation.fitting import fit_torque, fitted
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.regressor.regressor import Regressor

ARM = arm(1)
REGRESSOR = Regressor(ARM)
TRUTH = REGRESSOR.parameters
WINDOWS = Settings(window_s=0.1, energy_cutoff_hz=20.0)
OPEN = [name for name in ESTIMATORS if name not in ("idim-iv", "didim")]
"""Those that need no controller; test_closed_loop has the others."""


def posed(*logs: Log) -> Problem:
    return Problem(REGRESSOR, logs, Settings(), REGRESSOR, WINDOWS)


@lru_cache(maxsize=1)
def exact() -> Problem:
    return posed(exact_log(ARM, rate=400.0, periods=2))


@pytest.mark.parametrize("name", OPEN)
def test_each_finds_the_parameters_of_exact_rows(name: str) -> None:
    by = ESTIMATORS[name]
    found = fitted(exact(), by)
    assert found.model == by.model
    assert found.estimator == by.title
    assert (found.energy_residual_percent is None) == (by.model == "torque")
    share = 2e-3 if by.model == "torque" else 2e-2
    np.testing.assert_allclose(found.estimate.parameters, TRUTH, rtol=0, atol=share * np.abs(TRUTH).max())


@pytest.mark.parametrize("name", OPEN)
def test_errors_under_noise_are_of_the_size_that_is_stated(name: str) -> None:
    """rms of (estimate − truth) / σ over parameters and eight logs: 1 for honest deviations."""
    noise, z = 0.05, []
    for seed in range(8):
        log = exact_log(ARM, rate=400.0, periods=2)
        assert log.effort is not None
        shake = noise * np.random.default_rng(seed).standard_normal(log.effort.shape)
        estimate = fitted(posed(replace(log, effort=log.effort + shake)), ESTIMATORS[name]).estimate
        z.append((estimate.parameters - TRUTH) / estimate.std)
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5


@pytest.mark.parametrize("name", ["huber", "tukey"])
def test_bursts_in_the_effort_hardly_move_robust_estimates(name: str) -> None:
    """Two collisions of 0.3 s, ten times the noise and more: least squares is off, reweighting is not."""
    log = exact_log(ARM, rate=400.0, noise=0.02, periods=2)
    assert log.effort is not None
    effort = log.effort.copy()
    for start in (3.0, 12.0):
        rows = (log.time > start) & (log.time < start + 0.3)
        effort[rows] += (1 + 0.1 * np.abs(effort).max(axis=0)) * [1.0, -1.0, 1.0]
    struck = posed(replace(log, effort=effort))
    clean = fitted(posed(log), ESTIMATORS["wls"]).estimate.parameters

    def moved(name: str) -> float:
        return float(np.linalg.norm(fitted(struck, ESTIMATORS[name]).estimate.parameters - clean))

    assert moved(name) < moved("wls") / 5


def test_power_is_what_windows_of_work_tend_to() -> None:
    """Of exact signals, work over a short window divided by its length is the power in its middle."""
    log = exact().logs[0]
    settings = replace(WINDOWS, window_s=0.02, effort_cutoff_hz=50.0, decimated_rate_hz=400.0, energy_cutoff_hz=100.0)
    power = power_observation(REGRESSOR, log, settings)
    work = energy_observation(REGRESSOR, log, settings)
    width = round(settings.window_s * 400)
    middles = power.matrix[width // 2 :: width][: len(work.matrix)]
    found, expected = middles @ TRUTH, work.matrix[: len(middles)] @ TRUTH / settings.window_s
    assert np.linalg.norm(found - expected) < 0.02 * np.linalg.norm(expected)
    assert power.rate == 400.0


def test_both_takes_further_friction_along() -> None:
    """The energy rows of a model with cube-root friction have its columns, and exact work is explained by them."""
    rich = Regressor(ARM, ("cube_root",))
    log = exact().logs[0]
    settings = Settings(friction=("cube_root",))
    problem = Problem(rich, [log], settings, REGRESSOR, WINDOWS)
    estimate = fitted(problem, ESTIMATORS["both"]).estimate
    assert estimate.names == rich.names
    exact_work = problem.work.matrix @ rich.theta(ARM.standard, dict(zip(REGRESSOR.names, TRUTH, strict=True)))
    assert np.linalg.norm(problem.work.work - exact_work) < 1e-2 * np.linalg.norm(exact_work)
    found = dict(zip(estimate.names, estimate.parameters, strict=True))
    shared = np.array([found[name] for name in REGRESSOR.base.names])
    np.testing.assert_allclose(shared, TRUTH[: len(shared)], rtol=0, atol=5e-3 * np.abs(TRUTH).max())


def test_without_windows_the_energies_are_refused_with_the_reason() -> None:
    problem = replace(exact(), energy_settings=None, energy_reason="too short")
    for name in ("energy", "power", "both"):
        with pytest.raises(UnsupportedLogError, match="too short"):
            fitted(problem, ESTIMATORS[name])
    assert fit_torque(REGRESSOR, problem.logs, Settings()).by is ESTIMATORS["wls"]


def test_the_estimator_tells_the_model() -> None:
    assert tuple(DEFAULTS) == MODELS
    assert all(ESTIMATORS[name].model == model for model, name in DEFAULTS.items())
    assert choice(None, None) is choice("torque", "all") is ESTIMATORS[DEFAULTS["torque"]]
    assert choice("energy", None) is choice("energy", "all") is ESTIMATORS[DEFAULTS["energy"]]
    assert choice(None, "power").model == "energy"
    for model, estimator, message in (
        ("power", None, "choose one of torque, energy"),
        ("torque", "lasso", "choose one of ols, wls"),
        ("torque", "energy", "of the energy model; of the torque model are ols, wls"),
    ):
        with pytest.raises(InputError, match=message):
            choice(model, estimator)


def test_the_command_line_knows_them_all() -> None:
    assert tuple(ESTIMATORS) == options.ESTIMATORS
