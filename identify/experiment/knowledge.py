"""What is known before an experiment: how loud the effort's noise is, and what earlier experiments told."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot

EFFORT_NOISE = 1e-3
"""Noise of the effort that is assumed where nothing is known, as a share of the effort limit: `simulate`'s standard."""

RATE_HZ = 1000.0
"""Sampling rate at which it is assumed to be white."""


@dataclass(frozen=True, eq=False)
class Knowledge:
    """density (n,): variance of each joint's effort noise times the time between independent samples [(N·m)²·s or
    N²·s], what is left of it averaged over a second; `noise` says in words where it is from. information (p, p): of
    earlier experiments in the order of `Regressor.names`, the inverse of their covariance; None without any."""

    density: np.ndarray
    noise: str
    information: np.ndarray | None = None


def assumed(robot: Robot) -> Knowledge:
    """Noise of EFFORT_NOISE of the effort limits, sampled at RATE_HZ; relative to 1 N·m or N where one is infinite."""
    sigma = EFFORT_NOISE * noise_scale(robot)
    words = f"{100 * EFFORT_NOISE:g} % of the effort limits, white at {RATE_HZ:g} Hz"
    return Knowledge(sigma**2 / RATE_HZ, words)


def noise_scale(robot: Robot) -> np.ndarray:
    """(n,) size of the noise expected on each joint's effort: its effort limit, 1 where that is infinite."""
    effort = np.array([joint.limits.effort for joint in robot.joints])
    return np.where(np.isfinite(effort), effort, 1.0)


def joined(known: list[Knowledge], regressor: Regressor) -> Knowledge:
    """Several experiments' knowledge as one: informations add up, the last one's noise counts."""
    total = np.zeros((regressor.p, regressor.p))
    for one in known:
        if one.information is not None:
            total += one.information
    return Knowledge(known[-1].density, known[-1].noise, total)
