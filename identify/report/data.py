"""Section 7: was the motion enough, what was found in the logs, and what was done about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from identify.numbers import DASH, count, finite, given, interval, percent, significant
from identify.report import data_figures
from identify.report.markup import Notes, Section, absent, esc, figures, listing, prose, sentence, table, unit
from identify.report.record import UNKNOWN, Record, items, joints, part, reason, rejected, short

DONE = (
    ("position_cutoff_hz", "Positions passed a zero-phase low-pass of {} Hz before they were differentiated"),
    ("quiet_cutoff_hz", "Away from a joint's starts, stops and reversals that was {} Hz"),
    ("energy_cutoff_hz", "For energies, which need no acceleration, positions passed one of {} Hz"),
    ("effort_cutoff_hz", "Effort and every column of the model passed the same zero-phase low-pass of {} Hz"),
    ("decimated_rate_hz", "Rows were then kept at {} Hz"),
    ("window_s", "Energy was balanced over windows of {} s"),
    ("presliding_distance", "Presliding friction turns over within a few times {} rad (m where a joint slides)"),
    ("stribeck_velocity", "Of Stribeck friction 1/e is left at {} rad/s (m/s where a joint slides)"),
    ("still_rad_s", "A joint counts as at rest up to {} rad/s (m/s where it slides)"),
)
"""What a setting means, in words; {} is its number."""


def section(record: Record) -> Section:
    """Coverage of the limits, condition number in words, the logs, what was found in them and what was done."""
    rows = [row for row in items(record, "coverage", "per_joint") if isinstance(row, Mapping)]
    body = _logs(record) + _triage(record)
    if rows:
        robot = joints(record)
        drawn = []
        for what, title in (
            ("position", "Position range"),
            ("velocity", "Largest speed"),
            ("acceleration", "Largest acceleration"),
        ):
            bars = data_figures.coverage_rows(rows, robot, what)
            label = f"{title} in % of the limit: {', '.join(f'{name} {text}' for name, _, text in bars)}."
            drawn.append((title, "", data_figures.bars(bars, f"d-{what}", label)))
        body += "<h3>Coverage of the training motion</h3>" + figures(drawn, 3) + _coverage_table(rows, robot)
    else:
        body += absent("No coverage.", reason(record, "coverage"))
    words, number = condition_words(record)
    if not rejected(record):
        body += f"<h3>Condition number</h3><p>{esc(words)}</p><h3>What was done</h3>{_done(record)}"
    found = tuple(
        f"<b>{esc(short(part(log, 'path')))}:</b> {prose(text)}"
        for log in items(record, "logs")
        for text in items(log, "findings")
    )
    shares = [s for row in rows if (s := finite(row.get("position_limit_percent"))) is not None]
    told = (
        [f"{significant(min(shares), 2)} to {significant(max(shares), 2)} % of the position range used"]
        if shares
        else []
    )
    told += [f"scaled condition number {number}"] if number != DASH else []
    told += [] if found else ["nothing wrong found in the logs"]
    finding = "; ".join(told)
    return Section("data", 7, "Data", "Was the motion enough?", body, finding, found, folded=not rejected(record))


def condition_words(record: Record) -> tuple[str, str]:
    """The column-scaled condition number as a sentence, and as a number."""
    value = finite(part(record, "fit", "condition_number"))
    if value is None:
        return sentence(f"not available: {reason(record, 'fit', 'condition_number')}"), DASH
    text = significant(value, 2)
    words = (
        f"With every column scaled to the same length, the condition number is {text}: measured with the same noise, "
        f"the best determined combination of parameters is {text} times more certain than the worst determined one. "
        "1 would be ideal; adding motion that excites the worst combination lowers it."
    )
    return words, text


def _logs(record: Record) -> str:
    rows = []
    notes = Notes()
    for log in items(record, "logs"):
        kind = "simulated" if part(log, "simulated") else "recorded"
        if part(log, "simulated") and part(log, "noise"):
            kind += f", noise {part(log, 'noise')}"
        figures_of = [count(part(log, "samples")), given(part(log, "rate_hz"), 5), given(part(log, "duration_s"), 3)]
        cells = [esc(short(part(log, "path"))), esc(part(log, "role") or ""), *map(esc, figures_of), esc(kind)]
        rows.append([cell if cell != DASH else notes.missing("not recorded") for cell in cells])
    head = [("log", "text"), ("role", "text"), ("samples", "number"), ("rate" + unit("Hz"), "number")]
    head += [("duration" + unit("s"), "number"), ("origin", "text")]
    return table(head, rows, "Logs", notes) if rows else absent("No logs.", reason(record, "logs"))


def _triage(record: Record) -> str:
    """What was found in the logs, how bad it is, and what was done about it."""
    rows = [
        [
            esc(short(part(log, "path"))),
            *(esc(part(found, key) or "") for key in ("kind", "severity", "text", "action")),
        ]
        for log in items(record, "logs")
        for found in items(log, "triage")
    ]
    head = [(title, "text") for title in ("log", "finding", "severity", "what was found", "what was done")]
    return "<h3>Findings</h3>" + table(head, rows, "Findings in the logs") if rows else ""


def _coverage_table(rows: Sequence[Mapping[str, Any]], robot: Sequence[Mapping[str, Any]]) -> str:
    notes = Notes()
    by_name = {joint["name"]: joint for joint in robot}
    position_units = list(dict.fromkeys(joint["position_unit"] for joint in robot))
    one = position_units[0] if len(position_units) == 1 else ""
    names = {"position": "position", "velocity": "largest speed", "acceleration": "largest acceleration"}
    powers = {"position": "", "velocity": "/s", "acceleration": "/s²"}
    head = [("joint", "text")] + ([] if one else [("unit of position", "text")])
    for what, name in names.items():
        head += [(name + (unit(one + powers[what]) if one else ""), "number"), ("of the limit" + unit("%"), "number")]
    body = []
    for row in rows:
        joint = by_name.get(str(row.get("joint")), {})
        cells = [esc(row.get("joint", ""))] + ([] if one else [esc(joint.get("position_unit", ""))])
        pair = (*items(row, "position"), None, None)[:2]
        values = [interval(*pair), *(given(row.get(key), 3) for key in ("velocity_max", "acceleration_max"))]
        for what, value in zip(names, values, strict=True):
            share = finite(row.get(f"{what}_limit_percent"))
            why = reason(row, f"{what}_limit_percent")
            why = "the robot description gives no limit" if why == UNKNOWN else why
            cells += [esc(value), notes.missing(why) if share is None else significant(share, 2)]
        body.append(cells)
    return table(head, body, "Coverage of the limits", notes)


def _done(record: Record) -> str:
    """The settings as sentences: filter, decimation, rest, friction form, how they were chosen."""
    settings = part(record, "settings")
    if not isinstance(settings, Mapping):
        return absent("No settings.", reason(record, "settings"))
    told = [words.format(given(settings[key])) for key, words in DONE if finite(settings.get(key)) is not None]
    if settings.get("rest_counted") is not None:
        counted = (
            "Rows of a joint at rest count as any other" if settings["rest_counted"] else "Rows of a joint at rest"
        )
        guard = finite(settings.get("guard_s"))
        near = f" and those within {given(guard)} s of them" if guard else ""
        told.append(counted if settings["rest_counted"] else f"{counted}{near} were left out")
    if settings.get("coulomb_form"):
        width = finite(settings.get("coulomb_velocity"))
        through = f", with a linear passage from −{given(width)} to {given(width)} rad/s (or m/s)" if width else ""
        told.append(f"Coulomb friction follows the {settings['coulomb_form']} of the velocity{through}")
    if settings.get("chosen_by"):
        told.append(f"These settings were chosen by {settings['chosen_by']}{_candidates(settings)}")
    return listing(told, "done")


def _candidates(settings: Mapping[str, Any]) -> str:
    """How many settings were tried, and the least residual on blocks left out."""
    scores = [s for c in items(settings, "candidates") if (s := finite(part(c, "moving_percent"))) is not None]
    if not scores:
        return ""
    least = f"the least residual on blocks left out was {percent(min(scores))}, moving"
    return f", out of {len(scores)} candidates; {least}"
