"""What two results say when held against each other, in sentences: friction, links and motors, prediction."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from identify.logs.wording import first
from identify.numbers import estimate, percent, significant
from identify.validation.significance import LEVEL

TITLES = {"friction": "Friction", "links": "Links and motors", "prediction": "Prediction"}
"""What is asked, as a heading."""

CHANGED, UNCHANGED, UNTESTED = "CHANGED", "NO CHANGE SEEN", "NOT TESTED"
BETTER, UNDECIDED = "{} BETTER", "UNDECIDED"
MOST = 4
"""Joints or parameters that a sentence names."""

FINE = 0.005
"""Relative difference below which three digits would show none."""

SURE = 3.0
"""Change in σ that is said to have shown, had there been one."""

Comparison = Mapping[str, Any]


def findings(comparison: Comparison) -> list[dict[str, str]]:
    """What was asked, the answer in a word, and the answer in sentences: "friction", "links" and "prediction"."""
    if comparison["same_parameters"]:
        same = "both results hold the very same parameters"
        return [{"about": about, "state": UNCHANGED, "text": same} for about in ("friction", "links", "prediction")]
    answers = {"friction": _friction(comparison), "links": _links(comparison), "prediction": _prediction(comparison)}
    return [{"about": about, "state": state, "text": text} for about, (state, text) in answers.items()]


def cautions(comparison: Comparison) -> list[str]:
    """What a reader must know before believing any difference."""
    told = []
    if comparison["fitted_by_both"]:
        logs = first([Path(path).name for path in comparison["fitted_by_both"]], MOST)
        told.append(
            f"both were fitted to {logs}: their errors are "
            "alike, so a difference tells what was done to the log, not that the robot changed; differences in σ are "
            "reckoned as if the errors were independent, and no chance is stated"
        )
    robot = comparison["robot"]
    if not robot["same"] and not robot["same_frames"]:
        told.append(
            f"the robot files differ in {', '.join(robot['differs'])}: parameters of the same name may mean "
            "something else"
        )
    models = {result["model"] for result in comparison["results"]}
    if len(models) > 1:
        told.append("one is an energy model, the other a torque model: a difference may be the model's")
    kinds = [result["simulated"] for result in comparison["results"]]
    if bool(kinds[0]) != bool(kinds[1]):
        told.append(f"{'A' if kinds[0] else 'B'} is of a simulated robot, the other of a recorded one")
    factor, count = comparison["tests"]["factor"], sum(row["z"] is not None for row in comparison["parameters"])
    if not comparison["fitted_by_both"] and factor > 1:
        told.append(
            f"even the quarter of the {count} parameters that differs least differs {significant(factor, 2)} times as "
            "much as chance allows: either σ is too small throughout, as where the model has errors of its own, or "
            f"nearly everything changed; what is called changed stands out from σ taken {significant(factor, 2)} "
            "times as large"
        )
    return told


def level_text(level: Mapping[str, Any], row: Mapping[str, Any]) -> str:
    """ "at 3.9 rad/s from 36.0 to 36.7 N·m (+0.72 ± 0.01 N·m, +2.0 %)" of one speed of one joint."""
    a, b = (side["estimate"] for side in level["estimates"])
    fine = abs(b - a) < FINE * abs(a)
    shown = [
        estimate(side["estimate"], side["std"]).value if fine else significant(side["estimate"], 3)
        for side in level["estimates"]
    ]
    told = f"at {significant(level['speed'], 2)} {row['speed_unit']} from {shown[0]} to {shown[1]}"
    share = f", {plus(100 * level['difference'] / abs(a))}{percent(100 * level['difference'] / abs(a))}" if a else ""
    return f"{told} {row['effort_unit']} ({difference_text(level['difference'], level['std'])}{share})"


def difference_text(value: float, sigma: float) -> str:
    """A difference and its σ with its sign, or the bound that it stays under."""
    shown = estimate(value, sigma)
    if not shown.determined:
        return f"under {shown.bound}"
    return plus(value) + shown.text


def plus(value: float) -> str:
    """The sign that a number above zero is written without."""
    return "+" if value > 0 else ""


def chance_text(p: float | None) -> str:
    """A chance as text, none smaller than a thousandth written out."""
    return "" if p is None else "p < 0.001" if p < 0.001 else f"p = {significant(p, 2)}"


def _friction(comparison: Comparison) -> tuple[str, str]:
    rows = comparison["friction"]
    changed = [row for row in rows if row["changed"]]
    tested = [row for row in rows if row["changed"] is not None]
    other = [row["joint"] for row in rows if not row["same_forms"]]
    told = []
    if changed:
        order = sorted(changed, key=lambda row: row["p"])
        shown = "; ".join(f"{row['joint']} {_largest(comparison, row)}" for row in order[:MOST])
        more = f" and {len(order) - MOST} more joints" if len(order) > MOST else ""
        told.append(f"it changed on {shown}{more}")
        if len(tested) > len(changed):
            told.append(f"no change seen on the other {len(tested) - len(changed)} of {len(tested)} joints")
    elif tested:
        worst, joint = max((_resolution(row) * comparison["tests"]["factor"], row["joint"]) for row in tested)
        told.append(
            f"no joint’s friction is seen to have changed; a change of {percent(worst)} at speed would have shown "
            f"({SURE:g} σ of {joint}, the least known)"
        )
    elif comparison["fitted_by_both"]:
        told.append("not tested, as both were fitted to the same log")
    if other:
        who = "all joints" if len(other) == len(rows) else first(other, MOST)
        told.append(
            f"{who} can’t be tested, as the fits give them other forms of friction, or forms with other constants; fit "
            "both with the same `--friction`"
        )
    if not tested:
        fast, row = max(((row["levels"][-1], row) for row in rows), key=_relative)
        told.append(f"the largest difference is that of {row['joint']}, {level_text(fast, row)}")
    return (CHANGED if changed else UNCHANGED if tested else UNTESTED), "; ".join(told)


def _relative(pair: tuple[Mapping[str, Any], Mapping[str, Any]]) -> float:
    level = pair[0]
    return abs(level["difference"]) / max(abs(level["estimates"][0]["estimate"]), 1e-300)


def _resolution(row: Mapping[str, Any]) -> float:
    """Change of friction at the fast speed [%] that SURE σ are."""
    level = row["levels"][-1]
    return 100 * SURE * level["std"] / max(abs(level["estimates"][0]["estimate"]), 1e-300)


def _largest(comparison: Comparison, row: Mapping[str, Any]) -> str:
    """Where the friction of a joint differs most in σ: at one of the speeds, or in its offset."""
    j = comparison["friction"].index(row) + 1
    offset = next((p for p in comparison["parameters"] if p["name"] == f"off{j}" and p["std"]), None)
    level = max(row["levels"], key=lambda found: abs(found["difference"]) / max(found["std"], 1e-300))
    size = abs(level["difference"]) / max(level["std"], 1e-300)
    if offset and abs(offset["difference"]) / offset["std"] > size:
        a, b = (side["estimate"] for side in offset["estimates"])
        shown = difference_text(offset["difference"], offset["std"])
        return f"in its offset from {significant(a, 3)} to {significant(b, 3)} {row['effort_unit']} ({shown})"
    return level_text(level, row)


def _links(comparison: Comparison) -> tuple[str, str]:
    rows = [row for row in comparison["parameters"] if row["kind"] != "friction" and row["z"] is not None]
    if not rows:
        return UNTESTED, "there are no link or motor parameters that both have"
    worst = max(rows, key=lambda row: abs(row["z"]))
    together = comparison["tests"]["links"]
    if together is None:
        why = comparison["tests"].get("reason", "no standard deviations are known")
        return UNTESTED, f"{why}; the largest difference is {_z(worst)} ({worst['name']})"
    changed = sorted((row for row in rows if row["changed"]), key=lambda row: -abs(row["z"]))
    all_of_them = (
        f"all {len(rows)} together: χ² = {significant(together['statistic'], 3)} of {together['combinations']}, "
        f"{chance_text(together['p'])}"
    )
    if changed:
        named = first([f"{row['name']} by {_z(row)}" for row in changed], MOST)
        return (
            CHANGED,
            f"{len(changed)} of {len(rows)} link and motor parameters changed: {named} ({all_of_them})",
        )
    told = f"none of the {len(rows)} link and motor parameters is seen to have changed"
    if together["p"] < LEVEL:
        return CHANGED, f"{told} by itself, yet together they differ by more than chance ({all_of_them})"
    return UNCHANGED, f"{told} ({all_of_them}; the largest difference is {_z(worst)}, {worst['name']})"


def _z(row: Mapping[str, Any]) -> str:
    return f"{plus(row['z'])}{significant(row['z'], 2)} σ"


def _prediction(comparison: Comparison) -> tuple[str, str]:
    told, winners = [], []
    for log in comparison["logs"]:
        if not log["fair"]:
            continue
        a, b = (percent(x, 3) for x in log["total"]["moving_relative_residual_percent"])
        text = f"{Path(log['path']).name}, held out from both: A leaves {a} of the torque in motion, B {b}"
        if log["better"]:
            wins = max(log["pieces"])
            text += f"; {log['better']} is the better one in {wins} of {sum(log['pieces'])} s"
        else:
            text += f"; {log['better_reason']}"
        winners.append(log["better"])
        told.append(text)
    if not told:
        train = [percent(x) for x in comparison["training"]["total"]["moving_relative_residual_percent"]]
        return UNTESTED, (
            "no log was held out from both, so which one predicts better is not known: fit both with the same "
            f"`--test`; on its own training motion A leaves {train[0]} of the torque, B {train[1]}, which is no test"
        )
    state = BETTER.format(winners[0]) if winners[0] and set(winners) == {winners[0]} else UNDECIDED
    return state, "; ".join(told)
