"""The page of a load: the answer first, numbers with their σ, what is missing with its reason, nothing from outside."""

from __future__ import annotations

import re
from copy import deepcopy
from html import unescape
from typing import Any

import numpy as np
import pytest
from carried import carried

from identify.numbers import entry
from identify.payload_record import rejected_payload
from identify.report.payload import render
from identify.validation.payload_verdict import rejected_load


@pytest.fixture
def record() -> dict[str, Any]:
    return deepcopy(carried().record)


def text(page: str) -> str:
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", page.partition("<body>")[2])))


def test_the_answer_comes_first_with_its_uncertainty(record: dict[str, Any]) -> None:
    page = render(record, carried().curves)
    said = text(page)
    mass = " ± ".join(entry(record["load"]["body"][0]["estimate"], record["load"]["body"][0]["std"]))
    assert said.index(f"The load has a mass of {mass} kg") < said.index("Mass, centre of mass, inertia?")
    assert "mm in R₃" in said
    for words in ("About O₃", "without a load leaves", "Did it change with the load?", "Is it a possible body?"):
        assert words in said
    assert said.count("identified") >= 20
    assert page.count("<svg viewBox") == 3
    assert "<script" not in page
    assert not re.search(r"(src|href|url\()\W*https?:", page)
    assert render(record, carried().curves) == page


def test_what_the_logs_do_not_tell_is_a_dash_with_its_reason(record: dict[str, Any]) -> None:
    record["load"]["untold_reason"] = "joint_2 stands still"
    for row in record["load"]["standard"][:1] + record["load"]["body"][3:5]:
        row |= {"estimate": None, "std": None, "relative_std_percent": None, "identified": False}
    said = text(render(record, carried().curves))
    assert "Joint_2 stands still" in said or "joint_2 stands still" in said
    assert said.count("not determined") == 3
    assert "centre of mass is at" not in said


def test_a_body_that_can_not_be_is_told(record: dict[str, Any]) -> None:
    record["physical"] |= {"consistent": False, "moved": True, "cost": 7.25}
    said = text(render(record, carried().curves))
    assert "no distribution of mass has the estimated parameters" in said
    assert "χ² = 7.2" in said


def test_truth_gains_and_flange_have_their_places(record: dict[str, Any]) -> None:
    for row in record["load"]["body"]:
        row["truth"] = row["estimate"] + 2 * row["std"]
    record["load"]["flange"] = deepcopy(record["load"]["body"])
    record["gains"] = [
        {
            "joint": f"joint_{j}",
            "unit": "N·m per unit of logged effort",
            "estimate": 8.0 + j,
            "std": 0.012,
            "relative_std_percent": 0.1,
            "identified": True,
        }
        for j in (1, 2, 3)
    ]
    said = text(render(record, carried().curves))
    assert said.count("−2.0") >= 10
    assert "In the frame of the flange" in said
    assert "joint_2 10.000 ± 0.012" in said
    assert "The load has the stated mass of" in said


def test_a_refused_log_has_reasons_and_no_numbers(record: dict[str, Any]) -> None:
    refused = rejected_payload(record, rejected_load(("the motion can't tell the load's mass",)))
    page = render(refused, {})
    said = text(page)
    assert "The load can't be told from these logs." in said
    assert "The motion can't tell the load's mass." in said
    assert "kg·m²" not in said
    assert 'id="provenance"' in page


def test_names_from_outside_are_escaped(record: dict[str, Any]) -> None:
    record["robot"]["name"] = "<script>alert(1)</script>"
    record["logs"][0]["path"] = "<b>.mcap"
    page = render(record, carried().curves)
    assert "<script" not in page
    assert "<b>.mcap" not in page


@pytest.mark.parametrize(
    ("value", "sigma", "shown"),
    [
        (1.23456, 0.012, ("1.235", "0.012")),
        (0.0004, 0.012, ("0.000", "0.012")),
        (-0.02, 0.12, ("−0.02", "0.12")),
        (3.0, 150.0, ("3", "150")),
        (None, None, ("—", "")),
        (2.5, 0.0, ("2.500", "")),
        (1e-12, 3e-12, ("1.0·10⁻¹²", "3.0·10⁻¹²")),
        (np.float64(7.0), 0.5, ("7.00", "0.50")),
    ],
)
def test_entries_near_zero_keep_the_place_of_their_sigma(value: Any, sigma: Any, shown: tuple[str, str]) -> None:
    assert entry(value, sigma) == shown
