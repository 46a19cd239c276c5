"""The page of a batch: what came of each log, whether they agree, and which is the odd one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import quote

from identify.logs.wording import counted, first
from identify.numbers import DASH, column, given, percent, significant
from identify.report import batch_figures
from identify.report.drawing import drawing
from identify.report.markup import (
    SPRITE,
    Notes,
    Section,
    esc,
    figures,
    fold,
    legend,
    listing,
    mark,
    prose,
    status,
    table,
)
from identify.report.page import document, printable, section_html
from identify.report.record import short
from identify.report.symbols import symbol_html

Summary = Mapping[str, Any]
MOST = 4
"""Parameters of one log that a sentence names."""

WITHOUT = ("reject", "failed")
"""States of logs without a model."""


def batch_page(summary: Summary) -> str:
    """The summary of a batch as HTML, a pure function of summary.json; its links lead to the results beside it."""
    clean: Summary = printable(summary)
    name = (clean["robot"] or {}).get("name") or "Robot"
    with drawing():
        sections = "\n".join(section_html(s) for s in (_logs(clean), _agreement(clean), _provenance(clean)))
    main = f"{SPRITE}\n<main>\n{_header(clean, name)}\n{sections}\n</main>"
    return document(f"{name}: {counted(len(clean['fits']), 'log')}", main)


def _header(summary: Summary, name: str) -> str:
    told = f"{str(summary['model']).capitalize()} model"
    told += f" by {summary['estimator']}" if summary["estimator"] else ""
    told += f" · {counted(len(summary['fits']), 'log')}, each fitted on its own"
    simulated = [fit["name"] for fit in summary["fits"] if fit["simulated"]]
    banner = ""
    if simulated:
        every = len(simulated) == sum(fit["simulated"] is not None for fit in summary["fits"])
        what = "All logs here come from a simulated robot, none from a real one." if every else _listed(simulated)
        banner = f'<p class="simulated"><b>Simulated data</b> {esc(what)}</p>'
    return (
        f'<header><p class="kind">Identification of dynamic parameters, many logs</p><h1>{esc(name)}</h1>'
        f'<p class="meta">{esc(told)}</p>{banner}</header>'
    )


def _logs(summary: Summary) -> Section:
    fits, counts = summary["fits"], summary["counts"]
    known = [fit for fit in fits if fit["status"] not in WITHOUT]
    parts = [f"{len(known)} of {counted(len(fits), 'log')} gave a model"]
    parts += [f"{counts['reject']} can’t support one"] if counts["reject"] else []
    parts += [f"{counts['failed']} could not be used"] if counts["failed"] else []
    shape = mark("reject" if not known else "warn" if len(known) < len(fits) or summary["odd"] else "accept")
    body = f'<p class="answer">{shape} <span>{esc("; ".join(parts))}.</span></p>'
    body += _log_table(fits)
    lost = [fit for fit in fits if fit["status"] in WITHOUT]
    if lost:
        rows = "".join(f"<li><b>{_linked(fit)}</b><span>{_sentences(fit['reasons'])}</span></li>" for fit in lost)
        body += f'<h3>Without a model</h3><ul class="not-made">{rows}</ul>'
    warnings: dict[str, list[str]] = {}
    for fit in known:
        for reason in fit["reasons"]:
            warnings.setdefault(reason.removeprefix(f"{fit['log']}: "), []).append(fit["name"])
    if warnings:
        body += "<h3>Why models come with a warning</h3>"
        told = [f"{why} ({_whose(names, len(known))})" for why, names in warnings.items()]
        body += listing(told, "reasons")
    told = [sentence for _, sentence in _odd(summary)]
    told += [f"{esc(', '.join(names))} are one and the same file, compared once." for names in summary["same"]]
    return Section("logs", 1, "Logs", "What came of each?", body, warnings=tuple(told))


def _log_table(fits: Sequence[Mapping[str, Any]]) -> str:
    known = [fit for fit in fits if fit["parameters"]]
    test = any(fit["test_moving_relative_residual_percent"] is not None for fit in known)
    head = [("log", "text"), ("state", "word"), ('length <span class="unit">[s]</span>', "number")]
    head += [("error while moving", "number")] + ([("on unseen motion", "number")] if test else [])
    head += [("identified", "number"), ("condition", "number"), ("least known", "word")]
    rows: list[Sequence[str] | str] = []
    grouped = len({fit["unit"] for fit in fits}) < len(fits)
    above = ""
    for fit in fits:
        if grouped and fit["unit"] != above:
            above = fit["unit"]
            rows.append(esc(above))
        cells = [
            _linked(fit, short(fit["name"]) if grouped else ""),
            status(fit["status"]),
            given(fit["duration_s"], 3),
        ]
        cells.append(percent(fit["moving_relative_residual_percent"]))
        if test:
            cells.append(percent(fit["test_moving_relative_residual_percent"]))
        cells.append(f"{fit['identified']} of {fit['base_parameters']}" if fit["parameters"] else DASH)
        cells.append(significant(fit["condition_number"], 2))
        worst = [f"{symbol_html(p['name'])} {_relative(p['relative_std_percent'])}" for p in fit["worst"][:1]]
        rows.append([*cells, worst[0] if worst else DASH])
    notes = Notes()
    notes.plain.append(
        "Errors are residuals in percent of the torque, rows at rest set to zero. Identified: base parameters whose σ "
        "is below 10 % of their value. Least known: the one of the largest σ, in percent of its value"
    )
    return table(head, rows, "Logs and what came of them", notes)


def _agreement(summary: Summary) -> Section:
    body = f'<p class="lead">{esc(verdict_on_sigma(summary))}</p>'
    if summary["logs"] > 1:
        drawn = batch_figures.panels(summary)
        body += f'<p class="remark">{esc(batch_figures.EXPLAINED)}</p>'
        marks = [("dots", "one log"), ("rest", "within 2 σ")]
        body += legend(*marks, *([("odd", "odd log")] if summary["odd"] else [])) + figures(drawn)
    if summary["parameters"]:
        body += fold("Table of all parameters", _parameter_table(summary), counted(len(summary["parameters"]), "row"))
    return Section("agreement", 2, "Agreement", "Is σ believable, and is one of them odd?", body)


def verdict_on_sigma(summary: Summary) -> str:
    """What the spread between the logs says of the stated standard deviations, in plain sentences."""
    if summary["logs"] < 2:
        return "It takes two fitted logs to compare anything."
    within, every = summary["within"], summary["without_odd"] or summary["agreement"]
    told = []
    if within:
        told.append(f"Logs of the same sub-folder, taken for repeats of one robot, {_judged(within, _REPEATS)}")
    told.append(f"{'All logs' if within else 'The logs'} {_judged(every, _ROBOTS if within else _EITHER)}")
    if summary["without_odd"]:
        names = _listed([name for name, _ in _odd(summary)])
        told.append(f"This leaves out {names} as odd; with every log it is {_times(summary['agreement'])}.")
    return " ".join(told)


_WIDER, _TRUE, _NARROWER = "wider than stated", "as stated", "narrower than stated"
_REPEATS = {
    _WIDER: "σ is too small by about this factor",
    _TRUE: "σ is believable",
    _NARROWER: "σ is larger than it need be",
}
_ROBOTS = {
    _WIDER: "the robots differ by more than σ explains",
    _TRUE: "no difference between the robots is seen",
    _NARROWER: "no difference between the robots is seen",
}
_EITHER = _REPEATS | {
    _WIDER: "of repeats of one robot σ is too small by about this factor; of several, the robots differ"
}


def _judged(found: Mapping[str, Any], words: Mapping[str, str]) -> str:
    low, high = (significant(x, 2) for x in found["chance"])
    return f"differ by {_times(found)} their stated σ (chance alone: {low} to {high}): {words[found['sigma']]}."


def _times(found: Mapping[str, Any]) -> str:
    return f"{significant(found['ratio'], 2)} times"


def _parameter_table(summary: Summary) -> str:
    rows = summary["parameters"]
    head = [("symbol", "text"), ("mean", "number"), ("spread", "number"), ("stated σ", "number")]
    head += [("ratio", "number"), ("lowest", "number"), ("highest", "number"), ("unit", "text"), ("odd", "text")]
    ratios = column([row["ratio"] for row in rows], most=2)
    body = [
        [
            symbol_html(row["name"]),
            significant(row["mean"], 4),
            *(significant(row[key], 2) for key in ("spread", "std")),
            ratio,
            *(significant(row[key], 4) for key in ("low", "high")),
            esc(row["unit"]),
            esc(", ".join(row["odd"])),
        ]
        for row, ratio in zip(rows, ratios, strict=True)
    ]
    notes = Notes()
    notes.plain.append(
        "Spread: standard deviation between the logs. Ratio: root mean square distance from the weighted mean in "
        "stated σ, which is 1 where σ is true and the logs differ by chance"
    )
    return table(head, body, "Parameters over all logs", notes)


def _provenance(summary: Summary) -> Section:
    robot, versions = summary["robot"] or {}, summary["versions"] or {}
    rows = []
    if robot:
        rows.append(("Robot", f'{esc(robot["source"])}<br><span class="hash">sha256 {esc(robot["sha256"])}</span>'))
    rows.append(("Software", esc(", ".join(f"{name} {text}" for name, text in versions.items()) or DASH)))
    if summary["command"]:
        rows.append(("Command", f"<code>{esc(summary['command'])}</code>"))
    if summary["others"]:
        rows.append(("Not read", esc(", ".join(summary["others"]))))
    body = "".join(f"<dt>{name}</dt><dd>{text}</dd>" for name, text in rows)
    body = f'<dl class="table provenance">{body}</dl>'
    return Section("provenance", 3, "Provenance", "Where does it come from?", body)


def _odd(summary: Summary) -> list[tuple[str, str]]:
    """What is odd: a log, or a sub-folder of several odd ones, as plain text, and a sentence on it, HTML."""
    units = {fit["name"]: fit["unit"] for fit in summary["fits"] if fit["parameters"]}
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for row in summary["odd"]:
        unit = units.get(row["name"])
        mates = [other for other in summary["odd"] if unit and units.get(other["name"]) == unit]
        groups.setdefault(str(unit) if len(mates) > 1 else row["name"], []).append(row)
    told = []
    for name, rows in groups.items():
        worst = max(rows, key=lambda row: row["parameters"][0]["distance"])["parameters"]
        shown = [
            f"{symbol_html(p['name'])} {significant(p['distance'], 2)} times ({significant(p['sigmas'], 2)} σ)"
            for p in worst
        ]
        which = f" in {len(rows)} of its {list(units.values()).count(name)} logs" if len(rows) > 1 else ""
        listed = first(shown, MOST)
        sentence = (
            f"<b>{esc(name)}</b> is odd{which}. Distance from the median of all logs, against the usual: {listed}."
        )
        told.append((name, sentence))
    return told


def _linked(fit: Mapping[str, Any], text: str = "") -> str:
    name = esc(text or fit["name"])
    return f'<a href="{esc(quote(fit["folder"]))}/report.html">{name}</a>' if fit["folder"] else name


def _sentences(reasons: Sequence[str]) -> str:
    return " ".join(prose(reason) for reason in reasons)


def _whose(names: Sequence[str], known: int) -> str:
    return "all" if len(names) == known and known > 1 else _listed(names)


def _listed(names: Sequence[str]) -> str:
    return first(names, MOST)


def _relative(value: Any) -> str:
    return percent(value) if value is None or value < 100 else "> 100\u00a0%"
