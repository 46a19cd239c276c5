"""payload.json: everything the result says of a load, put together from the rooms' parts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identify.errors import InputError
from identify.estimation.drive_gains import DriveGains
from identify.estimation.identification import FRICTION, Identification
from identify.estimation.load_body import body_values, nearest_body, seen_from
from identify.estimation.payload import FRICTION_CHANGE, LoadEstimate, friction_scales
from identify.estimation.payload_result import FORMAT
from identify.estimation.scoring import explained
from identify.logs.log import Log
from identify.logs.triage import Findings
from identify.record import head
from identify.regressor.regressor import Regressor
from identify.robot.robot import IDENTITY, LINK_PARAMETERS, LINK_UNITS, Link, Robot
from identify.robot.transforms import inverse
from identify.validation.verdict import WELL_KNOWN

BODY = ("mass", "com_x", "com_y", "com_z", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
BODY_UNITS = ("kg", *("m",) * 3, *("kg·m²",) * 6)
KINDS = {"kg": "the mass", "m": "the distance from the origin", "kg·m": "the length of the vector"}
"""What a standard deviation is stated in percent of, by unit; inertias: of the largest moment of inertia."""

TINY = 1e-6
"""Relative standard deviation that a stated mass is given where it must have one."""


def payload_head(
    result: Identification,
    folder: str,
    digest: str,
    logs: Sequence[Log],
    test: Sequence[Log],
    triage: Sequence[Findings],
    command: str,
) -> dict[str, Any]:
    """What is known before anything is estimated. folder, digest: of the unloaded fit; triage: of logs, then test."""
    record = head(result.robot, "torque", logs, test, command, triage)
    for row in record["logs"]:
        row["role"] = "loaded" if row["role"] == "train" else row["role"]
    fitted = result.record
    del record["model"], record["seed"]
    return record | {
        "format": FORMAT,
        "unloaded": {
            "path": folder,
            "sha256": digest or None,
            "command": fitted.get("command"),
            "model": fitted.get("model"),
            "estimator": fitted.get("estimator"),
            "verdict": fitted["verdict"]["status"],
            "moving_relative_residual_percent": (fitted.get("fit") or {}).get("moving_relative_residual_percent"),
            "logs": [{key: log.get(key) for key in ("path", "role", "sha256")} for log in fitted.get("logs", [])],
        },
    }


def load_tables(
    robot: Robot, found: LoadEstimate, reason: str, truth: np.ndarray | None, certain: bool = False
) -> dict[str, Any]:
    """The load as ten standard parameters, as a body in R_n, and in the tool's frame; null where not told.

    reason: why some are not told. certain: the mass was stated.
    """
    n = robot.n
    gradients = np.eye(10)
    standard = _rows(LINK_PARAMETERS, LINK_UNITS, found.parameters, found.covariance, gradients, found, truth, n)
    values, slopes, true = np.zeros(10), np.zeros((10, 10)), None
    weighable = found.tells(gradients[9]) and found.parameters[9] != 0
    if weighable:
        values, slopes = body_values(found.parameters)
        true = None if truth is None else body_values(truth)[0]
    covariance = slopes @ found.covariance @ slopes.T
    body = _rows(BODY, BODY_UNITS, values, covariance, slopes, found, true)
    flange = None
    if robot.tool != IDENTITY and weighable:
        there, moved = seen_from(inverse(np.array(robot.tool)), values)
        theirs = None if true is None else seen_from(inverse(np.array(robot.tool)), true)[1]
        flange = _rows(BODY, BODY_UNITS, moved, there @ covariance @ there.T, there @ slopes, found, theirs)
    for row in [standard[9], body[0], *(flange or [])[:1]]:
        row |= {"known": True} if certain else {}
    result = {
        "link": robot.joints[-1].name,
        "frame": f"R_{n}",
        "frame_note": (
            f"R_{n} is the frame of the last link, {robot.joints[-1].name}, by modified Denavit-Hartenberg parameters "
            f"as in robot.toml of the fit's folder; its z is that joint's axis, its origin O_{n}"
        ),
        "standard": standard,
        "covariance": _matrix(found.covariance, standard),
        "body": body,
        "body_covariance": _matrix(covariance, body),
        "flange": flange,
        "flange_reason": "" if flange else "the robot file places no tool or flange in the last frame",
        "untold_reason": reason,
    }
    if truth is None:
        result["truth_reason"] = "a measured load has no known truth, or LOG.truth.json is not beside the log"
    return result


def _rows(
    names: Sequence[str],
    units: Sequence[str],
    values: np.ndarray,
    covariance: np.ndarray,
    gradients: np.ndarray,
    found: LoadEstimate,
    truth: np.ndarray | None,
    link: int | None = None,
) -> list[dict[str, Any]]:
    """A row for each quantity of these gradients (10, 10) in the ten parameters."""
    sizes = _sizes(units, values)
    rows = []
    for k, (name, unit) in enumerate(zip(names, units, strict=True)):
        told = bool(gradients[k].any()) and found.tells(gradients[k])
        std = float(np.sqrt(max(covariance[k, k], 0.0)))
        relative = 100 * std / sizes[k] if told and sizes[k] > 0 else None
        row = {
            "name": name if link is None else f"{name}{link}",
            "unit": unit,
            "estimate": float(values[k]) if told else None,
            "std": std if told else None,
            "relative_std_percent": relative if relative is None or relative < 1e9 else None,
            "relative_to": KINDS.get(unit, "the largest moment of inertia"),
            "identified": bool(relative is not None and relative < WELL_KNOWN),
            "truth": None if truth is None else float(truth[k]),
        }
        why = "these logs do not tell it" if not told else "the estimate is next to nothing"
        rows.append(explained(row, dict.fromkeys(("estimate", "std", "relative_std_percent"), why)))
    return rows


def _matrix(covariance: np.ndarray, rows: Sequence[dict[str, Any]]) -> list[list[float | None]]:
    """The covariance for JSON, null where one of the two is not told."""
    told = np.array([row["estimate"] is not None for row in rows])
    known = told[:, None] & told
    return [
        [float(x) if ok else None for x, ok in zip(*pair, strict=True)] for pair in zip(covariance, known, strict=True)
    ]


def _sizes(units: Sequence[str], values: np.ndarray) -> np.ndarray:
    """(10,) how large each value's kind is: the mass, the length of a vector, the largest of the inertias."""
    kinds = np.array(units)
    sizes = np.abs(values)
    for unit in ("m", "kg·m"):
        sizes[kinds == unit] = np.linalg.norm(values[kinds == unit])
    sizes[kinds == "kg·m²"] = np.abs(values[kinds == "kg·m²"]).max()
    return sizes


