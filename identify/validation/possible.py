"""The robot that physics allows nearest to a fit, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from identify.errors import InputError
from identify.estimation.fitting import ModelFit
from identify.estimation.physical import PULL, Consistent, information_of, nearest_consistent
from identify.estimation.reference import Reference
from identify.robot.robot import Robot


def check_prior(robot: Robot, prior: float | None) -> None:
    """InputError where a prior is asked for and the robot's description has no links to be one."""
    if prior is None:
        return
    if not (np.isfinite(prior) and prior > 0):
        raise InputError(f"prior {prior!r}: give a standard deviation above 0, in shares of the robot file's values")
    if not any(joint.link.mass for joint in robot.joints):
        raise InputError(
            f"{robot.name}: its file gives no link a mass, so that there is no prior; give links, or leave out --prior"
        )


def possible_robot(fit: ModelFit, bodies: Reference, prior: float | None) -> tuple[Consistent | None, str]:
    """The robot nearest to the estimate that physics allows, or None and why there is none.

    bodies: what stands for what the data leave open. prior: standard deviation of the description's links and actuator
    inertias in shares of them, None where they decide only what the data leave open. Masses keep to the bounds of the
    robot's file.
    """
    bounds = np.array([joint.limits.mass for joint in fit.regressor.robot.joints])
    bounded = bool((bounds[:, 0] > 0).any() or np.isfinite(bounds[:, 1]).any())
    try:
        found = nearest_consistent(
            fit.regressor,
            fit.estimate.parameters,
            information_of(fit.estimate.covariance),
            bodies,
            bounds if bounded else None,
            PULL if prior is None else 1 / prior**2,
            fit.settings.coulomb_velocity,
        )
    except InputError as error:
        return None, str(error)
    return found, ""


def cost(fit: ModelFit, found: Consistent, before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, Any]:
    """What consistency costs: χ² of the way from the estimate, and what the residual on the training logs grows by, in
    points of the torque [%] and in shares of itself [%]; beside it how well the residual of so many independent samples
    is known at all [%]. before, after: residual figures of the estimate and of the possible robot."""
    key = "relative_residual_percent"
    estimate = fit.estimate
    free = max(estimate.effective_samples - len(estimate.parameters), 1.0)
    result: dict[str, Any] = {"chi_squared": found.cost, "effective_samples": estimate.effective_samples}
    if before[key] and after[key]:
        result |= {
            "residual_points": after[key] - before[key],
            "residual_growth_percent": 100 * (after[key] / before[key] - 1),
        }
    return result | {"residual_uncertainty_percent": float(100 / np.sqrt(2 * free))}
