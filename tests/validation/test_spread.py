"""Logs against one another: known spreads are found again, and odd logs are named and no others."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.random import Generator, default_rng

from identify.batch.reduction import independent
from identify.validation.spread import spread

NAMES = [*(f"XX{j}" for j in range(1, 21)), *(f"{kind}{j}" for j in range(1, 5) for kind in ("Fv", "Fs", "off"))]
M = len(NAMES)
TRUE = np.linspace(-2.0, 3.0, M)
SIGMA = np.geomspace(1e-3, 0.3, M)


def correlated(rng: Generator) -> np.ndarray:
    """(m, m) covariance with standard deviations SIGMA and correlations up to about ±0.8."""
    mix = rng.standard_normal((M, M)) * np.geomspace(1, 0.2, M)
    matrix = mix @ mix.T + 0.5 * np.eye(M)
    scale = SIGMA / np.sqrt(np.diag(matrix))
    return matrix * np.outer(scale, scale)


def entries(x: np.ndarray, covariance: np.ndarray, units: list[str] | None = None) -> list[dict[str, Any]]:
    """x (k, m): logs as the reduction tells of them."""
    std = np.sqrt(np.diag(covariance))
    names = [f"log{i}" for i in range(len(x))]
    return [
        {
            "name": name,
            "unit": unit,
            "independent_parameters": independent(covariance.tolist()),
            "parameters": [
                {"name": n, "unit": "kg", "estimate": float(v), "std": float(s)}
                for n, v, s in zip(NAMES, row, std, strict=True)
            ],
        }
        for name, unit, row in zip(names, units or [""] * len(x), x, strict=True)
    ]


def test_independent_parameters_of_known_correlations() -> None:
    assert independent(np.diag([1.0, 4.0, 9.0]).tolist()) == pytest.approx(3.0)
    same = np.outer([1.0, 2.0, -3.0], [1.0, 2.0, -3.0])
    assert independent(same.tolist()) == pytest.approx(1.0)


@pytest.mark.parametrize("logs", [2, 4, 9])
def test_true_standard_deviations_are_believed_and_wrong_ones_are_not(logs: int) -> None:
    """Over 200 seeded batches of correlated estimates: rarely doubted where σ is true, whatever the correlation."""
    rng = default_rng(logs)
    doubted = named = 0
    ratios = []
    for _ in range(200):
        covariance = correlated(rng)
        x = rng.multivariate_normal(TRUE, covariance, logs)
        found = spread(entries(x, covariance))
        ratios.append(found["agreement"]["ratio"])
        doubted += found["agreement"]["sigma"] != "as stated"
        named += bool(found["odd"])
    assert np.mean(np.square(ratios)) == pytest.approx(1.0, abs=0.1)
    assert doubted <= 10  # 1 in 100 is expected
    assert named == 0
    covariance = correlated(rng)
    x = rng.multivariate_normal(TRUE, covariance, logs)
    if logs > 2:
        assert spread(entries(x, covariance / 16))["agreement"]["sigma"] == "wider than stated"
        assert spread(entries(x, covariance * 16))["agreement"]["sigma"] == "narrower than stated"


def test_mean_spread_and_ratio_of_a_parameter() -> None:
    rng = default_rng(0)
    x = TRUE + SIGMA * rng.standard_normal((3, M))
    rows = spread(entries(x, np.diag(SIGMA**2)))["parameters"]
    assert [row["name"] for row in rows] == NAMES
    for j, row in enumerate(rows):
        assert row["mean"] == pytest.approx(x[:, j].mean())
        assert row["spread"] == pytest.approx(x[:, j].std(ddof=1))
        assert row["std"] == pytest.approx(SIGMA[j])
        assert row["ratio"] == pytest.approx(row["spread"] / SIGMA[j])  # σ is the same for all logs
        assert (row["low"], row["high"]) == (x[:, j].min(), x[:, j].max())


def test_repeats_tell_of_sigma_what_different_robots_hide() -> None:
    """Friction differs from robot to robot by 30 σ; two logs of each robot differ by chance."""
    rng = default_rng(3)
    robots = np.tile(TRUE, (6, 1))
    robots[:, 20:] += 30 * SIGMA[20:] * rng.standard_normal((6, M - 20))
    x = np.repeat(robots, 2, axis=0) + SIGMA * rng.standard_normal((12, M))
    found = spread(entries(x, np.diag(SIGMA**2), [f"arm{i // 2}" for i in range(12)]))
    assert found["agreement"]["sigma"] == "wider than stated"
    assert found["within"]["sigma"] == "as stated"
    assert found["within"]["degrees_of_freedom"] == pytest.approx(6 * M)
    assert found["odd"] == []
    alone = spread(entries(x[::2], np.diag(SIGMA**2), [f"arm{i}" for i in range(6)]))
    assert alone["within"] is None


@pytest.mark.parametrize("logs", [3, 5, 8])
def test_the_odd_one_is_named_with_its_parameters(logs: int) -> None:
    rng = default_rng(logs)
    x = TRUE + SIGMA * rng.standard_normal((logs, M))
    x[1, 4] += 40 * SIGMA[4]
    x[1, 21] -= 80 * SIGMA[21]
    found = spread(entries(x, np.diag(SIGMA**2)))
    (odd,) = found["odd"]
    assert odd["name"] == "log1"
    assert [p["name"] for p in odd["parameters"]] == [NAMES[21], NAMES[4]]
    assert odd["parameters"][0]["sigmas"] == pytest.approx(80, abs=4)
    assert [row["name"] for row in found["parameters"] if row["odd"] == ["log1"]] == [NAMES[4], NAMES[21]]
    assert found["agreement"]["sigma"] == "wider than stated"
    assert found["without_odd"]["sigma"] == "as stated"
    assert found["without_odd"]["logs"] == logs - 1


def test_robots_that_all_differ_have_no_odd_one_but_a_worn_one_is() -> None:
    """Of 40 fleets whose friction spreads by 30 σ nearly none has an odd robot; one with 20 times that is found."""
    rng = default_rng(7)
    alarms = found_worn = 0
    for _ in range(40):
        x = TRUE + SIGMA * rng.standard_normal((8, M))
        x[:, 20:] += 30 * SIGMA[20:] * rng.standard_normal((8, M - 20))
        alarms += bool(spread(entries(x, np.diag(SIGMA**2)))["odd"])
        x[5, 23] = np.median(x[:, 23]) + 600 * SIGMA[23]
        found_worn += "log5" in [row["name"] for row in spread(entries(x, np.diag(SIGMA**2)))["odd"]]
    assert alarms <= 2
    assert found_worn >= 38


@pytest.mark.parametrize("logs", [0, 1])
def test_less_than_two_logs_compare_nothing(logs: int) -> None:
    found = spread(entries(np.tile(TRUE, (logs, 1)), np.diag(SIGMA**2)))
    assert found["logs"] == logs
    assert found["agreement"] is found["within"] is found["without_odd"] is None
    assert found["odd"] == []
    assert len(found["parameters"]) == (M if logs else 0)
    assert all(row["spread"] is None and row["ratio"] is None for row in found["parameters"])


def test_parameters_that_not_every_log_has_are_left_out() -> None:
    made = entries(np.tile(TRUE, (2, 1)), np.diag(SIGMA**2))
    made[0]["parameters"] = made[0]["parameters"][::-1]
    del made[1]["parameters"][3]
    found = spread(made)
    assert [row["name"] for row in found["parameters"]] == [name for name in reversed(NAMES) if name != NAMES[3]]
    assert {row["name"]: row["mean"] for row in found["parameters"]}[NAMES[7]] == pytest.approx(TRUE[7])
