"""The truth of a simulated log, for the report's comparison alone: nothing that estimates ever reads it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from identify.logs.log import Log
from identify.regressor.regressor import Regressor


def true_parameters(regressor: Regressor, log: Log) -> np.ndarray | None:
    """(p,) true values in the order of the regressor's names, from LOG.truth.json beside the log.

    None where there is no such file, it belongs to another log, or it makes no sense.
    """
    path = Path(log.source).with_suffix(".truth.json") if Path(log.source).name else None
    if path is None or not path.is_file():
        return None
    try:
        truth = json.loads(path.read_text(encoding="utf-8"))
        if (
            truth.get("log_sha256") not in (None, log.sha256)
            or len(truth["standard"]) != regressor.base.matrix.shape[1]
        ):
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
