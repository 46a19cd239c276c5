"""Section 4: what is known of the links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify.numbers import significant
from identify.report import certainty, parameter_figures
from identify.report.estimates import estimates_table, friction_parameters, score, state
from identify.report.markup import Notes, Section, absent, esc, figures, fold, legend
from identify.report.record import Record, items, joints, reason
from identify.report.symbols import symbol_text


def section(record: Record) -> Section:
    """Base and transmission parameters: a figure for each link, and the whole table folded."""
    parameters = [p for p in items(record, "base_parameters") if isinstance(p, Mapping)]
    coupled = [p for p in items(record, "transmission") if isinstance(p, Mapping)]
    if not parameters:
        why = reason(record, "base_parameters")
        return Section("parameters", 4, "Parameters", "What is known?", absent("No parameters.", why), why=why)
    states = [state(p) for p in parameters]
    told = [f"{states.count(word)} {word}" for word in ("identified", "weak", "not determined") if word in states]
    lead = f"{len(parameters)} base parameters: {', '.join(told)}.{_against_truth(record)}"
    explained = (
        "A dot is an estimate, its bar ±2σ. A ring is a parameter whose σ is as large as its value: only a bound is "
        "known. Every panel has its own scale."
    )
    marks = [("dot", "estimate ± 2σ"), ("ring", "not determined")]
    marks += [("truth", "truth of the simulation")] if any(p.get("truth") is not None for p in parameters) else []
    marks += [("prior", "prior (nominal model)")] if any(p.get("prior") is not None for p in parameters) else []
    body = f'<p class="lead">{esc(lead)}</p><p class="remark">{esc(explained)}</p>{legend(*marks)}{_plots(record)}'
    notes = Notes()
    groups = [(f"Link {j}", _of_link(parameters, j)) for j in _links(parameters)]
    groups += [("Coupled motors of the transmission", coupled)] if coupled else []
    rows = estimates_table(record, groups, notes, True)
    body += fold("Table of all parameters", rows, f"{len(parameters)} rows, with formulas") + certainty.folds(record)
    return Section("parameters", 4, "Parameters", "What is known?", body, finding=lead)


def _against_truth(record: Record) -> str:
    """How far all estimates lie from the truth of a simulation, in σ; empty where no truth is known."""
    every = [*items(record, "base_parameters"), *items(record, "transmission")]
    for k, row in enumerate(items(record, "friction"), 1):
        every += friction_parameters(k, row) if isinstance(row, Mapping) else []
    scores = [(abs(z), str(p.get("name"))) for p in every if isinstance(p, Mapping) and (z := score(p)) is not None]
    if not scores:
        return ""
    spread = float(np.sqrt(np.mean([z**2 for z, _ in scores])))
    worst, name = max(scores)
    return (
        f" Against the truth of the simulation, {len(scores)} estimates are off by {significant(spread, 2)} σ in the "
        f"root mean square (a believable σ gives 1) and by {significant(worst, 2)} σ at most, {symbol_text(name)}."
    )


def _links(parameters: Sequence[Mapping[str, Any]]) -> list[Any]:
    return list(dict.fromkeys(p.get("link") for p in parameters))


def _of_link(parameters: Sequence[Mapping[str, Any]], j: Any) -> list[Mapping[str, Any]]:
    return [p for p in parameters if p.get("link") == j]


def _plots(record: Record) -> str:
    names = [joint["name"] for joint in joints(record)]
    parameters = [p for p in items(record, "base_parameters") if isinstance(p, Mapping)]
    groups = [(f"Link {j}", _moved_by(names, j), _of_link(parameters, j)) for j in _links(parameters)]
    coupled = [p for p in items(record, "transmission") if isinstance(p, Mapping)]
    groups += [("Transmission", "coupled motors", coupled)] if coupled else []
    drawn = []
    for k, (title, remark, group) in enumerate(groups):
        dots = [d for p in group if (d := parameter_figures.dot(p, state(p))) is not None]
        if not dots:
            continue
        unsure = [symbol_text(d.name) for d in dots if d.open]
        finding = f"not determined: {', '.join(unsure)}" if unsure else "every one larger than its σ"
        label = f"{title}: {len(dots)} parameters with ±2σ; {finding}."
        drawn.append((esc(title), esc(remark), parameter_figures.figure(dots, f"p-{k}", label)))
    return figures(drawn)


def _moved_by(names: Sequence[str], j: Any) -> str:
    return f"moved by {names[j - 1]}" if isinstance(j, int) and 1 <= j <= len(names) else ""
