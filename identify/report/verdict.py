"""Section 1: may I use it, and for what?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from identify.numbers import count, given, percent, significant
from identify.report.markup import MARKS, Section, esc, listing, mark, prose, status, warned
from identify.report.record import Record, items, logs, part, reason, rejected, short, tests

ANSWERS = {"MET": "may be used for", "NOT MET": "falls short for", "NOT TESTED": "has not been tested for"}


def section(record: Record) -> Section:
    """The verdict: an answer in one sentence, one line for each use, the figures behind it, what to do next."""
    status_word = str(part(record, "verdict", "status") or "")
    reasons = items(record, "verdict", "reasons")
    body = [f'<p class="answer">{mark(status_word)} <span>{answer(record)}</span></p>']
    if rejected(record):
        body.append("<h3>Why</h3>" + listing(reasons or [reason(record, "verdict", "status")], "reasons"))
    elif status_word == "warn":
        body.append(warned([prose(r) for r in reasons]))
    else:
        body.append(listing(reasons, "reasons"))
    if not rejected(record):
        body += [_uses(record), _figures(record)]
    actions = items(record, "verdict", "actions")[:3]
    if actions:
        steps = "".join(f"<li>{prose(a)}</li>" for a in actions)
        body.append(f'<h3>What to do next</h3><ol class="actions">{steps}</ol>')
    return Section("verdict", 1, "Verdict", "May I use it, and for what?", "".join(body))


def uses(record: Record) -> list[Mapping[str, Any]]:
    """The uses of the verdict; without a test log nothing counts as tested, whatever the record says."""
    tested = bool(tests(record))
    found: list[Mapping[str, Any]] = []
    for use in items(record, "verdict", "uses"):
        word = str(part(use, "status") or "NOT TESTED")
        found.append({**use, "status": word if tested and word in ANSWERS else "NOT TESTED"})
    return found


def answer(record: Record) -> str:
    """The first sentence of the report, HTML."""
    if rejected(record):
        return "<b>No.</b> These logs can’t support a model, and none was made."
    parts = []
    for word, phrase in ANSWERS.items():
        names = [esc(use.get("use", "")) for use in uses(record) if use["status"] == word]
        if names:
            parts.append(f"{phrase} <b>{_joined(names)}</b>")
    if not parts:
        return "The model has not been tested for any use."
    return f"The model {'; it '.join(parts)}."


def _joined(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _uses(record: Record) -> str:
    rows = []
    for use in uses(record):
        word = use["status"]
        why = use.get("result") or use.get("result_reason") or ("no test log was given" if not tests(record) else "")
        limit, source = use.get("limit"), use.get("limit_source")
        told = [f"<b>{esc(str(use.get('use', '')).capitalize())}.</b>"]
        if why:
            told.append(prose(_figure(why)))
        if limit not in (None, ""):
            whose = f" ({source})" if source else ""
            told.append(prose(f"Limit: {_figure(limit)}{whose}"))
        elif word != "NOT TESTED":
            told.append(
                prose(f"No limit was given{': ' + str(use['limit_reason']) if use.get('limit_reason') else ''}")
            )
        if word != "NOT TESTED":
            told.append(prose(f"Data: {use.get('data') or ', '.join(short(part(t, 'path')) for t in tests(record))}"))
        if use.get("action"):
            told.append(f'<span class="todo">{prose(use["action"])}</span>')
        rows.append(f'<li class="{MARKS[word]}">{status(word)}<span>{" ".join(told)}</span></li>')
    return f'<ul class="uses">{"".join(rows)}</ul>' if rows else ""


def _figure(value: Any) -> str:
    return percent(value, 3) if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)


def _figures(record: Record) -> str:
    """Four figures at a glance, each with its unit and what it is."""
    held_out = tests(record)
    results = held_out[0] if held_out else part(record, "fit") or {}
    where = "unseen motion" if held_out else "training motion only"
    parameters = items(record, "base_parameters")
    known = sum(bool(part(p, "identified")) for p in parameters)
    shown = [
        (percent(part(results, "moving_relative_residual_percent")), f"error while moving, {where}"),
        (percent(part(results, "relative_residual_percent")), f"error with rest counted, {where}"),
    ]
    nominal = part(results, "nominal_relative_residual_percent")
    if nominal is not None:
        shown.append((percent(nominal), "error of the nominal model, same motion"))
    shown.append((f"{known} of {len(parameters)}", "base parameters identified"))
    shown.append((significant(part(record, "fit", "condition_number"), 2), "scaled condition number"))
    cells = "".join(f"<div><dt>{esc(words)}</dt><dd>{esc(value)}</dd></div>" for value, words in shown)
    return f'<dl class="glance">{cells}</dl>'


def header(record: Record) -> str:
    """Title of the page: the robot, where the numbers come from, and whether any of them is simulated."""
    robot = part(record, "robot") or {}
    train, test = logs(record, "train"), logs(record, "test")
    if rejected(record):
        told = f"No model · {_recorded('looked at', items(record, 'logs'))}"
    else:
        told = f"{str(part(record, 'model') or 'torque').capitalize()} model"
        told += f" by {part(record, 'estimator')}" if part(record, "estimator") else ""
        told += f" · {_recorded('trained on', train)}" if train else " · no training log"
        told += f" · {_recorded('tested on', test)}" if test else " · no test log"
    note = f'<p class="remark">{prose(robot["note"])}</p>' if robot.get("note") else ""
    title = esc(robot.get("name") or "Robot")
    return (
        f'<header><p class="kind">Identification of dynamic parameters</p><h1>{title}</h1>'
        f'<p class="meta">{esc(told)}</p>{simulated_banner(record)}{note}</header>'
    )


def simulated_banner(record: Record) -> str:
    """A visible word on the first screen where any log is a simulation; nothing where all were recorded."""
    marked = [log for log in items(record, "logs") if part(log, "simulated")]
    if not marked and not part(record, "simulated"):
        return ""
    everything = not marked or len(marked) == len(items(record, "logs"))
    if everything:
        what = "Every number here comes from a simulated robot, not from a real one."
    else:
        what = f"Simulated, not recorded: {', '.join(short(log.get('path')) for log in marked)}."
    noise = sorted({str(log["noise"]) for log in marked if log.get("noise")})
    if noise:
        what += f" Sensor noise: {', '.join(noise)}."
    return f'<p class="simulated"><b>Simulated data</b> {esc(what)}</p>'


def _recorded(verb: str, chosen: list[Mapping[str, Any]]) -> str:
    duration = sum(float(log.get("duration_s") or 0) for log in chosen)
    samples = sum(int(log.get("samples") or 0) for log in chosen)
    logs_word = "1 log" if len(chosen) == 1 else f"{len(chosen)} logs"
    lasting = f", {given(duration, 3)}\u00a0s" if duration else ""
    return f"{verb} {logs_word}{lasting}, {count(samples)}\u00a0samples"
