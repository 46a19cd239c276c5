"""From a matplotlib figure to a small SVG that takes its colours and its font from the page around it.

Colours are drawn as sentinels and handed on as CSS variables, so that one drawing serves light, dark and
paper. Text stays text. No identifier depends on the clock, and none is used twice on a page.
"""

from __future__ import annotations

import io
import re
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from identify.report import numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("ink", "muted", "rule", "rest", "measured", "predicted", "error", "paper", "second")
SENTINELS = {name: f"#0100{k + 1:02x}" for k, name in enumerate(COLOURS)}
WIDTH = 464.0  # one column of the page [px]
TEXT = 11.0  # [px]

_LOCK = threading.RLock()
_CARRIED = "text:"
_NUMBER = re.compile(r"-?\d+\.\d+")
_POINTS = re.compile(r"([A-Za-z])([^A-Za-z]*)")


@contextmanager
def drawing() -> Iterator[None]:
    """Hold matplotlib's defaults, whatever the user's own settings, while figures are made; one thread at a time."""
    import matplotlib

    with _LOCK, matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(
            {"svg.fonttype": "none", "svg.hashsalt": "identify", "font.size": TEXT, "path.simplify_threshold": 0.2}
        )
        yield


def colour(name: str) -> str:
    """The sentinel to draw with for one of `COLOURS`."""
    return SENTINELS[name]


def new(height: float, width: float = WIDTH) -> Figure:
    """An empty figure of width × height [px]."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / 72, height / 72), dpi=72, facecolor="none")
    FigureCanvasSVG(figure)
    return figure


def add_axes(figure: Figure, left: float, top: float, width: float, height: float) -> Axes:
    """Axes at a place in px from the upper left corner: no box, thin rules across, small grey tick labels."""
    whole_width, whole_height = figure.get_size_inches() * 72
    bottom = whole_height - top - height
    place = (left / whole_width, bottom / whole_height, width / whole_width, height / whole_height)
    axes = figure.add_axes(place, facecolor="none")
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.spines["bottom"].set(color=colour("muted"), linewidth=0.7)
    axes.tick_params(colors=colour("muted"), labelsize=TEXT - 0.5, length=3, width=0.7, pad=3)
    axes.tick_params(axis="y", length=0, pad=5)
    return axes


def scale(axes: Axes, which: str, low: float, high: float, most: int = 5, rules: bool = True) -> None:
    """Set the limits of the "x" or "y" axis, put at most `most` round ticks on it, and rules across at them."""
    from matplotlib.ticker import MaxNLocator

    axis = axes.xaxis if which == "x" else axes.yaxis
    places = MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    margin = 1e-9 * (high - low)
    places = [float(p) for p in places if low - margin <= p <= high + margin]
    places = [0.0 if abs(p) < 1e-12 * max(abs(low), abs(high)) else p for p in places]
    axis.set_ticks(places, labels=numbers.ticks(places))
    (axes.set_xlim if which == "x" else axes.set_ylim)(low, high)
    if rules:
        rule(axes, which, places)


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


def span_of(values: Sequence[np.ndarray | float], margin: float = 0.06, symmetric: bool = False) -> tuple[float, float]:
    """Limits around all finite values, a margin added; never of zero width."""
    flat = np.concatenate([np.ravel(np.asarray(v, dtype=float)) for v in values] or [np.zeros(1)])
    flat = flat[np.isfinite(flat)]
    if not len(flat):
        return -1.0, 1.0
    low, high = float(flat.min()), float(flat.max())
    if symmetric:
        low, high = -max(abs(low), abs(high)), max(abs(low), abs(high))
    width = high - low or abs(high) or 1.0
    return low - margin * width, high + margin * width


def write(figure: Figure, x: float, y: float, text: str, align: str = "left", tone: str = "muted") -> None:
    """Put text at x, y [px from the upper left corner, at the base line].

    The text travels as an identifier beside a stand-in, so that matplotlib looks for no glyphs and no formulas in it.
    """
    width, height = figure.get_size_inches() * 72
    drawn = figure.text(x / width, 1 - y / height, "x", color=colour(tone), ha=align, va="baseline")
    drawn.set_gid(_CARRIED + text)


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


def svg(figure: Figure, key: str, label: str) -> str:
    """The figure as inline SVG. `key` keeps identifiers apart; `label` states the finding for screen readers."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Type": None, "Format": None})
    root = ElementTree.fromstring(buffer.getvalue())
    names: dict[str, str] = {}
    inner = "".join(_markup(child, key, names) for child in root)
    return f'<svg viewBox="{root.get("viewBox", "")}" role="img" aria-label="{escape(label)}">{inner}</svg>'


