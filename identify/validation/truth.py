"""The truth of a simulated log, for the report's comparison alone: nothing that estimates ever reads it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from identify.logs.log import Log
from identify.regressor.regressor import Regressor


def true_parameters(regressor: Regressor, log: Log) -> np.ndarray | None:
    """(p,) true values in the order of the regressor's names, from LOG.truth.json beside the log.

    None where there is no such file, it belongs to another log, or it makes no sense.
    """
    try:
        truth = _read(log)
        if truth is None or len(truth["standard"]) != regressor.base.matrix.shape[1]:
            return None
        extra = {
            f"{name}{j}": float(joint[key])
            for j, joint in enumerate(truth["friction"], 1)
            for name, key in (("Fv", "viscous"), ("Fs", "coulomb"), ("off", "offset"))
        }
        extra |= {entry["name"]: float(entry["value"]) for entry in truth.get("transmission", [])}
        theta = regressor.theta(np.array(truth["standard"], dtype=float), extra)
    except (ValueError, KeyError, TypeError, AttributeError, OSError):
        return None
    return theta if np.isfinite(theta).all() else None


def true_load(log: Log) -> np.ndarray | None:
    """(10,) XX … M of the load that a simulated log was made with, about O_n in the axes of R_n, from LOG.truth.json.

    None where there is no such file, it belongs to another log, it tells of no load or makes no sense.
    """
    try:
        truth = _read(log)
        load = np.array([] if truth is None else truth["payload"], dtype=float)
    except (ValueError, KeyError, TypeError, AttributeError, OSError):
        return None
    return load if load.shape == (10,) and np.isfinite(load).all() else None


def _read(log: Log) -> dict[str, Any] | None:
    """What LOG.truth.json holds, None where there is none for this log. ValueError or OSError for a damaged one."""
    path = Path(log.source).with_suffix(".truth.json") if Path(log.source).name else None
    if path is None or not path.is_file():
        return None
    truth: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return truth if truth.get("log_sha256") in (None, log.sha256) else None
