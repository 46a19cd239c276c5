"""Drive gains from a known mass: found from currents, scaled as the problem is, refused where they can not be."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from exact_logs import arm, exact_log

from identify.errors import UnsupportedLogError
from identify.estimation.drive_gains import DriveGains, calibrated, drive_gains
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.regressor.regressor import Regressor
from identify.robot.payload import carrying
from identify.robot.robot import Link

SETTINGS = Settings(guard_s=0.05)
LOAD = Link(6.0, (0.16, -0.14, 0.21), (0.05, 0.004, -0.003, 0.045, 0.002, 0.04))
GAINS = np.array([14.9, 8.1, 0.35])
"""Torque per unit of current, of three drives that have nothing in common."""


@lru_cache(maxsize=1)
def regressor() -> Regressor:
    return Regressor(arm(1))


def logs(noise: float, seed: int = 0) -> tuple[Log, Log]:
    """Currents without and with the load, with noise on the torque behind them [N·m]."""
    rng = np.random.default_rng(seed)
    pair = []
    for robot, motion in ((arm(1), 1), (carrying(arm(1), LOAD), 2)):
        log = exact_log(robot, motion, periods=2)
        assert log.effort is not None
        pair.append(replace(log, effort=(log.effort + noise * rng.standard_normal(log.effort.shape)) / GAINS))
    return pair[0], pair[1]


def found(noise: float = 0.2, seed: int = 0, mass: float = 6.0) -> DriveGains:
    without, loaded = logs(noise, seed)
    return drive_gains(regressor(), SETTINGS, [without], [loaded], mass)


def test_gains_and_load_are_found_within_their_standard_deviations() -> None:
    """Errors over σ of gains and load have an rms of about one, over seeds."""
    scores = []
    for seed in range(12):
        result = found(0.5, seed)
        spread = np.sqrt(np.diag(result.covariance))
        assert (spread / result.gains).max() < 0.03
        scores += list((result.gains - GAINS) / spread)
        errors = (result.load.parameters - LOAD.standard)[:9]
        scores += list(errors / np.sqrt(np.diag(result.load.covariance))[:9])
        assert result.load.parameters[9] == 6.0
        assert result.load.covariance[9, 9] == 0.0
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.3


def test_a_mass_that_is_wrong_makes_all_gains_wrong_by_as_much() -> None:
    right, heavy = found(), found(mass=6.6)
    np.testing.assert_allclose(heavy.gains, 1.1 * right.gains, rtol=2e-3)
    np.testing.assert_allclose(heavy.load.parameters, 1.1 * right.load.parameters, rtol=0, atol=5e-3)


def test_gains_scale_with_the_unit_of_the_current() -> None:
    without, loaded = logs(0.2)
    milli = np.array([1e3, 1e3, 1e-3])
    scaled = drive_gains(regressor(), SETTINGS, [calibrated(without, milli)], [calibrated(loaded, milli)], 6.0)
    plain = found()
    np.testing.assert_allclose(scaled.gains * milli, plain.gains, rtol=1e-6)
    np.testing.assert_allclose(scaled.covariance * np.outer(milli, milli), plain.covariance, rtol=1e-4)
    np.testing.assert_allclose(scaled.load.parameters, plain.load.parameters, rtol=0, atol=1e-6)


def test_an_effort_of_the_wrong_sign_is_refused() -> None:
    without, loaded = (calibrated(log, np.array([1.0, -1.0, 1.0])) for log in logs(0.2))
    with pytest.raises(UnsupportedLogError, match="is its sign right"):
        drive_gains(regressor(), SETTINGS, [without], [loaded], 6.0)


def test_without_motion_under_the_load_there_is_no_scale() -> None:
    without, loaded = logs(0.2)
    still = replace(loaded, position=np.tile(loaded.position[:1], (loaded.samples, 1)))
    with pytest.raises(UnsupportedLogError, match="can't tell the drive gains"):
        drive_gains(regressor(), SETTINGS, [without], [still], 6.0)
