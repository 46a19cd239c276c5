"""Words for messages and findings."""

from __future__ import annotations


def printable(text: str) -> str:
    """The text on one line, as a damaged file may hold anything for a name."""
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in text)


def counted(number: int, noun: str) -> str:
    """ "1 row", "2 rows", "45,000 rows"."""
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"
