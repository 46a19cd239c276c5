"""Sections 8, 10 and 11: the two models, the checks, and where it all came from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify.numbers import DASH, column, count, estimate, finite, given, percent, significant
from identify.report import estimators, parameter_figures
from identify.report.markup import Notes, Section, absent, esc, figures, legend, prose, table, unit
from identify.report.record import UNKNOWN, Record, items, missing, part, reason, units
from identify.report.symbols import symbol_html, symbol_text

ROUNDING = math.sqrt(np.finfo(float).eps)
"""Largest relative difference that rounding of double-precision numbers is taken to explain: half of their digits."""


def models_section(record: Record) -> Section:
    """The torque model and the energy model on the same logs, parameter by parameter."""
    title, question = "Models", "Do energy and torque agree?"
    torque, energy = part(record, "models", "torque"), part(record, "models", "energy")
    if not torque or not energy:
        name = "energy" if torque else "torque"
        why = reason(record, "models", name)
        body = absent(f"No {name} model to compare with." if torque or energy else "No models.", why)
        finding = "; ".join(text for text in (f"only one model: {why}", estimators.finding(record)) if text)
        return Section("models", 8, title, question, body + estimators.table_of(record), finding, folded=True, why=why)
    pairs = _pairs(torque, energy, units(record), part(record, "model"))
    agreement = part(record, "models", "agreement") or {}
    within, largest = finite(agreement.get("within_2_sigma_percent")), finite(agreement.get("largest_z"))
    told = []
    if within is not None:
        told.append(f"{significant(within, 2)} % of the parameters agree within 2σ")
    if largest is not None:
        name = symbol_text(str(agreement.get("name") or ""))
        told.append(f"the largest difference is {significant(largest, 2)} σ{f' ({name})' if name else ''}")
    finding = "; ".join(told) or f"agreement: {reason(record, 'models', 'agreement')}"
    useless = [
        f"The {name} model leaves {percent(left)} of the torque unexplained on its own training logs, and predicting "
        "none would leave 100 %: that it agrees or not says nothing of the other."
        for name, model in (("torque", torque), ("energy", energy))
        if (left := finite(part(model, "moving_relative_residual_percent"))) is not None and left >= 100
    ]
    first, second = ("energy", "torque") if part(record, "model") == "energy" else ("torque", "energy")
    marks = legend(("dot", f"{first} model ± 2σ"), ("square", f"{second} model ± 2σ"))
    body = f"{estimators.table_of(record)}{_model_figures(torque, energy)}{marks}{_compared(record, pairs)}"
    finding = "; ".join(text for text in (finding, estimators.finding(record)) if text)
    body += _models_table(pairs, first, second)
    return Section("models", 8, title, question, body, finding, tuple(useless), folded=True)


def _pairs(
    torque: Any, energy: Any, unit_of: Mapping[str, str], main: Any
) -> list[tuple[str, str, Mapping[str, Any], Mapping[str, Any]]]:
    """(name, unit, main model's estimate, the other model's) of every parameter that both have."""
    first, second = (energy, torque) if main == "energy" else (torque, energy)
    others = {str(part(p, "name")): p for p in items(second, "parameters")}
    return [
        (name, unit_of.get(name, ""), p, others[name])
        for p in items(first, "parameters")
        if (name := str(part(p, "name"))) in others
    ]


def _model_figures(torque: Any, energy: Any) -> str:
    keys = {
        "condition_number": "scaled condition number",
        "moving_relative_residual_percent": "error moving" + unit("%"),
        "relative_residual_percent": "error with rest" + unit("%"),
    }
    head = [("model", "text"), *((title, "number") for title in keys.values())]
    rows = [
        [name, *(esc(significant(part(m, key), 2)) for key in keys)]
        for name, m in (("torque", torque), ("energy", energy))
    ]
    return table(head, rows, "Both models, fitted to the training logs")


def _compared(record: Record, pairs: Sequence[tuple[str, str, Mapping[str, Any], Mapping[str, Any]]]) -> str:
    """Figures of both estimates, grouped by the digits that end the name: the link or joint."""
    groups: dict[str, list[parameter_figures.Dot]] = {}
    for name, unit_text, p, other in pairs:
        value, rival = finite(p.get("estimate")), finite(other.get("estimate"))
        if value is None or rival is None:
            continue
        index = name[len(name.rstrip("0123456789")) :]
        sigmas = finite(p.get("std")) or 0.0, finite(other.get("std")) or 0.0
        dot = parameter_figures.Dot(
            name, unit_text, value, sigmas[0], open=sigmas[0] >= abs(value), other=(rival, sigmas[1])
        )
        groups.setdefault(index, []).append(dot)
    drawn = []
    for index, dots in groups.items():
        title = f"Link and joint {index}" if index else "Others"
        label = f"{title}: {len(dots)} parameters estimated by the torque model and by the energy model, ±2σ each."
        drawn.append((esc(title), "", parameter_figures.figure(dots, f"m-{index or 'x'}", label)))
    return figures(drawn)


def _models_table(
    pairs: Sequence[tuple[str, str, Mapping[str, Any], Mapping[str, Any]]], first: str, second: str
) -> str:
    head = [
        ("symbol", "text"),
        (f"{first} model", "value"),
        ("± σ", "sigma"),
        (f"{second} model", "value"),
        ("± σ", "sigma"),
    ]
    head += [("unit", "text"), ("difference" + unit("σ of both"), "number")]
    differences = []
    for _, _, p, q in pairs:
        values = [finite(x.get(key)) for x in (p, q) for key in ("estimate", "std")]
        a, s, b, t = (0.0 if v is None else v for v in values)
        differences.append((b - a) / math.hypot(s, t) if None not in values and math.hypot(s, t) else None)
    shown = column(differences, most=2)
    body = [[symbol_html(n), *_pair(p), *_pair(q), esc(u), d] for (n, u, p, q), d in zip(pairs, shown, strict=True)]
    return table(head, body, "Both estimates of every parameter")


def _pair(p: Mapping[str, Any]) -> tuple[str, str]:
    shown = estimate(p.get("estimate"), p.get("std"))
    if not shown.determined:
        return f'<span class="bound">|x| &lt; {esc(shown.bound)}</span>', ""
    return esc(shown.value), f"± {esc(shown.sigma)}" if shown.sigma else ""


def checks_section(record: Record) -> Section:
    """Largest differences between the regressor, Pinocchio and MuJoCo."""
    title, question = "Checks", "Do three engines agree?"
    checks = part(record, "cross_check")
    if not isinstance(checks, Mapping):
        why = reason(record, "cross_check")
        return Section("checks", 10, title, question, absent("Not checked.", why), "not checked", folded=True, why=why)
    notes, rows, differences, warnings = Notes(), [], [], []
    entries = [("regressor", checks, name) for name in ("pinocchio", "mujoco")]
    identified = checks.get("identified")
    entries += [("identified model", identified, name) for name in ("pinocchio", "mujoco")] if identified else []
    engines = {"pinocchio": "Pinocchio", "mujoco": "MuJoCo"}
    for what, group, name in entries:
        entry = part(group, name)
        difference = finite(part(entry, "max_abs_error"))
        told = part(entry, "what") or what
        if difference is None:
            rows.append([esc(told), engines[name], notes.missing(reason(group, name)), DASH])
            continue
        differences.append(difference)
        rows.append([esc(told), engines[name], esc(significant(difference, 2)), esc(count(part(entry, "samples")))])
        if difference > ROUNDING:
            warnings.append(
                f"The {what} differs from {engines[name]} by {significant(difference, 2)}, relative, "
                "which rounding can’t explain."
            )
    if not identified:
        notes.missing(f"identified model: {reason(checks, 'identified')}")
    head = [
        ("what was compared", "prose"),
        ("with", "text"),
        ("largest difference,<br>relative" + unit("1"), "number"),
    ]
    head += [("samples", "number")]
    finding = f"largest relative difference {significant(max(differences), 2)}" if differences else "not checked"
    body = table(head, rows, "Cross-checks", notes)
    return Section("checks", 10, title, question, body, finding, tuple(warnings), folded=True)


def provenance_section(record: Record) -> Section:
    """Hashes, settings, versions, seed, the command, and every reason for what is missing."""
    robot = part(record, "robot") or {}
    entries = [("command", f"<code>{esc(part(record, 'command') or DASH)}</code>")]
    seed = part(record, "seed")
    why = reason(record, "seed")
    drawn_none = "none" if why == UNKNOWN else f"none: {why}"
    entries.append(("seed", esc(seed if seed is not None else drawn_none)))
    entries.append(("robot", _file(robot.get("source"), robot.get("sha256"))))
    entries += [
        (f"{part(log, 'role')} log", _file(part(log, "path"), part(log, "sha256"))) for log in items(record, "logs")
    ]
    versions = part(record, "versions") or {}
    entries.append(("versions", esc(", ".join(f"{k} {v}" for k, v in versions.items()) or DASH)))
    settings = part(record, "settings")
    if isinstance(settings, Mapping):
        plain = [(k, v) for k, v in settings.items() if isinstance(v, (str, int, float)) and not k.endswith("_reason")]
        entries.append(("settings", ", ".join(f"<code>{esc(k)} = {esc(_setting(v))}</code>" for k, v in plain) or DASH))
    entries.append(("format", esc(part(record, "format") or DASH)))
    listed = "".join(f"<dt>{esc(name)}</dt><dd>{value}</dd>" for name, value in entries)
    gaps = missing(record)
    lines = "".join(f"<dt><code>{esc(name)}</code></dt><dd>{prose(text)}</dd>" for name, text in gaps)
    told = f'<h3>Not available, and why</h3><dl class="provenance gaps">{lines}</dl>' if gaps else ""
    finding = (
        f"command, seed, settings, versions, and the hashes of the robot file and {len(items(record, 'logs'))} logs"
    )
    body = f'<dl class="provenance">{listed}</dl>{told}'
    return Section("provenance", 11, "Provenance", "Can I repeat it?", body, finding, folded=True)


def _setting(value: Any) -> str:
    return given(value) if isinstance(value, float) else str(value)


def _file(path: Any, digest: Any) -> str:
    hashed = f'<br><span class="hash">sha256 {esc(digest)}</span>' if digest else ""
    return f"{esc(path or DASH)}{hashed}"
