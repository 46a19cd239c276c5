"""Section 6: can a simulator load it?"""

from __future__ import annotations

from collections.abc import Mapping

from identify.numbers import finite, significant
from identify.report.markup import Section, absent, esc, status, table
from identify.report.record import Record, items, part, reason


def section(record: Record) -> Section:
    """Physical consistency of every link, where it was computed; else why it wasn't."""
    title, question = "Physics", "Can a simulator load it?"
    physical = part(record, "physical")
    if not isinstance(physical, Mapping):
        why = reason(record, "physical")
        return Section("physics", 6, title, question, absent("Not yet checked.", why), why=why)
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
