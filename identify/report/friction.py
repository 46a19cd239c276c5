"""Section 5: what the joints lose."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from identify.estimation.identification import FRICTION
from identify.numbers import estimate, finite, significant
from identify.regressor.friction import ASYMMETRIC, CUBE_ROOT, FURTHER, LOAD, PRESLIDING, STRIBECK
from identify.report import data_figures
from identify.report.estimates import estimates_table, friction_parameters
from identify.report.markup import Notes, Section, absent, esc, figures, fold, legend
from identify.report.prediction import select
from identify.report.record import Record, items, joints, part, reason
from identify.report.symbols import symbol_text
from identify.validation.friction_law import LETTERS, both_ways, fitted_terms, friction_columns

SHARE = 0.8
"""Speed at which a caption tells the friction, of the largest one in training."""


def section(record: Record, curves: Mapping[str, np.ndarray]) -> Section:
    """Each joint's friction curve over the remainder of its training data, and the constants in a folded table."""
    rows = [row for row in items(record, "friction") if isinstance(row, Mapping)]
    if not rows:
        why = reason(record, "friction")
        return Section("friction", 5, "Friction", "What do the joints lose?", absent("No friction.", why), why=why)
    robot = {joint["name"]: (k, joint) for k, joint in enumerate(joints(record))}
    coupled = [str(p.get("name")) for p in items(record, "transmission") if isinstance(p, Mapping)]
    velocity, seen = _remainder(curves, "predicted" if coupled else "rigid")
    names, covariance = items(record, "names"), _covariance(record)
    drawn = []
    for row in rows:
        name = str(row.get("joint", ""))
        if name not in robot:
            continue
        k, joint = robot[name]
        have = velocity is not None and seen is not None and k < velocity.shape[1]
        x = velocity[:, k] if have else np.linspace(-1.0, 1.0, 3)  # type: ignore[index]
        y = seen[:, k] if have else np.full(3, np.nan)  # type: ignore[index]
        curve = friction_curve(row, record)
        if coupled and have:
            y = y + curve(x)
        label = f"{name}: friction over velocity. {_constants(row)}."
        svg = data_figures.friction(x, y, curve, joint, f"f-{k}", label)
        told = _at_speed(record, list(names), k, row, joint, covariance)
        drawn.append((esc(name), esc(told), svg))
    dots = "measured minus the rest of the model, median"
    marks = legend(("dots", dots), ("rest", "5 to 95 % of it"), ("predicted", "identified"))
    remark = _forms(record)
    if coupled:
        motors = ", ".join(symbol_text(name) for name in coupled)
        told = f"What the coupled motors add ({motors}) is taken out of the data as identified."
        remark += f'<p class="remark">{esc(told)}</p>'
    if velocity is None:
        remark += absent("No data behind the curves.", "the result folder holds no training arrays")
    groups = [(str(row.get("joint", "")), friction_parameters(k, row)) for k, row in enumerate(rows, 1)]
    rows_shown = fold("Table of friction constants", estimates_table(record, groups, Notes(), False))
    body = marks + remark + figures(drawn) + rows_shown
    return Section("friction", 5, "Friction", "What do the joints lose?", body)


def _remainder(curves: Mapping[str, np.ndarray], model: str) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Velocity of all training rows and what `model` ("rigid", "predicted") leaves of the measured effort, (M, n)."""
    found = [a for k in range(len(curves)) if (a := select(curves, f"train{k}")) and model in a and "velocity" in a]
    if not found:
        return None, None
    return np.vstack([a["velocity"] for a in found]), np.vstack([a["measured"] - a[model] for a in found])


def friction_curve(row: Mapping[str, Any], record: Record) -> Callable[[np.ndarray], np.ndarray]:
    """Friction of a joint that slides on, over its velocity; row: the joint's entry in the record."""
    terms = fitted_terms(row)
    columns = friction_columns(list(terms), part(record, "settings"))
    return lambda velocity: columns(velocity) @ np.array(list(terms.values()))


def _covariance(record: Record) -> np.ndarray | None:
    """(p, p) of all parameters, None where the record has none that fits its names."""
    try:
        found = np.array(items(record, "covariance"), dtype=float)
    except (TypeError, ValueError):
        return None
    count = len(items(record, "names"))
    return found if count and found.shape == (count, count) else None


def _at_speed(
    record: Record,
    names: Sequence[str],
    k: int,
    row: Mapping[str, Any],
    joint: Mapping[str, Any],
    covariance: np.ndarray | None,
) -> str:
    """Friction of joint k (from 0) at SHARE of its largest speed in training, with σ: "36.0 ± 0.2 N·m at 3.9 rad/s"."""
    covered = items(record, "coverage", "per_joint")
    top = finite(part(covered[k], "velocity_max")) if k < len(covered) else None
    terms = fitted_terms(row)
    wanted = [f"{LETTERS[key]}{k + 1}" for key in terms]
    if not top or not terms or covariance is None or not set(wanted) <= set(names):
        return ""
    columns = both_ways(list(terms), part(record, "settings"), SHARE * top)
    at = [names.index(name) for name in wanted]
    variance = float(columns @ covariance[np.ix_(at, at)] @ columns)
    shown = estimate(float(columns @ list(terms.values())), np.sqrt(max(variance, 0.0)))
    return f"{shown.text} {joint['effort_unit']} at {significant(SHARE * top, 2)} {joint['position_unit']}/s"


def _forms(record: Record) -> str:
    """What the curves are made of beside viscous and Coulomb friction, and which forms of it were tried in vain."""
    forms = items(record, "settings", "friction")
    told = []
    if CUBE_ROOT in forms:
        told.append("Friction has a part that follows the cube root of the velocity (Fc).")
    distance = finite(part(record, "settings", "presliding_distance"))
    if PRESLIDING in forms and distance:
        told.append(
            f"Part of the Coulomb friction (Fp) remembers how a joint moved: after a reversal it turns over within a "
            f"few times {1000 * distance:g} mrad (or mm), and at rest it keeps its value. The curves show "
            "it where the joint slides on, so that near zero the data lie between the two branches."
        )
    fading = finite(part(record, "settings", "stribeck_velocity"))
    if STRIBECK in forms and fading:
        told.append(f"Part of it (Fb) breaks away and fades with speed, to 1/e at {fading:g} rad/s (or m/s).")
    if ASYMMETRIC in forms:
        told.append("Viscous friction differs between the directions (Fa).")
    if LOAD in forms:
        told.append(
            "Part of it (Fl) grows with the load, the effort that the links need; the curves show it under the mean "
            "load, so that the data scatter about them."
        )
    tried = {form for c in items(record, "settings", "candidates") for form in items(c, "settings", "friction")}
    if vain := [form.replace("_", " ") for form in FURTHER if form in tried and form not in forms]:
        told.append(f"Tried on blocks left out, and not surely better there: {' and '.join(vain)} friction.")
    if forms:
        told.append(
            "Constants of one joint make up for each other: single ones may be weak, or below zero, where their sum, "
            "the curve, is well known."
        )
    return f'<p class="remark">{esc(" ".join(told))}</p>' if told else ""


def _constants(row: Mapping[str, Any]) -> str:
    told = []
    for key, letters in FRICTION:
        value = part(row, key)
        if isinstance(value, Mapping) and finite(value.get("estimate")) is not None:
            shown = estimate(value.get("estimate"), value.get("std")).text
            told.append(f"{letters} {shown} {value.get('unit') or ''}".strip())
    return "; ".join(told) or "no constants"
