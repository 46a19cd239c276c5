"""Constants of friction forms by variable projection, and forms chosen, against efforts made with known ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import oracle
import pytest
from exact_logs import arm, exact_log, friction, motion

from identify.estimation.fitting import fit_torque
from identify.estimation.friction_choice import FrictionRows
from identify.estimation.identification import predicted_effort
from identify.estimation.selection import choose_settings
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.regressor.regressor import Regressor

ARM = arm(1)
WIDTH, FADING = 0.05, 0.12
NOISE = 0.05
AMOUNT = {
    "stribeck": np.array([9.0, 7.0, 5.0]),
    "asymmetric": np.array([2.0, -1.5, 1.0]),
    "load": np.array([0.2, 0.15, 0.3]),
}
"""Fb [N·m], Fa [N·m·s/rad], and friction in shares of the load."""

SETTINGS = Settings(60.0, coulomb_velocity=WIDTH, rest_counted=True)


def made(form: str | None, seed: int = 1) -> Log:
    """The arm's motion with one further form, and Coulomb friction that is smooth unless friction is asymmetric."""
    log = exact_log(ARM, seed)
    q, dq, ddq = motion(ARM, seed).sample(log.time)
    smooth = np.sign(dq) if form == "asymmetric" else np.clip(dq / WIDTH, -1, 1)
    coulomb = np.array([joint.drive.coulomb for joint in ARM.joints])
    rigid = oracle.inverse_dynamics(ARM, q, dq, ddq)
    effort = rigid + friction(ARM, dq) + coulomb * (smooth - np.sign(dq))
    amount = AMOUNT.get(form or "", np.zeros(3))
    effort += {
        "stribeck": amount * smooth * np.exp(-np.abs(dq) / FADING),
        "asymmetric": amount * np.abs(dq),
        "load": amount * np.abs(rigid) * smooth,
    }.get(form or "", 0.0)
    noise = NOISE * np.random.default_rng(seed).standard_normal(q.shape)
    return replace(log, effort=effort + noise)


@pytest.mark.parametrize("form", ["stribeck", "asymmetric", "load"])
def test_the_form_that_is_there_is_chosen_and_predicts(form: str) -> None:
    chosen, tried = choose_settings(Regressor(ARM), [made(form)])
    assert chosen.friction == (form,)
    assert chosen.stribeck_velocity == (pytest.approx(FADING, rel=0.15) if form == "stribeck" else None)
    assert not any("load_parameters" in t["settings"] for t in tried)
    regressor = chosen.suited(Regressor(ARM))
    estimate = fit_torque(regressor, [made(form)], chosen, "wls").estimate
    letters = {"stribeck": "Fb", "asymmetric": "Fa", "load": "Fl"}[form]
    found = estimate.parameters[[regressor.names.index(f"{letters}{j}") for j in (1, 2, 3)]]
    expected = AMOUNT[form] * (np.array(chosen.mean_load) if chosen.mean_load else 1.0)
    np.testing.assert_allclose(found, expected, rtol=0.15)
    unseen = made(form, 3)
    left = predicted_effort(regressor, unseen, estimate.parameters, chosen)[50:-50] - unseen.effort[50:-50]
    assert np.sqrt(np.mean(left**2)) < 4 * NOISE


def test_what_a_form_gains_is_what_a_fit_with_it_gains() -> None:
    """Without a fit of its own, at any constant: variable projection against least squares with all columns."""
    log = made("stribeck")
    rows = FrictionRows(Regressor(ARM), [log], SETTINGS)
    grown = rows.grown("stribeck")
    assert grown.settings.stribeck_velocity == pytest.approx(FADING, rel=0.1)
    both = FrictionRows(Regressor(ARM), [log], grown.settings)
    assert rows.percent > 2 * both.percent
    assert grown.percent == pytest.approx(both.percent, rel=1e-2)  # the weights are those of the fit before


def test_settings_hold_the_constants_of_their_forms_and_no_others() -> None:
    with pytest.raises(ValueError, match="stribeck_velocity None"):
        Settings(friction=("stribeck",))
    with pytest.raises(ValueError, match="mean_load"):
        Settings(friction=("load",), load_parameters=(1.0,))
    with pytest.raises(ValueError, match="stribeck_velocity"):
        Settings(stribeck_velocity=0.1)
    load = Settings(friction=("load",), load_parameters=(1.0, -2.0), mean_load=(3.0,))
    assert Settings.from_dict(load.to_dict()) == load
    assert load.plain == Settings()
