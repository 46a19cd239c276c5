"""Sections 4, 5 and 6: what is known, what the joints lose, and whether a simulator can load it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from identify.regressor.columns import smooth_sign
from identify.report import data_figures, parameter_figures
from identify.report.markup import Notes, Section, absent, esc, figures, fold, legend, status, table
from identify.report.numbers import DASH, column, estimate, finite, significant
from identify.report.prediction import select
from identify.report.record import UNKNOWN, Record, items, joints, part, reason
from identify.report.symbols import formula_html, symbol_html, symbol_text

FRICTION = (("viscous", "Fv"), ("coulomb", "Fs"), ("offset", "off"))


def state(parameter: Mapping[str, Any]) -> str:
    """ "identified", "weak" (the record doesn't count it as identified) or "not determined" (σ ≥ |value|)."""
    if not estimate(parameter.get("estimate"), parameter.get("std")).determined:
        return "not determined"
    return "weak" if parameter.get("identified") is False else "identified"


def section(record: Record) -> Section:
    """Base and transmission parameters: a figure for each link, and the whole table folded."""
    parameters = [p for p in items(record, "base_parameters") if isinstance(p, Mapping)]
    coupled = [p for p in items(record, "transmission") if isinstance(p, Mapping)]
    if not parameters:
        body = absent("No parameters.", reason(record, "base_parameters"))
        return Section("parameters", 4, "Parameters", "What is known?", body, empty=True)
    states = [state(p) for p in parameters]
    told = [f"{states.count(word)} {word}" for word in ("identified", "weak", "not determined") if word in states]
    lead = f"{len(parameters)} base parameters: {', '.join(told)}."
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
    body += fold(
        "Table of all parameters", estimates_table(groups, notes, True), f"{len(parameters)} rows, with formulas"
    )
    return Section("parameters", 4, "Parameters", "What is known?", body, finding=lead)


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


def estimates_table(groups: Sequence[tuple[str, Sequence[Mapping[str, Any]]]], notes: Notes, formulas: bool) -> str:
    """Value, σ, unit, prior, truth, z and state of every parameter; columns that no parameter fills are left out."""
    every = [p for _, group in groups for p in group]
    prior = any(finite(p.get("prior")) is not None for p in every)
    truth = any(finite(p.get("truth")) is not None for p in every)
    scores = dict(zip(map(id, every), column([_score(p) for p in every], most=2), strict=True))
    head = [("symbol", "text")] + ([("formula", "formula")] if formulas else [])
    head += [("value", "value"), ("± σ", "sigma"), ("unit", "text")]
    head += [("prior", "number")] if prior else []
    head += [("truth", "number"), ("z", "number")] if truth else []
    head += [("state", "text")]
    body: list[Sequence[str] | str] = []
    for title, group in groups:
        body.append(esc(title))
        body += [_row(p, prior, truth, formulas, scores[id(p)], notes) for p in group]
    for wanted, key, what in ((prior, "prior", "prior"), (truth, "truth", "truth")):
        if not wanted and every:
            why = reason(every[0], key)
            notes.texts += [f"No {what}: {why}"] if why != UNKNOWN else []
    return table(head, body, "Parameters with their standard deviations", notes)


def _score(p: Mapping[str, Any]) -> float | None:
    """z = (estimate − truth)/σ, None where one is missing."""
    value, sigma, true = (finite(p.get(key)) for key in ("estimate", "std", "truth"))
    return None if value is None or true is None or not sigma else (value - true) / sigma


def _row(p: Mapping[str, Any], prior: bool, truth: bool, formulas: bool, score: str, notes: Notes) -> list[str]:
    name, value, sigma = str(p.get("name", "")), finite(p.get("estimate")), finite(p.get("std"))
    shown = estimate(value, sigma)
    cells = [symbol_html(name)]
    if formulas:
        grouping = str(p.get("grouping") or "")
        cells.append(formula_html(grouping) if grouping and grouping != name else '<span class="none">itself</span>')
    if value is None:
        cells += [notes.missing(reason(p, "estimate")), ""]
    elif not shown.determined:
        cells += [f'<span class="bound">|x| &lt; {esc(shown.bound)}</span>', ""]
    else:
        cells += [esc(shown.value), f"± {esc(shown.sigma)}" if shown.sigma else notes.missing(reason(p, "std"))]
    cells.append(esc(p.get("unit") or ""))
    if prior:
        cells.append(_like(p, "prior", notes))
    if truth:
        cells.append(_like(p, "truth", notes))
        cells.append(score)
    return [*cells, status(state(p))]


def _like(p: Mapping[str, Any], key: str, notes: Notes) -> str:
    """A number to compare with the estimate, to the same place as it."""
    value, sigma = finite(p.get(key)), finite(p.get("std"))
    if value is None:
        return notes.missing(reason(p, key)) if key in p else DASH
    if sigma and abs(value) > sigma:
        shown = estimate(value, sigma)
        return esc(shown.value + (shown.sigma.partition(")")[2] and f"){shown.sigma.partition(')')[2]}"))
    return esc(significant(value, 2))


def friction_section(record: Record, curves: Mapping[str, np.ndarray]) -> Section:
    """Each joint's friction curve over the remainder of its training data, and the constants in a folded table."""
    rows = [row for row in items(record, "friction") if isinstance(row, Mapping)]
    if not rows:
        body = absent("No friction.", reason(record, "friction"))
        return Section("friction", 5, "Friction", "What do the joints lose?", body, empty=True)
    robot = {joint["name"]: (k, joint) for k, joint in enumerate(joints(record))}
    velocity, seen = _remainder(curves)
    drawn = []
    for row in rows:
        name = str(row.get("joint", ""))
        if name not in robot:
            continue
        k, joint = robot[name]
        have = velocity is not None and seen is not None and k < velocity.shape[1]
        x = velocity[:, k] if have else np.linspace(-1.0, 1.0, 3)  # type: ignore[index]
        y = seen[:, k] if have else np.full(3, np.nan)  # type: ignore[index]
        told = _constants(row)
        label = f"{name}: friction over velocity. {told}."
        svg = data_figures.friction(x, y, friction_curve(row, record), joint, f"f-{k}", label)
        drawn.append((esc(name), "", svg))
    marks = legend(
        ("dots", "measured minus rigid-body model, median"), ("rest", "5 to 95 % of it"), ("predicted", "identified")
    )
    remark = ""
    coupled = [symbol_text(str(p.get("name"))) for p in items(record, "transmission") if "F" in str(p.get("name"))]
    if coupled:
        what = f"What the coupled motors add ({', '.join(coupled)}) is in the data and not in the curves."
        remark = f'<p class="remark">{esc(what)}</p>'
    if velocity is None:
        remark += absent("No data behind the curves.", "the result folder holds no training arrays")
    groups = [(str(row.get("joint", "")), _as_parameters(k, row)) for k, row in enumerate(rows, 1)]
    body = (
        marks + remark + figures(drawn) + fold("Table of friction constants", estimates_table(groups, Notes(), False))
    )
    return Section("friction", 5, "Friction", "What do the joints lose?", body)


def _remainder(curves: Mapping[str, np.ndarray]) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Velocity and measured − rigid of all training rows, (M, n) each."""
    found = [a for k in range(len(curves)) if (a := select(curves, f"train{k}")) and "rigid" in a and "velocity" in a]
    if not found:
        return None, None
    return np.vstack([a["velocity"] for a in found]), np.vstack([a["measured"] - a["rigid"] for a in found])


def friction_curve(row: Mapping[str, Any], record: Record) -> Callable[[np.ndarray], np.ndarray]:
    """Γf = Fs·s(q̇) + Fv·q̇ + offset [2.63], s the sign or the smooth sign of the settings."""
    viscous, coulomb, offset = (finite(part(row, key, "estimate")) or 0.0 for key, _ in FRICTION)
    width = finite(part(record, "settings", "coulomb_velocity"))
    smooth = part(record, "settings", "coulomb_form") == "smooth sign" and width
    sign = smooth_sign(width) if smooth and width else np.sign

    def curve(velocity: np.ndarray) -> np.ndarray:
        return coulomb * sign(velocity) + viscous * velocity + offset

    return curve


def _constants(row: Mapping[str, Any]) -> str:
    told = []
    for key, letters in FRICTION:
        value = part(row, key)
        if isinstance(value, Mapping) and finite(value.get("estimate")) is not None:
            shown = estimate(value.get("estimate"), value.get("std")).text
            told.append(f"{letters} {shown} {value.get('unit') or ''}".strip())
    return "; ".join(told) or "no constants"


def _as_parameters(k: int, row: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    found: list[Mapping[str, Any]] = []
    for key, letters in FRICTION:
        value = part(row, key)
        if isinstance(value, Mapping):
            found.append({**value, "name": f"{letters}{k}"})
    return found


def physics_section(record: Record) -> Section:
    """Physical consistency of every link, where it was computed; else why it wasn't."""
    title, question = "Physics", "Can a simulator load it?"
    physical = part(record, "physical")
    if not isinstance(physical, Mapping):
        body = absent("Not yet checked.", reason(record, "physical"))
        return Section("physics", 6, title, question, body, empty=True)
    consistent = physical.get("consistent")
    lead = (
        "Yes: every link is physically possible." if consistent else "No: at least one link is physically impossible."
    )
    rows = [row for row in items(physical, "links") if isinstance(row, Mapping)]
    keys = [key for key in ("mass", "min_eigenvalue", "triangle_margin") if any(key in row for row in rows)]
    titles = {
        "mass": 'mass <span class="unit">[kg]</span>',
        "min_eigenvalue": "smallest eigenvalue of the pseudo-inertia",
        "triangle_margin": 'triangle inequality, margin <span class="unit">[kg·m²]</span>',
    }
    head = [("link", "text"), *((titles[key], "number") for key in keys), ("possible", "text")]
    body = f'<p class="lead">{esc(lead)}</p>'
    cells = []
    for row in rows:
        least = finite(row.get("min_eigenvalue"))
        word = status("MET" if least is not None and least >= 0 else "NOT MET")
        cells.append([esc(row.get("name", "")), *(esc(significant(row.get(key))) for key in keys), word])
    return Section("physics", 6, title, question, body + table(head, cells, "Physical consistency"), finding=lead)
