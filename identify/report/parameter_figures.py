"""Parameters as dots with intervals of ±2σ, one unit a panel, one link a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from identify.numbers import finite
from identify.report import drawing
from identify.report.symbols import symbol_text

LEFT, WORDS, ROW = 46.0, 92.0, 17.0
STRETCH = 3.0  # an interval of an undetermined parameter is cut at this many widths of the others


@dataclass(frozen=True)
class Dot:
    """One row: `value` ± 2·`sigma`, its state in a word, the marks to compare with; `other` is a second estimate."""

    name: str
    unit: str
    value: float
    sigma: float
    word: str = ""
    open: bool = False
    truth: float | None = None
    prior: float | None = None
    other: tuple[float, float] | None = None


def dot(parameter: Mapping[str, Any], state: str) -> Dot | None:
    """The row of one parameter of the record, None where it has no estimate. `state` as in the table."""
    value = finite(parameter.get("estimate"))
    if value is None:
        return None
    sigma = finite(parameter.get("std")) or 0.0
    word = "" if state == "identified" else state
    marks = finite(parameter.get("truth")), finite(parameter.get("prior"))
    name, unit = str(parameter.get("name", "")), str(parameter.get("unit") or "")
    return Dot(name, unit, value, sigma, word, state == "not determined", *marks)


def figure(dots: Sequence[Dot], key: str, label: str) -> str:
    """One figure of all rows: a panel for every unit, each with its own axis."""
    units = list(dict.fromkeys(d.unit for d in dots))
    groups = [[d for d in dots if d.unit == unit] for unit in units]
    height = sum(ROW * len(group) + 44 for group in groups)
    drawn = drawing.new(height)
    top = 6.0
    for unit, group in zip(units, groups, strict=True):
        _panel(drawn, group, unit, top)
        top += ROW * len(group) + 44
    return drawing.svg(drawn, key, label)


def _panel(drawn: drawing.Drawing, dots: Sequence[Dot], unit: str, top: float) -> None:
    width = drawing.WIDTH - LEFT - WORDS
    axes = drawing.add_axes(drawn, LEFT, top, width, ROW * len(dots))
    axes.set_ylim(len(dots) - 0.5, -0.5)
    low, high = _limits(dots)
    drawing.scale(drawn, axes, "x", low, high, most=5)
    if low < 0 < high:
        drawing.rule(axes, "x", [0.0], "muted", 0.9)
    shift = 0.2 if any(d.other for d in dots) else 0.0
    marks = [(d.value, d.sigma, row - shift, d.open) for row, d in enumerate(dots)]
    others = [(*d.other, row + shift, False) for row, d in enumerate(dots) if d.other]
    _intervals(axes, others, "second", "s", (low, high))
    _intervals(axes, marks, "measured", "o", (low, high))
    _marks(axes, [(d.prior, row) for row, d in enumerate(dots) if d.prior is not None], "|", "muted", 11, 1.4)
    _marks(axes, [(d.truth, row) for row, d in enumerate(dots) if d.truth is not None], "D", "predicted", 7.5, 1.2)
    for row, d in enumerate(dots):
        place = top + ROW * (row + 0.5) + 4
        drawing.write(drawn, LEFT - 8, place, symbol_text(d.name), "right", "ink")
        if d.word:
            drawing.write(drawn, drawing.WIDTH, place, d.word, "right")
    drawing.write(drawn, drawing.WIDTH, top + ROW * len(dots) + 15, f"[{unit}]" if unit else "", "right")


def _limits(dots: Sequence[Dot]) -> tuple[float, float]:
    """Limits that hold every mark and every interval, but let no undetermined parameter squeeze the others."""
    sure = [v for d in dots for v in (d.truth, d.prior) if v is not None]
    for d in dots:
        pairs = [(d.value, d.sigma)] + ([d.other] if d.other else [])
        for value, sigma in pairs:
            sure += [value, *((value - 2 * sigma, value + 2 * sigma) if sigma < abs(value) else ())]
    low, high = min([*sure, 0.0]), max([*sure, 0.0])
    reach = [
        e
        for d in dots
        for v, s in [(d.value, d.sigma), *([d.other] if d.other else [])]
        for e in (v - 2 * s, v + 2 * s)
    ]
    width = (high - low) or max((abs(e) for e in reach), default=1.0) or 1.0
    low, high = max(min([low, *reach]), low - STRETCH * width), min(max([high, *reach]), high + STRETCH * width)
    return drawing.span_of([low, high], 0.05)


def _intervals(
    axes: Any, rows: Sequence[tuple[float, float, float, bool]], tone: str, shape: str, limits: tuple[float, float]
) -> None:
    """Estimates (value, sigma, row, hollow) with bars of ±2σ; an arrow where a bar goes on beyond the limits."""
    spans = [(max(x - 2 * s, limits[0]), y, min(x + 2 * s, limits[1]), y) for x, s, y, _ in rows]
    drawing.segments(axes, spans, tone, 1.4, zorder=1.5)
    left = [(limits[0], y) for x, s, y, _ in rows if x - 2 * s < limits[0]]
    right = [(limits[1], y) for x, s, y, _ in rows if x + 2 * s > limits[1]]
    for ends, arrow in ((left, "<"), (right, ">")):
        _marks(axes, ends, arrow, tone, 5, 0, tone)
    size = 5 if shape == "o" else 4.4
    for hollow, face in ((False, tone), (True, "paper")):
        _marks(axes, [(x, y) for x, _, y, h in rows if h is hollow], shape, tone, size, 1.2, face)


def _marks(
    axes: Any, places: Sequence[tuple[float, float]], shape: str, tone: str, size: float, width: float, face: str = ""
) -> None:
    if places:
        style: dict[str, Any] = {"markersize": size, "markeredgewidth": width, "linestyle": "none", "clip_on": False}
        style |= {"markeredgecolor": drawing.colour(tone), "markerfacecolor": drawing.colour(face) if face else "none"}
        axes.plot(*zip(*places, strict=True), marker=shape, **style)
