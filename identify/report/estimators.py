"""The estimators side by side, where a fit was asked for all of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from identify.numbers import column, finite, percent, significant
from identify.report.markup import Notes, esc, table, unit
from identify.report.record import Record, items, part, reason, tests

_MOVING, _ALL = "moving_relative_residual_percent", "relative_residual_percent"
_FIGURES = (
    ("train", _MOVING, "training,<br>moving"),
    ("test", _MOVING, "unseen,<br>moving"),
    ("test", _ALL, "unseen,<br>with rest"),
)


def finding(record: Record) -> str:
    """How many were run and which has the least error, in plain text; empty where none was asked for."""
    rows = _rows(record)
    if not rows:
        return ""
    role = "test" if tests(record) else "train"
    known = [(x, str(row.get("estimator"))) for row in rows if (x := finite(part(row, role, _MOVING))) is not None]
    told = f"{len(rows)} estimators side by side"
    if not known:
        return told
    least = min(known)[0]
    alike = [name for x, name in known if percent(x) == percent(least)]
    where = "unseen" if role == "test" else "training"
    return f"{told}, least error on {where} motion {percent(least)} ({', '.join(alike)})"


def table_of(record: Record) -> str:
    """A row an estimator: what it does, its model, errors on training and unseen motion, condition number."""
    rows = _rows(record)
    if not rows:
        return ""
    notes = Notes()
    head = [("estimator", "text"), ("what it does", "prose"), ("model", "text")]
    head += [(title + unit("%"), "number") for _, _, title in _FIGURES] + [("scaled condition<br>number", "number")]
    figures = [column([part(row, role, key) for row in rows], digits=3) for role, key, _ in _FIGURES]
    body = []
    for k, row in enumerate(rows):
        name = esc(row.get("estimator", ""))
        if row.get("default") and row.get("model") == part(record, "model"):
            name = f"<b>{name}</b>, default"
            if row.get("why"):
                notes.plain.append(str(row["why"]).rstrip("."))
        cells = [name, esc(row.get("title") or ""), esc(row.get("model") or "")]
        for texts, (role, key, _) in zip(figures, _FIGURES, strict=True):
            known = finite(part(row, role, key)) is not None
            cells.append(esc(texts[k]) if known else notes.missing(_why(row, role)))
        condition = finite(row.get("condition_number"))
        cells.append(esc(significant(condition, 2)) if condition is not None else notes.missing(_why(row, "train")))
        body.append(cells)
    notes.plain.append(
        "Errors are residuals in percent of the torque. Those of one log do not tell which estimate is nearest to the "
        "truth; `scripts/bench_estimators` holds all of them against truths that are known"
    )
    return "<h3>Estimators</h3>" + table(head, body, "Estimators side by side", notes)


def _rows(record: Record) -> list[Mapping[str, Any]]:
    return [row for row in items(record, "estimators") if isinstance(row, Mapping)]


def _why(row: Mapping[str, Any], role: str) -> str:
    return str(row.get("reason") or reason(row, role))
