"""Behind the parameters: which are essential, which the logs leave open and what would tell them, which go together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from identify.numbers import estimate, percent, significant
from identify.report.markup import Notes, esc, fold, prose, table
from identify.report.record import Record, items, part, reason
from identify.report.symbols import symbol_html, symbol_text

ASKED = "What tells most: "
"""Where the record's sentence on open parameters comes to the motion that would tell them."""


def folds(record: Record) -> str:
    """Three folded tables; those that the record has nothing for are left out."""
    found = part(record, "statistics")
    return _unknown(found) + _essential(found) + _correlations(found) if isinstance(found, Mapping) else ""


def textbook(record: Record) -> dict[str, Any]:
    """Textbook standard deviation of every parameter by its name; empty where the record has none."""
    names, values = items(record, "names"), items(record, "statistics", "textbook_std")
    return dict(zip(map(str, names), values, strict=True)) if len(names) == len(values) else {}


def _unknown(found: Mapping[str, Any]) -> str:
    """Each motion that would tell most of some parameters that the logs leave open, and which these are."""
    groups: dict[str, dict[str, list[str]]] = {}
    count = 0
    for row in (row for row in items(found, "unknown") if isinstance(row, Mapping)):
        names = [str(name) for name in items(row, "names")]
        count += len(names)
        for asked in str(row.get("told") or "").rpartition(ASKED)[2].rstrip(".").split("; "):
            groups.setdefault(asked, {}).setdefault(str(row.get("state")), []).extend(names)
    if not groups:
        return ""
    states = ("not determined", "weak")
    head = [("a motion with", "prose"), ("would tell most of these, not determined so far", "prose"), ("weak", "prose")]
    order = sorted(groups.items(), key=lambda item: -sum(map(len, item[1].values())))
    rows = [
        [prose(asked), *(", ".join(map(symbol_html, told.get(state, ()))) for state in states)] for asked, told in order
    ]
    notes = Notes()
    if found.get("command"):
        notes.plain.append(f"A motion designed for them, DIR being this folder: `{found['command']}`")
    shown = table(head, rows, "What the logs leave open", notes)
    return fold("What the logs leave open", shown, f"{count} parameters, and the motion that would tell them")


def _essential(found: Mapping[str, Any]) -> str:
    """The parameters that carry the model when all that is hardly told is set to zero, and what that costs."""
    row = part(found, "essential")
    kept = [p for p in items(row, "parameters") if isinstance(p, Mapping)]
    if not kept:
        return ""
    dropped = [p for p in items(row, "dropped") if isinstance(p, Mapping)]
    before, after = (part(row, f"residual_{when}_percent") for when in ("before", "after"))
    told = (
        f"Set to zero one after the other, the least certain first, {len(dropped)} of {len(kept) + len(dropped)} "
        f"parameters can go; the residual of the solved rows grows from {percent(before, 3)} to {percent(after, 3)}"
    )
    refused = part(row, "refused")
    if isinstance(refused, Mapping):
        chance = significant(refused.get("chance"), 2)
        told += (
            f". Without {symbol_text(str(refused.get('name')))} as well it would be worse beyond doubt (p = {chance})"
        )
    else:
        told += f". It ended because {reason(row, 'refused')}"
    names = [symbol_text(str(p.get("name"))) for p in dropped]
    gone = f'<p class="remark">{prose("Set to zero: " + ", ".join(names))}</p>' if names else ""
    head = [("symbol", "text"), ("value", "value"), ("± σ", "sigma"), ("unit", "text"), ("relative σ", "number")]
    body = []
    for p in kept:
        shown = estimate(p.get("estimate"), p.get("std"))
        value = esc(shown.value) if shown.determined else f'<span class="bound">|x| &lt; {esc(shown.bound)}</span>'
        sigma = f"± {esc(shown.sigma)}" if shown.determined and shown.sigma else ""
        cells = [symbol_html(str(p.get("name", ""))), value, sigma, esc(p.get("unit") or "")]
        body.append([*cells, esc(percent(p.get("relative_std_percent")))])
    rows = table(head, body, "Essential parameters")
    finding = f"{len(kept)} of {len(kept) + len(dropped)} carry the model"
    return fold("Essential parameters", f'<p class="remark">{prose(told)}</p>{gone}{rows}', finding)


def _correlations(found: Mapping[str, Any]) -> str:
    """Pairs of parameters whose errors go together: their sum, or their difference, is known better than each."""
    rows = [row for row in items(found, "correlations") if isinstance(row, Mapping)]
    if not rows:
        return ""
    head = [("first", "text"), ("second", "text"), ("correlation of their errors", "number"), ("known best", "prose")]
    body = [
        [
            symbol_html(str(row.get("first", ""))),
            symbol_html(str(row.get("second", ""))),
            esc(significant(row.get("correlation"), 2)),
            "their sum" if (row.get("correlation") or 0) < 0 else "their difference",
        ]
        for row in rows
    ]
    notes = Notes()
    notes.plain.append("Sum and difference of the two, each divided by its σ")
    largest = rows[0]
    finding = f"{symbol_text(str(largest.get('first')))} and {symbol_text(str(largest.get('second')))} "
    finding += f"{significant(largest.get('correlation'), 2)}, the most correlated"
    return fold("Parameters that go together", table(head, body, "Correlations", notes), finding)
