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


def parameter_sizes(regressor: Regressor) -> np.ndarray:
    """(p,) |value| of each parameter as described, for an offset at least its joint's Coulomb friction."""
    size = dict(zip(regressor.names, np.abs(regressor.parameters), strict=True))
    return np.array([max(size[name], size.get(name.replace("off", "Fs"), 0.0)) for name in regressor.names])


def standard_deviations(information: np.ndarray) -> np.ndarray:
    """(p,) roots of the diagonal of its inverse; infinite for parameters that it can't tell from others."""
    size = np.sqrt(np.diag(information))
    scaled = information / np.outer(*(np.where(size > 0, size, 1.0),) * 2)
    values, vectors = np.linalg.eigh(scaled)
    told = values > 1e-13 * values[-1]
    variance = (vectors[:, told] ** 2 / values[told]).sum(axis=1)
    lost = np.abs(vectors[:, ~told]).max(axis=1, initial=0.0) > 1e-6
    return np.where(lost, np.inf, np.sqrt(variance)) / np.where(size > 0, size, 1.0)


def root_of(information: np.ndarray) -> np.ndarray:
    """(p, p) rows R with RᵀR = information (p, p), which may leave directions out, whatever the units of its
    parameters."""
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(size, size))
    return np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * size
