"""What a result is worth on a log: residuals by the common rule, the nominal model's beside them, curves to draw."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identify.estimation.identification import predicted_effort
from identify.estimation.motion import clock, motion_at, motion_pieces
from identify.estimation.scoring import CUTOFF_HZ, explained, pieces, scored
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot

CURVE_ROWS = 3000
"""Most rows a curve is stored with."""

LAGS_S = 1.0
"""Residual autocorrelation is stored up to this lag [s]."""


def nominal_parameters(regressor: Regressor) -> np.ndarray | None:
    """(p,) what the robot's description says of its parameters, or None where it gives no inertia."""
    robot = regressor.robot
    if not any(joint.link.mass for joint in robot.joints):
        return None
    return regressor.parameters


def figures(
    regressor: Regressor, logs: Sequence[Log], parameters: np.ndarray, settings: Settings
) -> tuple[dict[str, Any], list[np.ndarray]]:
    """Residual figures over the logs together, and the prediction (N, n) for each."""
    predictions = [predicted_effort(regressor, log, parameters, settings) for log in logs]
    return scored(logs, predictions, regressor.robot), predictions


def held_out(
    regressor: Regressor,
    log: Log,
    training: Sequence[Log],
    parameters: np.ndarray,
    settings: Settings,
    nominal: np.ndarray | None,
) -> tuple[dict[str, Any], np.ndarray]:
    """Figures of a log that was not fitted, with the nominal model's and how far it leaves the training positions."""
    theirs = None if nominal is None else figures(regressor, [log], nominal, settings)[0]
    result, (prediction,) = figures(regressor, [log], parameters, settings)
    low = np.min([t.position.min(axis=0) for t in training], axis=0)
    high = np.max([t.position.max(axis=0) for t in training], axis=0)
    outside = ((log.position < low) | (log.position > high)).mean(axis=0)
    result["outside_training_percent"] = [float(100 * x) for x in outside]
    result["is_a_training_log"] = any(np.array_equal(log.position, t.position) for t in training)
    why = "the joint never moves or nothing was measured"
    if theirs is None:
        same = "the log is a simulation of the robot file itself"
        why = same if log.simulated else "the robot file gives no inertias to predict with"
    result["nominal_relative_residual_percent"] = theirs and theirs["relative_residual_percent"]
    for j, joint in enumerate(result["per_joint"]):
        joint["nominal_moving_rmse"] = theirs and theirs["per_joint"][j]["moving_rmse"]
    reasons = {"nominal_relative_residual_percent": why, "nominal_moving_rmse": why}
    result["per_joint"] = [explained(joint, reasons) for joint in result["per_joint"]]
    return explained(result, reasons), prediction


def curves(
    prefix: str, regressor: Regressor, log: Log, prediction: np.ndarray, parameters: np.ndarray, settings: Settings
) -> dict[str, np.ndarray]:
    """Arrays for figures under `prefix`, on the log's even clock: at most CURVE_ROWS rows, efforts low-passed at 10 Hz.
    SI."""
    ticks = clock(log)
    step = max(1, int(np.ceil(log.samples / CURVE_ROWS)))
    base = np.where(np.arange(regressor.p) < len(regressor.base.names), parameters, 0.0)
    parts: dict[str, list[np.ndarray]] = {}
    for x in pieces(log, prediction):
        motion = motion_at(log, x.around, settings.position_cutoff_hz, ticks)
        rigid = regressor.inverse_dynamics(motion.q, motion.dq, motion.ddq, base)
        measured, error, rigid = x.low_passed(x.effort, x.error, rigid)
        found = {"time": motion.time[x.inside], "moving": x.moves[x.inside], "measured": measured}
        found |= {"predicted": measured - error, "rigid": rigid}
        moved = {"position": motion.q, "velocity": motion.dq, "acceleration": motion.ddq}
        found |= {name: values[x.inside] for name, values in moved.items()}
        for name, values in found.items():
            kept = values[-x.rows.start % step :: step]
            kind = values.dtype if name in ("time", "moving") else np.float32
            parts.setdefault(name, []).append(kept.astype(kind))
    return {f"{prefix}/{name}": np.concatenate(values) for name, values in parts.items()}


def residual_autocorrelation(log: Log, prediction: np.ndarray) -> dict[str, np.ndarray]:
    """Autocorrelation (L, n) over lag (L,) [s] of the low-passed residual, rows at rest set to zero."""
    rate = log.rate_hz
    step = max(1, int(rate / (8 * CUTOFF_HZ)))
    smooth = ((x.rows.start, *x.low_passed(x.error * x.moves)) for x in pieces(log, prediction))
    thin = np.concatenate([error[-start % step :: step].copy() for start, error in smooth])
    lags = np.arange(min(len(thin) - 1, int(LAGS_S * rate / step)))
    power = np.maximum((thin**2).sum(axis=0), 1e-300)
    values = np.array([(thin[lag:] * thin[: len(thin) - lag]).sum(axis=0) / power for lag in lags])
    return {"residual/lag": lags * step / rate, "residual/autocorrelation": values}


def coverage(robot: Robot, logs: Sequence[Log], settings: Settings) -> dict[str, Any]:
    """How much of each joint's range, speed and acceleration the training logs used."""
    motions = (m for log in logs for _, m in motion_pieces(log, settings.position_cutoff_hz))
    extremes = np.array([[m.q.min(0), m.q.max(0), np.abs(m.dq).max(0), np.abs(m.ddq).max(0)] for m in motions])
    lows, (_, tops, speeds, accelerations) = extremes.min(axis=0)[0], extremes.max(axis=0)
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


def top_speeds(regressor: Regressor, logs: Sequence[Log], settings: Settings) -> np.ndarray:
    """(arms,) highest speed of each joint and coupled motor [rad/s or m/s] in the logs."""
    assert regressor.extra is not None
    motions = (m for log in logs for _, m in motion_pieces(log, settings.position_cutoff_hz))
    return np.max([np.abs(regressor.extra.speeds(m.dq)).max(axis=0) for m in motions], axis=0)


def _share(value: float, limit: float) -> float | None:
    return 100 * value / limit if np.isfinite(limit) and limit > 0 else None