def _markup(element: ElementTree.Element, key: str, names: dict[str, str]) -> str:
    """One element of matplotlib's SVG and all within, without what an inline drawing doesn't need.

    `names` collects the identifiers met so far and what they are called on the page.
    """
    tag = element.tag.rpartition("}")[2]
    if tag in ("metadata", "style"):
        return ""
    attributes = {k.rpartition("}")[2]: v for k, v in element.attrib.items()}
    if attributes.get("id", "").startswith(_CARRIED):
        return _text(element[0], attributes["id"].removeprefix(_CARRIED))
    inner = "".join(_markup(child, key, names) for child in element)
    if tag == "g" and "clip-path" not in attributes:
        return inner
    if tag == "text":
        return _text(element, "".join(element.itertext()))
    unseen = attributes.get("style") == "fill: none" or not attributes.get("d")
    if (tag in ("g", "defs") and not inner) or (tag == "path" and unseen):
        return ""
    written = "".join(f' {k}="{_attribute(k, v, key, names)}"' for k, v in attributes.items())
    return f"<{tag}{written}>{inner}</{tag}>" if inner else f"<{tag}{written}/>"


def _attribute(name: str, value: str, key: str, names: dict[str, str]) -> str:
    if name == "d":
        return _path(value)
    if name == "style":
        return _style(value)
    if name in ("id", "href", "clip-path"):
        name = value.removeprefix("url(").strip("#)")
        return value.replace(name, names.setdefault(name, f"{key}.{len(names)}"))
    return escape(_NUMBER.sub(_short, value))


def _short(match: re.Match[str]) -> str:
    return _tenths(round(float(match.group()) * 10))


def _tenths(number: int) -> str:
    """A whole number of tenths, as short as SVG allows: 12, -3.4, .5."""
    text = f"{number // 10}" if number % 10 == 0 else f"{number / 10:.1f}"
    return text.replace("0.", ".", 1) if text.startswith(("0.", "-0.")) else text


def _path(data: str) -> str:
    """A path to a tenth of a pixel, its lines relative to the point before, so that rounding doesn't add up."""
    pieces: list[str] = []
    at = start = (0, 0)
    last = ""
    for letter, rest in _POINTS.findall(data):
        values = [round(float(v) * 10) for v in rest.split()]
        if letter == "L":
            step = values[0] - at[0], values[1] - at[1]
            letter, values = ("h", [step[0]]) if not step[1] else ("v", [step[1]]) if not step[0] else ("l", [*step])
            at = at[0] + step[0], at[1] + step[1]
            if step == (0, 0):
                continue
        elif letter in "Zz":
            at = start
        else:
            at = values[-2], values[-1]
            start = at if letter == "M" else start
        numbers_text = " ".join(_tenths(v) for v in values).replace(" -", "-")
        joint = "" if numbers_text.startswith("-") else " "
        pieces.append(joint + numbers_text if letter == last == "l" else letter + numbers_text)
        last = letter
    return "".join(pieces)


def _style(style: str) -> str:
    """A style attribute with the sentinels as CSS variables and the page's own defaults left out."""
    for name, sentinel in SENTINELS.items():
        style = style.replace(sentinel, f"var(--{name})")
    entries = [entry.split(":", 1) for entry in style.split(";") if ":" in entry]
    left_out = ("stroke-linejoin", "stroke-linecap", "stroke-dashoffset")
    return ";".join(f"{k.strip()}:{_NUMBER.sub(_tidy, v.strip())}" for k, v in entries if k.strip() not in left_out)


def _tidy(match: re.Match[str]) -> str:
    return f"{float(match.group()):.4g}"


def _text(element: ElementTree.Element, text: str) -> str:
    """A text element that keeps its place, its anchor and its colour, and leaves font and size to the page."""
    style = dict(entry.strip().split(": ", 1) for entry in element.attrib.get("style", "").split(";") if ": " in entry)
    anchor = style.get("text-anchor", "start")
    place = "".join(f' {k}="{_NUMBER.sub(_short, element.attrib[k])}"' for k in ("x", "y") if k in element.attrib)
    kept = f"fill: {style.get('fill', colour('ink'))}" + (f"; text-anchor: {anchor}" if anchor != "start" else "")
    return f'<text{place} style="{_style(kept)}">{escape(text)}</text>'
