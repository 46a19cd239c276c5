"""The page of two results held against each other: what changed, and which predicts better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from identify.logs.wording import first
from identify.numbers import DASH, significant
from identify.report import comparison_figures, comparison_tables
from identify.report.drawing import drawing
from identify.report.markup import (
    MARKS,
    Section,
    absent,
    esc,
    figures,
    fold,
    legend,
    listing,
    mark,
    prose,
    status,
)
from identify.report.page import printable, sectioned
from identify.report.record import short
from identify.report.symbols import symbol_text
from identify.validation.comparison_findings import CHANGED, TITLES, UNCHANGED, cautions, findings

Comparison = Mapping[str, Any]
NAMED = 3
"""Logs, joints or parameters that a line names."""

FEW, MOST = 8, 12
"""Joints up to which the table of friction is open; joints whose curves a page draws, those that differ most."""


def comparison_page(comparison: Comparison) -> str:
    """A comparison as HTML, a pure function of what `validation.comparison.compare` gives."""
    clean: Comparison = printable(comparison)
    with drawing():
        made = [_answers(clean), _results(clean), _prediction(clean), _friction(clean), _parameters(clean)]
        made += [_physics(clean), _provenance(clean)]
    return sectioned(f"{clean['robot']['name']}: two results compared", _header(clean), made)


def _header(comparison: Comparison) -> str:
    told = "".join(
        f'<p class="meta"><b>{name}</b> {esc(side["folder"])}, trained on {esc(_logs(side))}</p>'
        for name, side in zip("AB", comparison["results"], strict=True)
    )
    simulated = [side["simulated"] for side in comparison["results"]]
    banner = ""
    if any(simulated):
        which = "Both results come" if all(simulated) else f"{'A' if simulated[0] else 'B'} comes"
        what = f"{which} from a simulated robot, not from a real one."
        banner = f'<p class="simulated"><b>Simulated data</b> {what}</p>'
    name = esc(comparison["robot"]["name"])
    return f'<header><p class="kind">Two results compared</p><h1>{name}</h1>{told}{banner}</header>'


def _logs(side: Mapping[str, Any]) -> str:
    names = [short(log["path"]) for log in side["logs"] if log["role"] == "train"]
    return first(names, NAMED)


def _answers(comparison: Comparison) -> Section:
    """One sentence, a line for each question, and what has to be known before any of it is believed."""
    found = findings(comparison)
    states = [row["state"] for row in found[:2]]
    shape = mark("warn" if CHANGED in states else "accept" if set(states) == {UNCHANGED} else "NOT TESTED")
    lines = "".join(
        f'<li class="{MARKS.get(row["state"], "open")}">{status(row["state"])}'
        f"<span><b>{TITLES[row['about']]}.</b> {prose(row['text'])}</span></li>"
        for row in found
    )
    body = f'<p class="answer">{shape} <span>{esc(answer(comparison))}</span></p><ul class="uses answers">{lines}</ul>'
    warnings = tuple(prose(text) for text in cautions(comparison))
    return Section("answers", 1, "Answers", "What changed, and which is better?", body, warnings=warnings)


def answer(comparison: Comparison) -> str:
    """The first sentence, in plain text."""
    if comparison["same_parameters"]:
        return "The two results hold the same parameters."
    states = {row["about"]: row["state"] for row in findings(comparison)}
    joints = [row["joint"] for row in comparison["friction"] if row["changed"]]
    links = [symbol_text(row["name"]) for row in comparison["parameters"] if row["changed"]]
    if comparison["fitted_by_both"]:
        told = ["both rest on a log in common, so that no change of the robot can be told"]
    else:
        told = [
            _changed(states["friction"], "friction", joints),
            _changed(states["links"], "link and motor parameters", links),
        ]
    state = states["prediction"]
    told.append(f"{state[0]} predicts better" if state.endswith("BETTER") else "neither is seen to predict better")
    text = "; ".join(told)
    return f"{text[0].upper()}{text[1:]}."


def _changed(state: str, what: str, names: Sequence[str]) -> str:
    if state == CHANGED:
        return f"{what} changed" + (f" ({first(names, NAMED)})" if names else "")
    return f"no change of {what} is seen" if state == UNCHANGED else f"changes of {what} can’t be told"


def _results(comparison: Comparison) -> Section:
    robot = comparison["robot"]
    if robot["same"]:
        told = "Both are of the same robot file."
    elif robot["differs"]:
        told = f"The robot files differ: {'; '.join(robot['differs'])}."
    else:
        told = "The robot files differ, though not in geometry, links, drives or limits."
    body = f'<p class="lead">{esc(told)}</p>{comparison_tables.about(comparison)}'
    return Section("results", 2, "Results", "What is compared with what?", body)


def _prediction(comparison: Comparison) -> Section:
    body = ""
    for log in sorted(comparison["logs"], key=lambda row: not row["fair"]):
        if not log["per_joint"]:
            continue
        name = short(log["path"])
        shown = _errors(log, f"Errors on {name}")
        if log["fair"]:
            body += f"<h3>{esc(name)}, held out from both</h3>{shown}"
        else:
            body += fold(f"{name}, {' and '.join(_roles(log))}", shown, "no fair contest")
    if not any(log["fair"] for log in comparison["logs"]):
        mend = "fit both with the same `--test` log to learn which is better"
        body = absent("No log was held out from both.", mend) + body
    shown = _errors(comparison["training"], "Errors on training logs")
    body += fold("Each on its own training logs", shown, "not a test: each fit has seen them")
    return Section("prediction", 3, "Prediction", "Which one is less wrong?", body)


def _errors(row: Mapping[str, Any], label: str) -> str:
    return f'<p class="lead">{comparison_tables.totals(row)}</p>{comparison_tables.residuals(row, label)}'


def _roles(log: Mapping[str, Any]) -> list[str]:
    words = {"test": "tested on by", "train": "fitted by"}
    return [f"{words[role]} {name}" for name, role in zip("AB", log["roles"], strict=True)]


def _friction(comparison: Comparison) -> Section:
    rows = comparison["friction"]
    order = sorted(range(len(rows)), key=lambda k: -_distance(rows[k]))[:MOST]
    drawn = [
        (esc(rows[k]["joint"]), esc(_caption(rows[k])), comparison_figures.friction(rows[k], f"f-{k}"))
        for k in sorted(order)
    ]
    marks = legend(("measured", "A"), ("predicted", "B"), ("error", "difference B − A"), ("rest", "±2σ of it"))
    body = marks + figures(drawn)
    if len(order) < len(rows):
        body += f'<p class="remark">The {MOST} joints that differ most; all are in the table.</p>'
    shown = comparison_tables.friction(rows)
    body += shown if len(rows) <= FEW else fold("Table of friction", shown, f"all {len(rows)} joints")
    return Section("friction", 4, "Friction", "Do the joints lose more?", body)


def _distance(row: Mapping[str, Any]) -> float:
    return max(abs(level["difference"]) / (level["std"] or 1e-300) for level in row["levels"])


def _caption(row: Mapping[str, Any]) -> str:
    word = "not tested" if row["changed"] is None else "changed" if row["changed"] else "no change seen"
    if row["same_forms"]:
        return word
    names = [set(forms) for forms in row["forms"]]
    alone = [(side, names[k] - names[1 - k]) for k, side in enumerate("AB")]
    told = [f"{', '.join(sorted(own))} in {side} alone" for side, own in alone if own]
    return f"{word}: {'; '.join(told) or 'forms with other constants'}".replace("_", " ")


def _parameters(comparison: Comparison) -> Section:
    rows = comparison["parameters"]
    count = sum(row["kind"] != "friction" for row in rows)
    factor = comparison["tests"]["factor"]
    lead = f"{len(rows)} parameters that both have, {count} of them of links and motors. By chance alone one in twenty"
    lead += " lies outside the band; what changed is told by a test that is corrected for their number."
    if factor > 1:
        lead += (
            f" The band is ±{significant(2 * factor, 2)} σ, as even those that differ least lie "
            f"{significant(factor, 3)} times as far off as chance has it."
        )
    drawn = []
    for key, title, chosen in (
        ("links", "Links and motors", [r for r in rows if r["kind"] != "friction" and r["z"] is not None]),
        ("friction", "Friction", [r for r in rows if r["kind"] == "friction" and r["z"] is not None]),
    ):
        if chosen:
            drawn.append((title, "", comparison_figures.distances(chosen, factor, f"z-{key}", title)))
    marks = legend(("dots", "a parameter"), ("odd", "changed"), ("rest", "within 2 σ"))
    body = f'<p class="lead">{esc(lead)}</p>{marks}{figures(drawn)}'
    panels = []
    for j in dict.fromkeys(_index(row) for row in rows):
        mine = [row for row in rows if _index(row) == j]
        title = f"Link and joint {j}" if j else "Others"
        panels.append((title, "", comparison_figures.estimates(mine, f"p-{j or 'x'}", title)))
    marks = legend(("dot", "A ± 2σ"), ("square", "B ± 2σ"))
    body += f"<h3>Both estimates</h3>{marks}{figures(panels)}"
    body += fold("Table of all parameters", comparison_tables.parameters(rows), f"{len(rows)} rows")
    alone = [(name, ", ".join(map(symbol_text, own))) for name, own in zip("AB", comparison["only"], strict=True)]
    body += listing([f"{name} alone has {own}" for name, own in alone if own], "reasons")
    return Section("parameters", 5, "Parameters", "Do the estimates agree?", body)


def _index(row: Mapping[str, Any]) -> str:
    """The digits that end a name: its link or joint."""
    return row["name"][len(row["name"].rstrip("0123456789")) :]


def _physics(comparison: Comparison) -> Section:
    title, question = "Physics", "Are the links alike?"
    rows = comparison["links"]
    if not rows:
        why = "not both of the results hold links that physics allows"
        return Section("physics", 6, title, question, absent("No links side by side.", why), why, folded=True)
    told = (
        "Joint torques leave open how parameters are shared out among the links: differences here can be a matter of "
        "that choice, where the parameters above agree."
    )
    body = f'<p class="remark">{esc(told)}</p>{comparison_tables.links(rows)}'
    return Section("physics", 6, title, question, body, "masses and centres of mass side by side", folded=True)


def _provenance(comparison: Comparison) -> Section:
    parts = []
    for name, side in zip("AB", comparison["results"], strict=True):
        entries = [("folder", esc(side["folder"])), ("command", f"<code>{esc(side['command'] or DASH)}</code>")]
        entries.append(("robot", _file(side["robot"]["source"], side["robot"]["sha256"])))
        entries += [(f"{log['role']} log", _file(log["path"], log["sha256"])) for log in side["logs"]]
        versions = ", ".join(f"{key} {text}" for key, text in (side["versions"] or {}).items())
        entries.append(("versions", esc(versions or DASH)))
        listed = "".join(f"<dt>{esc(key)}</dt><dd>{value}</dd>" for key, value in entries)
        parts.append(f'<h3>{name}</h3><dl class="provenance">{listed}</dl>')
    finding = "commands, versions, and the hashes of robot files and logs"
    return Section("provenance", 7, "Provenance", "Can I repeat it?", "".join(parts), finding, folded=True)


def _file(path: Any, digest: Any) -> str:
    hashed = f'<br><span class="hash">sha256 {esc(digest)}</span>' if digest else ""
    return f"{esc(path or DASH)}{hashed}"
