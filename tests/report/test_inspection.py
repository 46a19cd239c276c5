"""The pictures of a log: strips in the terminal, and a page that stands alone."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np

from identify.logs.log import Log
from identify.logs.triage import inspect, refusals
from identify.report.inspection import inspection_page
from identify.report.terminal import CELLS, NAME, ROWS, picture, strip

DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])


def log(samples: int = 3000) -> Log:
    time = np.arange(samples) / 500
    position = np.column_stack([np.sin(time), 0.3 * np.cos(2 * time)])
    effort = np.column_stack([5 * np.cos(time) + 1, -2 * np.sin(2 * time)])
    return Log(time, position, None, effort, ("shoulder", "a joint with a long name"), source="folder/run.mcap")


def dots(lines: list[str]) -> np.ndarray:
    """(4 ROWS, 2 CELLS) which dots of a strip are set."""
    codes = np.array([[ord(letter) - 0x2800 for letter in line] for line in lines])
    return ((codes[:, :, None, None] & DOTS) > 0).transpose(0, 2, 1, 3).reshape(4 * len(lines), -1)


def test_a_strip_shows_the_range_of_every_fraction_of_time() -> None:
    time = np.arange(640) / 10
    rising = dots(strip(time, time))
    assert rising.shape == (4 * ROWS, 2 * CELLS)
    assert rising[-1, 0] and rising[0, -1] and not rising[0, 0]  # noqa: PT018
    # The straight line from the lowest to the highest level, dot by dot.
    levels = np.rint(time / time[-1] * (4 * ROWS - 1)).astype(int).reshape(2 * CELLS, -1)
    for column, own in enumerate(levels):
        assert set(4 * ROWS - 1 - np.flatnonzero(rising[:, column])) == set(range(own.min(), own.max() + 1))


def test_a_gap_stays_empty_and_a_constant_is_a_line() -> None:
    time = np.r_[0:100, 200:300] / 10.0
    shown = dots(strip(time, np.sin(time)))
    third = slice(2 * CELLS // 3 + 2, 4 * CELLS // 3 - 2)
    assert not shown[:, third].any()
    flat = dots(strip(time, np.full(200, 3.0)))
    assert flat.any(axis=1).sum() == 1
    assert not dots(strip(time, np.full(200, np.nan))).any()


def test_the_picture_fits_80_columns_and_names_every_joint() -> None:
    lines = picture(log()).splitlines()
    assert max(map(len, lines)) <= 80
    assert len(lines) == 2 + 2 * ROWS
    assert lines[1].startswith("shoulder ")
    assert lines[1 + ROWS][:NAME] == "a joint wit…"
    assert lines[-1].endswith("5.998 s")
    assert "effort" not in picture(replace(log(), effort=None))


class Words(HTMLParser):
    """The text of a page, and the addresses that it would load."""

    def __init__(self) -> None:
        super().__init__()
        self.text = ""
        self.loaded: list[str] = []

    def handle_data(self, data: str) -> None:
        self.text += data

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loaded += [value or "" for key, value in attrs if key in ("src", "href")]


def page(one: Log) -> Words:
    found = inspect(one)
    words = Words()
    words.feed(inspection_page(found, one, refusals(found)))
    return words


def test_the_page_says_what_was_found_and_what_was_done_and_loads_nothing() -> None:
    jumped = log()
    position = jumped.position.copy()
    position[1500:, 0] += 2 * np.pi
    words = page(replace(jumped, position=position))
    assert "the position of shoulder jumps by +1 × 2π at 3.000 s: unwrap the encoder" in words.text
    assert "refused" in words.text
    assert "It can't support a fit" in words.text
    assert all(address.startswith("#") for address in words.loaded)
    assert "run.mcap" in words.text


def test_a_good_log_and_one_without_effort_have_a_page() -> None:
    assert "Nothing here speaks against a fit" in page(log()).text
    assert "Nothing odd was found" in page(log()).text
    assert "the log holds no effort" in page(replace(log(), effort=None)).text


def test_names_are_shown_as_they_are_and_never_as_markup() -> None:
    one = replace(log(), joints=("<b>joint</b>", "b"))
    found = inspect(one)
    text = inspection_page(found, one, [])
    assert "<b>joint</b></" not in text
    assert "&lt;b&gt;joint" in text
    assert text == inspection_page(found, one, [])
    assert len(re.findall("<figure>", text)) == 2
