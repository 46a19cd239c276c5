"""Every log's estimate of every parameter, as its distance from the weighted mean in stated standard deviations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify.regressor.columns import TURNING, column_kind
from identify.report import drawing
from identify.report.symbols import symbol_text

LEFT, RIGHT, ROW, FOOT = 46.0, 8.0, 15.0, 30.0
BAND = 2.0
LEAST, SHARE = 3.0, 97.0
"""A panel reaches over this share of its dots [%], and so many σ at least."""

EXPLAINED = (
    "Each row is a parameter, each dot a log: how far its estimate lies from the mean weighted by 1/σ² (odd estimates "
    "left out), in its own stated σ. Where σ is true and nothing but chance differs, nearly all lie in the band. "
    "Arrows stand for dots farther out."
)


def panels(summary: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Small multiples as `markup.figures` takes them: parameters of the links, then of friction and drives."""
    fits = [fit for fit in summary["fits"] if fit["parameters"]]
    names = [p["name"] for p in summary["parameters"]]
    tables = [{p["name"]: p for p in fit["parameters"]} for fit in fits]
    x, sigma = (np.array([[t[name][key] for name in names] for t in tables], float) for key in ("estimate", "std"))
    odd = np.array([[fit["name"] in p["odd"] for p in summary["parameters"]] for fit in fits])
    away = distances(x, np.maximum(sigma, 1e-300), odd)
    joint = np.array([column_kind(name) in TURNING for name in names])
    shown = []
    for key, title, mine in (("links", "Links", ~joint), ("drives", "Friction and drives", joint)):
        if mine.any():
            label = f"{title}: distance of {len(fits)} logs from their weighted mean in standard deviations."
            reach = float(np.clip(1.15 * np.percentile(np.abs(away[:, mine]), SHARE), LEAST, 1e6))
            chosen = [name for name, own in zip(names, mine, strict=True) if own]
            shown.append(
                (title, "distance in σ", _strip(chosen, away[:, mine], odd[:, mine], reach, f"b-{key}", label))
            )
    return shown


def distances(x: np.ndarray, sigma: np.ndarray, odd: np.ndarray) -> np.ndarray:
    """(k, m) distance of the estimates x (k, m) from each parameter's weighted mean, in σ; all odd: from the median.

    Estimates whose σ differ widely have their mean near the sure ones, which a median would not.
    """
    weight = np.where(odd, 0.0, sigma**-2.0)
    total = weight.sum(axis=0)
    mean = np.divide((weight * x).sum(axis=0), total, out=np.median(x, axis=0), where=total > 0)
    return (x - mean) / sigma


def _strip(names: Sequence[str], away: np.ndarray, odd: np.ndarray, reach: float, key: str, label: str) -> str:
    """Rows of dots: away, odd (k, m), one row for each of m names, within ±reach."""
    height = ROW * len(names)
    drawn = drawing.new(height + FOOT)
    axes = drawing.add_axes(drawn, LEFT, 4.0, drawing.WIDTH - LEFT - RIGHT, height)
    axes.set_ylim(len(names) - 0.5, -0.5)
    drawing.scale(drawn, axes, "x", -reach, reach, most=6)
    drawing.boxes(axes, [(-BAND, -0.5, 2 * BAND, len(names))], "rest", zorder=0)
    drawing.rule(axes, "x", [0.0], "muted", 0.9)
    rows = np.broadcast_to(np.arange(len(names)), away.shape)
    for tone, chosen in (("measured", ~odd), ("error", odd)):
        inside = chosen & (np.abs(away) <= reach)
        _dots(axes, away[inside], rows[inside], "o", 4.6, tone)
        for side, arrow in ((-1, "<"), (1, ">")):
            beyond = chosen & (side * away > reach)
            _dots(axes, np.full(int(beyond.sum()), side * reach), rows[beyond], arrow, 5.5, tone)
    for row, name in enumerate(names):
        drawing.write(drawn, LEFT - 8, 4.0 + ROW * (row + 0.5) + 4, symbol_text(name), "right", "ink")
    return drawing.svg(drawn, key, label)


def _dots(axes: Any, x: np.ndarray, y: np.ndarray, shape: str, size: float, tone: str) -> None:
    if len(x):
        colour = drawing.colour(tone)
        axes.plot(x, y, shape, markersize=size, color=colour, markeredgewidth=0, alpha=None, clip_on=False)
