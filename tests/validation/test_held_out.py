"""What a result is worth on a log: figures of the prediction, the range it was trained on, curves to draw."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from exact_logs import arm, exact_log, fitted, motion, unknown

from identify import side_by_side
from identify.estimation import scoring
from identify.estimation.prediction import Predictor, predicted_effort
from identify.estimation.scoring import scored
from identify.estimation.settings import STILL, Settings
from identify.logs.log import Log
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot
from identify.validation.held_out import (
    NOMINAL,
    coverage,
    figures_on,
    held_out,
    nominal_parameters,
    residual_autocorrelation,
)
from identify.validation.review import CURVE_ROWS, Review, reviewed

ARM = arm(1)
REGRESSOR = Regressor(ARM)
SETTINGS = Settings()
HALF = 0.5 * REGRESSOR.parameters


def of(regressor: Regressor, parameters: np.ndarray) -> Predictor:
    return Predictor(regressor, parameters, SETTINGS)


def review(log: Log, **parameters: np.ndarray) -> Review:
    return reviewed(log, {name: of(REGRESSOR, values) for name, values in ({"half": HALF} | parameters).items()})


def figures(logs: list[Log], parameters: np.ndarray) -> dict[str, Any]:
    return figures_on(logs, {"only": of(REGRESSOR, parameters)})["only"]


def numbers(value: Any) -> list[float]:
    """Every number of a figure, one after the other."""
    if isinstance(value, dict):
        return numbers([value[key] for key in sorted(value)])
    if isinstance(value, list):
        return [x for each in value for x in numbers(each)]
    return [] if isinstance(value, str) or value is None else [value]


def uneven(log: Log, share: float) -> Log:
    """The log with times up to this share of a step from where they were."""
    step = log.time[1] - log.time[0]
    return replace(log, time=log.time + share * step * np.random.default_rng(1).uniform(-1, 1, log.samples))


@pytest.mark.parametrize("share", [0.0, 0.005, 0.3])
@pytest.mark.parametrize("threads", [1, 3])
def test_figures_in_one_pass_are_those_of_whole_predictions(
    share: float, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of several predictions, one with a presliding state; whatever the clock, the pieces and the threads."""
    monkeypatch.setattr(side_by_side, "workers", lambda: threads)
    monkeypatch.setattr(scoring, "PIECE_S", 3.1)
    logs = [uneven(exact_log(ARM, seed), share) for seed in (1, 2)]
    rich = REGRESSOR.with_forms(("presliding",))
    settings = Settings(
        position_cutoff_hz=25.0, coulomb_velocity=0.05, rest_counted=True, friction=rich.forms, presliding_distance=3e-3
    )
    predictors = {
        "half": of(REGRESSOR, HALF),
        "presliding": Predictor(rich, np.linspace(0.5, 1.5, rich.p), settings),
        "whole": of(REGRESSOR, REGRESSOR.parameters),
    }
    found = figures_on(logs, predictors)
    assert list(found) == list(predictors)
    for name, p in predictors.items():
        predictions = [predicted_effort(p.regressor, log, p.parameters, p.settings) for log in logs]
        expected = scored(logs, predictions, ARM)
        assert numbers(found[name]) == pytest.approx(numbers(expected), rel=1e-7, abs=1e-9)
    # Effort is linear in the parameters: half of them leave half of it.
    assert found["half"]["relative_residual_percent"] == pytest.approx(50, abs=0.5)


def test_threads_change_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scoring, "PIECE_S", 1.3)
    found = []
    for threads in (1, 2, 4):
        monkeypatch.setattr(side_by_side, "workers", lambda threads=threads: threads)
        found.append(review(exact_log(ARM, 1)))
    for other in found[1:]:
        np.testing.assert_array_equal(other.residual, found[0].residual)
        for name, values in found[0].curves.items():
            np.testing.assert_array_equal(other.curves[name], values)
        for ours, theirs in zip(found[0].tallies["half"], other.tallies["half"], strict=True):
            np.testing.assert_array_equal(ours.sums, theirs.sums)


