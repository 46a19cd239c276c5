"""What can be said of a recording before any model: what it holds, what is odd, whether it can support a result."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from identify.errors import UnsupportedLogError
from identify.logs.log import Log
from identify.logs.wording import counted
from identify.robot.robot import Limits

STILL_RANGE = 0.01
"""A joint whose position spans no more than this [rad or m] does not move: friction can't be told from nothing."""
REST_SPEED = 0.01
"""Below this speed [rad/s or m/s] a joint counts as at rest."""
LEAST_MOTION = 1.0
"""Seconds of motion below which nothing is identified."""
LEAST_SAMPLES = 200
SPEED_SPAN = 0.05
"""Speeds are mean speeds over this time [s], so that encoder steps and noise do not count as motion."""
LIMIT_TOLERANCE = 0.01
"""Share of a limit by which noise and rounding may pass it without a word."""
GAP = 5.0
"""A step of more than so many median steps is a gap in the recording."""
UNEVEN = 1.5
_SPARKS = "▁▂▃▄▅▆▇█"
_SPARK_LENGTH = 32


@dataclass(frozen=True)
class JointFacts:
    """What one joint did. Position, speed and effort in rad, rad/s, N·m or m, m/s, N; shares of the samples, 0 to 1."""

    joint: str
    position_min: float
    position_max: float
    max_speed: float
    effort_min: float | None
    effort_max: float | None
    rest_share: float
    repeated_share: float
    sparkline: str

    @property
    def position_range(self) -> float:
        """Peak-to-peak position."""
        return self.position_max - self.position_min

    @property
    def moves(self) -> bool:
        """Whether it spans more than STILL_RANGE."""
        return self.position_range > STILL_RANGE

    @property
    def effort_dead(self) -> bool:
        """Whether there is no effort, or one that never changes."""
        if self.effort_min is None or self.effort_max is None:
            return True
        return self.effort_max - self.effort_min <= 1e-12 * max(abs(self.effort_max), abs(self.effort_min), 1.0)


@dataclass(frozen=True)
class Findings:
    """A recording at a glance.

    duration, median_step, max_step, motion (time in which any joint moves) [s]; jitter: largest step over the
    median one; gaps: steps of more than GAP median ones; dropped: rows left out while reading; findings:
    sentences, those of the reading first.
    """

    source: str
    samples: int
    duration: float
    rate_hz: float
    median_step: float
    max_step: float
    gaps: int
    motion: float
    dropped: int
    has_velocity: bool
    has_effort: bool
    joints: tuple[JointFacts, ...]
    findings: tuple[str, ...]

    @property
    def jitter(self) -> float:
        """Largest step over the median step; 1 where the recording is even."""
        return self.max_step / self.median_step if self.median_step else 1.0

    def as_dict(self) -> dict[str, Any]:
        """Everything as plain values, for JSON; None where there is no number."""
        joints = [
            {
                **{key: _plain(value) for key, value in asdict(facts).items()},
                "position_range": _plain(facts.position_range),
                "moves": facts.moves,
                "effort_dead": facts.effort_dead,
            }
            for facts in self.joints
        ]
        return {**asdict(self), "jitter": self.jitter, "joints": joints, "findings": list(self.findings)}

    def summary(self) -> str:
        """A page of text for the terminal."""
        even = f"steps of {1e3 * self.median_step:.3f} ms, the longest {1e3 * self.max_step:.3f} ms"
        lines = [
            f"{self.source}: {counted(self.samples, 'sample')}, {self.duration:.3f} s, {self.rate_hz:.1f} Hz ({even})",
            f"{self.motion:.1f} s in motion; velocity {_given(self.has_velocity)}, effort {_given(self.has_effort)}; "
            f"{counted(self.dropped, 'row')} dropped, {counted(self.gaps, 'gap')}",
            "",
            f"{'joint':<16} {'position':^19} {'max speed':>9} {'effort':^19} {'at rest':>7}  motion",
        ]
        for facts in self.joints:
            effort = "" if facts.effort_min is None else f"{facts.effort_min:9.3f} {facts.effort_max:9.3f}"
            lines.append(
                f"{facts.joint:<16} {facts.position_min:9.3f} {facts.position_max:9.3f} {facts.max_speed:9.3f} "
                f"{effort:19} {100 * facts.rest_share:5.0f} %  {facts.sparkline}"
            )
        return "\n".join([*lines, "", *(f"- {finding}" for finding in self.findings or ("nothing odd was found",))])


