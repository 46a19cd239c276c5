"""The page of a load: what it weighs and where, how sure that is, and what speaks for it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identify.estimation.payload_result import answer, load_payload, subscripts
from identify.logs.files import replacing
from identify.numbers import DASH, column, entry, finite, given, percent, significant
from identify.report.curve_figures import panel
from identify.report.drawing import drawing
from identify.report.markup import (
    Notes,
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
    table,
    unit,
    warned,
)
from identify.report.page import printable, sectioned
from identify.report.record import Record, items, joint_row, joints, part, reason, rejected, short
from identify.report.symbols import symbol_html
from identify.report.verdict import simulated_banner

NAMES = {"mass": "mass", "com_x": "centre x", "com_y": "centre y", "com_z": "centre z"}
NAMES |= {f"I{axes}": f"I<sub>{axes}</sub>" for axes in ("xx", "xy", "xz", "yy", "yz", "zz")}
BINS = 240
"""Points of a curve are the extremes of so many bins."""

FORMS = {"viscous": "viscous", "coulomb": "Coulomb", "offset": "offset"}


def render(record: dict[str, Any], curves: Mapping[str, np.ndarray]) -> str:
    """The report as HTML, a pure function of the record of `payload.json` and the arrays of `curves.npz`."""
    clean: Record = printable(record)
    with drawing():
        sections = [_verdict(clean)]
        if not rejected(clean):
            sections += [_load(clean), _residuals(clean, curves), _friction(clean), _physics(clean)]
        sections.append(_provenance(clean, len(sections) + 1))
    name = part(clean, "robot", "name") or "robot"
    return sectioned(f"{name}: load", _header(clean), sections)


def write_payload_page(folder: str | os.PathLike[str]) -> Path:
    """Write `report.html` into a payload's folder anew, from `payload.json` and `curves.npz`; its path.

    InputError where the folder holds no payload, OutputError where the report can't be written.
    """
    record, curves = load_payload(Path(folder))
    path = Path(folder) / "report.html"
    with replacing(path) as stream:
        stream.write(render(record, curves).encode())
    return path


def _header(record: Record) -> str:
    loaded = [log for log in items(record, "logs") if part(log, "role") == "loaded"]
    seconds = sum(float(log.get("duration_s") or 0) for log in loaded)
    told = f"{len(loaded)} log{'s' * (len(loaded) != 1)} with the load, {given(seconds, 3)}\u00a0s"
    told += f" · arm by {part(record, 'unloaded', 'estimator') or 'an earlier fit'}"
    return (
        f'<header><p class="kind">Identification of a load</p><h1>{esc(part(record, "robot", "name") or "Robot")}</h1>'
        f'<p class="meta">{esc(told)}</p>{simulated_banner(record)}</header>'
    )


def _verdict(record: Record) -> Section:
    word = str(part(record, "verdict", "status") or "")
    reasons, actions = items(record, "verdict", "reasons"), items(record, "verdict", "actions")
    body = [f'<p class="answer">{mark(word)} <span>{esc(answer(dict(record)))}</span></p>']
    if rejected(record):
        body.append("<h3>Why</h3>" + listing(reasons, "reasons"))
    else:
        body += [warned([prose(text) for text in reasons]), _glance(record)]
    if actions:
        steps = "".join(f"<li>{prose(text)}</li>" for text in actions)
        body.append(f'<h3>What to do next</h3><ol class="actions">{steps}</ol>')
    return Section("verdict", 1, "Verdict", "What does it carry?", "".join(body))


def _glance(record: Record) -> str:
    """Figures at a glance."""
    body = {row["name"]: row for row in items(record, "load", "body")}
    mass, centre = body["mass"], [body[f"com_{axis}"] for axis in "xyz"]
    weight, sigma = entry(mass["estimate"], mass["std"])
    shown = [
        (weight, "mass [kg], as stated" if mass.get("known") else f"mass [kg], ± {sigma}"),
        (_farthest(centre), "largest standard deviation of the centre of mass [mm]"),
        (percent(part(record, "fit", "without", "moving_relative_residual_percent")), "error while moving, no load"),
        (percent(part(record, "fit", "with", "moving_relative_residual_percent")), "error while moving, with load"),
    ]
    known = sum(bool(part(row, "identified")) for row in body.values())
    shown.append((f"{known} of {len(body)}", "parameters known within 10 %"))
    cells = "".join(f"<div><dt>{esc(words)}</dt><dd>{esc(value)}</dd></div>" for value, words in shown)
    return f'<dl class="glance">{cells}</dl>'


def _farthest(rows: Sequence[Mapping[str, Any]]) -> str:
    spread = [1e3 * s for row in rows if (s := finite(row.get("std"))) is not None]
    return significant(max(spread), 2) if len(spread) == len(rows) else DASH


def _load(record: Record) -> Section:
    """The ten parameters in every form that somebody may need."""
    load = part(record, "load")
    frame = subscripts(str(load["frame"]))
    body = [f'<p class="lead">{prose(subscripts(load["frame_note"]))}</p>']
    body.append(_table(record, load["body"], f"Mass, centre of mass, inertia in the axes of {frame}", True))
    if load["flange"]:
        body.append("<h3>In the frame of the flange</h3>")
        body.append('<p class="remark">The tool frame that the robot file places in the last one.</p>')
        body.append(_table(record, load["flange"], "The load in the tool frame"))
    else:
        body.append(f'<p class="remark">{prose(load["flange_reason"])}</p>')
    origin = f"O{frame[1:]}"
    more = _table(record, load["standard"], f"Standard parameters about {origin}")
    body.append(fold(f"About {origin}, as standard parameters", more, "first moments and inertia about the origin"))
    body.append(_gains(record))
    return Section("load", 2, "Load", "Mass, centre of mass, inertia?", "".join(body))


def _table(record: Record, rows: Sequence[Mapping[str, Any]], label: str, told: bool = False) -> str:
    """Value, σ, share, truth and state of each quantity; told: whether the notes say what a share is of."""
    truth = any(finite(row.get("truth")) is not None for row in rows)
    head = [("quantity", "text"), ("value", "value"), ("± σ", "sigma"), ("unit", "text"), ("share", "number")]
    head += [("truth", "number"), ("z", "number")] if truth else []
    head += [("state", "text")]
    notes, cells = Notes(), []
    for row in rows:
        value, sigma = entry(row.get("estimate"), row.get("std"))
        name = str(row["name"])
        line = [NAMES.get(name) or symbol_html(name)]
        if row.get("estimate") is None:
            line += [notes.missing(str(part(record, "load", "untold_reason"))), ""]
        else:
            line += [esc(value), "as stated" if row.get("known") else f"± {esc(sigma)}"]
        line += [esc(row.get("unit") or ""), esc(percent(row.get("relative_std_percent")))]
        if truth:
            true, z = finite(row.get("truth")), _score(row)
            line += [DASH if true is None else esc(entry(true, row.get("std"))[0]), esc(column([z], most=2)[0])]
        cells.append([*line, status(_state(row))])
    if told:
        notes.plain.append(
            "The share is that of σ in the mass, the distance of the centre of mass from the origin, the length of the "
            "first moments, the largest of the inertias; identified: below 10 %. Products of inertia are matrix entries"
        )
        if not truth:
            notes.plain.append(f"No truth: {part(record, 'load', 'truth_reason')}")
    return table(head, cells, label, notes)


def _score(row: Mapping[str, Any]) -> float | None:
    value, sigma, true = (finite(row.get(key)) for key in ("estimate", "std", "truth"))
    return None if value is None or true is None or not sigma else (value - true) / sigma


def _state(row: Mapping[str, Any]) -> str:
    relative = finite(row.get("relative_std_percent"))
    if row.get("known") or row.get("identified"):
        return "identified"
    return "weak" if row.get("estimate") is not None and relative is not None and relative < 100 else "not determined"


def _gains(record: Record) -> str:
    rows = items(record, "gains")
    if not rows:
        return ""
    head = [("joint", "text"), ("gain", "value"), ("± σ", "sigma"), ("unit", "text"), ("σ" + unit("%"), "number")]
    cells = []
    for row in rows:
        value, sigma = entry(row["estimate"], row["std"])
        relative = significant(row["relative_std_percent"], 2)
        cells.append([esc(row["joint"]), esc(value), f"± {esc(sigma)}", esc(row["unit"]), esc(relative)])
    told = (
        "What the logged effort has to be multiplied by. The stated mass sets their scale: if it is off by 1 %, so are "
        "all gains. Put them into the map of the table as effort gains and fit again."
    )
    return f'<h3>Drive gains</h3><p class="remark">{esc(told)}</p>{table(head, cells, "Drive gains")}'


def _residuals(record: Record, curves: Mapping[str, np.ndarray]) -> Section:
    """What the arm alone leaves of the effort, and what arm and load leave of it."""
    before, after = (part(record, "fit", key) for key in ("without", "with"))
    lead = (
        f"The arm without a load leaves {percent(before['moving_relative_residual_percent'])} of the effort in motion "
        f"unexplained, the arm with the load {percent(after['moving_relative_residual_percent'])}; the fit left "
        f"{percent(part(record, 'unloaded', 'moving_relative_residual_percent'))} of its own log."
    )
    chi, free = part(record, "fit", "chi_squared"), part(record, "fit", "degrees_of_freedom")
    if chi is not None:
        lead += (
            f" Against parameters of its own the log is explained worse by χ² = {significant(chi, 2)}; chance alone "
            f"would give about {significant(free, 2)}."
        )
    lead += (
        " Drawn is the effort beyond that of the arm without its load: what the log has, and what the load explains."
    )
    marks = legend(("", "measured"), ("predicted", "load"), ("error", "error"), ("rest", "at rest"))
    panels = []
    for k in range(len([log for log in items(record, "logs") if part(log, "role") == "loaded"])):
        arrays = {name.partition("/")[2]: x for name, x in curves.items() if name.startswith(f"loaded{k}/")}
        if not arrays:
            continue
        beyond = {key: arrays[key] - arrays["without"] for key in ("measured", "predicted")}
        beyond |= {key: arrays[key] for key in ("time", "moving")}
        for j, joint in enumerate(joints(record)):
            rows = [joint_row(figure, joint["name"]) for figure in (before, after)]
            remark = " → ".join(significant(row.get("moving_rmse")) for row in rows) + f" {joint['effort_unit']} rms"
            panels.append((esc(joint["name"]), esc(remark), panel(beyond, j, joint, rows[1], f"r-{k}-{j}", BINS)))
    body = f'<p class="lead">{esc(lead)}</p>{marks}{figures(panels)}'
    tests = items(record, "test")
    if tests:
        told = [
            f"{short(part(t, 'path'))}: {percent(part(t, 'moving_relative_residual_percent'))} of the effort in motion"
            for t in tests
        ]
        body += "<h3>Logs with the load that were not fitted</h3>" + listing(told, "reasons")
    return Section("residual", 3, "Residual", "Is it the load?", body)


def _friction(record: Record) -> Section:
    """How friction under load differs from the fit's."""
    title, question = "Friction", "Did it change with the load?"
    rows = [row for row in items(record, "friction") if isinstance(row, Mapping)]
    keys = [key for key in (*FORMS, *{k for row in rows for k in row}) if any(key in row for row in rows)]
    keys = [key for key in dict.fromkeys(keys) if key not in ("joint", "beyond")]
    if not keys:
        why = "friction was held to that of the fit"
        return Section("friction", 4, title, question, absent("Not asked.", why), why, folded=True)
    head = [("joint", "text")]
    for key in keys:
        head += [(FORMS.get(key, key.replace("_", " ")), "number"), ("change", "value"), ("± σ", "sigma")]
    cells, sure = [], []
    for row in rows:
        line = [esc(row["joint"])]
        for key in keys:
            found = row.get(key)
            if not isinstance(found, Mapping):
                line += ["", "", ""]
                continue
            value, sigma = entry(found["change"], found["std"])
            line += [esc(significant(found["unloaded"])), esc(value), f"± {esc(sigma)}"]
            if abs(found["change"]) > 3 * found["std"]:
                sure.append(f"{row['joint']} {FORMS.get(key, key)}")
        cells.append(line)
    finding = f"changed by more than 3 σ: {', '.join(sure)}" if sure else "no friction changed by more than 3 σ"
    told = (
        "Friction under load is free: it may differ from the fit's by as much as itself (1 σ). Beside each value of "
        "the fit stands the change that the log tells, in N·m (N for sliding joints), per rad/s (m/s) if viscous."
    )
    body = f'<p class="remark">{esc(told)}</p>{table(head, cells, "Friction under load")}'
    return Section("friction", 4, title, question, body, finding, folded=True)


