"""Settings are chosen by how well they predict what was not fitted."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import oracle
import pytest
from exact_logs import arm, exact_log, friction, motion

from identify.errors import UnsupportedLogError
from identify.estimation.cutoff_choice import ALIKE
from identify.estimation.least_squares import solution, weights_by_noise
from identify.estimation.observation import signals, stacked, torque_blocks
from identify.estimation.reduction import reduced
from identify.estimation.selection import choose_settings, choose_window, validated
from identify.estimation.settings import STILL, Settings
from identify.logs.log import Log
from identify.regressor.regressor import Regressor

ARM = arm(1)
REGRESSOR = Regressor(ARM)
NOISE = 0.02


def log_with(friction_at: np.ndarray, seed: int = 0) -> Log:
    """The motion's rigid-body effort with this friction (N, n) and white noise."""
    log = exact_log(ARM)
    q, dq, ddq = motion(ARM).sample(log.time)
    white = NOISE * np.random.default_rng(seed).standard_normal(q.shape)
    return replace(log, effort=oracle.inverse_dynamics(ARM, q, dq, ddq) + friction_at + white)


def speed() -> np.ndarray:
    return motion(ARM).sample(exact_log(ARM).time)[1]


@pytest.mark.parametrize("width", [0.05, 0.1])
def test_friction_with_a_slope_is_smoothed_as_wide_as_it_is(width: float) -> None:
    dq = speed()
    coulomb = np.array([joint.drive.coulomb for joint in ARM.joints])
    sloped = friction(ARM, dq) + coulomb * (np.clip(dq / width, -1, 1) - np.sign(dq))
    chosen, _ = choose_settings(REGRESSOR, [log_with(sloped)])
    assert (chosen.coulomb_velocity, chosen.rest_counted) == (width, True)


def test_friction_that_sticks_leaves_rest_out() -> None:
    dq = speed()
    held = np.random.default_rng(4).uniform(-3, 3, dq.shape)
    sticking = np.where(np.abs(dq) <= STILL, held, friction(ARM, dq))
    chosen, _ = choose_settings(REGRESSOR, [log_with(sticking)])
    assert (chosen.coulomb_velocity, chosen.rest_counted) == (None, False)


def test_noise_of_the_position_lowers_the_cut_offs() -> None:
    log = exact_log(ARM)
    noisy = replace(log, position=log.position + 1e-4 * np.random.default_rng(5).standard_normal(log.position.shape))
    settings, tried = choose_settings(REGRESSOR, [noisy])
    alone = [t["moving_percent"] for t in tried if t["settings"].get("quiet_cutoff_hz") is None]
    assert settings.position_cutoff_hz <= 40
    assert settings.quiet_cutoff_hz is not None
    assert next(t for t in tried if t["settings"] == settings.to_dict())["moving_percent"] < 0.6 * min(alone)


def test_what_was_fitted_is_not_what_is_predicted() -> None:
    """Effort that is nothing but noise: any fit explains some of its own rows, and worsens those it has not seen."""
    log = exact_log(ARM)
    log = replace(log, effort=np.random.default_rng(6).standard_normal(log.position.shape))
    settings = Settings(position_cutoff_hz=20.0)
    reduction = reduced(torque_blocks(REGRESSOR, [log], settings))
    theta = solution(reduction, weights_by_noise(reduction))[2]
    rows = stacked(torque_blocks(REGRESSOR, [log], settings))
    left = [b - a @ theta for a, b in zip(rows.matrix, rows.effort, strict=True)]
    assert np.linalg.norm(left) < 0.99 * np.linalg.norm(rows.effort)
    assert validated(REGRESSOR, [log], settings).percent["all_percent"] > 101


def test_what_is_chosen_is_hardly_worse_than_any_and_all_that_was_tried_is_told() -> None:
    logs = [exact_log(ARM, noise=NOISE), exact_log(ARM, 2, noise=NOISE)]
    told: list[float] = []
    chosen, tried = choose_settings(REGRESSOR, logs, progress=lambda share, text: told.append(share))
    assert told == sorted(told)
    assert 0 <= told[0] < told[-1] < 1
    treatment = min(tried[:4], key=lambda t: t["all_percent"])["settings"]
    alike = [t for t in tried if not t["settings"]["friction"] and t["settings"]["rest_counted"] == chosen.rest_counted]
    least = min(t["moving_percent"] for t in alike)
    assert len({json.dumps(t["settings"]) for t in tried}) == len(tried) > 4 + 4
    mine = next(t for t in alike if t["settings"] == chosen.to_dict())
    assert mine["moving_percent"] <= ALIKE * least
    assert chosen.coulomb_velocity == treatment.get("coulomb_velocity")
    assert (
        Settings.from_dict(json.loads(json.dumps(tried, allow_nan=False))[-1]["settings"]).to_dict()
        == tried[-1]["settings"]
    )


def test_energy_window_is_the_one_that_predicts_effort_best() -> None:
    log = exact_log(ARM, noise=NOISE, periods=2)
    chosen, tried = choose_window(REGRESSOR, [log], Settings())
    assert chosen.to_dict() == min(tried, key=lambda t: t["moving_percent"])["settings"]
    assert len({(t["settings"]["window_s"], t["settings"]["energy_cutoff_hz"]) for t in tried}) == len(tried) > 3
    assert signals(log, chosen).rate == 250.0


def test_a_log_too_short_for_any_window_is_refused() -> None:
    log = exact_log(ARM)
    short = replace(log, time=log.time[:300], position=log.position[:300], effort=log.effort[:300])
    with pytest.raises(UnsupportedLogError):
        choose_window(REGRESSOR, [short], Settings())


def test_settings_survive_their_table() -> None:
    settings = Settings(31.0, 9.0, 18.0, 0.03, True, 0.04, 0.15, 12.0)
    assert Settings.from_dict(settings.to_dict()) == settings
    assert settings.to_dict()["coulomb_form"] == "smooth sign"
    np.testing.assert_allclose(settings.sign(np.array([-1.0, 0.015, 0.0, 0.6])), [-1, 0.5, 0, 1])


def test_coulomb_friction_is_a_sign_but_for_rest() -> None:
    """Where a joint counts as moving the sign is exact; what little speed a filter leaves at rest means no friction."""
    speeds = np.array([-2.0, -1.001 * STILL, -1e-17, 0.0, 1e-9, 1.001 * STILL, 0.3])
    np.testing.assert_allclose(Settings().sign(speeds), [-1, -1, 0, 0, 0, 1, 1], rtol=0, atol=1e-6)
