"""Small figures with matplotlib: axes placed in pixels, few round ticks, text that stays text.

Axes, ticks and words are set here rather than by matplotlib, so that text keeps the page's font and may be anything
that a joint is called. Nothing depends on the clock or on the user's own matplotlib settings.
"""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from identify import numbers
from identify.report.svg import SENTINELS, compact, themed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 464.0  # one column of the page [px]
NARROWEST = 2e-3  # least width of an axis, of its largest value

_LOCK = threading.RLock()
_ANCHORS = {"left": "", "center": ";text-anchor:middle", "right": ";text-anchor:end"}


@dataclass(frozen=True)
class Drawing:
    """A figure of width × height [px] and the words upon it, as SVG."""

    figure: Figure
    width: float
    height: float
    words: list[str] = field(default_factory=list)


@contextmanager
def drawing() -> Iterator[None]:
    """Hold matplotlib's defaults, whatever the user's own settings, while figures are made; one thread at a time."""
    import matplotlib

    with _LOCK, matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "identify", "path.simplify_threshold": 0.2})
        yield


def colour(name: str) -> str:
    """The sentinel to draw with for one of the page's colours."""
    return SENTINELS[name]


def new(height: float, width: float = WIDTH) -> Drawing:
    """An empty figure of width × height [px]."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / 72, height / 72), dpi=72, facecolor="none")
    FigureCanvasSVG(figure)
    return Drawing(figure, width, height)


def add_axes(drawn: Drawing, left: float, top: float, width: float, height: float) -> Axes:
    """Bare axes at a place in px from the upper left corner; `scale` gives them limits, ticks and rules."""
    bottom = drawn.height - top - height
    place = (left / drawn.width, bottom / drawn.height, width / drawn.width, height / drawn.height)
    axes = drawn.figure.add_axes(place)
    axes.set_axis_off()
    return axes


def scale(
    drawn: Drawing,
    axes: Axes,
    which: str,
    low: float,
    high: float,
    most: int = 5,
    rules: bool = True,
    bare: bool = False,
) -> None:
    """Set the limits of the "x" or "y" axis, label at most `most` round ticks, and draw rules across at them.

    bare: limits alone. The x axis has a base line with tick marks, the y axis neither.
    """
    from matplotlib.ticker import MaxNLocator

    (axes.set_xlim if which == "x" else axes.set_ylim)(low, high)
    if bare:
        return
    found = MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    margin = 1e-9 * (high - low)
    places = [float(p) for p in found if low - margin <= p <= high + margin]
    places = [0.0 if abs(p) < 1e-12 * max(abs(low), abs(high)) else p for p in places]
    if rules:
        rule(axes, which, places)
    box = axes.get_position()
    left, top = box.x0 * drawn.width, (1 - box.y1) * drawn.height
    width, height = box.width * drawn.width, box.height * drawn.height
    shares = [(p - low) / (high - low) for p in places]
    for share, text in zip(shares, numbers.ticks(places), strict=True):
        if which == "x":
            write(drawn, left + share * width, top + height + 14.5, text, "center")
        else:
            write(drawn, left - 5, top + (1 - share) * height + 3.8, text, "right")
    if which == "x":
        marks = [(0.0, 0.0, 1.0, 0.0), *((s, 0.0, s, -3 / height) for s in shares)]
        segments(axes, marks, "muted", 0.7, transform=axes.transAxes)


def rule(axes: Axes, which: str, places: Sequence[float], tone: str = "rule", linewidth: float = 0.7) -> None:
    """Lines across the axes at places of one axis."""
    lines = [(p, 0.0, p, 1.0) if which == "x" else (0.0, p, 1.0, p) for p in places]
    transform = axes.get_xaxis_transform() if which == "x" else axes.get_yaxis_transform()
    segments(axes, lines, tone, linewidth, transform=transform, zorder=0)


def segments(
    axes: Axes, lines: Sequence[tuple[float, float, float, float]], tone: str, linewidth: float, **style: Any
) -> None:
    """Straight lines (x, y, x, y) as one path, in data coordinates unless a `transform` is given."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    if not lines:
        return
    path = Path(np.array(lines, dtype=float).reshape(-1, 2), [Path.MOVETO, Path.LINETO] * len(lines))
    style = {"transform": axes.transData, "clip_on": False, **style}
    axes.add_artist(PathPatch(path, edgecolor=colour(tone), facecolor="none", linewidth=linewidth, **style))


def span_of(
    values: Sequence[np.ndarray | float], margin: float = 0.06, symmetric: bool = False, least: float = 0.0
) -> tuple[float, float]:
    """Limits around all finite values, a margin added; at least `least` wide, and wide enough for short tick labels."""
    flat = np.concatenate([np.ravel(np.asarray(v, dtype=float)) for v in values] or [np.zeros(1)])
    flat = flat[np.isfinite(flat)]
    if not len(flat):
        return -1.0, 1.0
    low, high = float(flat.min()), float(flat.max())
    if symmetric:
        low, high = -max(abs(low), abs(high)), max(abs(low), abs(high))
    width = max(high - low, least, NARROWEST * max(abs(low), abs(high))) or 1.0
    middle, reach = 0.5 * (low + high), (0.5 + margin) * width
    return middle - reach, middle + reach


def write(drawn: Drawing, x: float, y: float, text: str, align: str = "left", tone: str = "muted") -> None:
    """Put text at x, y [px from the upper left corner, at the base line]."""
    style = f"{themed(f'fill: {colour(tone)}')}{_ANCHORS[align]}"
    drawn.words.append(f'<text x="{x:.4g}" y="{y:.4g}" style="{style}">{escape(text)}</text>')


def boxes(axes: Axes, rectangles: Sequence[tuple[float, float, float, float]], tone: str, **style: Any) -> None:
    """Fill rectangles (x, y, width, height) as one path, in data coordinates unless a `transform` is given."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    if not rectangles:
        return
    corners = [[(x, y), (x + w, y), (x + w, y + h), (x, y + h), (x, y)] for x, y, w, h in rectangles]
    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY] * len(rectangles)
    path = Path(np.array(corners).reshape(-1, 2), codes)
    axes.add_patch(PathPatch(path, facecolor=colour(tone), edgecolor="none", linewidth=0, **style))


def svg(drawn: Drawing, key: str, label: str) -> str:
    """The figure as inline SVG. `key` keeps identifiers apart; `label` states the finding for screen readers."""
    buffer = io.StringIO()
    nothing = {"Date": None, "Creator": None, "Type": None, "Format": None}
    drawn.figure.savefig(buffer, format="svg", metadata=nothing)
    inner = compact(buffer.getvalue(), key) + "".join(drawn.words)
    box = f"0 0 {drawn.width:g} {drawn.height:g}"
    return f'<svg viewBox="{box}" role="img" aria-label="{escape(label)}">{inner}</svg>'
