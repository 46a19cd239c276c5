"""Section 6: can a simulator load it?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from identify.numbers import column, finite, percent, significant
from identify.report.markup import Notes, Section, absent, esc, fold, prose, status, table, unit
from identify.report.record import Record, items, joints, part, reason, short, tests
from identify.report.symbols import symbol_html, symbol_text

OPEN = (
    "Joint torques tell combinations of the links' parameters, not each link's own: the masses, centres of mass and "
    "inertias below are one robot out of many that move alike"
)
THIN = 0.02
"""Triangle margin, of the largest moment, below which a link is told to be flat or thin."""

NOT_MET = "No: at least one link is physically impossible."


def section(record: Record) -> Section:
    """The links that physics allows nearest to the estimate, what they cost, and whether a simulator took them."""
    title, question = "Physics", "Can a simulator load it?"
    physical = part(record, "physical")
    if not isinstance(physical, Mapping):
        why = reason(record, "physical")
        return Section("physics", 6, title, question, absent("No links that physics allows.", why), why=why)
    rows = [row for row in items(physical, "links") if isinstance(row, Mapping)]
    lead = _lead(record, physical)
    body = f'<p class="lead">{esc(lead)}</p>'
    body += "".join(
        f'<p class="remark">{prose(text)}</p>' for text in (_cost(record, physical), _open(physical)) if text
    )
    body += "".join(f'<p class="remark">{prose(text)}</p>' for text in (_thin(rows),) if text)
    body += _links(rows)
    body += _drives(record, physical) + _moved(physical)
    return Section("physics", 6, title, question, body, finding=lead)


def _lead(record: Record, physical: Mapping[str, Any]) -> str:
    if not physical.get("consistent"):
        return NOT_MET
    lead = "Yes: every link is a possible body, and no drive has a negative inertia or friction."
    error = finite(part(record, "cross_check", "identified", "mujoco", "max_abs_error"))
    if error is not None:
        lead += f" MuJoCo loaded them and differs by {significant(error, 2)} of the torque scale."
    return lead


def _cost(record: Record, physical: Mapping[str, Any]) -> str:
    """What it took to make the links possible, and what it did to the residuals."""
    chi, size = (finite(part(physical, "cost", key)) for key in ("chi_squared", "effective_samples"))
    if chi is None:
        return ""
    moved = items(physical, "moved")
    if not moved:
        told = "The fitted parameters are those of a possible robot: none moved by 0.01 σ"
    else:
        worst = moved[0]
        told = (
            f"The fitted parameters belong to no possible robot. The nearest one differs in {len(moved)} of "
            f"{len(items(physical, 'parameters'))} parameters, most in {symbol_text(str(part(worst, 'name')))}, by "
            f"{significant(abs(finite(part(worst, 'shift_sigma')) or 0.0), 2)} σ; all shifts together cost χ² = "
            f"{significant(chi, 2)}, against {significant(size, 3)} effective samples"
        )
    told += _growth(physical)
    changes = [_change("training motion", part(record, "fit"), part(physical, "fit"))]
    changes += [
        _change(short(part(mine, "path")), plain, mine)
        for plain, mine in zip(tests(record), items(physical, "test"), strict=False)
    ]
    named = "; ".join(text for text in changes if text)
    return told + (f". Residual while moving, of the fit and of the possible robot: {named}" if named else "")


def _growth(physical: Mapping[str, Any]) -> str:
    """What the residual grew by, in points of the torque and in shares of itself."""
    points, growth, known = (
        finite(part(physical, "cost", f"residual_{key}")) for key in ("points", "growth_percent", "uncertainty_percent")
    )
    if points is None or growth is None or known is None or not items(physical, "moved"):
        return ""
    return (
        f". It leaves {significant(abs(points), 2)} % of the training torque {'more' if points >= 0 else 'less'} "
        f"unexplained, which is {significant(abs(growth), 2)} % of the residual; so few independent samples tell a "
        f"residual to {significant(known, 2)} %"
    )


def _change(name: str, plain: Any, mine: Any) -> str:
    before, after = (finite(part(x, "moving_relative_residual_percent")) for x in (plain, mine))
    if before is None or after is None:
        return ""
    return f"{name} {percent(before, 3)}, {percent(after, 3)}"


def _open(physical: Mapping[str, Any]) -> str:
    bodies = items(physical, "pull", "bodies")
    if not bodies:
        return ""
    if set(bodies) == {"neutral"}:
        which = f"neutral bodies ({part(physical, 'pull', 'why')})"
    elif "neutral" in bodies:
        which = "the robot file's links, and neutral bodies where it gives none"
    else:
        which = "the robot file's links"
    prior = finite(part(physical, "pull", "prior_percent"))
    if prior is not None:
        return f"{OPEN}. They were asked to stay near {which}, with a standard deviation of {significant(prior, 2)} %"
    return f"{OPEN}. What the motion leaves open is pulled to {which}"


def _thin(rows: list[Mapping[str, Any]]) -> str:
    """Which links lie at the edge of what a body can be."""
    found = []
    for row in rows:
        margin, moments = finite(row.get("triangle_margin")), items(row, "principal_moments")
        largest = finite(moments[-1]) if moments else None
        if margin is not None and largest and margin < THIN * largest:
            found.append(str(row.get("name", "")))
    if not found:
        return ""
    which = "every link is" if len(found) == len(rows) else f"{', '.join(found)} {'is' if len(found) == 1 else 'are'}"
    return (
        f"{which} at the edge of what a body can be, flat or thin (A + B − C under {100 * THIN:g} % of C): a simulator "
        "loads such links, but their single numbers mean little"
    )


def _links(rows: list[Mapping[str, Any]]) -> str:
    """One row a link: mass, centre of mass, principal moments, triangle inequality, smallest eigenvalue."""
    head, columns = [("link of", "text")], [[esc(row.get("name", "")) for row in rows]]

    def add(title: str, values: list[Any], shown: list[str]) -> None:
        """A column, unless there is none of its values."""
        if any(finite(x) is not None for x in values):
            head.append((title, "number"))
            columns.append([esc(x) for x in shown])

    masses = [row.get("mass") for row in rows]
    add(f"mass{unit('kg')}", masses, column(masses, 3))
    for axis, name in enumerate("xyz"):
        centres = [_micrometres(_entry(row.get("com"), axis)) for row in rows]
        add(f"centre {name}{unit('m')}", centres, column(centres, 2))
    for k, name in enumerate("ABC"):
        moments = [_entry(row.get("principal_moments"), k) for row in rows]
        add(f"{name}{unit('kg·m²')}", moments, [significant(x) for x in moments])
    for key, title in (("triangle_margin", f"A + B − C{unit('kg·m²')}"), ("min_eigenvalue", "smallest eigenvalue")):
        values = [row.get(key) for row in rows]
        add(title, values, [significant(x, 2) for x in values])
    head.append(("possible", "text"))
    columns.append([status("MET" if (finite(row.get("min_eigenvalue")) or 0.0) > 0 else "NOT MET") for row in rows])
    notes = Notes()
    if any("principal_moments" in row for row in rows):
        notes.plain.append(
            "A ≤ B ≤ C are the principal moments about the centre of mass; a body has A + B > C. The eigenvalue is the "
            "pseudo-inertia's, in SI units; above zero, some distribution of mass has these parameters."
        )
    return table(head, [list(row) for row in zip(*columns, strict=True)], "Links that physics allows", notes)


def _drives(record: Record, physical: Mapping[str, Any]) -> str:
    rows = [row for row in items(physical, "drives") if isinstance(row, Mapping)]
    if not rows:
        return ""
    units = {joint["name"]: (joint["effort_unit"], joint["position_unit"]) for joint in joints(record)}
    cells = []
    for row in rows:
        effort, position = units.get(str(row.get("joint")), ("N·m", "rad"))
        of = "kg·m²" if position == "rad" else "kg"
        told = (("inertia", of), ("viscous", f"{effort}·s/{position}"), ("coulomb", effort), ("offset", effort))
        cells.append(
            [esc(row.get("joint", "")), *(f"{esc(significant(row.get(key), 4))} {esc(text)}" for key, text in told)]
        )
    head = [("joint", "text")]
    head += [(name, "number") for name in ("actuator inertia", "viscous", "Coulomb", "offset")]
    said = "actuator inertia and friction, none negative"
    if items(record, "settings", "friction"):
        said += "; viscous and Coulomb nearest to all forms of friction together"
    return fold("Drives", table(head, cells, "Drives"), said)


def _moved(physical: Mapping[str, Any]) -> str:
    rows = [row for row in items(physical, "moved") if isinstance(row, Mapping)]
    if not rows:
        return ""
    head = [
        ("symbol", "text"),
        ("fitted", "number"),
        ("possible", "number"),
        ("unit", "text"),
        ("shift in σ", "number"),
    ]
    shifts = column([row.get("shift_sigma") for row in rows], most=2)
    cells = [
        [
            symbol_html(str(row.get("name", ""))),
            esc(significant(row.get("estimate"), 4)),
            esc(significant(row.get("consistent"), 4)),
            esc(row.get("unit") or ""),
            esc(shift),
        ]
        for row, shift in zip(rows, shifts, strict=True)
    ]
    return fold("Parameters that moved", table(head, cells, "Parameters that moved"), f"{len(rows)} by 0.01 σ or more")


def _micrometres(x: Any) -> float | None:
    """A length [m] without what is below a micrometre."""
    value = finite(x)
    return None if value is None else round(value, 6) + 0.0


def _entry(values: Any, k: int) -> Any:
    return values[k] if isinstance(values, (list, tuple)) and k < len(values) else None
