"""A page about one log: what it holds, what is odd about it, every joint's curves. One self-contained HTML file."""

from __future__ import annotations

from collections.abc import Sequence

from identify.logs.log import Log
from identify.logs.triage import Findings
from identify.numbers import count, given, interval, percent, significant
from identify.report import curve_figures
from identify.report.drawing import drawing
from identify.report.markup import SPRITE, esc, figures, listing, mark, table, unit
from identify.report.page import document
from identify.report.record import short
from identify.robot.robot import Robot

_BINS = 400


def inspection_page(found: Findings, log: Log, reasons: Sequence[str], robot: Robot | None = None) -> str:
    """The page as HTML, a pure function of its input. reasons: why the log can't support a fit; empty where it can."""
    units = {joint.name: (joint.position_unit, joint.effort_unit) for joint in robot.joints} if robot else {}
    rows = [
        {"name": name, "position_unit": pair[0], "effort_unit": pair[1]}
        for name in log.joints
        for pair in [units.get(name, ("rad or m", "N·m or N"))]
    ]
    word = "reject" if reasons else ("warn" if found.findings else "accept")
    told = "It can't support a fit" if reasons else "Nothing here speaks against a fit"
    facts = (
        f"{count(found.samples)} samples over {given(found.duration, 4)} s at {given(found.rate_hz, 5)} Hz, "
        f"{significant(found.motion, 3)} s of it in motion; {count(found.dropped)} rows dropped."
    )
    with drawing():
        panels = [(esc(row["name"]), "", _panel(log, k, row)) for k, row in enumerate(rows)]
    name = short(found.source) or "log"
    body = (
        f"{SPRITE}\n<main>\n<header><h1>{esc(name)}</h1><p>{esc(facts)}</p>"
        f"<p><b>{mark(word)} {told}.</b></p></header>\n"
        f"{listing(reasons)}<section><h2>What was found</h2>{findings_table(found)}</section>\n"
        f"<section><h2>Joints</h2>{_joints(found)}</section>\n"
        f"<section><h2>Curves</h2>{figures(panels)}</section>\n</main>"
    )
    return document(f"{name}: inspection", body)


def findings_table(found: Findings) -> str:
    """Kind, severity, sentence and what was done, a row each."""
    if not found.findings:
        return "<p>Nothing odd was found.</p>"
    head = [("finding", "text"), ("severity", "text"), ("what", "text"), ("what was done", "text")]
    rows = [[esc(f.kind), esc(f.severity), esc(f.text), esc(f.action)] for f in found.findings]
    return table(head, rows, "Findings")


def _joints(found: Findings) -> str:
    head = [
        ("joint", "text"),
        ("position" + unit("rad or m"), "number"),
        ("largest speed" + unit("rad/s or m/s"), "number"),
    ]
    head += [("effort" + unit("N·m or N"), "number"), ("at rest", "number")]
    rows = [
        [
            esc(facts.joint),
            esc(interval(facts.position_min, facts.position_max)),
            esc(significant(facts.max_speed, 3)),
            esc(interval(facts.effort_min, facts.effort_max)),
            esc(percent(100 * facts.rest_share)),
        ]
        for facts in found.joints
    ]
    return table(head, rows, "Joints")


def _panel(log: Log, k: int, joint: dict[str, str]) -> str:
    """Effort and beneath it position of joint k; position alone where there is no effort."""
    arrays = {"time": log.time, "measured": log.position}
    if log.effort is None:
        joint = joint | {"effort_unit": joint["position_unit"]}
    else:
        arrays |= {"measured": log.effort, "position": log.position}
    return curve_figures.panel(arrays, k, joint, {}, f"i{k}", _BINS)
