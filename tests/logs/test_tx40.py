"""The measured log of a TX40 through datasets/tx40.toml, against its decoding written out by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from beside import shared, tx40_recording

from identify.logs.reading import read_log
from identify.logs.triage import inspect, refusals

MAP = Path(__file__).parents[2] / "datasets" / "tx40.toml"


@pytest.fixture(scope="module")
def log():
    return read_log(tx40_recording(), MAP)


def test_shape_and_rate(log) -> None:
    assert log.position.shape == log.effort.shape == (45_000, 6)
    assert log.rate_hz == pytest.approx(5000)
    assert log.joints == tuple(f"joint_{j}" for j in range(1, 7))
    assert (log.velocity, log.findings, log.dropped) == (None, (), 0)


def test_positions_and_torques_are_those_of_the_joints(log) -> None:
    """Axes 1 to 5 by their ratios; axis 6 is driven through axis 5: m6 = 32 q5 + 32 q6, so Γ5 gains 32 Γm6."""
    motor = np.genfromtxt(shared("data", "tx40", "motor_position.csv"), delimiter=",", skip_header=1)
    torque = np.genfromtxt(shared("data", "tx40", "motor_torque.csv"), delimiter=",", skip_header=1)
    ratios = np.array([32.0, 32.0, 45.0, -48.0, 45.0])
    position = np.empty_like(motor)
    position[:, :5] = motor[:, :5] / ratios
    position[:, 5] = motor[:, 5] / 32.0 - motor[:, 4] / 45.0
    position[:, 1] -= np.pi / 2
    position[:, 2] += np.pi / 2
    effort = np.column_stack([torque[:, :5] * ratios, 32.0 * torque[:, 5]])
    effort[:, 4] += 32.0 * torque[:, 5]
    np.testing.assert_allclose(log.position, position, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(log.effort, effort, rtol=1e-13, atol=1e-13)


def test_triage_agrees_with_what_is_known_of_it(log) -> None:
    """Counts from the data's README: 4,133 repeated rows, 1.5 s at rest at the end."""
    found = inspect(log)
    motor = np.genfromtxt(shared("data", "tx40", "motor_position.csv"), delimiter=",", skip_header=1)
    assert (np.diff(motor, axis=0) == 0).all(axis=1).sum() == 4133
    assert min(facts.repeated_share for facts in found.joints) * 44_999 >= 4133
    assert found.motion == pytest.approx(7.5, abs=0.1)
    assert refusals(found) == []