def inspect(log: Log, limits: Mapping[str, Limits] | None = None) -> Findings:
    """Facts and findings of a recording of at least one sample. limits: joint name → limits it should have kept."""
    steps = np.diff(log.time) if log.samples > 1 else np.zeros(1)
    median, longest = float(np.median(steps)), float(steps.max())
    speed = mean_speed(log)
    moving = (np.abs(speed) > REST_SPEED).any(axis=1)
    facts = tuple(_joint_facts(log, j, speed[:, j]) for j in range(len(log.joints)))
    gaps = int((steps > GAP * median).sum())
    sentences = [*log.findings, *_of_time(steps, gaps, log), *_of_joints(log, facts)]
    for fact in facts:
        sentences.extend(_of_limits(fact, (limits or {}).get(fact.joint, Limits())))
    return Findings(
        source=log.source,
        samples=log.samples,
        duration=log.duration,
        rate_hz=(log.samples - 1) / log.duration if log.duration else 0.0,
        median_step=median,
        max_step=longest,
        gaps=gaps,
        motion=float(moving.mean() * log.duration),
        dropped=log.dropped,
        has_velocity=log.velocity is not None,
        has_effort=log.effort is not None,
        joints=facts,
        findings=tuple(sentences),
    )


def require_identifiable(log: Log, joints: Sequence[str] | None = None) -> None:
    """Raise UnsupportedLogError, with every reason, where the log can't support a result whatever the robot is.

    joints: those to be identified, by default all of the log's. Refused: a joint without position, no or dead
    effort on a joint that moves, no joint that moves, less than LEAST_MOTION seconds of motion, fewer than
    LEAST_SAMPLES samples.
    """
    from identify.logs.slicing import select

    found = inspect(log if joints is None else select(log, joints))
    moving = [facts for facts in found.joints if facts.moves]
    reasons = []
    if found.samples < LEAST_SAMPLES:
        reasons.append(f"the log is too short: {found.samples} samples, and at least {LEAST_SAMPLES} are needed")
    if not moving:
        reasons.append(f"the log is static: no joint moves by more than {STILL_RANGE} rad or m")
    elif found.motion < LEAST_MOTION:
        reasons.append(
            f"the log is too short: its joints move for {found.motion:.2f} s in all, "
            f"and at least {LEAST_MOTION:g} s of motion are needed"
        )
    blind = [facts.joint for facts in found.joints if math.isnan(facts.position_min)]
    if blind:
        reasons.append(f"the log holds no position of {', '.join(blind)}; record it, or leave the joint out")
    dead = [facts.joint for facts in moving if facts.effort_dead]
    if not found.has_effort:
        reasons.append("the log holds no effort, so that there is nothing to explain; record torque or current too")
    elif dead:
        reasons.append(
            f"the effort of {', '.join(dead)} never changes though the joint moves; record torque or current"
        )
    if reasons:
        raise UnsupportedLogError(*reasons)


def mean_speed(log: Log) -> np.ndarray:
    """(N, n) mean speed over SPEED_SPAN around every sample, from position [rad/s or m/s]."""
    if log.samples < 2:
        return np.zeros_like(log.position)
    after = np.minimum(np.searchsorted(log.time, log.time + SPEED_SPAN / 2), log.samples - 1)
    before = np.maximum(np.searchsorted(log.time, log.time - SPEED_SPAN / 2, side="right") - 1, 0)
    # At a rate too low for the span, the neighbours serve.
    after = np.minimum(np.maximum(after, np.arange(log.samples) + 1), log.samples - 1)
    return (log.position[after] - log.position[before]) / (log.time[after] - log.time[before])[:, None]


