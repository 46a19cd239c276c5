"""The truth of a simulated log, for the report's comparison alone: nothing that estimates ever reads it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from identify.logs.log import Log
from identify.regressor.regressor import Regressor

FRICTION_KEYS = ("viscous", "coulomb", "offset")


def true_parameters(regressor: Regressor, log: Log) -> np.ndarray | None:
    """(p,) true values in the order of the regressor's names, from LOG.truth.json beside the log.

    None where there is no such file, or it belongs to another log.
    """
    path = Path(log.source).with_suffix(".truth.json")
    if not log.source or not path.is_file():
        return None
    try:
        truth = json.loads(path.read_text(encoding="utf-8"))
        if (
            truth.get("log_sha256") not in (None, log.sha256)
            or len(truth["standard"]) != regressor.base.matrix.shape[1]
        ):
            return None
        values = list(regressor.base.matrix @ np.array(truth["standard"], dtype=float))
        values += [float(joint[key]) for joint in truth["friction"] for key in FRICTION_KEYS]
        extra = {entry["name"]: float(entry["value"]) for entry in truth.get("transmission", [])}
        values += [extra.get(name, 0.0) for name in regressor.names[len(values) :]]
    except (ValueError, KeyError, TypeError, OSError):
        return None
    return np.array(values) if len(values) == len(regressor.names) else None
