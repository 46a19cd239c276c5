"""Inertial and friction parameters of a robot arm from its logs: the public names, handed on."""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "Robot": "identify.robot.robot",
    "load_robot": "identify.robot.library",
    "base_parameters": "identify.symbolic.base_parameters",
    "Regressor": "identify.regressor.regressor",
    "NormalEquations": "identify.regressor.normal_equations",
    "Log": "identify.logs.log",
    "read_log": "identify.logs.reading",
    "Trajectory": "identify.experiment.trajectory",
    "excite": "identify.workflow",
    "simulate": "identify.workflow",
    "fit": "identify.workflow",
    "export": "identify.workflow",
    "payload": "identify.payload_workflow",
    "Identification": "identify.estimation.identification",
}

__all__ = [*_HOMES, "__version__"]


def __getattr__(name: str) -> Any:
    """Import a public name from its home when it is first asked for, so that `import identify` stays quick."""
    if name not in _HOMES:
        raise AttributeError(f"module 'identify' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
