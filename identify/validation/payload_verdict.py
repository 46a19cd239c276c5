"""May the load that was found be used: what speaks against it, each with its number and its limit."""

from __future__ import annotations

from typing import Any

UNEXPLAINED = 50.0
"""Error in motion [% of the effort], arm and load together, from which they do not explain the log at all."""

VAGUE = 50.0
"""Standard deviation of the mass [% of it] from which the motion does not tell it …"""

SLIGHT = 1.0
"""… where it is also above this share of the arm's own mass [%]: what weighs less need not be told from nothing."""

WORSE = 2.0
"""Ratio of the error in motion with load to that of the fit, from which something else than a load has changed."""

NOISE = 1.0
"""Error in motion [% of the effort] below which that ratio says nothing."""

IMPOSSIBLE = 16.0
"""χ² of the way to the nearest possible body that chance does not explain: four standard deviations of a parameter."""

ACTIONS = {
    "motion": "Move every joint in the loaded log, the last ones too; `identify excite --payload` designs a motion.",
    "other": "Look at the residuals joint by joint; fit the arm again without its load if it is another day's.",
}


def refusals_of_load(
    told: bool, felt: bool, mass: float, std: float, arm_mass: float, still: list[str], residual: float | None
) -> list[str]:
    """Why nothing can be said of the load; empty where something can.

    told: whether the logs tell its mass [kg], of standard deviation std, by themselves; felt: whether any motion of
    this arm would; arm_mass: of the order of the arm's own [kg]; still: joints that stand still; residual: error in
    motion of arm and load together [% of the effort].
    """
    reasons = []
    if not felt:
        reasons.append(
            "the joints of this arm feel a load's mass only together with its inertia, so that no motion tells it apart"
        )
    elif not told or (std > VAGUE / 100 * abs(mass) and std > SLIGHT / 100 * arm_mass):
        found = f" ({mass:.2g} ± {std:.2g} kg)" if told else ""
        because = f": {', '.join(still)} stand{'s' * (len(still) == 1)} still" if still else ""
        reasons.append(f"the motion can't tell the load's mass{found}{because}")
    if residual is None or residual > UNEXPLAINED:
        left = "all" if residual is None else f"{residual:.0f} %"
        reasons.append(
            f"a load on the last link leaves {left} of the effort in motion unexplained: is it a log of this robot, "
            "with the fit's units and signs?"
        )
    return reasons


def rejected_load(reasons: tuple[str, ...]) -> dict[str, Any]:
    """The verdict on logs that can't tell a load."""
    return {"status": "reject", "reasons": list(reasons), "actions": [ACTIONS["motion"]]}


def load_verdict(record: dict[str, Any]) -> dict[str, Any]:
    """The verdict on a record that holds load, fit, friction and physical: "accept", or "warn" with its reasons."""
    reasons: list[str] = []
    actions: list[str] = []
    body = record["load"]["body"]
    mass = body[0]
    if mass["std"] is not None and abs(mass["estimate"]) < 2 * mass["std"]:
        reasons.append("no load is to be seen: its mass is less than two standard deviations from nothing")
    elif mass["estimate"] < 0:
        reasons.append("the load's mass is negative: is the loaded log the unloaded one?")
    untold = [row["name"] for row in record["load"]["standard"] if row["estimate"] is None]
    if untold:
        reasons.append(f"{', '.join(untold)} of the load can't be told: {record['load']['untold_reason']}")
        actions.append(ACTIONS["motion"])
    residual, before = (
        figures["moving_relative_residual_percent"] for figures in (record["fit"]["with"], record["unloaded"])
    )
    if record["gains"] is None and before is not None and residual > max(WORSE * before, NOISE):
        reasons.append(
            f"arm and load leave {residual:.2g} % of the effort in motion unexplained, the fit left {before:.2g} % of "
            "its own log: something else than the load has changed, for which the deviations do not allow"
        )
        actions.append(ACTIONS["other"])
    physical = record["physical"]
    if physical is None:
        reasons.append(f"no possible body was found near the estimate: {record['physical_reason']}")
    elif physical["cost"] > IMPOSSIBLE:
        reasons.append(
            f"no body has these parameters, and the nearest that can be is further away (χ² = {physical['cost']:.2g}) "
            "than chance explains"
        )
    for row in record["friction"]:
        if row["beyond"]:
            reasons.append(f"{row['joint']}: its friction changed by more than itself, which a load hardly does")
    reasons += [f"{log['path']}: {finding}" for log in record["logs"] for finding in log["findings"]]
    return {"status": "warn" if reasons else "accept", "reasons": reasons, "actions": list(dict.fromkeys(actions))}
