"""The page of two results: whole, self-contained, repeatable, and saying of known changes what they are."""

from __future__ import annotations

import json
import re

import pytest
from compared_results import WORN, result
from exact_logs import arm
from test_page import HOSTILE, LIMIT, TAGS, Page

from identify.numbers import significant
from identify.report.comparison import comparison_page
from identify.validation.comparison import compare

SECTIONS = ["answers", "results", "prediction", "friction", "parameters", "physics", "provenance"]
PAIRS = {
    "wear": (("before", 1), ("worn", 4)),
    "other forms": (("before", 1), ("worn", 4, "cube_root")),
    "one log": (("before", 1), ("before", 1, "plain", "ols")),
    "itself": (("before", 1), ("before", 1)),
}


def compared(name: str) -> dict:
    first, second = PAIRS[name]
    return compare(result(*first), result(*second), ("march", "april"))


@pytest.mark.parametrize("name", PAIRS)
def test_a_page_is_whole_and_asks_for_nothing(name: str) -> None:
    found = compared(name)
    html = comparison_page(found)
    assert html == comparison_page(json.loads(json.dumps(found)))
    page = Page(html)
    assert page.open == []
    assert {tag for tag, _ in page.elements} <= TAGS
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    targets = [attributes["href"] for _, attributes in page.elements if "href" in attributes]
    assert all(target.startswith("#") and target[1:] in ids for target in targets)
    assert not re.search(r"https?:|@import|\bsrc=|<script", html)
    assert re.findall(r'<section id="(\w+)"', html) == SECTIONS
    drawn = [attributes for tag, attributes in page.elements if tag == "svg" and "viewbox" in attributes]
    assert all(a.get("aria-label") or a.get("aria-hidden") for a in drawn)
    assert len(html.encode()) < LIMIT / 5


def test_wear_is_told_first_with_its_size_and_drawn_for_every_joint() -> None:
    found = compared("wear")
    page = Page(comparison_page(found))
    joint = arm(1).joint_names[WORN - 1]
    assert (
        f"Friction changed ({joint}); no change of link and motor parameters is seen; A predicts better." in page.seen
    )
    level = max(found["friction"][WORN - 1]["levels"], key=lambda row: abs(row["difference"]) / row["std"])
    a, b = (significant(side["estimate"], 3) for side in level["estimates"])
    assert f"from {a} to {b}" in page.seen
    labels = [a["aria-label"] for tag, a in page.elements if tag == "svg" and "aria-label" in a]
    assert sum("friction over velocity of A and of B" in label for label in labels) == 3


def test_what_can_not_be_told_is_said_where_it_is_seen() -> None:
    page = Page(comparison_page(compared("one log")))
    assert "their errors are alike" in page.seen
    assert "no chance is stated" in page.seen
    assert "NO CHANGE SEEN" not in page.seen
    page = Page(comparison_page(compared("other forms")))
    assert "cube root in B alone" in page.seen
    assert "B alone has Fc₁, Fc₂, Fc₃" in page.seen


def test_names_are_only_names() -> None:
    found = compared("wear")
    for side in found["results"]:
        side["folder"] = side["command"] = HOSTILE
        side["logs"][0]["path"] = HOSTILE
    found["robot"]["name"] = HOSTILE
    for row in found["friction"]:
        row["joint"] = HOSTILE
    page = Page(comparison_page(found))
    assert {tag for tag, _ in page.elements} <= TAGS
    assert not {"script", "img"} & {tag for tag, _ in page.elements}
