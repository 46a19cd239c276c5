"""How sure a result is, as its report shows it: where σ comes from, whiteness, open and essential parameters."""

from __future__ import annotations

import re
from typing import Any

import pytest
from example_results import example
from test_page import HOSTILE, check

from identify.report.markup import sentence
from identify.report.page import render

WHITE = "white: no correlation between rows beyond chance"
COLOURED = "coloured: neighbouring rows err alike, as where the model leaves something out"


def statistics(record: dict[str, Any]) -> dict[str, Any]:
    """What `validation.statistics` gives, made up for a record of two joints."""
    names = record["names"]
    rows = [("joint_1", 0.48, 1.04, 2e-14, COLOURED), ("joint_2", 0.02, 1.95, 0.34, WHITE)]
    keys = ("group", "neighbours", "durbin_watson", "chance", "told")
    return {
        "covariance": {
            "method": "sandwich by the spectrum of residuals",
            "textbook_method": "rows taken as independent",
            "edges_hz": [1.0, 5.0],
            "noise": [{"group": row[0], "unit": "N·m", "std": [1.25, 0.5]} for row in rows],
            "widening": 1.24,
        },
        "textbook_std": [0.5 + 0.001 * k for k in range(len(names))],
        "whiteness": [dict(zip(keys, row, strict=True)) | {"ljung_box": 31.0, "lags": 20} for row in rows],
        "correlations": [{"first": "Fv1", "second": "Fs1", "correlation": -0.953}],
        "essential": {
            "names": ["ZZR1", "Fv1"],
            "parameters": [
                {"name": name, "unit": "kg·m²", "estimate": 1.247, "std": 0.011, "relative_std_percent": 0.88}
                for name in ("ZZR1", "Fv1")
            ],
            "dropped": [{"name": "off1", "chance": 0.9}],
            "refused": {"name": "Fv1", "chance": 0.029},
            "residual_before_percent": 3.57,
            "residual_after_percent": 3.84,
        },
        "unknown": [
            {"names": ["XY2"], "state": "not determined", "motions": [], "beside": []}
            | {"told": "XY2: smaller than its σ. What tells most: joint_1 and joint_2 fast at the same time."},
            {"names": ["off1"], "state": "weak", "motions": [], "beside": ["Fs1"]}
            | {"told": "off1: known to no better than 10 %. What tells most: joint_1 fast; poses all over."},
        ],
        "command": "identify excite rx90 --from DIR -o TRAJECTORY.toml",
    }


def shown() -> tuple[dict[str, Any], str]:
    record, curves = example(2)
    record["statistics"] = statistics(record)
    record["test"][0]["motion"] = {"told": "some way off the training motion: half of its states within 0.8"}
    return record, render(record, curves)


def test_sigma_and_whiteness_are_told() -> None:
    page = check(shown()[1])
    assert "σ is 1.2 times the textbook’s" in page.seen
    assert "residuals of 1 of 2 joints are coloured" in page.seen
    for text in ("σ: sandwich by the spectrum", "White: no correlation", "Coloured: neighbouring rows", "< 0.001"):
        assert text in page.text
    assert "How new this motion is: some way off the training motion" in page.seen
    assert "widens σ" not in page.text
    assert "Σ" not in page.text


def test_what_is_open_essential_and_together_stands_behind_the_parameters() -> None:
    record, html = shown()
    section = html.partition('<section id="parameters">')[2].partition("</section>")[0]
    table = section.partition("Table of all parameters")[2].partition("</table>")[0]
    cells = re.findall(r"<td class=\"number\">(0\.5\d*)</td>", table)
    assert len(cells) >= len(record["base_parameters"])
    page = check(html)
    for text in (
        "2 parameters, and the motion that would tell them",
        "identify excite rx90 --from DIR",
        "1 of 3 parameters can go; the residual of the solved rows grows from 3.57 % to 3.84 %",
        "it would be worse beyond doubt (p = 0.029)",
        "Set to zero: off₁",
        "their sum",
    ):
        assert text in page.text
    rows = section.partition("What the logs leave open")[2].partition("</table>")[0]
    assert len(re.findall(r"<tr><th", rows)) == 4  # the head, and three motions


def test_a_result_without_statistics_says_what_it_has() -> None:
    record, curves = example(2)
    page = check(render(record, curves))
    assert "independent ones, which widens σ" in page.seen
    assert "Whiteness" not in page.text
    why = "the estimator gives no residuals by row"
    keys = ("covariance", "textbook_std", "whiteness", "correlations", "essential", "unknown")
    record["statistics"] = dict.fromkeys(keys) | {"covariance_reason": why, "whiteness_reason": why}
    page = check(render(record, curves))
    assert "The estimator gives no residuals by row." in page.text


def test_statistics_of_any_text_are_only_text() -> None:
    record, curves = example(2)
    record["statistics"] = found = statistics(record)
    for row in [*found["whiteness"], *found["unknown"]]:
        row["told"] = HOSTILE
    found["command"] = found["covariance"]["method"] = found["unknown"][0]["names"][0] = HOSTILE
    check(render(record, curves))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("σ is 1.2 times the textbook’s", "σ is 1.2 times the textbook’s."),
        ("a possible body", "A possible body."),
        ("joint_2 fast", "joint_2 fast."),
        ("état", "État."),
        ("χ² = 3", "χ² = 3."),
    ],
)
def test_a_sentence_begins_with_a_capital_unless_with_a_symbol(text: str, told: str) -> None:
    assert sentence(text) == told