def _physics(record: Record) -> Section:
    """Whether a body can have these parameters, and the nearest that can."""
    title, question = "Physics", "Is it a possible body?"
    physical = part(record, "physical")
    if not isinstance(physical, Mapping):
        why = reason(record, "physical")
        return Section("physics", 5, title, question, absent("No possible body.", why), why, folded=True, why=why)
    if physical["consistent"] and not physical["moved"]:
        lead = "Yes: some distribution of mass has exactly the estimated parameters."
    elif physical["consistent"]:
        lead = "Yes; what the logs do not tell is filled in by an even ball about the centre of mass."
    else:
        lead = (
            "Not exactly: no distribution of mass has the estimated parameters. The nearest that has costs χ² = "
            f"{significant(physical['cost'], 2)}; one parameter off by one σ would cost 1."
        )
    rows = [
        [NAMES[row["name"]], esc(significant(row["value"], 4)), esc(row["unit"])] for row in items(physical, "body")
    ]
    moments = ", ".join(significant(x, 3) for x in items(physical, "principal_moments"))
    told = (
        f"Principal moments about the centre of mass {moments} kg·m²; the smaller two exceed the largest by "
        f"{significant(physical['triangle_margin'], 2)} kg·m². Smallest eigenvalue of the pseudo-inertia: "
        f"{significant(physical['min_eigenvalue'], 2)} as estimated, "
        f"{significant(physical['nearest_min_eigenvalue'], 2)} of the body below (SI)."
    )
    head = [("quantity", "text"), ("value", "value"), ("unit", "text")]
    body = f'<p class="remark">{esc(told)}</p>'
    body += table(head, rows, "A possible body, for a simulator or a controller")
    return Section("physics", 5, title, question, body, lead, folded=True)


