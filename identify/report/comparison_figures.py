"""Two results in figures: friction curves over one another with their difference, and every difference in σ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify.numbers import significant
from identify.report import drawing, parameter_figures
from identify.report.symbols import symbol_text

LEFT, RIGHT = 46.0, 6.0
NAMES, ROW, FOOT = 46.0, 15.0, 36.0
BAND = 2.0
LEAST = 4.0
"""σ that an axis of differences reaches at least."""


def friction(row: Mapping[str, Any], key: str) -> str:
    """Friction of one joint over velocity in A and B, and beneath it the difference B − A within ±2σ."""
    curve = row["curve"]
    velocity = np.array(curve["velocity"])
    (a, b), (s, t) = np.array(curve["estimates"]), np.array(curve["std"])
    difference, reach = b - a, BAND * np.hypot(s, t)
    figure = drawing.new(226)
    width = drawing.WIDTH - LEFT - RIGHT
    low, high = drawing.span_of([velocity], 0.02)
    upper = drawing.add_axes(figure, LEFT, 18, width, 106)
    drawing.scale(figure, upper, "y", *drawing.span_of([a, b]))
    drawing.scale(figure, upper, "x", low, high, bare=True)
    upper.plot(velocity, a, color=drawing.colour("measured"), linewidth=1.4, clip_on=False)
    line: dict[str, Any] = {"color": drawing.colour("predicted"), "linewidth": 1.4, "dashes": (3.2, 2.6)}
    upper.plot(velocity, b, clip_on=False, **line)
    drawing.write(figure, 2, 10, f"friction [{row['effort_unit']}]")
    lower = drawing.add_axes(figure, LEFT, 147, width, 46)
    limits = drawing.span_of([difference - reach, difference + reach, np.zeros(1)])
    drawing.scale(figure, lower, "y", *limits, most=3)
    drawing.scale(figure, lower, "x", low, high, most=6, rules=False)
    drawing.rule(lower, "y", [0.0], "muted", 0.9)
    band: dict[str, Any] = {"color": drawing.colour("rest"), "linewidth": 0, "clip_on": False}
    lower.fill_between(velocity, difference - reach, difference + reach, **band)
    lower.plot(velocity, difference, color=drawing.colour("error"), linewidth=1.2, clip_on=False)
    drawing.write(figure, 2, 140, f"B − A [{row['effort_unit']}]")
    drawing.write(figure, drawing.WIDTH - RIGHT, 221, f"velocity [{row['speed_unit']}]", "right")
    level = row["levels"][-1]
    values = [significant(side["estimate"], 3) for side in level["estimates"]]
    label = (
        f"{row['joint']}: friction over velocity of A and of B; at {significant(level['speed'], 2)} "
        f"{row['speed_unit']} {values[0]} and {values[1]} {row['effort_unit']}."
    )
    return drawing.svg(figure, key, label)


def distances(rows: Sequence[Mapping[str, Any]], factor: float, key: str, title: str) -> str:
    """The difference B − A of each parameter in its σ, those that changed in another colour and shape."""
    away = np.array([row["z"] for row in rows])
    reach = 1.1 * max(LEAST, float(np.percentile(np.abs(away), 90)) * 1.5)
    height = ROW * len(rows)
    figure = drawing.new(height + FOOT)
    axes = drawing.add_axes(figure, NAMES, 4.0, drawing.WIDTH - NAMES - 60.0, height)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    drawing.scale(figure, axes, "x", -reach, reach, most=6)
    drawing.boxes(axes, [(-BAND * factor, -0.5, 2 * BAND * factor, len(rows))], "rest", zorder=0)
    drawing.rule(axes, "x", [0.0], "muted", 0.9)
    changed = np.array([bool(row["changed"]) for row in rows])
    for tone, chosen, shapes, size in (("measured", ~changed, "o<>", 4.6), ("error", changed, "D<>", 5.2)):
        inside = np.clip(away, -reach, reach)
        groups = (np.abs(away) <= reach, away < -reach, away > reach)
        for shape, group in zip(shapes, groups, strict=True):
            at = np.flatnonzero(chosen & group)
            if len(at):
                style: dict[str, Any] = {"markersize": size, "markeredgewidth": 0, "clip_on": False}
                axes.plot(inside[at], at, shape, color=drawing.colour(tone), **style)
    for k, row in enumerate(rows):
        place = 4.0 + ROW * (k + 0.5) + 4
        drawing.write(figure, NAMES - 8, place, symbol_text(row["name"]), "right", "ink")
        if row["changed"] or abs(away[k]) > reach:
            drawing.write(figure, drawing.WIDTH, place, f"{significant(row['z'], 2)} σ", "right")
    drawing.write(figure, drawing.WIDTH - 60.0, height + 34, "difference B − A [σ]", "right")
    worst = rows[int(np.argmax(np.abs(away)))]
    told = f"{title}: {len(rows)} differences in σ, {int(changed.sum())} of them more than chance explains; "
    return drawing.svg(figure, key, f"{told}the largest is {significant(worst['z'], 2)} σ, {worst['name']}.")


def estimates(rows: Sequence[Mapping[str, Any]], key: str, title: str) -> str:
    """Both estimates of each parameter with ±2σ, one unit a panel."""
    dots = []
    for row in rows:
        (value, sigma), other = ((side["estimate"], side["std"]) for side in row["estimates"])
        word = "changed" if row["changed"] else ""
        hollow = bool(sigma >= abs(value))
        dots.append(parameter_figures.Dot(row["name"], row["unit"], value, sigma, word, hollow, other=other))
    label = f"{title}: {len(dots)} parameters of A and of B, ±2σ each."
    return parameter_figures.figure(dots, key, label)
