"""Periods are found with and without the trajectory, and their average tells parameters and noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exact_logs import arm, exact_log, motion

from identify.errors import UnsupportedLogError
from identify.estimation.estimators.periods import periods_of
from identify.estimation.estimators.problem import Problem
from identify.estimation.estimators.registry import ESTIMATORS
from identify.estimation.fitting import fitted
from identify.estimation.least_squares import Estimate
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.logs.slicing import window
from identify.regressor.regressor import Regressor

ARM = arm(1)
REGRESSOR = Regressor(ARM)
LOG = exact_log(ARM, rate=400.0, periods=3)
CARRYING = replace(LOG, attachments={"trajectory.toml": motion(ARM, 1, 3).to_toml().encode()})


def estimated(name: str, *logs: Log) -> Estimate:
    problem = Problem(REGRESSOR, logs, Settings(), REGRESSOR, None, "not asked for")
    return fitted(problem, ESTIMATORS[name]).estimate


def shaken(log: Log, seed: int, position: float, effort: float) -> Log:
    generator = np.random.default_rng(seed)
    assert log.effort is not None
    q, tau = (generator.standard_normal(log.position.shape) for _ in range(2))
    return replace(log, position=log.position + position * q, effort=log.effort + effort * tau)


@pytest.mark.parametrize("log", [LOG, CARRYING], ids=["found", "told"])
@pytest.mark.parametrize("noise", [0.0, 2e-4])
def test_all_periods_are_taken_and_are_alike(log: Log, noise: float) -> None:
    found = periods_of(shaken(log, 0, noise, 0.0), ARM.joint_names)
    assert found.position.shape == (3, 4000, 3)
    assert found.length == pytest.approx(10.0, abs=1e-9)
    assert found.rate == pytest.approx(400.0)
    assert found.position.std(axis=0).max() < 6 * noise + 1e-7


def test_parts_have_the_periods_that_are_whole_in_them() -> None:
    for start, stop, count in ((0.2, None, 3), (3.0, 30.7, 2), (11.0, None, 1)):
        part = window(CARRYING, start, stop)
        if count < 2:
            with pytest.raises(UnsupportedLogError, match="does not repeat itself"):
                periods_of(part, ARM.joint_names)
        else:
            assert len(periods_of(part, ARM.joint_names).position) == count


def test_a_period_that_is_no_whole_number_of_samples_is_found() -> None:
    length = 10.0037
    stretched = replace(LOG, time=LOG.time * length / 10)
    found = periods_of(stretched, ARM.joint_names[::-1])
    assert found.length == pytest.approx(length, abs=1e-4)
    assert found.position.std(axis=0).max() < 1e-3


def test_what_does_not_repeat_itself_is_refused() -> None:
    wandering = replace(LOG, position=LOG.position + 0.05 * LOG.time[:, None])
    still = replace(LOG, position=np.zeros_like(LOG.position))
    other = replace(CARRYING, position=wandering.position)
    for log in (exact_log(ARM), wandering, still, other):
        with pytest.raises(UnsupportedLogError, match="does not repeat itself"):
            periods_of(log, ARM.joint_names)


def test_a_vibration_is_told_from_the_motion() -> None:
    """A tone in the effort, out of step with the motion: rows near its frequency count for less."""
    errors: dict[str, list[np.ndarray]] = {"wls": [], "ml": []}
    z = []
    for seed in range(3):
        log = shaken(CARRYING, seed, 0.0, 0.01)
        assert log.effort is not None
        tone = np.cos(2 * np.pi * 3.37 * log.time[:, None] + np.arange(3) + seed)
        log = replace(log, effort=log.effort + 0.5 * tone)
        for name, found in errors.items():
            estimate = estimated(name, log)
            found.append(estimate.parameters - REGRESSOR.parameters)
        z.append(errors["ml"][-1] / estimate.std)
    size = {name: np.sqrt(np.mean(np.square(found), axis=0)) for name, found in errors.items()}
    assert np.median(size["ml"] / size["wls"]) < 0.5
    assert np.sqrt(np.mean(np.square(z))) < 1.5


def test_noise_of_the_position_counts_too() -> None:
    """Errors in variables: with the effort exact, deviations still are those of the noise that there is."""
    z = []
    for seed in range(3):
        found = estimated("ml", shaken(CARRYING, seed, 5e-4, 0.0))
        z.append((found.parameters - REGRESSOR.parameters) / found.std)
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5
