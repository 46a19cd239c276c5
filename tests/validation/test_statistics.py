"""What the record says of how sure a result is, against the result itself and against constructed truth."""

from __future__ import annotations

import numpy as np
import pytest
from exact_logs import arm, exact_log, fitted

from identify.estimation.estimators.problem import Problem
from identify.estimation.estimators.registry import ESTIMATORS
from identify.estimation.fitting import fitted as solved
from identify.estimation.settings import Settings
from identify.regressor.regressor import Regressor
from identify.validation.statistics import statistics
from identify.validation.verdict import WELL_KNOWN

ARM = arm(1)
REGRESSOR = Regressor(ARM)
SETTINGS = Settings()


def problem(noise: float, seconds: float | None = None) -> Problem:
    log = exact_log(ARM, noise=noise)
    if seconds is not None:
        from identify.logs.slicing import window

        log = window(log, 2.0, 2.0 + seconds)
    windows = Settings(window_s=0.1, energy_cutoff_hz=20.0)
    return Problem(REGRESSOR, [log], SETTINGS, REGRESSOR, windows)


def test_figures_of_a_result_are_those_of_its_covariance() -> None:
    record = fitted().record
    found = record["statistics"]
    covariance, names = np.array(record["covariance"]), record["names"]
    first = found["correlations"][0]
    i, j = names.index(first["first"]), names.index(first["second"])
    expected = covariance[i, j] / np.sqrt(covariance[i, i] * covariance[j, j])
    assert first["correlation"] == pytest.approx(expected)
    ratio = np.sqrt(np.diag(covariance)) / np.array(found["textbook_std"])
    assert found["covariance"]["widening"] == pytest.approx(np.median(ratio))
    assert [row["group"] for row in found["whiteness"]] == [joint["name"] for joint in record["robot"]["joints"]]
    assert all(len(row["std"]) == len(found["covariance"]["edges_hz"]) for row in found["covariance"]["noise"])
    assert found["covariance"]["edges_hz"][-1] == pytest.approx(record["settings"]["decimated_rate_hz"] / 2, rel=0.05)
    assert found["command"].startswith("identify excite ")


def test_noise_by_band_is_that_which_was_added() -> None:
    """White noise σ at 250 Hz has the density 2σ²/250 everywhere; rows of 20 Hz hold all of it up to the filter's
    cut-off, so that slow bands have the standard deviation σ·√(20/250)."""
    by = ESTIMATORS["wls"]
    given = problem(0.5)
    found = statistics(solved(given, by), given)
    slow = np.array([row["std"][:4] for row in found["covariance"]["noise"]])
    np.testing.assert_allclose(slow.mean(axis=1), 0.5 * np.sqrt(20 / 250), rtol=0.25)


@pytest.mark.parametrize("name", ["wls", "energy"])
def test_essential_parameters_predict_the_rows_nearly_as_well(name: str) -> None:
    given = problem(2.0)
    fit = solved(given, ESTIMATORS[name])
    row = statistics(fit, given)["essential"]
    assert len(row["names"]) + len(row["dropped"]) == REGRESSOR.p
    assert row["names"] == [p["name"] for p in row["parameters"]]
    assert row["residual_before_percent"] <= row["residual_after_percent"] < 1.1 * row["residual_before_percent"]
    relative = [p["relative_std_percent"] for p in row["parameters"]]
    assert max(relative) / min(relative) == pytest.approx(row["ratio"])
    assert row["ratio"] <= row["ratio_limit"] or row["refused"]
    assert ("refused_reason" in row) == (row["refused"] is None)


def test_every_open_parameter_is_in_one_sentence_and_known_ones_in_none() -> None:
    given = problem(4.0, seconds=6.0)
    fit = solved(given, ESTIMATORS["wls"])
    found = statistics(fit, given)["unknown"]
    relative = 100 * fit.estimate.std / np.abs(fit.estimate.parameters)
    listed = [name for group in found for name in group["names"]]
    assert sorted(listed) == sorted(n for n, r in zip(REGRESSOR.names, relative, strict=True) if r >= WELL_KNOWN)
    assert len(listed) == len(set(listed)) > 0
    for group in found:
        lost = [relative[REGRESSOR.names.index(name)] >= 100 for name in group["names"]]
        assert all(lost) if group["state"] == "not determined" else not any(lost)
        assert group["motions"]
        assert all(name in group["told"] for name in group["names"])
        assert all(joint in ARM.joint_names for motion in group["motions"] for joint in motion["joints"])


def test_exact_rows_leave_nothing_open() -> None:
    given = problem(0.0)
    found = statistics(solved(given, ESTIMATORS["wls"]), given)
    assert found["unknown"] == []
