"""The table of estimates that sections 4 and 5 share: value ± σ, what to compare with, and the state in a word."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from identify.estimation.identification import FRICTION
from identify.numbers import DASH, Estimate, column, estimate, finite, significant
from identify.report.certainty import textbook
from identify.report.markup import Notes, esc, status, table
from identify.report.record import UNKNOWN, Record, part, reason
from identify.report.symbols import formula_html, symbol_html


def state(parameter: Mapping[str, Any]) -> str:
    """ "identified", "weak" (the record doesn't count it as identified) or "not determined" (σ ≥ |value|)."""
    if finite(parameter.get("estimate")) is None or not _known(parameter).determined:
        return "not determined"
    return "weak" if parameter.get("identified") is False else "identified"


def _known(parameter: Mapping[str, Any]) -> Estimate:
    return estimate(parameter.get("estimate"), parameter.get("std"))


def estimates_table(
    record: Record, groups: Sequence[tuple[str, Sequence[Mapping[str, Any]]]], notes: Notes, formulas: bool
) -> str:
    """Value, σ, unit, prior, truth, z and state of every parameter; columns that no parameter fills are left out."""
    every = [p for _, group in groups for p in group]
    prior = any(finite(p.get("prior")) is not None for p in every)
    truth = any(finite(p.get("truth")) is not None for p in every)
    plain = textbook(record)
    scores = dict(zip(map(id, every), column([score(p) for p in every], most=2), strict=True))
    head = [("symbol", "text")] + ([("formula", "formula")] if formulas else [])
    head += [("value", "value"), ("± σ", "sigma"), ("unit", "text")]
    head += [("textbook σ", "number")] if plain else []
    head += [("prior", "number")] if prior else []
    head += [("truth", "number"), ("z", "number")] if truth else []
    head += [("state", "text")]
    body: list[Sequence[str] | str] = []
    for title, group in groups:
        body.append(esc(title))
        body += [_row(p, plain, prior, truth, formulas, scores[id(p)], notes) for p in group]
    for shown, key in ((prior or not formulas, "prior"), (truth, "truth")):
        why = reason(every[0], key) if every else UNKNOWN
        why = reason(record, key) if why == UNKNOWN else why
        if not shown and why != UNKNOWN:
            notes.plain.append(f"No {key}: {why}")
    return table(head, body, "Parameters with their standard deviations", notes)


def score(p: Mapping[str, Any]) -> float | None:
    """z = (estimate − truth)/σ, None where one is missing."""
    value, sigma, true = (finite(p.get(key)) for key in ("estimate", "std", "truth"))
    return None if value is None or true is None or not sigma else (value - true) / sigma


def _row(
    p: Mapping[str, Any],
    plain: Mapping[str, Any],
    prior: bool,
    truth: bool,
    formulas: bool,
    score: str,
    notes: Notes,
) -> list[str]:
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
    if plain:
        cells.append(esc(significant(plain.get(name), 2)))
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


def friction_parameters(k: int, row: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Rows for `estimates_table` of the friction of joint k, from 1; row: that joint's entry in the record."""
    found: list[Mapping[str, Any]] = []
    for key, letters in FRICTION:
        value = part(row, key)
        if isinstance(value, Mapping):
            found.append({**value, "name": f"{letters}{k}"})
        elif reason(row, key) != UNKNOWN:
            found.append({"name": f"{letters}{k}", "estimate": None, "estimate_reason": reason(row, key)})
    return found
