"""`generate`: the text of the files that a controller carries along."""

from __future__ import annotations

import re
import unicodedata

import numpy as np

from identify.codegen.c import c_files
from identify.codegen.functions import models
from identify.codegen.python import python_files
from identify.codegen.samples import samples
from identify.errors import InputError
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot

LANGUAGES = {"c": c_files, "python": python_files}


def generate(robot: Robot, language: str = "c", parameters: np.ndarray | None = None) -> dict[str, str]:
    """{file name: text} of the robot's models in C99 ("c": source and header) or Python ("python": one module).

    parameters (p,) in the order of Regressor(robot).names; by default what the robot's description states. The text is
    the same, byte by byte, whenever robot and parameters are. Raises InputError for another language, and where
    parameters have another length or are not finite.
    """
    if language not in LANGUAGES:
        raise InputError(f"language {language!r} is not known; choose one of {', '.join(LANGUAGES)}")
    regressor = Regressor(robot)
    theta = np.asarray(regressor.parameters if parameters is None else parameters, dtype=float)
    if theta.shape != (regressor.p,) or not np.isfinite(theta).all():
        raise InputError(
            f"parameters of shape {theta.shape}; give {regressor.p} finite numbers, in the order of Regressor.names"
        )
    made = models(robot, theta)
    return LANGUAGES[language](made, samples(made), identifier(robot.name))


def identifier(name: str) -> str:
    """The robot's name as an identifier of both languages: "Stäubli RX-90" is staubli_rx_90."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    word = re.sub(r"[^a-z0-9]+", "_", plain.lower()).strip("_")
    return word if word and word[0].isalpha() else f"robot_{word}".rstrip("_")
