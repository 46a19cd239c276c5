"""Matplotlib's SVG made small, and its colours handed on to the page.

Colours are drawn as sentinels and become CSS variables, so that one drawing serves light, dark and paper. No identifier
is used twice on a page.
"""

from __future__ import annotations

import re
from html import escape
from xml.etree import ElementTree

COLOURS = ("ink", "muted", "rule", "rest", "measured", "predicted", "error", "paper", "second")
SENTINELS = {name: f"#0100{k + 1:02x}" for k, name in enumerate(COLOURS)}

_NUMBER = re.compile(r"-?\d+\.\d+")
_POINTS = re.compile(r"([A-Za-z])([^A-Za-z]*)")


def compact(drawn: str, key: str) -> str:
    """What matplotlib drew, as the inside of an inline SVG. `key` keeps its identifiers apart from other drawings'."""
    names: dict[str, str] = {}
    return "".join(_markup(child, key, names) for child in ElementTree.fromstring(drawn))


def _markup(element: ElementTree.Element, key: str, names: dict[str, str]) -> str:
    """One element of matplotlib's SVG and all within, without what an inline drawing doesn't need.

    `names` collects the identifiers met so far and what they are called on the page.
    """
    tag = element.tag.rpartition("}")[2]
    if tag in ("metadata", "style"):
        return ""
    attributes = {k.rpartition("}")[2]: v for k, v in element.attrib.items()}
    inner = "".join(_markup(child, key, names) for child in element)
    if tag == "g" and "clip-path" not in attributes:
        return inner
    unseen = attributes.get("style") == "fill: none" or not attributes.get("d")
    if (tag in ("g", "defs") and not inner) or (tag == "path" and unseen):
        return ""
    written = "".join(f' {k}="{_attribute(k, v, key, names)}"' for k, v in attributes.items())
    return f"<{tag}{written}>{inner}</{tag}>" if inner else f"<{tag}{written}/>"


def _attribute(name: str, value: str, key: str, names: dict[str, str]) -> str:
    if name == "d":
        return _path(value)
    if name == "style":
        return themed(value)
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


def themed(style: str) -> str:
    """A style attribute with the sentinels as CSS variables and the page's own defaults left out."""
    for name, sentinel in SENTINELS.items():
        style = style.replace(sentinel, f"var(--{name})")
    entries = [entry.split(":", 1) for entry in style.split(";") if ":" in entry]
    left_out = ("stroke-linejoin", "stroke-linecap", "stroke-dashoffset")
    return ";".join(f"{k.strip()}:{_NUMBER.sub(_tidy, v.strip())}" for k, v in entries if k.strip() not in left_out)


def _tidy(match: re.Match[str]) -> str:
    return f"{float(match.group()):.4g}"