def friction_rows(
    regressor: Regressor, unloaded: np.ndarray, change: dict[str, float], change_std: dict[str, float]
) -> list[dict[str, Any]]:
    """Per joint how far each form of its friction under load is from the unloaded one's parameters (p,)."""
    values = dict(zip(regressor.names, zip(unloaded, regressor.units, strict=True), strict=True))
    scales = dict(zip(change, friction_scales(regressor, unloaded, tuple(change)), strict=True))
    rows = []
    for j, joint in enumerate(regressor.robot.joints, 1):
        row: dict[str, Any] = {"joint": joint.name, "beyond": False}
        for key, letters in FRICTION:
            if (name := f"{letters}{j}") not in change:
                continue
            value, unit = values[name]
            row[key] = {"unloaded": float(value), "change": change[name], "std": change_std[name], "unit": unit}
            row["beyond"] |= bool(abs(change[name]) > FRICTION_CHANGE * scales[name] + 3 * change_std[name])
        rows.append(row)
    return rows


def gain_rows(robot: Robot, found: DriveGains) -> list[dict[str, Any]]:
    """The drive gains, joint by joint."""
    spread = np.sqrt(np.diag(found.covariance))
    return [
        {
            "joint": joint.name,
            "unit": f"{joint.effort_unit} per unit of logged effort",
            "estimate": float(gain),
            "std": float(std),
            "relative_std_percent": float(100 * std / gain),
            "identified": bool(100 * std / gain < WELL_KNOWN),
        }
        for joint, gain, std in zip(robot.joints, found.gains, spread, strict=True)
    ]


def physical_load(found: LoadEstimate, certain: bool) -> dict[str, Any]:
    """The possible body nearest to the estimate, and how far it is."""
    covariance = found.covariance.copy()
    if certain:
        covariance[9, 9] = (TINY * found.parameters[9]) ** 2
    try:
        body = nearest_body(found.parameters, covariance, found.told)
    except InputError as error:
        return {"physical": None, "physical_reason": str(error)}
    values = body_values(body.parameters)[0]
    moments = Link(inertia=tuple(values[4:])).principal_moments
    return {
        "physical": {
            "consistent": bool(body.eigenvalue > 0),
            "moved": body.moved,
            "cost": body.cost,
            "min_eigenvalue": body.eigenvalue,
            "nearest_min_eigenvalue": body.least,
            "principal_moments": [float(x) for x in moments],
            "triangle_margin": float(moments[0] + moments[1] - moments[2]),
            "body": [
                {"name": name, "unit": unit, "value": float(x)}
                for name, unit, x in zip(BODY, BODY_UNITS, values, strict=True)
            ],
            "parameters": [float(x) for x in body.parameters],
        }
    }


def payload_settings(found: LoadEstimate, friction: bool) -> dict[str, Any]:
    """How the loaded log was processed and solved."""
    return {
        **found.settings.to_dict(),
        "rows": found.rows,
        "effective_samples": found.effective_samples,
        "rows_per_effective_sample": [float(x) for x in found.inflation],
        "condition_number": found.condition_number,
        "friction_may_change": friction,
        "friction_change_std_percent": 100 * FRICTION_CHANGE if friction else 0.0,
    }


def rejected_payload(record: dict[str, Any], verdict: dict[str, Any]) -> dict[str, Any]:
    """The record of logs that can't tell a load: the verdict, and null with the reason for all else."""
    why = "the logs can't support a result: " + "; ".join(verdict["reasons"])
    empty: dict[str, Any] = {}
    for key in ("load", "fit", "gains", "physical", "settings"):
        empty |= {key: None, f"{key}_reason": why}
    return record | empty | {"friction": [], "friction_reason": why, "test": [], "test_reason": why, "verdict": verdict}


def fit_digest(folder: Path) -> str:
    """SHA-256 of a result folder's parameters.json; empty where there is no such file."""
    from identify.estimation.identification import RECORD
    from identify.logs.files import digest

    return digest(folder / RECORD) if (folder / RECORD).is_file() else ""
