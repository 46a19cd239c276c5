"""`identify inspect` on the command line: its words, its picture, its page, and `fit` that begins with it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from identify.logs.log import Log


def wrong_sign(log: Log, path: str) -> None:
    effort = log.effort.copy()
    effort[:, 1] *= -1
    replace(log, effort=effort).save(path)


def test_a_good_log_is_quiet_with_its_robot_and_draws_nothing_into_a_pipe(run, arm) -> None:
    outcome = run("inspect", arm.train, "--robot", arm.robot)
    assert outcome.status == 0
    assert "nothing odd was found" in outcome.out
    assert not any("\u2800" <= letter <= "\u28ff" for letter in outcome.out)
    assert any("\u2801" <= letter <= "\u28ff" for letter in run("inspect", arm.train, "--picture").out)


def test_a_finding_has_a_kind_a_severity_and_what_was_done(run, arm) -> None:
    wrong_sign(arm.log, "wrong.mcap")
    outcome = run("inspect", "wrong.mcap", "--robot", arm.robot)
    assert outcome.status == 0
    assert "- error: sign: the effort of elbow has the wrong sign" in outcome.out
    assert "(refused)" in outcome.out
    assert "can't support a fit:" in outcome.out
    found = run("inspect", "wrong.mcap", "--robot", arm.robot, "--json").json
    assert [(each["kind"], each["action"], each["joints"]) for each in found["triage"]] == [
        ("sign", "refused", ["elbow"])
    ]
    assert found["can_support_a_fit"] is False
    assert found["findings"][0].startswith("the effort of elbow")


def test_fit_refuses_the_log_and_its_report_says_why(run, arm) -> None:
    wrong_sign(arm.log, "wrong.mcap")
    outcome = run("fit", "wrong.mcap", "--robot", arm.robot, "-o", "result")
    assert outcome.status == 1
    record = json.loads(Path("result/parameters.json").read_text(encoding="utf-8"))
    assert record["verdict"]["status"] == "reject"
    assert "the effort of elbow has the wrong sign" in record["verdict"]["reasons"][0]
    assert record["logs"][0]["triage"][0]["kind"] == "sign"
    page = Path("result/report.html").read_text(encoding="utf-8")
    assert "Findings in the logs" in page
    assert "refused" in page


def test_the_page_is_written_and_never_over_another_unasked(run, arm) -> None:
    outcome = run("inspect", arm.train, "--robot", arm.robot, "--html", "new/page.html")
    assert outcome.status == 0
    text = Path("new/page.html").read_text(encoding="utf-8")
    assert "shoulder" in text
    assert "://" not in text
    again = run("inspect", arm.train, "--html", "new/page.html")
    assert again.status == 2
    assert "exists already" in again.err
    assert run("inspect", arm.train, "--html", "new/page.html", "--force").status == 0
    assert run("inspect", arm.train, "--html", "page.txt").status == 2
