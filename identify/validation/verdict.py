"""May the result be used, and for what: each use with its number, its limit and whose limit it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from identify.validation.cross_check import AGREE

MEAN_LIMIT = 100.0
"""Residual [% of the signal's standard deviation] of a model that predicts each joint's mean."""

ZERO_LIMIT = 100.0
"""Residual [% of the measured effort] of a model that predicts no effort at all."""

SOME_PERCENT = 10.0
"""Share [%] of a held-out motion that repeats the training motion, from which the verdict says so."""

WELL_KNOWN = 10.0
"""Relative standard deviation [%] below which a parameter counts as well identified (Gautier & Khalil 1992)."""


def rejected(reasons: tuple[str, ...]) -> dict[str, Any]:
    """The verdict on logs that can't support a result."""
    action = "Record the motion again with the reasons mended; `identify excite` designs one that excites every joint."
    return {"status": "reject", "reasons": list(reasons), "uses": [], "actions": [action]}


def refusals_of_fit(model: str, figures: dict[str, dict[str, Any]]) -> list[str]:
    """Why the fitted model supports nothing: it explains its own training logs no better than no effort at all does.

    figures: residual figures on the training logs by model name, of `model` and of the other where it could be fitted.
    Rows at rest don't count, as brakes may hold a joint there. Empty where the model explains something.
    """
    moving = {name: row["moving_relative_residual_percent"] for name, row in figures.items()}
    found = moving.pop(model)
    if found is None or found < ZERO_LIMIT:
        return []
    others = [f"; the {name} model leaves {x:.2g} %" for name, x in moving.items() if x is not None and x < ZERO_LIMIT]
    return [
        f"the {model} model leaves {found:,.0f} % of the effort in motion of its own training logs unexplained, "
        f"and predicting none would leave {ZERO_LIMIT:g} %{''.join(others)}"
    ]


def verdict(record: dict[str, Any]) -> dict[str, Any]:
    """The verdict on a record that holds fit, test, parameters and cross_check.

    "accept": a held-out log was predicted, every joint better than by its mean, engines agree, nothing was found wrong
    with the logs. "warn": something of this is missing; `reasons` says what.
    """
    reasons: list[str] = []
    actions: list[str] = []
    uses = [_prediction(record, reasons, actions), _simulation(record), _payload(record)]
    for engine, error in _engines(record):
        if error > AGREE:
            reasons.append(
                f"the regressor differs from {engine} by {error:.1e} of the torque scale: a defect in the robot model"
            )
    findings = [(log["path"], finding) for log in record["logs"] for finding in log["findings"]]
    reasons += [f"{path}: {finding}" for path, finding in findings]
    undetermined = [b["name"] for b in record["base_parameters"] if b["std"] >= abs(b["estimate"])]
    if undetermined:
        actions.append(
            f"{len(undetermined)} of {len(record['base_parameters'])} base parameters are smaller than their standard "
            f"deviation ({', '.join(undetermined[:4])}{' …' if len(undetermined) > 4 else ''}): take them as zero "
            "within it, or record a longer or faster motion."
        )
    return {"status": "warn" if reasons else "accept", "reasons": reasons, "uses": uses, "actions": actions[:3]}


def _prediction(record: dict[str, Any], reasons: list[str], actions: list[str]) -> dict[str, Any]:
    use: dict[str, Any] = {
        "use": "prediction of joint torque",
        "limit": "100 % of each joint's standard deviation, moving",
        "limit_percent": MEAN_LIMIT,
        "limit_source": "predicting the joint's mean",
    }
    if not record["test"]:
        reasons.append("no held-out log was given, so prediction is not tested")
        actions.append("Record a second, different motion and pass it with --test.")
        return use | {
            "status": "NOT TESTED",
            "result": "no held-out log",
            "action": "Pass a log of another motion with --test.",
        }
    shares: list[float] = []
    for test in record["test"]:
        if test["is_a_training_log"]:
            reasons.append(f"{test['path']}: is a training log too, so that it tests nothing")
            continue
        repeat = test["motion"]["repeat"]
        if repeat and repeat["share_percent"] >= SOME_PERCENT:
            reasons.append(
                f"{test['path']}: repeats the training motion for {repeat['share_percent']:.0f} % of its moving time, "
                f"so that it {'does not test' if repeat['repeats'] else 'tests less of'} what the model leaves out"
            )
        if not _is_new(test):
            continue
        found = _shares(test)
        shares += found.values()
        if bad := [name for name, share in found.items() if share >= MEAN_LIMIT]:
            reasons.append(f"{test['path']}: {', '.join(bad)} predicted worse than by the mean of its torque")
        outside = [
            (share, joint["joint"])
            for share, joint in zip(test["outside_training_percent"], test["per_joint"], strict=True)
        ]
        share, name = max(outside)
        if share >= 1.0:
            actions.append(
                f"{name} is outside the positions of the training logs for {share:.0f} % of {Path(test['path']).name}: "
                "trust the parameters less there, or train on a wider motion."
            )
    if not shares:
        reasons.append("no joint moves in a held-out log that was not fitted, so prediction is not tested")
        return use | {
            "status": "NOT TESTED",
            "result": "no motion that was not fitted",
            "action": "Pass a log of another motion with --test.",
        }
    worst = max(shares)
    totals = [t["moving_relative_residual_percent"] for t in record["test"] if _is_new(t)]
    total = max(x for x in totals if x is not None) if any(x is not None for x in totals) else None
    met = worst < MEAN_LIMIT
    return use | {
        "status": "MET" if met else "NOT MET",
        "result": ("" if total is None else f"residual {total:.2g} % of the torque on unseen motion, moving; ")
        + f"worst joint {worst:.2g} % of its standard deviation",
        "action": "Use it within the positions and speeds of the training logs."
        if met
        else "Do not use the joints named below; look at their curves.",
    }


def _simulation(record: dict[str, Any]) -> dict[str, Any]:
    use: dict[str, Any] = {
        "use": "simulation",
        "limit": "every link a possible body, and its model predicts each moving joint better than its mean",
        "limit_source": "a rigid body (Traversaro et al. 2016), and predicting the joint's mean",
    }
    physical = record.get("physical")
    if not physical or not physical["consistent"]:
        why = (physical or record).get("physical_reason", "a link that was found is no possible body")
        return use | {
            "status": "NOT TESTED" if physical is None else "NOT MET",
            "result": f"no links that physics allows: {why}",
            "action": "Use the base parameters for prediction and control; a simulator needs possible links.",
        }
    moved = physical["moved"]
    told = "every link is possible at no cost to the fit"
    if moved:
        first = moved[0]
        told = (
            f"links made possible by moving {len(moved)} of {len(physical['parameters'])} parameters, "
            f"{first['name']} most, by {abs(first['shift_sigma']):.2g} σ"
        )
    tests = [mine for mine, test in zip(physical["test"], record["test"], strict=False) if _is_new(test)]
    shares = [share for test in tests for share in _shares(test).values()]
    found = [x for t in tests if (x := t["moving_relative_residual_percent"]) is not None]
    if found:
        told += f"; residual {max(found):.2g} % of the torque on unseen motion, moving"
    if not shares:
        return use | {
            "status": "NOT TESTED",
            "result": told + "; no held-out motion",
            "action": "`identify export` writes the robot; pass a log of another motion with --test to try it.",
        }
    met = max(shares) < MEAN_LIMIT
    return use | {
        "status": "MET" if met else "NOT MET",
        "result": told,
        "action": "Write it with `identify export` as TOML, URDF or MJCF, which says what each leaves out."
        if met
        else "Look at the joints that prediction names; a simulator would be as wrong there.",
    }


def _shares(test: dict[str, Any]) -> dict[str, float]:
    """RMSE [% of the signal's standard deviation] of every joint that moves in a held-out log, by its name."""
    shares = {joint["joint"]: share_of_spread(joint) for joint in test["per_joint"]}
    return {name: share for name, share in shares.items() if share is not None}


def _is_new(test: dict[str, Any]) -> bool:
    """Whether a held-out log shows a motion that was not fitted."""
    repeat = test["motion"]["repeat"]
    return not test["is_a_training_log"] and not (repeat and repeat["repeats"])


def share_of_spread(joint: dict[str, Any]) -> float | None:
    """RMSE while moving [% of the signal's standard deviation] of one joint's figures: from MEAN_LIMIT on, its mean
    predicts as well. None where it does not move."""
    if joint["moving_rmse"] is None or not joint["std_of_signal"]:
        return None
    return float(100 * joint["moving_rmse"] / joint["std_of_signal"])


def _payload(record: dict[str, Any]) -> dict[str, Any]:
    return {
        "use": "payload identification",
        "status": "NOT TESTED",
        "result": "no log with a load was given",
        "limit": "a log with a known load",
        "limit_source": "none given",
        "action": "Keep this result as the unloaded reference: `identify payload` holds a log with a load against it.",
    }


def _engines(record: dict[str, Any]) -> list[tuple[str, float]]:
    """Largest disagreement of each engine, on the regressor and on the identified model."""
    check = record["cross_check"]
    return [
        (engine + where, part[engine]["max_abs_error"])
        for part, where in ((check, ""), (check["identified"], " on the identified model"))
        for engine in ("pinocchio", "mujoco")
        if part.get(engine)
    ]
