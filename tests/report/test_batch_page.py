"""The page of a batch: what it says of known summaries, and that any name is only a name on it."""

from __future__ import annotations

import json
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest
from exact_logs import fitted as one_fit

from identify.batch.folder import files, same_files, summarise
from identify.batch.reduction import Options, entry, failed
from identify.batch.sources import Source
from identify.report.batch import batch_page, verdict_on_sigma

NAMES = ("a", "b", "c", "d")


def fitted(name: str, shift: dict[str, float] | None = None, noise: int = 0, unit: str = "") -> dict[str, Any]:
    """The entry of a log whose estimates are moved by chance, and single ones by so many σ."""
    rng = np.random.default_rng(noise)
    made = {"name": name, "unit": unit, "log": f"{name}.mcap", "test_logs": [], "folder": name} | entry(
        one_fit().record
    )
    made["sha256"] = name
    for p in made["parameters"]:
        p["estimate"] += p["std"] * (rng.standard_normal() + (shift or {}).get(p["name"], 0.0))
    return made


def summary(*entries: dict[str, Any]) -> dict[str, Any]:
    return summarise(entries, Options(command="identify batch logs"), ["logs/notes.txt"])


def fleet(shift: dict[str, float] | None = None) -> dict[str, Any]:
    return summary(*(fitted(name, shift if name == "c" else None, k) for k, name in enumerate(NAMES)))


class Tags(HTMLParser):
    """The tags of a page, which must be closed in order."""

    VOID = ("meta", "br", "use", "path", "circle", "rect", "line", "i")

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.names: set[str] = set()
        self.links: list[str] = []
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names.add(tag)
        self.links += [value or "" for key, value in attrs if key == "href"]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in self.VOID:
            assert self.open.pop() == tag


def test_a_page_is_whole_and_the_same_whatever_the_order() -> None:
    forward = fleet()
    backward = summary(*(fitted(name, None, k) for k, name in reversed(list(enumerate(NAMES)))))
    assert forward == backward
    page = batch_page(forward)
    assert page == batch_page(json.loads(json.dumps(backward)))
    tags = Tags(page)
    assert "script" not in tags.names
    assert [link for link in tags.links if not link.startswith("#")] == [f"{name}/report.html" for name in NAMES]
    assert "4 of 4 logs gave a model." in page
    assert "is odd" not in page
    assert "σ is believable" in page
    assert "logs/notes.txt" in page


def test_the_odd_log_and_its_parameter_are_named() -> None:
    made = fleet({"Fv2": 60.0})
    page = batch_page(made)
    assert "<b>c</b> is odd" in page
    assert "F<sub>v2</sub>" in page.split("<b>c</b> is odd")[1][:200]
    assert "odd log" in page
    assert "leaves out c as odd" in verdict_on_sigma(made)
    (row,) = [line for line in files(made)["parameters.csv"].splitlines() if line.startswith("Fv2,")]
    assert ",c," in row


def test_repeats_and_robots_are_told_apart() -> None:
    entries = [
        fitted(f"{unit}/{k}", {"Fv1": 9.0 * u}, 10 * u + k, unit) for u, unit in enumerate("xyz") for k in (1, 2)
    ]
    told = verdict_on_sigma(summary(*entries))
    assert told.startswith("Logs of the same sub-folder")
    assert "σ is believable. All logs differ by" in told


def test_a_sub_folder_of_odd_logs_is_named_once() -> None:
    pairs = [(u, k) for u in range(4) for k in range(2)]
    moved = {(2, 0): {"Fv2": 80.0}, (2, 1): {"Fv2": 80.0}}
    made = summary(*(fitted(f"arm{u}/{k}", moved.get((u, k)), 10 * u + k, f"arm{u}") for u, k in pairs))
    assert [row["name"] for row in made["odd"]] == ["arm2/0", "arm2/1"]
    page = batch_page(made)
    assert page.count("is odd") == 1
    assert "<b>arm2</b> is odd in 2 of its 2 logs" in page
    assert "leaves out arm2 as odd" in page


def test_one_file_twice_is_named() -> None:
    entries = [fitted("a"), fitted("b", None, 1), fitted("copy of a")]
    entries[2]["sha256"] = "a"
    assert same_files(entries) == [["a", "copy of a"]]
    made = summary(*entries)
    assert "a, copy of a are one and the same file" in batch_page(made)
    assert made["logs"] == 2
    assert made["agreement"] == summary(*entries[:2])["agreement"]


@pytest.mark.parametrize("good", [0, 1])
def test_a_batch_of_failures_has_a_page(good: int) -> None:
    """No comparison without two models; any text of a reason or name stands as text."""
    nasty = '<script>alert("x")</script> & \x00 \ud800'
    entries = [failed(Source(f"logs/{nasty}", nasty), f"{nasty}: can't be read"), *[fitted("a")] * good]
    made = summary(*entries)
    page = batch_page(made)
    assert "script" not in Tags(page).names
    assert f"{good} of {1 + good} log" in page
    assert "It takes two fitted logs to compare anything." in page
    page.encode()
    assert set(files(made | {"fits": made["fits"][1:]})) == {
        "summary.json",
        "summary.html",
        "summary.csv",
        "parameters.csv",
    }
