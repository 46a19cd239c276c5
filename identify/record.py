"""parameters.json: everything a result says, put together from the rooms' parts. Nothing is computed here."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from itertools import chain
from typing import Any

import numpy as np

from identify import __version__
from identify.estimation.fitting import Fit, ModelFit
from identify.estimation.identification import FORMAT, FRICTION
from identify.estimation.identified_robot import link_table, plain_friction, with_standard
from identify.estimation.physical import PULL, Consistent
from identify.estimation.reference import Reference
from identify.estimation.scoring import explained
from identify.estimation.settings import CONSTANTS
from identify.logs.log import Log
from identify.logs.triage import Findings
from identify.numbers import finite
from identify.regressor.columns import COUPLED, MORE, column_kind
from identify.regressor.friction import FURTHER
from identify.robot.robot import Limits, Robot
from identify.symbolic.formula import formula
from identify.validation.verdict import WELL_KNOWN

PACKAGES = ("numpy", "scipy", "sympy", "pin", "mujoco", "mcap", "matplotlib", "clarabel")
MOTORS = (*COUPLED, *(kind for kinds in MORE.values() for kind in kinds[1:]))
"""Kinds of columns of the transmission."""

MOVED = 0.01
"""Shift of a parameter, in its standard deviations, from which the record says that consistency moved it."""


def head(
    robot: Robot, model: str, train: Sequence[Log], test: Sequence[Log], command: str, triage: Sequence[Findings]
) -> dict[str, Any]:
    """What is known before anything is fitted: robot, logs, versions. triage: of training, then test logs."""
    from identify.robot.library import robot_digest

    roles = [("train", log) for log in train] + [("test", log) for log in test]
    logs = [log_entry(log, role, found) for (role, log), found in zip(roles, triage, strict=True)]
    return {
        "format": FORMAT,
        "robot": {
            "name": robot.name,
            "source": robot.source,
            "sha256": robot_digest(robot),
            "note": robot.note,
            "joints": [
                {
                    "name": joint.name,
                    "type": joint.type,
                    "effort_unit": joint.effort_unit,
                    "position_unit": joint.position_unit,
                    "limits": _limits(joint.limits),
                }
                for joint in robot.joints
            ],
        },
        "model": model,
        "simulated": any(log.simulated for log in train),
        "logs": logs,
        "versions": versions(),
        "seed": 0,
        "command": command,
    }


def log_entry(log: Log, role: str, triage: Findings) -> dict[str, Any]:
    """One log, with what reading and triage found wrong with it."""
    found = triage.as_dict()
    row = {
        "path": log.source,
        "role": role,
        "sha256": log.sha256,
        "samples": log.samples,
        "rate_hz": float(log.rate_hz) if log.samples > 1 else None,
        "duration_s": log.duration,
        "simulated": log.simulated,
        "noise": log.metadata.get("noise"),
        "findings": found["findings"],
        "triage": found["triage"],
    }
    return explained(row, {"noise": "the log does not say", "rate_hz": "it has a single sample"})


def parameters(fit: ModelFit, truth: np.ndarray | None, prior: np.ndarray | None, prior_reason: str) -> dict[str, Any]:
    """Base, friction and transmission parameters with their uncertainty, and the covariance."""
    regressor, estimate, robot = fit.regressor, fit.estimate, fit.regressor.robot
    count = len(regressor.base.names)
    at = {name: i for i, name in enumerate(regressor.names)}
    relative = 100 * estimate.std / np.maximum(np.abs(estimate.parameters), 1e-300)

    def entry(i: int) -> dict[str, Any]:
        row = {
            "estimate": float(estimate.parameters[i]),
            "std": float(estimate.std[i]),
            "relative_std_percent": float(relative[i]) if relative[i] < 1e9 else None,
            "unit": regressor.units[i],
            "identified": bool(relative[i] < WELL_KNOWN),
            "truth": None if truth is None else float(truth[i]),
        }
        return explained(row, {"relative_std_percent": "the estimate is next to nothing"})

    base = [
        {
            "name": name,
            "grouping": formula(regressor.base.grouping[name], robot.standard_names[regressor.base.kept[i]]),
            "link": regressor.base.kept[i] // 11 + 1,
            **entry(i),
            "prior": None if prior is None else float(prior[i]),
        }
        for i, name in enumerate(regressor.base.names)
    ]
    friction = []
    for j, joint in enumerate(robot.joints, 1):
        row: dict[str, Any] = {"joint": joint.name}
        for key, letters in FRICTION:
            if key in FURTHER and key not in regressor.forms:
                continue
            name = f"{letters}{j}"
            row[key] = entry(at[name]) if name in at else None
            if name not in at:
                others = ", ".join(regressor.dropped[name])
                row[f"{key}_reason"] = f"{name} can't be told from {others}, which hold it"
        friction.append(row)
    coupled = [i for i in range(count, len(regressor.names)) if column_kind(regressor.names[i]) in MOTORS]
    result: dict[str, Any] = {
        "names": list(regressor.names),
        "base_parameters": base,
        "friction": friction,
        "transmission": [{"name": regressor.names[i], **entry(i)} for i in coupled],
        "covariance": estimate.covariance.tolist(),
    }
    if truth is None:
        result["truth_reason"] = "a measured robot has no known truth, or LOG.truth.json is not beside the log"
    if prior is None:
        result["prior_reason"] = prior_reason
    return result


def fit_figures(fit: ModelFit, figures: dict[str, Any]) -> dict[str, Any]:
    """What the record says of the fit: its residual figures on the training logs, conditioning and equations."""
    estimate = fit.estimate
    result = {
        **figures,
        "condition_number": estimate.condition_number,
        "samples_used": estimate.rows,
        "energy_residual_percent": fit.energy_residual_percent,
    }
    if fit.energy_residual_percent is None:
        result["energy_residual_percent_reason"] = "the torque model was fitted"
    return result


def physical(
    fit: ModelFit,
    found: Consistent,
    bodies: Reference,
    bodies_reason: str,
    figures: dict[str, Any],
    speeds: np.ndarray,
    cost: dict[str, Any],
    prior: float | None,
) -> dict[str, Any]:
    """The standard parameters that physics allows: links, drives, what they cost and which parameters moved.

    prior: standard deviation of the description's links in shares of them, where they were one; cost: see
    `validation.possible.cost`; speeds (arms,): the fastest that joints and coupled motors went, up to which drives
    stand for further forms of friction. figures: residual figures of their model, {"fit": on the training logs,
    "test": [on each held-out log]}.
    """
    regressor, estimate = fit.regressor, fit.estimate
    plain = plain_friction(regressor, found.extra, fit.settings, speeds)
    robot = with_standard(regressor.robot, found.standard, plain)
    shift = (found.parameters - estimate.parameters) / np.maximum(estimate.std, 1e-300)
    moved = [i for i in np.argsort(-np.abs(shift), kind="stable") if abs(shift[i]) >= MOVED]
    eigenvalues = zip(link_table(robot), found.eigenvalues, bodies.kinds, strict=True)
    return {
        "consistent": found.possible,
        "links": [row | {"min_eigenvalue": float(x), "pulled_to": kind} for row, x, kind in eigenvalues],
        "drives": [{"joint": joint.name, **asdict(joint.drive)} for joint in robot.joints],
        "transmission": [
            {"name": f"{kind}{k + 1}", "value": plain[f"{kind}{k + 1}"]} for k, _ in robot.couplings for kind in COUPLED
        ],
        "parameters": [float(x) for x in found.parameters],
        "cost": cost,
        "moved": [
            {
                "name": regressor.names[i],
                "unit": regressor.units[i],
                "estimate": float(estimate.parameters[i]),
                "consistent": float(found.parameters[i]),
                "shift_sigma": float(shift[i]),
            }
            for i in moved
        ],
        "pull": explained(
            {
                "weight": PULL if prior is None else 1 / prior**2,
                "prior_percent": None if prior is None else 100 * prior,
                "bodies": list(bodies.kinds),
                "why": bodies_reason,
            },
            {"prior_percent": "no prior was asked for"},
        ),
        **figures,
        "solver": {
            "name": "clarabel",
            "primal_residual": found.primal_residual,
            "dual_residual": found.dual_residual,
            "gap": found.gap,
            "iterations": found.iterations,
        },
    }


def settings(fit: ModelFit, tried: list[dict[str, Any]]) -> dict[str, Any]:
    """How the logs were processed, every key there; tried: the candidates that settings were chosen from."""
    table = (
        dict.fromkeys(("coulomb_velocity", *chain(*CONSTANTS.values()), "window_s", "energy_cutoff_hz"))
        | fit.settings.to_dict()
    )
    reasons = {
        "coulomb_velocity": "the exact sign is used where the joint moves",
        "presliding_distance": "no friction before sliding was fitted",
        "stribeck_velocity": "no Stribeck friction was fitted",
        "load_parameters": "no friction that grows with the load was fitted",
        "mean_load": "no friction that grows with the load was fitted",
        "window_s": "the torque model has no windows",
        "energy_cutoff_hz": "the torque model has no energies",
    }
    return {
        **explained(table, reasons),
        "chosen_by": "cross-validation inside the training logs: 0.5 s blocks dealt to 5 folds",
        "rows": fit.estimate.rows,
        "effective_samples": fit.estimate.effective_samples,
        "rows_per_effective_sample": [float(x) for x in fit.estimate.inflation],
        "candidates": tried,
    }


def models(fit: Fit, figures: dict[str, dict[str, Any]], agreement: dict[str, Any] | None) -> dict[str, Any]:
    """Both models side by side; figures: residual figures by model name."""
    result: dict[str, Any] = {"agreement": agreement}
    if agreement is None:
        result["agreement_reason"] = "only one of the models could be fitted"
    for model in (fit.torque, fit.energy):
        if model is None:
            continue
        estimate = model.estimate
        result[model.model] = {
            "estimator": model.estimator,
            "parameters": [
                {"name": name, "estimate": float(x), "std": float(s)}
                for name, x, s in zip(estimate.names, estimate.parameters, estimate.std, strict=True)
            ],
            "condition_number": estimate.condition_number,
            **({} if model.model == "torque" else _energy_only(model)),
            **{k: figures[model.model][k] for k in ("relative_residual_percent", "moving_relative_residual_percent")},
        }
    for name, reason in fit.reasons.items():
        result[name], result[f"{name}_reason"] = None, reason
    return result


def rejected(record: dict[str, Any], verdict: dict[str, Any]) -> dict[str, Any]:
    """A refused log's record: the verdict, and null with the reason for all that a fit would have given."""
    why = "the log can't support a result: " + "; ".join(verdict["reasons"])
    empty: dict[str, Any] = {"names": [], "base_parameters": [], "friction": [], "transmission": []}
    keys = ("estimator", "covariance", "fit", "settings", "statistics", "coverage", "models", "cross_check")
    for key in (*keys, "physical"):
        empty |= {key: None, f"{key}_reason": why}
    reasons = {f"{key}_reason": why for key in ("base_parameters", "friction", "transmission", "test")}
    return record | empty | reasons | {"test": [], "verdict": verdict}


def versions() -> dict[str, str]:
    """Version of this package, of Python and of PACKAGES, by name."""
    found = {"identify": __version__, "python": sys.version.split()[0]}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def _energy_only(fit: ModelFit) -> dict[str, Any]:
    return {"window_s": fit.settings.window_s, "energy_residual_percent": fit.energy_residual_percent}


def _limits(limits: Limits) -> dict[str, Any]:
    position = [finite(x) for x in limits.position]
    row = {
        "position": None if position == [None, None] else position,
        "velocity": finite(limits.velocity),
        "acceleration": finite(limits.acceleration),
        "effort": finite(limits.effort),
    }
    one_sided = {"position_reason": "the robot file gives it on one side alone"} if None in position else {}
    return one_sided | explained(row, dict.fromkeys(row, "the robot file gives none"))
