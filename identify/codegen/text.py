"""Names and long lines as source code holds them: plain ASCII, whatever a robot or its joints are called."""

from __future__ import annotations

import keyword
import re
import sys
import textwrap
import unicodedata
from collections.abc import Iterable

WIDTH = 120

TAKEN = {*sys.stdlib_module_names, "numpy"}
"""Names that a file beside a program must not have: `import math` would find the robot called Math."""

PLAIN = {"·": ".", "²": "^2", "³": "^3", "×": "*", "−": "-", "–": "-", "°": "deg", "ß": "ss", "φ": "phi", "∛": "cbrt"}


def ascii_text(text: str) -> str:
    """The text in ASCII: accents taken off, N·m as N.m, what has no like left out."""
    text = "".join(PLAIN.get(c, c) for c in text)
    return unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()


def title(text: str) -> str:
    """A name as it may stand in a comment of any language."""
    plain = "".join(c for c in ascii_text(text) if c.isprintable() and c not in '*/\\"?').strip()
    return plain or "robot without a name in ASCII"


def identifier(name: str) -> str:
    """The robot's name as an identifier of both languages: "Stäubli RX-90" is staubli_rx_90."""
    word = re.sub(r"[^a-z0-9]+", "_", ascii_text(name).lower()).strip("_")
    safe = word[:1].isalpha() and not keyword.iskeyword(word) and word not in TAKEN
    return word if safe else f"robot_{word}".rstrip("_")


def c_string(text: str) -> str:
    """A string literal of C: UTF-8, with octal escapes for what is not plain."""
    return '"' + "".join(_escaped(byte) for byte in text.encode("utf-8", "replace")) + '"'


def _escaped(byte: int) -> str:
    # A question mark could begin a trigraph.
    plain = 32 <= byte < 127 and chr(byte) not in '"\\?'
    return chr(byte) if plain else f"\\{byte:03o}"


TOGETHER = re.compile(r"(?<=\*) | (?=\*)|(?<=\bconst) |(?<=\bdouble) |(?<=\bint) |(?<= [-+]) ")
"""Blanks at which a line is not broken: within products, after a sign, within a declaration, before the end of a
comment."""


def wrapped(line: str) -> list[str]:
    """A line of code or of a comment, broken and indented once more, if it is longer than WIDTH."""
    if len(line) <= WIDTH:
        return [line]
    indent = " " * (len(line) - len(line.lstrip()))
    joined = TOGETHER.sub("\0", line.strip())
    parts = textwrap.wrap(
        joined, WIDTH, initial_indent=indent, subsequent_indent=f"{indent}    ", break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip
    return [part.replace("\0", " ") for part in parts]


def prose(text: str, indent: str = "") -> list[str]:
    """Sentences as lines."""
    return textwrap.wrap(
        text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


def rows(values: Iterable[str], width: int = WIDTH, indent: str = "    ") -> list[str]:
    """Values as lines of a list, each followed by a comma."""
    joined = " ".join(f"{value}," for value in values)
    return textwrap.wrap(
        joined, width, initial_indent=indent, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )
