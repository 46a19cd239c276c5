"""Both models on the same logs, and which part of a long log the settings are chosen on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exact_logs import arm, exact_log

from identify.errors import UnsupportedLogError
from identify.estimation import fitting as module
from identify.estimation.fitting import agreement, fit_models, liveliest
from identify.estimation.least_squares import Estimate
from identify.logs.log import Log
from identify.regressor.regressor import Regressor

ARM = arm(1)
REGRESSOR = Regressor(ARM)


def after_a_rest(log: Log, rest: float) -> Log:
    """The same with the arm at rest first, for `rest` seconds."""
    rows = round(rest * log.rate_hz)
    assert log.effort is not None
    return replace(
        log,
        time=np.concatenate([np.arange(rows) / log.rate_hz, log.time + rest]),
        position=np.concatenate([np.repeat(log.position[:1], rows, axis=0), log.position]),
        effort=np.concatenate([np.repeat(log.effort[:1], rows, axis=0), log.effort]),
    )


def test_both_models_find_the_parameters_of_exact_rows() -> None:
    both = fit_models(REGRESSOR, [exact_log(ARM, rate=400.0, periods=2)], "torque")
    assert both.torque is not None
    assert both.energy is not None
    truth = REGRESSOR.parameters
    size = np.abs(truth).max()
    np.testing.assert_allclose(both.torque.estimate.parameters, truth, rtol=0, atol=2e-3 * size)
    np.testing.assert_allclose(both.energy.estimate.parameters, truth, rtol=0, atol=2e-2 * size)
    assert both.energy.settings.window_s is not None
    assert both.reasons == {}


def test_settings_of_a_long_log_are_chosen_where_it_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a minute at rest, then 11 s of motion, with room for 10 s: the rest alone would support nothing."""
    log = after_a_rest(exact_log(ARM, rate=100.0), 30.0)
    part = liveliest(log, 10.0)
    assert part.duration == pytest.approx(10.0, abs=0.02)
    np.testing.assert_array_equal(part.position, log.position[3050 : 3050 + part.samples])
    assert part.time[0] == 0
    assert liveliest(part, 10.0) is part
    monkeypatch.setattr(module, "SETTINGS_S", 10.0)
    assert fit_models(REGRESSOR, [log], "torque").torque is not None


def test_a_model_without_support_says_why_and_leaves_the_other() -> None:
    """Four seconds are enough for the torque model, with its rows of every joint, and too few for energies."""
    log = exact_log(ARM, noise=0.01)
    rows = slice(0, 1000)
    short = replace(log, time=log.time[rows], position=log.position[rows], effort=log.effort[rows])
    both = fit_models(REGRESSOR, [short], "torque")
    assert both.torque is not None
    if both.energy is None:
        assert "equations are left" in both.reasons["energy"]
    tiny = replace(log, time=log.time[:400], position=log.position[:400], effort=log.effort[:400])
    with pytest.raises(UnsupportedLogError):
        fit_models(REGRESSOR, [tiny], "energy")


def test_agreement_is_in_deviations_of_the_difference() -> None:
    def estimate(parameters: list[float], std: list[float]) -> Estimate:
        covariance = np.diag(np.square(std))
        return Estimate(("a", "b", "c"), np.array(parameters), covariance, 1.0, np.ones(1), np.ones(1), 9, 9.0)

    found = agreement(estimate([1.0, 2.0, 3.0], [0.3, 0.1, 3.0]), estimate([1.5, 2.0, 18.0], [0.4, 0.1, 4.0]))
    assert found["largest_z"] == pytest.approx(3.0)
    assert found["name"] == "c"
    assert found["within_2_sigma_percent"] == pytest.approx(200 / 3)
