"""`generate`: the text of the files that a controller carries along."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from identify.codegen.c import c_files
from identify.codegen.functions import models
from identify.codegen.inverse import left_out
from identify.codegen.python import python_files
from identify.codegen.samples import pose_samples, samples
from identify.codegen.text import identifier
from identify.errors import InputError
from identify.regressor.friction import STRIBECK_VELOCITY, FrictionConstants
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot

__all__ = ["LANGUAGES", "generate", "identifier", "left_out"]

LANGUAGES = {"c": c_files, "python": python_files}


def generate(
    robot: Robot,
    language: str = "c",
    parameters: np.ndarray | None = None,
    covariance: np.ndarray | None = None,
    friction: Collection[str] = (),
    coulomb_velocity: float | None = None,
    stribeck_velocity: float = STRIBECK_VELOCITY,
) -> dict[str, str]:
    """{file name: text} of the robot's models in C99 ("c": source and header) or Python ("python": one module).

    parameters (p,) in the order of Regressor(robot, friction).names; by default what the robot's description states.
    covariance (p, p) of parameters that were identified, written beside them. friction: its forms beside the plain
    ones; coulomb_velocity [rad/s or m/s]: speed up to which the sign grows linearly, exact where it is None;
    stribeck_velocity: see `identify.regressor.friction`. Inverse geometry is in the code unless `left_out` says why
    not. The text is the same, byte by byte, whenever robot, parameters and covariance are. Raises InputError for
    another language, and where parameters or covariance have another shape or are not finite.
    """
    if language not in LANGUAGES:
        raise InputError(f"language {language!r} is not known; choose one of {', '.join(LANGUAGES)}")
    regressor = Regressor(robot, friction, constants=FrictionConstants(stribeck_velocity))
    theta = np.asarray(regressor.parameters if parameters is None else parameters, dtype=float)
    if theta.shape != (regressor.p,) or not np.isfinite(theta).all():
        raise InputError(
            f"parameters of shape {theta.shape}; give {regressor.p} finite numbers, in the order of Regressor.names"
        )
    origin = "what the robot's description states" if parameters is None else "as given"
    if covariance is not None:
        origin = "identified, with their standard deviations and covariance"
        covariance = np.asarray(covariance, dtype=float)
        if covariance.shape != (regressor.p, regressor.p) or not np.isfinite(covariance).all():
            raise InputError(
                f"covariance of shape {covariance.shape}; give {regressor.p} by {regressor.p} finite numbers"
            )
    made = models(regressor, theta, covariance, origin, coulomb_velocity)
    return LANGUAGES[language](made, samples(made), pose_samples(made), identifier(robot.name))