def _provenance(record: Record, number: int) -> Section:
    origin = part(record, "unloaded") or {}
    entries = [("command", f"<code>{esc(part(record, 'command') or DASH)}</code>")]
    robot = part(record, "robot") or {}
    entries += [("robot", _file(robot.get("source"), robot.get("sha256")))]
    entries += [("unloaded fit", _file(origin.get("path") or "a result in memory", origin.get("sha256")))]
    entries += [("its command", f"<code>{esc(origin.get('command') or DASH)}</code>")]
    for whose, logs in (("its ", items(origin, "logs")), ("", items(record, "logs"))):
        entries += [(f"{whose}{part(x, 'role')} log", _file(part(x, "path"), part(x, "sha256"))) for x in logs]
    versions = part(record, "versions") or {}
    entries.append(("versions", esc(", ".join(f"{k} {v}" for k, v in versions.items()))))
    settings = part(record, "settings")
    if isinstance(settings, Mapping):
        plain = [(k, v) for k, v in settings.items() if isinstance(v, (str, int, float))]
        shown = ", ".join(f"<code>{esc(k)} = {esc(given(v) if isinstance(v, float) else v)}</code>" for k, v in plain)
        entries.append(("settings", shown))
    entries.append(("format", esc(part(record, "format") or DASH)))
    body = "".join(f"<dt>{esc(name)}</dt><dd>{value}</dd>" for name, value in entries)
    finding = "command, settings, versions, and the hashes of the robot file, the fit and the logs"
    body = f'<dl class="provenance">{body}</dl>'
    return Section("provenance", number, "Provenance", "Can I repeat it?", body, finding, folded=True)


def _file(path: Any, digest: Any) -> str:
    hashed = f'<br><span class="hash">sha256 {esc(digest)}</span>' if digest else ""
    return f"{esc(path or DASH)}{hashed}"
