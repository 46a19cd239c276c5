"""Torque over time: measured, predicted and the error of each joint, and a strip of all joints where there are many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify.numbers import given, significant
from identify.report import drawing
from identify.report.envelope import binned, envelope, runs, spans
from identify.report.record import effort_name

LEFT, RIGHT = 46.0, 6.0
STATIC = 0.05  # least height of a position axis [rad or m]: a joint that stands still shall look it
LEVELS = (2.0, 5.0, 10.0, 20.0, 50.0)  # steps of the heat strip [% of the signal's standard deviation]
STRENGTHS = (0.08, 0.2, 0.36, 0.54, 0.76, 1.0)
BOUNDS = ("under 2 %", "2–5 %", "5–10 %", "10–20 %", "20–50 %", "over 50 %")


def panel(
    arrays: Mapping[str, np.ndarray], k: int, joint: Mapping[str, Any], row: Mapping[str, Any], key: str, bins: int
) -> str:
    """Joint k (0-based) of one log: measured and predicted effort, and beneath on the same time axis the error.

    `arrays` holds time (M,) and measured (M, n), and where there is a model predicted and moving (M, n). Without a
    prediction the lower strip shows the position. `row` holds the joint's figures for the label.
    """
    time, measured = arrays["time"], arrays["measured"][:, k]
    predicted = arrays["predicted"][:, k] if "predicted" in arrays else None
    lower, tone = None, "error"
    if predicted is not None:
        lower = measured - predicted
    elif "position" in arrays:
        lower, tone = arrays["position"][:, k], "ink"
    rest = ~arrays["moving"][:, k].astype(bool) if "moving" in arrays else np.zeros(len(time), dtype=bool)

    figure = drawing.new(236 if lower is not None else 176)
    width = drawing.WIDTH - LEFT - RIGHT
    start, stop = _extent(time)
    shown = [measured] if predicted is None else [measured, predicted]
    upper = drawing.add_axes(figure, LEFT, 18, width, 120)
    drawing.scale(figure, upper, "y", *drawing.span_of(shown))
    drawing.write(figure, 2, 10, f"{effort_name(joint)} [{joint['effort_unit']}]")
    _shade(upper, spans(time, rest))
    upper.plot(*envelope(time, measured, bins), color=drawing.colour("measured"), linewidth=1.5)
    if predicted is not None:
        line: dict[str, Any] = {"color": drawing.colour("predicted"), "linewidth": 1.5, "dashes": (3.2, 2.6)}
        upper.plot(*envelope(time, predicted, bins), **line)
    last, foot = upper, 138.0
    if lower is not None:
        least = 0.0 if tone == "error" else STATIC
        name = f"error [{joint['effort_unit']}]" if tone == "error" else f"position [{joint['position_unit']}]"
        drawing.write(figure, 2, 154, name)
        strip = drawing.add_axes(figure, LEFT, 161, width, 42)
        drawing.scale(figure, strip, "y", *drawing.span_of([lower], symmetric=tone == "error", least=least), most=3)
        _shade(strip, spans(time, rest))
        strip.plot(*envelope(time, lower, bins), color=drawing.colour(tone), linewidth=1.0)
        last, foot = strip, 203.0
        drawing.scale(figure, upper, "x", start, stop, bare=True)
    drawing.scale(figure, last, "x", start, stop, most=8, rules=False)
    drawing.write(figure, drawing.WIDTH - RIGHT, foot + 30, "time [s]", "right")
    return drawing.svg(figure, key, _label(joint, row, predicted is not None, stop - start))


def _extent(time: np.ndarray) -> tuple[float, float]:
    start, stop = float(time[0]), float(time[-1])
    return (start, stop) if stop > start else (start, start + 1.0)


def _shade(axes: Any, rests: Sequence[tuple[float, float]]) -> None:
    boxes = [(a, 0.0, b - a, 1.0) for a, b in rests]
    drawing.boxes(axes, boxes, "rest", transform=axes.get_xaxis_transform(), zorder=-1, clip_on=False)


def _label(joint: Mapping[str, Any], row: Mapping[str, Any], modelled: bool, duration: float) -> str:
    unit, what = joint["effort_unit"], effort_name(joint)
    over = f"{joint['name']}: {what} over {given(duration, 3)} s"
    if not modelled:
        return f"{over}, as recorded; there is no prediction."
    figures = (("moving_rmse", "moving"), ("rest_rmse", "at rest"), ("max_abs_error", "at most"))
    told = [f"{significant(row[name])} {unit} {word}" for name, word in figures if row.get(name) is not None]
    return f"{over}, measured and predicted. Error: {', '.join(told) or 'see the strip beneath'}."


def heat_strip(arrays: Mapping[str, np.ndarray], joints: Sequence[Mapping[str, Any]], key: str, worst: str) -> str:
    """Error of every joint over time, in classes of its share of the joint's own signal. `worst` names the largest."""
    time, error = arrays["time"], arrays["measured"] - arrays["predicted"]
    size = np.std(arrays["measured"], axis=0)
    columns = min(150, len(time))
    share = 100 * binned(error, columns) / np.where(size > 0, size, np.inf)
    levels = np.digitize(share, LEVELS)
    row, left, width = 15.0, 132.0, 952.0
    figure = drawing.new(row * len(joints) + 42, width)
    axes = drawing.add_axes(figure, left, 4, width - left - RIGHT, row * len(joints))
    start, stop = _extent(time)
    step = (stop - start) / columns
    axes.set_ylim(len(joints), 0)
    drawing.scale(figure, axes, "x", start, stop, most=8, rules=False)
    for level, strength in enumerate(STRENGTHS):
        found = [
            (start + a * step, k + 0.08, (b - a) * step, 0.84)
            for k in range(len(joints))
            for a, b in runs(levels[:, k], level)
        ]
        drawing.boxes(axes, found, "error", alpha=strength, clip_on=False)
    for k, joint in enumerate(joints):
        name = joint["name"] if len(joint["name"]) <= 20 else joint["name"][:19] + "…"
        drawing.write(figure, left - 6, 4 + row * (k + 0.76), name, "right")
    drawing.write(figure, width - RIGHT, row * len(joints) + 36, "time [s]", "right")
    return drawing.svg(
        figure, key, f"Error of {len(joints)} joints over time, in % of each signal; largest at {worst}."
    )
