"""What the record says of how sure a result is: where σ comes from, essential parameters, whiteness, correlations, and
what the logs can't tell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identify.estimation.correlation import correlated_pairs, correlations
from identify.estimation.essential import RATIO, SIGNIFICANCE, Essential, essential_parameters
from identify.estimation.estimators.problem import Problem
from identify.estimation.fitting import ModelFit
from identify.estimation.noise import Noise
from identify.estimation.spectra import EDGES
from identify.estimation.telling_motion import Motion, telling_motions
from identify.estimation.whiteness import whiteness
from identify.robot.robot import Robot
from identify.validation.verdict import WELL_KNOWN

PAIRS = 10
"""Correlated pairs that are listed."""

TOGETHER = 0.8
"""Correlation with another parameter from which the sentence about an unknown one names that."""

NO_NOISE = "the estimator gives no residuals by row"


def statistics(fit: ModelFit, problem: Problem) -> dict[str, Any]:
    """record["statistics"]; a null has its reason beside it under "<key>_reason". Parameters are in the order of
    record["names"], joints in the robot's order; the energy model has one group of rows, called "energy".

    covariance: {method, textbook_method, edges_hz [upper ends of the bands, Hz], noise [{group, unit, std [by band]}],
        widening: median over parameters of σ / textbook σ} | null
    textbook_std: [p] σ²(WᵀW)⁻¹, rows taken as independent | null
    whiteness: [{group, durbin_watson, ljung_box, lags, chance, neighbours, told}] | null
    correlations: [{first, second, correlation}], the largest first
    essential: {names, parameters [{name, unit, estimate, std, relative_std_percent}], dropped [{name, chance}],
        refused {name, chance} | null, ratio, ratio_limit, significance, residual_before_percent,
        residual_after_percent}: residuals of the rows that are solved, in units of their noise
    unknown: [{names, state "not determined" | "weak", motions [{kind, joints}], beside [names], told}]
    command: the command that designs the motion that tells them, DIR being the result folder
    """
    noise = fit.estimate.noise
    known: dict[str, Any] = dict.fromkeys(("covariance", "textbook_std", "whiteness"))
    if noise is None:
        known |= {f"{key}_reason": NO_NOISE for key in known}
    else:
        known = _noise(fit, noise)
    name = (fit.regressor.robot.source or "ROBOT").removeprefix("built-in ")
    return {
        **known,
        "correlations": [
            {"first": fit.regressor.names[i], "second": fit.regressor.names[j], "correlation": x}
            for i, j, x in correlated_pairs(fit.estimate.covariance, PAIRS)
        ],
        "essential": _essential(fit, problem),
        "unknown": _unknown(fit),
        "command": f"identify excite {name} --from DIR -o TRAJECTORY.toml",
    }


def _noise(fit: ModelFit, noise: Noise) -> dict[str, Any]:
    groups = _groups(fit)
    widening = fit.estimate.std / np.maximum(noise.textbook, 1e-300)
    rows = [
        {"group": name, "unit": unit, "std": np.sqrt(variance).tolist()}
        for (name, unit), variance in zip(groups, noise.variance, strict=True)
    ]
    method = "sandwich by the spectrum of each group's residuals in bands of frequency"
    return {
        "covariance": {
            "method": method,
            "textbook_method": "σ²(WᵀW)⁻¹, rows taken as independent",
            "edges_hz": [float(x * noise.rate / 2) for x in (*EDGES, 1.0)],
            "noise": rows,
            "widening": float(np.median(widening)),
        },
        "textbook_std": noise.textbook.tolist(),
        "whiteness": [
            {
                "group": name,
                "durbin_watson": found.durbin_watson,
                "ljung_box": found.ljung_box,
                "lags": found.lags,
                "chance": found.chance,
                "neighbours": found.neighbours,
                "told": found.told,
            }
            for (name, _), found in zip(groups, whiteness(noise), strict=True)
        ],
    }


def _groups(fit: ModelFit) -> list[tuple[str, str]]:
    """Name of each group of rows, and the unit of its noise."""
    if fit.model == "energy":
        return [("energy", "of its own σ")]
    return [(joint.name, joint.effort_unit) for joint in fit.regressor.robot.joints]


def _essential(fit: ModelFit, problem: Problem) -> dict[str, Any]:
    estimate, names = fit.estimate, fit.regressor.names
    found = essential_parameters(estimate.parameters, estimate.covariance, estimate.effective_samples)
    std = np.sqrt(np.diag(found.covariance))
    refused = found.refused and {"name": names[found.refused[0]], "chance": found.refused[1]}
    row = {
        "names": [names[k] for k in found.kept],
        "parameters": [
            {
                "name": names[k],
                "unit": fit.regressor.units[k],
                "estimate": float(found.parameters[k]),
                "std": float(std[k]),
                "relative_std_percent": float(100 * std[k] / max(abs(found.parameters[k]), 1e-300)),
            }
            for k in found.kept
        ],
        "dropped": [{"name": names[k], "chance": chance} for k, chance in found.dropped],
        "refused": refused,
        "ratio": found.ratio,
        "ratio_limit": RATIO,
        "significance": SIGNIFICANCE,
        "residual_before_percent": _residual(fit, problem, estimate.parameters),
        "residual_after_percent": _residual(fit, problem, found.parameters),
    }
    return row if refused else row | {"refused_reason": _why_ended(found)}


def _why_ended(found: Essential) -> str:
    if found.ratio <= RATIO:
        return f"the largest relative σ is no more than {RATIO:g} times the smallest"
    return "one parameter is left"


def _residual(fit: ModelFit, problem: Problem, parameters: np.ndarray) -> float:
    """100·‖residual‖/‖what was measured‖ [%] over the rows, each in units of its noise."""
    if fit.model == "energy":
        work = problem.energy
        size = float(np.linalg.norm(work.work))
        return 100 * float(np.linalg.norm(work.work - work.matrix @ parameters)) / max(size, 1e-300)
    weight = 1 / np.maximum(fit.estimate.sigma, 1e-300) ** 2
    left, size = problem.reduction.residual_power(parameters), (problem.reduction.effort**2).sum(axis=0)
    return float(100 * np.sqrt((weight * left).sum() / max(float((weight * size).sum()), 1e-300)))


def _unknown(fit: ModelFit) -> list[dict[str, Any]]:
    """Groups of parameters that the logs leave open, by what would tell them."""
    estimate, names, robot = fit.estimate, fit.regressor.names, fit.regressor.robot
    relative = estimate.std / np.maximum(np.abs(estimate.parameters), 1e-300)
    open_ones = [k for k in range(len(names)) if 100 * relative[k] >= WELL_KNOWN]
    if not open_ones:
        return []
    sigma = estimate.sigma if len(estimate.sigma) == robot.n else np.ones(robot.n)
    related = np.abs(correlations(estimate.covariance) - np.eye(len(names)))
    motions = telling_motions(fit.regressor, open_ones, np.maximum(sigma, 1e-12))
    groups: dict[tuple[bool, frozenset[Motion] | str], list[int]] = {}
    by_column = dict(zip(open_ones, motions, strict=True))
    for k, best in by_column.items():
        # Each joint's own friction asks for the same of each joint: one sentence for all of them.
        inertial = k < len(fit.regressor.base.names)
        groups.setdefault((bool(relative[k] >= 1), frozenset(best[:3]) if inertial else best[0].kind), []).append(k)
    found = []
    for (lost, _), members in groups.items():
        telling = sorted({m for k in members for m in by_column[k][:3]}, key=lambda m: (m.kind, m.joints))
        beside = sorted({int(i) for k in members for i in np.flatnonzero(related[k] >= TOGETHER) if i not in members})
        found.append(
            {
                "names": [names[k] for k in members],
                "state": "not determined" if lost else "weak",
                "motions": [{"kind": m.kind, "joints": [robot.joint_names[j] for j in m.joints]} for m in telling],
                "beside": [names[i] for i in beside],
                "told": _told([names[k] for k in members], lost, telling, [names[i] for i in beside], robot),
            }
        )
    return sorted(found, key=lambda group: group["state"])


def _told(names: list[str], lost: bool, motions: list[Motion], beside: list[str], robot: Robot) -> str:
    """One sentence about a group of parameters."""
    state = "smaller than their σ" if len(names) > 1 else "smaller than its σ"
    weak = f"known to no better than {WELL_KNOWN:g} %"
    by_kind = [[m for m in motions if m.kind == kind] for kind in dict.fromkeys(m.kind for m in motions)]
    asked = "; ".join(_asked(each, robot) for each in by_kind)
    near = f"; hardly told apart from {', '.join(beside[:4])}" if beside else ""
    return f"{', '.join(names)}: {state if lost else weak}{near}. What tells most: {asked}."


def _asked(motions: Sequence[Motion], robot: Robot) -> str:
    """What motions of one kind ask for."""
    sets = [" and ".join(robot.joint_names[j] for j in motion.joints) for motion in motions]
    joints = ", ".join(sets)
    match motions[0].kind:
        case "gravity":
            return "poses all over the range, held or passed slowly"
        case "acceleration":
            return f"strong acceleration of {joints}"
        case "reversal":
            return f"{joints} turning in both directions, often and at several speeds"
    return f"high speed of {joints}{' at the same time' if any(len(m.joints) > 1 for m in motions) else ''}"
