"""What is said of a recording is true of it, and what can't support a result is refused."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from identify.logs.log import Log
from identify.logs.slicing import select
from identify.logs.triage import inspect, refusals
from identify.robot.robot import Limits


def swing(samples: int = 4000, rate: float = 1000.0, rest: int = 1000) -> Log:
    """Joints of amplitude 0.5 and 1.25 at 4 and 6 rad/s; at the start the first rests and the second creeps."""
    time = np.arange(samples) / rate
    phase = np.maximum(time - rest / rate, 0)
    position = np.column_stack([0.5 * np.sin(4 * phase) + 0.1, 1.25 * (1 - np.cos(6 * phase))])
    position[:, 1] -= 0.004 * np.minimum(time - rest / rate, 0)
    effort = np.column_stack([-8 * np.sin(4 * phase), 20 * np.cos(6 * phase)])
    return Log(time, position, None, effort, ("a", "b"), source="swing")


def test_facts_of_a_known_motion() -> None:
    found = inspect(swing())
    a, b = found.joints
    assert (found.samples, found.gaps, found.has_velocity, found.has_effort) == (4000, 0, False, True)
    assert found.duration == pytest.approx(3.999)
    assert found.rate_hz == pytest.approx(1000)
    assert found.jitter == pytest.approx(1)
    assert (a.position_min, a.position_max) == pytest.approx((-0.4, 0.6), abs=1e-4)
    assert b.position_range == pytest.approx(2.5, abs=1e-4)
    # Means over 50 ms are sinc-damped: 1 - (ω·0.025)²/6.
    assert a.max_speed == pytest.approx(2.0, rel=3e-3)
    assert b.max_speed == pytest.approx(7.5, rel=6e-3)
    assert (b.effort_min, b.effort_max) == pytest.approx((-20, 20), abs=1e-2)
    assert a.rest_share == pytest.approx(0.25, abs=0.01)
    assert b.rest_share == pytest.approx(0.25, abs=0.01)
    assert a.repeated_share == pytest.approx(0.25, abs=0.01)
    assert b.repeated_share == 0
    assert found.motion == pytest.approx(3.0, abs=0.05)
    assert found.findings == ()
    assert refusals(found) == []


def test_text_and_json() -> None:
    found = inspect(swing())
    text = found.summary()
    assert "swing: 4,000 samples, 3.999 s, 1000.0 Hz" in text
    assert "nothing odd was found" in text
    assert max(map(len, text.splitlines())) <= 80
    values = json.loads(json.dumps(found.as_dict(), allow_nan=False))
    assert values["joints"][0]["position_max"] == found.joints[0].position_max
    assert values["joints"][1]["moves"] is True
    assert values["findings"] == []
    empty = replace(swing(), effort=None, position=np.full((4000, 2), np.nan))
    assert json.loads(json.dumps(inspect(empty).as_dict(), allow_nan=False))["joints"][0]["position_min"] is None


def test_gaps_and_uneven_sampling_are_found() -> None:
    log = swing()
    gap = replace(log, time=log.time + 0.3 * (np.arange(4000) > 1234))
    (found,) = inspect(gap).findings
    assert found.kind == "gap"
    assert found.text == "the recording has 1 gap of more than 5 median steps, the longest 0.301 s at 1.234 s"
    assert found.sentence.endswith("(resampled onto an even clock, by straight lines between samples)")
    late = replace(log, time=log.time + 0.002 * (np.arange(4000) > 1234))
    (found,) = inspect(late).findings
    assert found.text == "the sampling is uneven: the longest step is 3.0 times the median one"
    assert inspect(late).jitter == pytest.approx(3)


def test_limits_tell_wrong_units() -> None:
    limits = {"a": Limits((-1, 1), 3.0, 10.0, 10.0), "b": Limits((-1, 1), 3.0, 10.0, 10.0)}
    (position, speed, effort) = (finding.text for finding in inspect(swing(), limits).findings)
    assert position.startswith("b goes from 0.000 to 2.500, beyond its limits -1 and 1")
    assert speed.startswith("b reaches a speed of 7.4")
    assert effort.startswith("b shows an effort of 20.000, beyond its limit 10")


def test_a_joint_that_rests_is_a_finding_and_no_refusal() -> None:
    log = swing()
    log = replace(log, position=log.position * [0.009, 1.0], effort=log.effort * [0.0, 1.0])
    (found,) = inspect(log).findings
    assert (found.kind, found.joints) == ("no motion", ("a",))
    assert found.text == "no motion beyond 0.01 rad or m in a: nothing of it can be learnt"
    assert refusals(inspect(log)) == []
    (reason,) = refusals(inspect(select(log, ["a"])))
    assert "static" in reason


def test_a_velocity_that_never_changes_is_found() -> None:
    (found,) = inspect(replace(swing(), velocity=np.zeros((4000, 2)))).findings
    assert found.text == "the velocity of a, b never changes though the joint moves"


@pytest.mark.parametrize(
    ("change", "reasons"),
    [
        (lambda log: replace(log, position=log.position * 0.003), ["the log is static"]),
        (lambda log: replace(log, position=log.position * [1.0, np.nan]), ["no position of b"]),
        (lambda log: replace(log, effort=None), ["holds no effort"]),
        (lambda log: replace(log, effort=log.effort * [1.0, 0.0]), ["the effort of b never changes"]),
        (lambda log: replace(log, effort=log.effort * 0.0 + 3.7), ["the effort of a, b never changes"]),
        (lambda log: cut(log, 900, 1900), ["too short: its joints move for 0.9"]),
        (lambda log: cut(log, 1500, 1600), ["too short: 100 samples", "too short: its joints move for 0.1"]),
        (lambda log: replace(cut(log, 0, 150), effort=None), ["too short: 150 samples", "static", "no effort"]),
    ],
)
def test_what_can_not_support_a_result_is_refused_with_every_reason(change, reasons) -> None:
    for reason, words in zip(refusals(inspect(change(swing()))), reasons, strict=True):
        assert words in reason


def cut(log: Log, begin: int, end: int) -> Log:
    part = slice(begin, end)
    return replace(log, time=log.time[part] - log.time[begin], position=log.position[part], effort=log.effort[part])
