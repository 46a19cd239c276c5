"""How well a predicted effort fits a measured one: the same rule for every model, log and tool.

Both efforts go through one zero-phase Butterworth low-pass at 10 Hz, every sample counts. "Moving": before the filter,
rows of a joint that is at rest are set to zero in both.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identify.estimation.motion import low_pass, uniform
from identify.estimation.settings import STILL
from identify.logs.log import Log
from identify.robot.robot import Robot

CUTOFF_HZ = 10.0
SPEED_CUTOFF_HZ = 20.0
WHY_NOT = {
    "relative_residual_percent": "the measured effort is zero",
    "moving_relative_residual_percent": "the joint never moves with any effort",
    "moving_rmse": "the joint never moves",
    "rest_rmse": "the joint is never at rest",
}


def speed_of(log: Log, joints: slice = slice(None)) -> np.ndarray:
    """(N, joints) measured velocity where the log has it, else differences of the position low-passed at 20 Hz."""
    if log.velocity is not None:
        return log.velocity[:, joints]
    return np.gradient(low_pass(log.position[:, joints], SPEED_CUTOFF_HZ, log.rate_hz), log.time, axis=0)


def relative(measured: np.ndarray, predicted: np.ndarray) -> float | None:
    """100·‖measured − predicted‖ / ‖measured‖ [%]; None where nothing was measured."""
    size = np.linalg.norm(measured)
    return float(100 * np.linalg.norm(measured - predicted) / size) if size > 0 else None


def explained(row: dict[str, Any], reasons: dict[str, str]) -> dict[str, Any]:
    """The row with, for each of its values that is None, the reason beside it as "<key>_reason"."""
    return row | {f"{key}_reason": text for key, text in reasons.items() if key in row and row[key] is None}


def scored(logs: Sequence[Log], predictions: Sequence[np.ndarray], robot: Robot) -> dict[str, Any]:
    """Figures of predictions (N, n), one a log: over all, moving and at rest, logs and joints together and per joint.

    RMSE in N·m or N, residuals in percent. Each log is filtered on its own. rmse and moving_rmse are over every sample,
    the latter with rows at rest set to zero before the filter; rest_rmse is that of the samples at rest.
    """
    joints = []
    # Squared norms of error and effort, over all samples and moving: one joint at a time, as a log may be long.
    norms = np.zeros((2, 2))
    for j, joint in enumerate(robot.joints):
        parts = [_filtered(log, hat, slice(j, j + 1)) for log, hat in zip(logs, predictions, strict=True)]
        tau, guess, tau_moving, guess_moving, moves = (np.concatenate(x)[:, 0] for x in zip(*parts, strict=True))
        error, moving_error = tau - guess, tau_moving - guess_moving
        norms += [[error @ error, tau @ tau], [moving_error @ moving_error, tau_moving @ tau_moving]]
        joints.append(
            {
                "joint": joint.name,
                "unit": joint.effort_unit,
                "rmse": _rms(error),
                "relative_residual_percent": relative(tau, guess),
                "moving_relative_residual_percent": relative(tau_moving, guess_moving),
                "moving_rmse": _rms(moving_error) if moves.any() else None,
                "rest_rmse": _rms(error[~moves]) if not moves.all() else None,
                "max_abs_error": float(np.abs(error).max()),
                "std_of_signal": float(tau.std()),
                "rest_share_percent": float(100 * (~moves).mean()),
            }
        )
    whole, moving = (float(100 * np.sqrt(error / size)) if size > 0 else None for error, size in norms)
    total = {
        "relative_residual_percent": whole,
        "moving_relative_residual_percent": moving,
        "per_joint": [explained(joint, WHY_NOT) for joint in joints],
        "duration_s": float(sum(log.duration for log in logs)),
    }
    return explained(total, WHY_NOT)


def _filtered(log: Log, predicted: np.ndarray, joints: slice) -> tuple[np.ndarray, ...]:
    """Of these joints: measured and predicted effort low-passed, both with rows at rest zero, and which rows move."""
    assert log.effort is not None
    # The rule interpolates whatever the clock; figures then agree to the last digit.
    channels = (log.effort[:, joints], predicted[:, joints], speed_of(log, joints))
    _, (effort, hat, speed), rate = uniform(log, *channels, jitter=0.0)
    cutoff = min(CUTOFF_HZ, 0.4 * rate)
    moves = np.abs(speed) > STILL
    smooth = [low_pass(x, cutoff, rate) for x in (effort, hat, effort * moves, hat * moves)]
    return (*smooth, moves)


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))
