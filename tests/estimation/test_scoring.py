"""Residual figures are those of the common rule, as the script that states it computes them."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from beside import shared
from exact_logs import arm, exact_log
from script_modules import module

from identify.estimation.scoring import relative, scored, speed_of
from identify.logs.log import Log

ARM = arm(2)
TOLERANCE = 1e-3  # percentage points


@pytest.fixture(scope="module")
def rule() -> ModuleType:
    return module(shared("score.py"))


def prediction(log: Log, seed: int = 0) -> np.ndarray:
    """The log's effort with an error of a few percent, coloured and white, much larger where a joint rests."""
    rng = np.random.default_rng(seed)
    slow = np.sin(np.arange(log.samples)[:, None] * [0.01, 0.023, 0.05])
    error = 0.03 * slow + 0.02 * rng.normal(size=slow.shape)
    error[np.abs(np.gradient(log.position, log.time, axis=0)) < 0.05] *= 8.0
    return log.effort + np.abs(log.effort).max(axis=0) * error


def variants() -> list[tuple[str, Log]]:
    plain = exact_log(ARM)
    jitter = np.random.default_rng(1).uniform(-1, 1, plain.samples) / 250
    noise = 2e-4 * np.random.default_rng(2).standard_normal(plain.position.shape)
    speed = np.gradient(plain.position, plain.time, axis=0) + 0.004 * np.sin(plain.time * 400)[:, None]
    return [
        ("no velocity", replace(plain, position=plain.position + noise)),
        ("velocity", replace(plain, velocity=speed)),
        ("hardly uneven", replace(plain, time=plain.time + 0.009 * jitter)),
        ("uneven", replace(plain, time=plain.time + 0.3 * jitter)),
        ("uneven, velocity", replace(plain, time=plain.time + 0.3 * jitter, velocity=speed)),
        ("slow", exact_log(ARM, rate=12.0)),
    ]


@pytest.mark.parametrize(("log"), [pytest.param(log, id=name) for name, log in variants()])
def test_figures_are_those_of_the_rule(rule: ModuleType, log: Log) -> None:
    hat = prediction(log)
    table = {"t": log.time, "q": log.position, "tau": log.effort}
    if log.velocity is not None:
        table["dq"] = log.velocity
    theirs = rule.score(table, {"t": log.time, "tau": hat})
    ours = scored([log], [hat], ARM)
    assert theirs["moving"]["rel_pct"] < 0.8 * theirs["filtered"]["rel_pct"]
    for key, figure, rmse in (
        ("filtered", "relative_residual_percent", "rmse"),
        ("moving", "moving_relative_residual_percent", "moving_rmse"),
    ):
        assert ours[figure] == pytest.approx(theirs[key]["rel_pct"], abs=TOLERANCE)
        joints = ours["per_joint"]
        assert [j[figure] for j in joints] == pytest.approx(theirs[key]["rel_pct_joint"], abs=TOLERANCE)
        assert [j[rmse] for j in joints] == pytest.approx(theirs[key]["rmse_Nm_joint"], abs=1e-5, rel=1e-4)


def test_rest_and_largest_error() -> None:
    """An error of 4 at rest only, longer than the filter: rest holds it, moving does not, the largest is its size."""
    log = exact_log(ARM, periods=1)
    still = log.time < 0.5
    log = replace(log, position=np.where(still[:, None], log.position[0], log.position))
    hat = log.effort + 4.0 * (log.time < 0.35)[:, None]
    (first, *_) = scored([log], [hat], ARM)["per_joint"]
    assert first["max_abs_error"] == pytest.approx(4.0, rel=0.15)
    assert first["rest_rmse"] > 10 * first["moving_rmse"]
    assert first["rest_share_percent"] == pytest.approx(100 * (np.abs(speed_of(log)[:, 0]) <= 0.01).mean())
    assert first["std_of_signal"] == pytest.approx(log.effort[:, 0].std(), rel=0.02)
    assert (first["joint"], first["unit"]) == (ARM.joint_names[0], "N")


def test_logs_count_together_each_filtered_on_its_own() -> None:
    logs = [exact_log(ARM, seed) for seed in (1, 2)]
    hats = [prediction(log, seed) for seed, log in enumerate(logs)]
    both = scored(logs, hats, ARM)
    alone = [scored([log], [hat], ARM) for log, hat in zip(logs, hats, strict=True)]
    for j in range(ARM.n):
        squares = [a["per_joint"][j]["rmse"] ** 2 for a in alone]
        assert both["per_joint"][j]["rmse"] == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-9)
    low, high = sorted(a["moving_relative_residual_percent"] for a in alone)
    assert low <= both["moving_relative_residual_percent"] <= high
    assert both["duration_s"] == pytest.approx(sum(log.duration for log in logs))


def test_a_joint_that_never_moves_has_no_moving_figure() -> None:
    log = exact_log(ARM)
    position, effort = log.position.copy(), log.effort.copy()
    position[:, 1] = 0.3
    effort[:, 2] = 0.0
    log = replace(log, position=position, effort=effort)
    _, still, silent = scored([log], [effort + 1.0], ARM)["per_joint"]
    assert still["moving_rmse"] is None
    assert still["moving_relative_residual_percent"] is None
    assert still["rest_rmse"] == pytest.approx(1.0)
    assert silent["relative_residual_percent"] is None
    assert silent["rmse"] == pytest.approx(1.0)


def test_relative_is_of_the_measured_norm() -> None:
    assert relative(np.array([3.0, 4.0]), np.array([3.0, 4.5])) == pytest.approx(10.0)
    assert relative(np.zeros(3), np.ones(3)) is None
