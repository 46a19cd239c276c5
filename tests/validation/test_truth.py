"""The truth of a simulated log is found beside it, or not at all; it never stops a fit."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exact_logs import arm, exact_log

from identify.experiment.simulation import truth
from identify.logs.log import Log
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.robot import Robot
from identify.validation.truth import true_parameters


def beside(folder: Path, robot: Robot, **changes: object) -> Log:
    """A log in the folder, with the truth of its robot beside it."""
    log = replace(exact_log(robot), source=str(folder / "run.mcap"))
    table = truth(robot, "standard", 0, {}) | {"log_sha256": log.sha256} | changes
    (folder / "run.truth.json").write_text(json.dumps(table))
    return log


@pytest.mark.parametrize("robot", [arm(1), arm(2), load_robot("rx90"), load_robot("tx40")])
def test_truth_is_in_the_order_of_the_regressor(robot: Robot, tmp_path: Path) -> None:
    """And makes the same effort, where offsets are folded into inertias and motors are coupled too."""
    regressor = Regressor(robot)
    found = true_parameters(regressor, beside(tmp_path, robot))
    np.testing.assert_allclose(found, regressor.parameters, rtol=1e-12, atol=1e-14)


def test_without_a_file_there_is_no_truth(tmp_path: Path) -> None:
    robot = arm(1)
    log = beside(tmp_path, robot)
    for source in ("", "somewhere/else.mcap", str(tmp_path / "other.mcap")):
        assert true_parameters(Regressor(robot), replace(log, source=source)) is None


@pytest.mark.parametrize(
    "changes",
    [
        {"log_sha256": "0" * 64},
        {"standard": [1.0] * 22},
        {"standard": ["heavy"] * 33},
        {"standard": [float("nan")] * 33},
        {"standard": None},
        {"friction": None},
        {"friction": [{"joint": "joint_1"}]},
        {"transmission": [{"name": "Iam6"}]},
    ],
)
def test_a_truth_that_is_not_this_logs_is_none(changes: dict[str, object], tmp_path: Path) -> None:
    robot = arm(1)
    assert true_parameters(Regressor(robot), beside(tmp_path, robot)) is not None
    assert true_parameters(Regressor(robot), beside(tmp_path, robot, **changes)) is None


@pytest.mark.parametrize("content", [b"", b"[]", b"null", b"{", b"\xff\xff", b"{}"])
def test_a_damaged_truth_is_none(content: bytes, tmp_path: Path) -> None:
    robot = arm(1)
    log = beside(tmp_path, robot)
    (tmp_path / "run.truth.json").write_bytes(content)
    assert true_parameters(Regressor(robot), log) is None
