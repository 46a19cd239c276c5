"""What a result is worth on its logs: residuals by the common rule, the nominal model's beside them, motion that was
used of the robot's limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify.estimation.prediction import Predictor
from identify.estimation.scoring import Tally, explained, figures_of
from identify.logs.log import Log
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot
from identify.validation.motion_distance import motion_distance
from identify.validation.review import Review, reviewed
from identify.validation.verdict import MEAN_LIMIT, share_of_spread

NOMINAL = "nominal"
"""Name of the prediction by the robot's own description in the review of a held-out log."""

LAGS_S = 1.0
"""Residual autocorrelation is stored up to this lag [s]."""


def nominal_parameters(regressor: Regressor) -> np.ndarray | None:
    """(p,) what the robot's description says of its parameters, or None where it gives no inertia."""
    robot = regressor.robot
    if not any(joint.link.mass for joint in robot.joints):
        return None
    return regressor.parameters


def figures(reviews: Sequence[Review], robot: Robot) -> dict[str, dict[str, Any]]:
    """Residual figures of each prediction over the reviewed logs together."""
    duration = sum(review.log.duration for review in reviews)

    def tallies(name: str) -> list[Tally]:
        return [tally for review in reviews for tally in review.tallies[name]]

    return {name: figures_of(tallies(name), duration, robot) for name in reviews[0].tallies}


def figures_on(logs: Sequence[Log], predictors: Mapping[str, Predictor]) -> dict[str, dict[str, Any]]:
    """Residual figures of each prediction over the logs together, each gone through once."""
    robot = next(iter(predictors.values())).regressor.robot
    return figures([reviewed(log, predictors) for log in logs], robot)


def held_out(review: Review, training: Sequence[Review], robot: Robot) -> dict[str, Any]:
    """Figures of the first prediction of a log that was not fitted, with the NOMINAL one's where that is reviewed, and
    how far the log's motion is from that of the training logs: see `motion_distance`."""
    log, found = review.log, figures([review], robot)
    theirs = found.pop(NOMINAL, None)
    result = next(iter(found.values()))
    low = np.min([t.log.position.min(axis=0) for t in training], axis=0)
    high = np.max([t.log.position.max(axis=0) for t in training], axis=0)
    outside = ((log.position < low) | (log.position > high)).mean(axis=0)
    result["outside_training_percent"] = [float(100 * x) for x in outside]
    result["is_a_training_log"] = any(np.array_equal(log.position, t.log.position) for t in training)
    paths = [t.log.source for t in training]
    result["motion"] = motion_distance(review.states, [t.states for t in training], paths)
    why = "the joint never moves or nothing was measured"
    if theirs is None:
        same = "the log is a simulation of the robot file itself"
        why = same if log.simulated else "the robot file gives no inertias to predict with"
    result["nominal_relative_residual_percent"] = theirs and theirs["relative_residual_percent"]
    for j, joint in enumerate(result["per_joint"]):
        joint["nominal_moving_rmse"] = theirs and theirs["per_joint"][j]["moving_rmse"]
        share = share_of_spread(joint)
        joint["worse_than_mean"] = None if share is None else share >= MEAN_LIMIT
    reasons = {
        "nominal_relative_residual_percent": why,
        "nominal_moving_rmse": why,
        "worse_than_mean": "the joint never moves",
    }
    result["per_joint"] = [explained(joint, reasons) for joint in result["per_joint"]]
    return explained(result, reasons)


def residual_autocorrelation(review: Review) -> dict[str, np.ndarray]:
    """Autocorrelation (L, n) over lag (L,) [s] of the low-passed residual, rows at rest set to zero."""
    thin, rate = review.residual, review.residual_rate
    lags = np.arange(min(len(thin) - 1, int(LAGS_S * rate)))
    power = np.maximum((thin**2).sum(axis=0), 1e-300)
    values = np.array([(thin[lag:] * thin[: len(thin) - lag]).sum(axis=0) / power for lag in lags])
    return {"residual/lag": lags / rate, "residual/autocorrelation": values}


def coverage(robot: Robot, reviews: Sequence[Review]) -> dict[str, Any]:
    """How much of each joint's range, speed and acceleration the reviewed logs used."""
    lows = np.min([review.lowest for review in reviews], axis=0)
    tops, speeds, accelerations = (
        np.max([getattr(review, name) for review in reviews], axis=0) for name in ("highest", "speed", "acceleration")
    )
    rows = []
    for joint, *found in zip(robot.joints, lows, tops, speeds, accelerations, strict=True):
        least, most, speed, acceleration = map(float, found)
        low, high = joint.limits.position
        row = {
            "joint": joint.name,
            "position": [least, most],
            "position_limit_percent": _share(most - least, high - low),
            "velocity_max": speed,
            "velocity_limit_percent": _share(speed, joint.limits.velocity),
            "acceleration_max": acceleration,
            "acceleration_limit_percent": _share(acceleration, joint.limits.acceleration),
        }
        rows.append(explained(row, dict.fromkeys(row, "the robot file gives no such limit")))
    return {"per_joint": rows}


def _share(value: float, limit: float) -> float | None:
    return 100 * value / limit if np.isfinite(limit) and limit > 0 else None
