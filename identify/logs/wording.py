"""Words for messages and findings."""

from __future__ import annotations

from collections.abc import Sequence

_SHOWN = 40
_LETTERS = 80


def printable(text: str) -> str:
    """The text on one line, as a damaged file may hold anything for a name."""
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in text)


def counted(number: int, noun: str) -> str:
    """ "1 row", "2 rows", "45,000 rows"."""
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def listed(names: Sequence[str]) -> str:
    """The names with commas between them, on one line; of very many or very long ones no more than is readable."""
    shown = [printable(name if len(name) <= _LETTERS else f"{name[:_LETTERS]}…") for name in names[:_SHOWN]]
    return first([*shown, *names[_SHOWN:]], _SHOWN)


def first(texts: Sequence[str], most: int) -> str:
    """ "a, b and 3 more": the first texts with commas between them, and how many there are beside."""
    return ", ".join(texts[:most]) + (f" and {len(texts) - most:,} more" if len(texts) > most else "")
