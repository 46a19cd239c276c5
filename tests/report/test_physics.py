"""The physics section says whether a simulator can load the links, what that cost, and what is open."""

from __future__ import annotations

import re
from copy import deepcopy
from html import unescape
from typing import Any

import pytest
from exact_logs import fitted

from identify.report.physics import section


@pytest.fixture
def record() -> dict[str, Any]:
    return deepcopy(fitted().record)


def text(record: dict[str, Any]) -> str:
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", section(record).body)))


def test_possible_links_are_shown_with_mass_centre_moments_and_margin(record: dict[str, Any]) -> None:
    said = text(record)
    assert said.count("MET") == 3
    assert "Yes: every link is a possible body" in said
    assert "MuJoCo loaded them" in said
    for word in ("mass", "centre x", "A + B − C", "smallest eigenvalue", "actuator inertia"):
        assert word in said
    assert "not each link's own" in said
    assert "neutral bodies" not in said  # the description of this arm has links
    assert section(record).finding.startswith("Yes")


def test_what_moved_and_what_it_cost_are_told(record: dict[str, Any]) -> None:
    physical = record["physical"]
    physical["moved"] = [
        {"name": "XX3", "unit": "kg·m²", "estimate": -0.5, "consistent": 0.25, "shift_sigma": 1.75},
        {"name": "Fv1", "unit": "N·m·s/rad", "estimate": -0.1, "consistent": 0.0, "shift_sigma": 0.125},
    ]
    physical["cost"] = {
        "chi_squared": 3.25,
        "effective_samples": 812.0,
        "residual_points": 0.043,
        "residual_growth_percent": 1.34,
        "residual_uncertainty_percent": 4.4,
    }
    physical["fit"]["moving_relative_residual_percent"] = 4.125
    physical["pull"]["bodies"] = ["neutral"] * 3
    said = text(record)
    assert "belong to no possible robot" in said
    assert "2 of 28 parameters, most in XX₃, by 1.8 σ" in said
    assert "χ² = 3.2, against 812 effective samples" in said
    assert "leaves 0.043 % of the training torque more unexplained, which is 1.3 % of the residual" in said
    assert "tell a residual to 4.4 %" in said
    assert "4.12 %" in said
    assert "−0.5000 0.2500 kg·m² 1.75" in said
    assert "pulled to neutral bodies" in said
    physical["pull"] |= {"prior_percent": 30.0, "bodies": ["description"] * 3}
    assert "stay near the robot file's links, with a standard deviation of 30 %" in text(record)


def test_without_possible_links_the_reason_stands_there(record: dict[str, Any]) -> None:
    record["physical"], record["physical_reason"] = None, "the solver ended with NumericalError"
    assert "The solver ended with NumericalError." in text(record)
    assert section(record).why == "the solver ended with NumericalError"


def test_an_impossible_link_is_marked(record: dict[str, Any]) -> None:
    record["physical"]["consistent"] = False
    record["physical"]["links"][1]["min_eigenvalue"] = -0.1
    said = text(record)
    assert "No: at least one link is physically impossible." in said
    assert said.count("NOT MET") == 1