def test_outside_training_is_the_share_of_time_beyond_its_positions() -> None:
    train, log = exact_log(ARM, 1), exact_log(ARM, 2)
    spread = np.ptp(train.position, axis=0)
    low, high = train.position.min(axis=0), train.position.max(axis=0)
    moved = train.position + 0.25 * spread * [1.0, -1.0, 0.0]
    found = held_out(review(replace(train, position=moved)), [review(train)], ARM)
    expected = [(moved[:, 0] > high[0]).mean(), (moved[:, 1] < low[1]).mean(), 0.0]
    assert found["outside_training_percent"] == pytest.approx([100 * x for x in expected])
    assert 0 < expected[0] < 1
    both = held_out(review(log), [review(train), review(log)], ARM)
    assert both["outside_training_percent"] == [0.0] * 3


def test_a_training_log_is_known_again() -> None:
    train, log = exact_log(ARM, 1), exact_log(ARM, 2)
    assert held_out(review(train), [review(log), review(train)], ARM)["is_a_training_log"] is True
    assert held_out(review(log), [review(train)], ARM)["is_a_training_log"] is False


def test_a_log_that_repeats_the_training_motion_is_told() -> None:
    """The same trajectory logged at another rate, begun later, with noise of its own; and another trajectory."""
    train, rate = review(exact_log(ARM, 1, noise=0.1)), 310.0
    again = exact_log(ARM, 1, rate=rate)
    rng = np.random.default_rng(3)
    kept = slice(137, None)
    position = again.position[kept] + 1e-5 * rng.standard_normal(again.position[kept].shape)
    assert again.effort is not None
    again = replace(again, time=again.time[kept] - again.time[137], position=position, effort=again.effort[kept])
    found = held_out(review(again), [train], ARM)
    assert found["is_a_training_log"] is False
    assert found["motion"]["repeat"]["repeats"] is True
    assert found["motion"]["repeat"]["share_percent"] > 90
    other = held_out(review(exact_log(ARM, 2, rate=rate)), [train], ARM)["motion"]
    assert other["repeat"]["share_percent"] < 2
    assert other["distance"]["median"] > 5 * found["motion"]["distance"]["median"]


def test_a_joint_predicted_no_better_than_by_its_mean_is_marked() -> None:
    log = exact_log(ARM, 2)
    wrong = held_out(review(log, half=-HALF), [review(exact_log(ARM, 1))], ARM)["per_joint"]
    right = held_out(review(log, half=REGRESSOR.parameters), [review(exact_log(ARM, 1))], ARM)["per_joint"]
    assert [joint["worse_than_mean"] for joint in right] == [False] * 3
    assert any(joint["worse_than_mean"] for joint in wrong)


def test_the_nominal_model_stands_beside_the_identified_one() -> None:
    log = exact_log(ARM, 2)
    nominal = nominal_parameters(REGRESSOR)
    assert nominal is not None
    found = held_out(review(log, **{NOMINAL: nominal}), [review(exact_log(ARM, 1))], ARM)
    exact = figures([log], REGRESSOR.parameters)
    assert found["nominal_relative_residual_percent"] == exact["relative_residual_percent"] < 1
    assert [j["nominal_moving_rmse"] for j in found["per_joint"]] == [j["moving_rmse"] for j in exact["per_joint"]]
    assert found["relative_residual_percent"] > 40


@pytest.mark.parametrize(
    ("metadata", "reason"), [({}, "gives no inertias"), ({"simulated": "true"}, "is a simulation of the robot file")]
)
def test_where_there_is_no_nominal_model_it_says_why(metadata: dict[str, str], reason: str) -> None:
    assert nominal_parameters(Regressor(unknown(ARM))) is None
    log = replace(exact_log(ARM, 2), metadata=metadata)
    found = held_out(review(log), [review(log)], ARM)
    assert found["nominal_relative_residual_percent"] is None
    assert reason in found["nominal_relative_residual_percent_reason"]
    for joint in found["per_joint"]:
        assert joint["nominal_moving_rmse"] is None
        assert reason in joint["nominal_moving_rmse_reason"]


