"""What earlier results tell the design of the next experiment: parameters, their covariance, and the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identify.errors import InputError
from identify.estimation.identification import Identification
from identify.estimation.identified_robot import identified_robot
from identify.estimation.physical import information_of
from identify.experiment.excitation import Excitation, designed_excitation
from identify.experiment.knowledge import Knowledge, standard_deviations
from identify.regressor.regressor import Regressor
from identify.robot.robot import GEOMETRY, Robot

RESIDUAL_BAND_HZ = 10.0
"""Band of the residuals whose size a record gives: white noise in it has this density where nothing tells it better."""


def next_excitation(robot: Robot, results: Sequence[Identification], *arguments: Any, **options: Any) -> Excitation:
    """`designed_excitation` that adds most to what earlier results tell, inside the effort limits by the last one's
    parameters; without any, by the robot's own."""
    known = None
    if results:
        robot, known = earlier(robot, results)
    return designed_excitation(robot, *arguments, known=known, **options)


def earlier(robot: Robot, results: Sequence[Identification]) -> tuple[Robot, Knowledge]:
    """The robot with the last result's links, drives and friction, as physics allows them; and what all results
    together tell of its parameters, with the last one's noise.

    InputError where a result is of another robot, or holds no links that physics allows.
    """
    for result in results:
        _check_same(robot, result.robot)
    found = identified_robot(results[-1])
    joints = tuple(
        replace(own, link=one.link, drive=one.drive) for own, one in zip(robot.joints, found.joints, strict=True)
    )
    guess = replace(robot, joints=joints, transmission=found.transmission)
    regressor = Regressor(guess)
    total = sum((information(regressor, result) for result in results), np.zeros((regressor.p, regressor.p)))
    words = "as in the earlier result's residuals" if len(results) == 1 else "as in the last result's residuals"
    return guess, Knowledge(density(regressor, results[-1]), words, total)


def information(regressor: Regressor, result: Identification) -> np.ndarray:
    """(p, p) inverse of the covariance of the regressor's parameters, those that only the result has left open."""
    at = [result.names.index(name) for name in regressor.names]
    return information_of(result.covariance[np.ix_(at, at)])


def density(regressor: Regressor, result: Identification) -> np.ndarray:
    """(n,) density of the effort's noise [effort²·s]: of the joints' residuals in proportion, and of the size by which
    white noise on the recorded motion gives the torque model's stated standard deviations (their median)."""
    rows = result.record["fit"]["per_joint"]
    rmse = np.array([row["moving_rmse"] or row["rmse"] or 0.0 for row in rows])
    shape = np.maximum(rmse, 1e-6 * max(rmse.max(), 1e-12)) ** 2 / (2 * RESIDUAL_BAND_HZ)
    stated = _torque_deviations(result)
    names = [name for name in regressor.names if name in stated]
    recorded = _recorded_information(regressor, result, shape)
    if recorded is None or not names:
        return shape
    expected = dict(zip(regressor.names, standard_deviations(recorded), strict=True))
    return shape * float(np.median([(stated[name] / expected[name]) ** 2 for name in names]))


def _torque_deviations(result: Identification) -> dict[str, float]:
    """Standard deviations by the torque model, by name; of the energy model's result too."""
    model = result.record["models"].get("torque")
    return {row["name"]: row["std"] for row in model["parameters"]} if model else {}


def _recorded_information(regressor: Regressor, result: Identification, density: np.ndarray) -> np.ndarray | None:
    """(p, p) what the training motions would tell with white noise of this density; None where none are kept."""
    total, logs = np.zeros((regressor.p, regressor.p)), 0
    while f"train{logs}/time" in result.curves:
        time, moving, q, dq, ddq = (
            np.asarray(result.curves[f"train{logs}/{key}"], dtype=float)
            for key in ("time", "moving", "position", "velocity", "acceleration")
        )
        step = (time[-1] - time[0]) / max(len(time) - 1, 1)
        weight = moving * np.sqrt(step / density)
        rows = (regressor.torque(q, dq, ddq) * weight[:, :, None]).reshape(-1, regressor.p)
        total += rows.T @ rows
        logs += 1
    return total if logs else None


def _check_same(robot: Robot, other: Robot) -> None:
    """InputError where the robots differ in joints or geometry."""
    kinds, numbers = (
        [[tuple(getattr(joint, key) for key in keys) for joint in one.joints] for one in (robot, other)]
        for keys in (("name", "type", "parent"), GEOMETRY)
    )
    same = kinds[0] == kinds[1] and np.allclose(numbers[0], numbers[1], rtol=0, atol=1e-9)
    if not same or not np.allclose(robot.gravity, other.gravity, rtol=0, atol=1e-9):
        raise InputError(
            f"{robot.name}: the earlier result is of another robot ({other.name}, {other.n} joints); "
            "give the description that was fitted, with the same joints in the same order"
        )
