"""What the motion and the residuals looked like: friction over velocity, coverage of the limits, autocorrelation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify.numbers import DASH, finite, significant
from identify.report import drawing
from identify.report.envelope import quantiles

LEFT, RIGHT = 46.0, 6.0


def friction(velocity: np.ndarray, seen: np.ndarray, curve: Any, joint: Mapping[str, Any], key: str, label: str) -> str:
    """Friction of one joint over its velocity: the measured remainder as band and dots, the model as a line.

    velocity, seen (M,); curve maps velocities to friction, or None where no friction was identified.
    """
    figure = drawing.new(192)
    axes = drawing.add_axes(figure, LEFT, 18, drawing.WIDTH - LEFT - RIGHT, 136)
    centres, bands = quantiles(velocity, seen)
    low, high = drawing.span_of([velocity], 0.02)
    ramp = np.concatenate([[1e-9], np.linspace(0.02, 1.0, 32) ** 3])  # dense near zero, where friction bends
    grid = np.concatenate([low * ramp[::-1], high * ramp]) if low < 0 < high else np.linspace(low, high, 65)
    model = None if curve is None else curve(grid)
    drawing.scale(figure, axes, "y", *drawing.span_of([bands, *([] if model is None else [model])]))
    drawing.scale(figure, axes, "x", low, high, most=6)
    if len(centres):
        axes.fill_between(centres, bands[:, 0], bands[:, 2], color=drawing.colour("rest"), linewidth=0, clip_on=False)
        style: dict[str, Any] = {"markersize": 3.6, "markeredgewidth": 0, "clip_on": False}
        axes.plot(centres, bands[:, 1], "o", color=drawing.colour("measured"), **style)
    if model is not None:
        axes.plot(grid, model, clip_on=False, color=drawing.colour("predicted"), linewidth=1.3, dashes=(3.2, 2.6))
    drawing.write(figure, 2, 10, f"friction [{joint['effort_unit']}]")
    drawing.write(figure, drawing.WIDTH - RIGHT, 184, f"velocity [{joint['position_unit']}/s]", "right")
    return drawing.svg(figure, key, label)


def bars(rows: Sequence[tuple[str, tuple[float, float] | None, str]], key: str, label: str) -> str:
    """Horizontal bars against limits: (joint, (from, to) in percent of the limit or None, text at the right)."""
    width, left, row, words = 304.0, 78.0, 18.0, 84.0
    figure = drawing.new(row * len(rows) + 34, width)
    axes = drawing.add_axes(figure, left, 2, width - left - words, row * len(rows))
    axes.set_ylim(len(rows) - 0.5, -0.5)
    most = max([100.0, *(bar[1] for _, bar, _ in rows if bar)])
    least = min([0.0, *(bar[0] for _, bar, _ in rows if bar)])
    drawing.scale(figure, axes, "x", least, most, most=2)
    drawing.boxes(axes, [(0, k - 0.28, 100, 0.56) for k, (_, bar, _) in enumerate(rows) if bar], "rest")
    drawing.boxes(axes, [(b[0], k - 0.28, b[1] - b[0], 0.56) for k, (_, b, _) in enumerate(rows) if b], "muted")
    for k, (name, _bar, text) in enumerate(rows):
        place = 2 + row * (k + 0.5) + 4
        drawing.write(figure, left - 6, place, name if len(name) <= 11 else name[:10] + "…", "right", "ink")
        drawing.write(figure, width - words + 10, place, text)
    drawing.write(figure, width - words + 16, row * len(rows) + 16, "% of limit")
    return drawing.svg(figure, key, label)


def autocorrelation(lag: np.ndarray, values: np.ndarray, bound: float | None, key: str, label: str) -> str:
    """Autocorrelation (L,) of one joint's residual over lag (L,) [s]; `bound`: what white noise stays within, 95 %."""
    figure = drawing.new(132)
    axes = drawing.add_axes(figure, LEFT, 18, drawing.WIDTH - LEFT - RIGHT, 78)
    finite_values = values[np.isfinite(values)]
    lowest = min([-0.25, *finite_values.tolist()])
    drawing.scale(figure, axes, "y", lowest * 1.05, 1.05, most=4)
    drawing.scale(figure, axes, "x", min(0.0, float(lag[0])), float(lag[-1]) or 1.0, most=6, rules=False)
    if bound is not None:
        drawing.boxes(axes, [(float(lag[0]), -bound, float(lag[-1] - lag[0]), 2 * bound)], "rest", zorder=0.5)
    axes.plot(lag, values, color=drawing.colour("error"), linewidth=1.2)
    drawing.write(figure, 2, 10, "autocorrelation [1]")
    drawing.write(figure, drawing.WIDTH - RIGHT, 126, "lag [s]", "right")
    return drawing.svg(figure, key, label)


def coverage_rows(
    rows: Sequence[Mapping[str, Any]], joints: Sequence[Mapping[str, Any]], what: str
) -> list[tuple[str, tuple[float, float] | None, str]]:
    """Rows of `bars` for "position", "velocity" or "acceleration", from the record's coverage and limits."""
    by_name = {joint["name"]: joint for joint in joints}
    found: list[tuple[str, tuple[float, float] | None, str]] = []
    for row in rows:
        name = str(row.get("joint", ""))
        joint = by_name.get(name, {})
        if what == "position":
            bar, share = _position(row, joint), finite(row.get("position_limit_percent"))
        else:
            share = finite(row.get(f"{what}_limit_percent"))
            bar = None if share is None else (0.0, share)
        text = "no limit" if share is None else f"{significant(share, 2)} %"
        found.append((name or DASH, bar, text))
    return found


def _position(row: Mapping[str, Any], joint: Mapping[str, Any]) -> tuple[float, float] | None:
    """The range of motion in percent of the way from the lower to the upper limit."""
    limits = joint.get("limits") or {}
    reach, used = limits.get("position"), row.get("position")
    pair = [finite(x) for x in (*(reach or ()), *(used or ()))]
    if len(pair) != 4 or any(x is None for x in pair):
        return None
    low, high, first, last = (float(x) for x in pair if x is not None)
    if high <= low:
        return None
    return 100 * (first - low) / (high - low), 100 * (last - low) / (high - low)