@pytest.mark.parametrize("robot", [arm(1), arm(2)])
def test_curves_split_the_prediction_into_rigid_body_and_friction(robot: Robot) -> None:
    """measured − rigid is friction: of exact data with exact parameters, Fv·q̇ + Fs·sign(q̇) + offset."""
    regressor = Regressor(robot)
    log = exact_log(robot, 1, rate=500.0)
    theta = regressor.parameters
    found = reviewed(log, {"drawn": of(regressor, theta), "other": of(regressor, 0 * theta)}).curves
    rows = len(found["time"])
    assert CURVE_ROWS / 2 < rows <= CURVE_ROWS
    for name in ("measured", "predicted", "rigid", "position", "velocity", "acceleration"):
        assert found[name].shape == (rows, 3)
    assert found["moving"].dtype == bool
    t = found["time"]
    q, dq, ddq = motion(robot).sample(t)
    inside = slice(100, -100)
    for name, exact in (("position", q), ("velocity", dq), ("acceleration", ddq)):
        np.testing.assert_allclose(found[name][inside], exact[inside], rtol=0, atol=5e-3)
    clear = np.abs(np.abs(dq) - STILL) > 0.002
    np.testing.assert_array_equal(found["moving"][inside][clear[inside]], (np.abs(dq) > STILL)[inside][clear[inside]])
    lost = found["measured"] - found["rigid"]
    drives = [joint.drive for joint in robot.joints]
    far = np.array([np.abs(dq[max(0, k - 100) : k + 101]).min(axis=0) > 0.03 for k in range(len(t))])
    for j, drive in enumerate(drives):
        if "off" + str(j + 1) in regressor.names:
            expected = drive.viscous * dq[:, j] + drive.coulomb * np.sign(dq[:, j]) + drive.offset
            assert np.abs(lost[far[:, j], j] - expected[far[:, j]]).max() < 0.05 * np.abs(expected).max()


def test_coverage_is_what_the_motion_used_of_the_limits() -> None:
    logs = [exact_log(ARM, seed) for seed in (1, 2)]
    samples = [motion(ARM, seed).sample(logs[0].time) for seed in (1, 2)]
    q, dq, ddq = (np.concatenate(x) for x in zip(*samples, strict=True))
    for j, row in enumerate(coverage(ARM, [review(log) for log in logs])["per_joint"]):
        limits = ARM.joints[j].limits
        assert row["position"] == pytest.approx([q[:, j].min(), q[:, j].max()], abs=1e-3)
        assert row["position_limit_percent"] == pytest.approx(100 * np.ptp(q[:, j]) / 4.0, rel=1e-3)
        assert row["velocity_max"] == pytest.approx(np.abs(dq[:, j]).max(), rel=1e-2)
        assert row["velocity_limit_percent"] == pytest.approx(100 * row["velocity_max"] / limits.velocity)
        assert row["acceleration_limit_percent"] == pytest.approx(
            100 * np.abs(ddq[:, j]).max() / limits.acceleration, rel=0.05
        )


def test_limits_that_nobody_gave_are_null_with_a_reason() -> None:
    free = replace(ARM, joints=tuple(replace(j, limits=type(j.limits)()) for j in ARM.joints))
    for row in coverage(free, [review(exact_log(ARM))])["per_joint"]:
        for key in ("position_limit_percent", "velocity_limit_percent", "acceleration_limit_percent"):
            assert row[key] is None
            assert row[f"{key}_reason"] == "the robot file gives no such limit"


def test_autocorrelation_of_an_oscillating_residual() -> None:
    log = exact_log(ARM, 1)
    wave = np.sin(2 * np.pi * 4.0 * log.time)[:, None] * [1.0, 2.0, 0.0]
    # With parameters of zero all of the effort is residual.
    found = residual_autocorrelation(review(replace(log, effort=wave), half=np.zeros(REGRESSOR.p)))
    lag, values = found["residual/lag"], found["residual/autocorrelation"]
    assert values.shape == (len(lag), 3)
    assert lag[0] == 0
    np.testing.assert_allclose(values[0, :2], 1.0)
    half, whole = (int(np.abs(lag - x).argmin()) for x in (0.125, 0.25))
    assert (values[half, :2] < -0.8).all()
    assert (values[whole, :2] > 0.8).all()
    np.testing.assert_array_equal(values[:, 2], 0.0)


def test_a_whole_fit_holds_these_figures() -> None:
    record = fitted().record
    assert [t["path"] for t in record["test"]] == ["test.mcap"]
    assert record["test"][0]["is_a_training_log"] is False
    assert len(record["coverage"]["per_joint"]) == 3
    assert {name.split("/")[0] for name in fitted().curves} == {"train0", "test0", "residual"}
