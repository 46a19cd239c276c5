"""Faults in a clock, a channel, a velocity are found where they are, and what only looks like one is left alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from identify.logs.finding import ERROR, Finding
from identify.logs.log import Log
from identify.logs.outliers import jumps, robust_range, runs, spikes
from identify.logs.triage import inspect
from identify.robot.robot import Limits

RATE = 500.0


def noisy(seed: int = 0, rate: float = RATE) -> Log:
    """20 s of three joints with noise, friction steps in the effort, rest at both ends, and its velocity."""
    random = np.random.default_rng(seed)
    time = np.arange(round(20 * rate)) / rate
    t = np.clip(time - 1, 0, 18)
    # Multiples of the same 18 s, squared sines: at rest at both ends.
    phase = 2 * np.pi * t[:, None] * np.array([2, 3, 5]) / 18
    size = np.array([1.1, 0.8, 0.4])
    position = size * np.sin(phase / 2) ** 2 + [0.2, -0.4, 0.1] + 0.3 * size * np.sin(phase) ** 2
    velocity = np.gradient(position, time, axis=0)
    effort = 9 * np.gradient(velocity, time, axis=0) + 4 * np.tanh(50 * velocity) + 20 * np.cos(position[:, ::-1])
    position += 2e-5 * random.standard_normal(position.shape)
    effort += 0.2 * random.standard_normal(position.shape)
    velocity += 0.01 * random.standard_normal(position.shape)
    return Log(time, position, velocity, effort, ("a", "b", "c"), source="noisy")


def spoilt(what: str, joint: int, change: Callable[[np.ndarray], np.ndarray]) -> Log:
    log = noisy()
    values = getattr(log, what).copy()
    values[:, joint] = change(values[:, joint].copy())
    return replace(log, **{what: values})


def only(log: Log) -> Finding:
    (found,) = inspect(log).findings
    return found


def put(at: list[int] | slice, add: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(x: np.ndarray) -> np.ndarray:
        x[at] += add
        return x

    return change


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("rate", [100.0, RATE, 2000.0])
def test_a_good_log_is_quiet(seed: int, rate: float) -> None:
    assert inspect(noisy(seed, rate)).findings == ()


def test_a_step_of_friction_is_no_spike_and_a_fast_motion_no_jump() -> None:
    time = np.arange(5000) / RATE
    step = 5 * np.sign(np.sin(2 * time)) + 0.01 * np.random.default_rng(0).standard_normal(5000)
    assert len(spikes(step, 0.05 * robust_range(step))) == 0
    fast = np.where(time > 5, np.sin(40 * (time - 5)), 0.0)
    assert len(jumps(fast, time, 0.002 * robust_range(fast))) == 0


def test_spikes_are_counted_once_whatever_their_width() -> None:
    x = np.random.default_rng(1).standard_normal(20_000)
    x[700] += 60
    x[3000:3002] -= 50
    x[9000:9003] += 70
    np.testing.assert_array_equal(spikes(x, 5.0), [700, 3000, 9000])


def test_a_jump_over_a_gap_in_time_is_motion() -> None:
    time = np.arange(4000) / RATE
    x = np.sin(time)
    keep = np.r_[0:1500, 1700:4000]
    assert len(jumps(x[keep], time[keep], 0.002)) == 0
    np.testing.assert_array_equal(jumps(x + 0.1 * (np.arange(4000) > 2000), time, 0.002), [2000])


def test_runs_are_those_of_true() -> None:
    starts, lengths = runs(np.array([True, True, False, True, False, False, True, True, True]))
    np.testing.assert_array_equal((starts, lengths), ([0, 3, 6], [2, 1, 3]))


@pytest.mark.parametrize(
    ("log", "kind", "joint", "words"),
    [
        (spoilt("effort", 1, put([2000, 4000, 7000], 30.0)), "spikes", "b", "3 spikes of up to 29.9, first at 4.000 s"),
        (spoilt("position", 2, put([2500], 0.02)), "spikes", "c", "1 spike of up to 0.0"),
        (spoilt("position", 0, put(slice(5000, None), 2 * np.pi)), "wrap", "a", "jumps by +1 × 2π at 10.000 s"),
        (spoilt("position", 1, put(slice(5000, None), -0.03)), "jump", "b", "jumps 1 time, by -0.0"),
        (
            spoilt("effort", 0, lambda x: np.clip(x, -3, np.quantile(x, 0.95))),
            "saturation",
            "a",
            "478 samples lie exactly at its largest value",
        ),
        (spoilt("effort", 0, lambda x: np.round(x / 3) * 3), "quantisation", "a", "steps of 3 "),
        (spoilt("position", 0, lambda x: np.round(x / 2e-3) * 2e-3), "quantisation", "a", "steps of 0.002"),
        (spoilt("effort", 2, lambda x: x[np.arange(len(x)) // 5 * 5]), "mixed rates", "c", "measured at 100 Hz"),
        (spoilt("velocity", 2, lambda x: -x), "velocity", "c", "its sign is wrong"),
        (spoilt("velocity", 0, np.rad2deg), "velocity", "a", "57.29 times it: it is in degrees"),
        (spoilt("velocity", 1, lambda x: 1.7 * x), "velocity", "b", "1.7 times it: unit or gear ratio is wrong"),
        (spoilt("velocity", 1, lambda x: noisy().velocity[:, 0]), "copied channel", "b", "copy of the velocity of a"),
    ],
)
def test_a_fault_is_named_with_its_joint_and_size(log: Log, kind: str, joint: str, words: str) -> None:
    found = [finding for finding in inspect(log).findings if finding.kind == kind]
    assert len(found) == 1
    assert joint in found[0].joints
    assert words in found[0].text


def test_a_frozen_channel_is_found_and_a_joint_at_rest_is_none() -> None:
    def freeze(x: np.ndarray) -> np.ndarray:
        x[3000:3100] = x[3000]
        return x

    position = [finding for finding in inspect(spoilt("position", 0, freeze)).findings if finding.kind == "frozen"]
    assert position[0].severity == ERROR
    assert "freezes for 99 samples" in position[0].text
    assert "frozen at" in only(spoilt("effort", 0, freeze)).text
    still = noisy()
    rest = np.zeros((500, 3))
    held = replace(
        still,
        time=np.concatenate([still.time, still.time[-1] + np.arange(1, 501) / RATE]),
        position=np.concatenate([still.position, still.position[-1] + rest]),
        velocity=np.concatenate([still.velocity, rest]),
        effort=np.concatenate([still.effort, still.effort[-1] + rest]),
    )
    assert inspect(held).findings == ()


def test_another_joints_velocity_is_named() -> None:
    log = noisy()
    other = replace(log, velocity=log.velocity[:, [1, 0, 2]])
    assert [finding.text for finding in inspect(other).findings] == [
        "the velocity of a is not the derivative of its position but that of b",
        "the velocity of b is not the derivative of its position but that of a",
    ]


def test_a_copied_effort_is_refused() -> None:
    log = noisy()
    found = only(replace(log, effort=log.effort[:, [0, 1, 0]]))
    assert (found.kind, found.severity, found.joints) == ("copied channel", ERROR, ("a", "c"))
    assert found.sentence == "the effort of c is a copy of the effort of a (refused)"


def test_a_rate_that_changes_and_steps_that_jitter_are_told_apart() -> None:
    log = noisy()
    rows = np.r_[0:5000, 5000:10000:2]
    half = replace(
        log, time=log.time[rows], position=log.position[rows], velocity=log.velocity[rows], effort=log.effort[rows]
    )
    assert "changes from 500 to 250 Hz near" in only(half).text
    shaken = replace(log, time=log.time + np.random.default_rng(0).uniform(-4e-4, 4e-4, log.samples))
    assert "jitters: its steps of 1.99" in only(shaken).text


def test_degrees_are_told_from_a_wrong_offset() -> None:
    log = noisy()
    limits = {name: Limits((-2.0, 2.0), 10.0, 10.0, 1000.0) for name in log.joints}
    found = inspect(replace(log, position=np.rad2deg(log.position), velocity=None), limits).findings
    assert ("degrees", ERROR, ("a", "b", "c")) in [(f.kind, f.severity, f.joints) for f in found]
    moved = inspect(replace(log, position=log.position + 3, velocity=None), limits).findings
    assert {finding.kind for finding in moved} == {"beyond limits"}


def test_an_effort_at_its_limit_and_one_far_below_it_are_found() -> None:
    log = noisy()
    top = float(log.effort.max())
    sat = replace(log, effort=np.minimum(log.effort, 0.8 * top))
    limits = {name: Limits(effort=0.8 * top) for name in log.joints}
    assert any("is at its limit" in finding.text for finding in inspect(sat, limits).findings)
    faint = inspect(log, {name: Limits(effort=1e5) for name in log.joints}).findings
    assert [finding.kind for finding in faint] == ["effort unit"]