def _joint_facts(log: Log, j: int, speed: np.ndarray) -> JointFacts:
    position = log.position[:, j]
    finite = position[np.isfinite(position)]
    if not len(finite):
        return JointFacts(log.joints[j], math.nan, math.nan, math.nan, None, None, 1.0, 1.0, "")
    effort = np.empty(0) if log.effort is None else log.effort[:, j]
    effort = effort[np.isfinite(effort)]
    rest = np.abs(speed) <= REST_SPEED
    repeated = np.diff(position) == 0
    return JointFacts(
        joint=log.joints[j],
        position_min=float(finite.min()),
        position_max=float(finite.max()),
        max_speed=float(np.nanmax(np.abs(speed))),
        effort_min=float(effort.min()) if len(effort) else None,
        effort_max=float(effort.max()) if len(effort) else None,
        rest_share=float(rest.mean()),
        repeated_share=float(repeated.mean()) if len(repeated) else 0.0,
        sparkline=_sparkline(finite),
    )


def _of_time(steps: np.ndarray, gaps: int, log: Log) -> list[str]:
    median = float(np.median(steps))
    if gaps:
        worst = int(steps.argmax())
        where = f"the longest {steps[worst]:.3f} s at {log.time[worst]:.3f} s"
        return [f"the recording has {counted(gaps, 'gap')} of more than {GAP:g} median steps, {where}"]
    if steps.max() > UNEVEN * median > 0:
        return [f"the sampling is uneven: the longest step is {steps.max() / median:.1f} times the median one"]
    return []


def _of_joints(log: Log, facts: tuple[JointFacts, ...]) -> list[str]:
    sentences = []
    still = [fact.joint for fact in facts if not fact.moves]
    if still:
        sentences.append(f"no motion beyond {STILL_RANGE} rad or m in {', '.join(still)}: nothing of it can be learnt")
    dead = [fact.joint for fact in facts if fact.moves and fact.effort_dead]
    if log.effort is not None and dead:
        sentences.append(f"the effort of {', '.join(dead)} never changes though the joint moves")
    if log.effort is None:
        sentences.append("the log holds no effort")
    if log.velocity is not None:
        flat = np.ptp(log.velocity, axis=0) == 0
        stuck = [fact.joint for fact, constant in zip(facts, flat, strict=True) if fact.moves and constant]
        if stuck:
            sentences.append(f"the velocity of {', '.join(stuck)} never changes though the joint moves")
    return sentences


def _of_limits(fact: JointFacts, limits: Limits) -> list[str]:
    sentences = []
    low, high = limits.position
    room = LIMIT_TOLERANCE * (high - low) if math.isfinite(high - low) else 0.0
    if fact.position_min < low - room or fact.position_max > high + room:
        sentences.append(
            f"{fact.joint} goes from {fact.position_min:.3f} to {fact.position_max:.3f}, beyond its limits {low:g} and "
            f"{high:g}: are units, offset or sign right?"
        )
    if fact.max_speed > (1 + LIMIT_TOLERANCE) * limits.velocity:
        sentences.append(f"{fact.joint} reaches a speed of {fact.max_speed:.3f}, beyond its limit {limits.velocity:g}")
    largest = max(abs(fact.effort_min or 0.0), abs(fact.effort_max or 0.0))
    if largest > (1 + LIMIT_TOLERANCE) * limits.effort:
        sentences.append(f"{fact.joint} shows an effort of {largest:.3f}, beyond its limit {limits.effort:g}")
    return sentences


def _sparkline(values: np.ndarray) -> str:
    """A curve of block characters from the lowest to the highest value."""
    parts = np.array_split(values, min(_SPARK_LENGTH, len(values)))
    means = np.array([part.mean() for part in parts])
    span = np.ptp(values)
    if span == 0:
        return _SPARKS[0] * len(parts)
    levels = np.clip((means - values.min()) / span * len(_SPARKS), 0, len(_SPARKS) - 1).astype(int)
    return "".join(_SPARKS[level] for level in levels)


def _given(present: bool) -> str:
    return "given" if present else "none"


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
