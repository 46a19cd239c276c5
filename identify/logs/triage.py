"""What can be said of a recording before any model: what it holds, what is odd, whether it can support a result."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from identify.logs.channel_checks import CLIPPED_LEAST, of_copies, of_joint
from identify.logs.clock_checks import GAP, of_clock
from identify.logs.finding import ERROR, KEPT, REFUSED, WARNING, Finding, of_reading
from identify.logs.log import Log
from identify.logs.outliers import runs
from identify.logs.spans import Spans
from identify.logs.velocity_check import NOT_USED, of_velocity
from identify.logs.wording import counted
from identify.robot.robot import Limits
from identify.side_by_side import mapped

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
DEGREES_RANGE, DEGREES_SPEED = 8 * math.pi, 30.0
"""A joint that spans more [rad] faster [rad/s] than this is rather in degrees, where no limits are known."""
AT_LIMIT = 0.99
"""Share of its limit from which an effort is at it."""
AT_LIMIT_SHARE = 1e-3
"""Share of the samples at the limit from which an effort is saturated."""
LEAST_EFFORT = 0.01
"""Share of its limit that the effort of one joint at least exceeds in any motion that is worth a fit."""


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
    median one; gaps: steps of more than GAP median ones; dropped: rows left out while reading; findings: those of
    the reading first.
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
    findings: tuple[Finding, ...]

    @property
    def jitter(self) -> float:
        """Largest step over the median step; 1 where the recording is even."""
        return self.max_step / self.median_step if self.median_step else 1.0

    def as_dict(self) -> dict[str, Any]:
        """Everything as plain values, for JSON; None where there is no number. findings: a sentence each; triage: the
        same with kind, severity, text, action and joints."""
        joints = [
            {
                **{key: _plain(value) for key, value in asdict(facts).items()},
                "position_range": _plain(facts.position_range),
                "moves": facts.moves,
                "effort_dead": facts.effort_dead,
            }
            for facts in self.joints
        ]
        return {
            **asdict(self),
            "jitter": self.jitter,
            "joints": joints,
            "findings": [f.sentence for f in self.findings],
            "triage": [f.as_dict() for f in self.findings],
        }

    def summary(self) -> str:
        """A page of text for the terminal."""
        lines = [
            f"{self.source}: {counted(self.samples, 'sample')}, {self.duration:.3f} s, {self.rate_hz:.1f} Hz",
            f"steps of {1e3 * self.median_step:.3f} ms, the longest {1e3 * self.max_step:.3f} ms; "
            f"{counted(self.dropped, 'row')} dropped, {counted(self.gaps, 'gap')}",
            f"{self.motion:.1f} s in motion; velocity {_given(self.has_velocity)}, effort {_given(self.has_effort)}",
            "",
            f"{'joint':<16} {'position':^19} {'max speed':>9} {'effort':^19} {'at rest':>7}",
        ]
        for facts in self.joints:
            effort = "" if facts.effort_min is None else f"{facts.effort_min:9.3f} {facts.effort_max:9.3f}"
            lines.append(
                f"{facts.joint:<16} {facts.position_min:9.3f} {facts.position_max:9.3f} {facts.max_speed:9.3f} "
                f"{effort:19} {100 * facts.rest_share:5.0f} %"
            )
        return "\n".join([*lines, "", *(self.told() or ["- nothing odd was found"])])

    def told(self) -> list[str]:
        """The findings as lines of text: kind, sentence and what was done."""
        return [f"- {f.severity}: {f.kind}: {f.sentence}" for f in self.findings]


def inspect(log: Log, limits: Mapping[str, Limits] | None = None) -> Findings:
    """Facts and findings of a recording of at least one sample. limits: joint name → limits it should have kept."""
    median, longest, gaps = _steps(log.time)
    spans = Spans.of(log.time, SPEED_SPAN)
    moving = np.zeros(log.samples, dtype=bool)
    facts, odd, velocities = [], [], []

    def look(j: int) -> tuple[np.ndarray, JointFacts, list[Finding], list[Finding]]:
        # A joint at a time: a log may be long.
        speed = spans.slope(np.ascontiguousarray(log.position[:, j]))
        moves_now = np.abs(speed) > REST_SPEED
        fact = _joint_facts(log, j, speed, moves_now)
        return moves_now, fact, of_joint(log, j, speed, moves_now), of_velocity(log, j, spans, speed)

    for moves_now, fact, found, of_its_velocity in mapped(look, range(len(log.joints))):
        moving |= moves_now
        facts.append(fact)
        odd += found
        velocities += of_its_velocity
    findings = [
        *map(of_reading, log.findings),
        *of_clock(log.time),
        *_of_joints(log, facts),
        *odd,
        *of_copies(log),
        *velocities,
        *_of_limits(log, facts, limits or {}),
    ]
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
        joints=tuple(facts),
        findings=tuple(findings),
    )


def refusals(found: Findings) -> list[str]:
    """Why the log that these findings are of can't support a result, every reason; empty where it can.

    Refused: a joint without position, no or dead effort on a joint that moves, no joint that moves, less than
    LEAST_MOTION seconds of motion, fewer than LEAST_SAMPLES samples, and findings that are errors.
    """
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
    told = ("dead effort", "no effort")
    return reasons + [f.text for f in found.findings if f.severity == ERROR and f.kind not in told]


def _steps(time: np.ndarray) -> tuple[float, float, int]:
    """Median and longest step [s] of times (N,), and how many are gaps."""
    steps = np.diff(time) if len(time) > 1 else np.zeros(1)
    median = float(np.median(steps))
    return median, float(steps.max()), int((steps > GAP * median).sum())


def _joint_facts(log: Log, j: int, speed: np.ndarray, moving: np.ndarray) -> JointFacts:
    position = log.position[:, j]
    finite = position[np.isfinite(position)]
    if not len(finite):
        return JointFacts(log.joints[j], math.nan, math.nan, math.nan, None, None, 1.0, 1.0)
    effort = np.empty(0) if log.effort is None else log.effort[:, j]
    effort = effort[np.isfinite(effort)]
    repeated = np.diff(position) == 0
    return JointFacts(
        joint=log.joints[j],
        position_min=float(finite.min()),
        position_max=float(finite.max()),
        max_speed=float(np.nanmax(np.abs(speed))),
        effort_min=float(effort.min()) if len(effort) else None,
        effort_max=float(effort.max()) if len(effort) else None,
        rest_share=float(1.0 - moving.mean()),
        repeated_share=float(repeated.mean()) if len(repeated) else 0.0,
    )


def _of_joints(log: Log, facts: Sequence[JointFacts]) -> list[Finding]:
    findings = []
    still = tuple(fact.joint for fact in facts if not fact.moves)
    if still:
        text = f"no motion beyond {STILL_RANGE} rad or m in {', '.join(still)}: nothing of it can be learnt"
        findings.append(Finding("no motion", WARNING, text, KEPT, still))
    dead = tuple(fact.joint for fact in facts if fact.moves and fact.effort_dead)
    if log.effort is not None and dead:
        text = f"the effort of {', '.join(dead)} never changes though the joint moves"
        findings.append(Finding("dead effort", ERROR, text, REFUSED, dead))
    if log.effort is None:
        findings.append(Finding("no effort", ERROR, "the log holds no effort", REFUSED))
    if log.velocity is not None:
        flat = np.ptp(log.velocity, axis=0) == 0
        stuck = tuple(fact.joint for fact, constant in zip(facts, flat, strict=True) if fact.moves and constant)
        if stuck:
            text = f"the velocity of {', '.join(stuck)} never changes though the joint moves"
            findings.append(Finding("dead velocity", WARNING, text, NOT_USED, stuck))
    return findings


def _of_limits(log: Log, facts: Sequence[JointFacts], limits: Mapping[str, Limits]) -> list[Finding]:
    """What the motion and effort of the joints are by their limits, in words that name the likely mistake."""
    findings, degrees, faint = [], [], []
    for j, fact in enumerate(facts):
        limit = limits.get(fact.joint, Limits())
        if _in_degrees(fact, limit):
            degrees.append(fact.joint)
            continue
        findings += _beyond(fact, limit)
        largest = max(abs(fact.effort_min or 0.0), abs(fact.effort_max or 0.0))
        faint.append(0 < largest < LEAST_EFFORT * limit.effort < math.inf)
        if log.effort is not None and largest <= (1 + LIMIT_TOLERANCE) * limit.effort < math.inf:
            # Noise takes an effort to its limit for a sample, saturation for longer.
            _, lengths = runs(np.abs(log.effort[:, j]) >= AT_LIMIT * limit.effort)
            share = float(lengths[lengths >= CLIPPED_LEAST].sum() / log.samples)
            if share > AT_LIMIT_SHARE:
                text = (
                    f"the effort of {fact.joint} is at its limit {limit.effort:g} in {100 * share:.1f} % of the samples"
                )
                findings.append(Finding("saturation", WARNING, text, KEPT, (fact.joint,)))
    if degrees:
        text = f"the position of {', '.join(degrees)} is beyond any joint in rad, and would be possible in degrees"
        findings.insert(0, Finding("degrees", ERROR, text, f"{REFUSED}; give the unit in a map", tuple(degrees)))
    if faint and all(faint):
        text = f"no effort exceeds {100 * LEAST_EFFORT:g} % of its limit: is it a current, or in another unit?"
        findings.append(Finding("effort unit", WARNING, text, KEPT, tuple(fact.joint for fact in facts)))
    return findings


def _in_degrees(fact: JointFacts, limits: Limits) -> bool:
    """Whether the position makes sense in degrees alone."""
    low, high = limits.position
    if not math.isfinite(high - low):
        return fact.position_range > DEGREES_RANGE and fact.max_speed > DEGREES_SPEED
    shrunk = [math.radians(value) for value in (fact.position_min, fact.position_max)]
    inside = low - LIMIT_TOLERANCE <= min(shrunk) and max(shrunk) <= high + LIMIT_TOLERANCE
    # Twice the whole range of the joint is no wrong offset.
    return inside and fact.position_range > 2 * (high - low)


def _beyond(fact: JointFacts, limits: Limits) -> list[Finding]:
    found = []
    low, high = limits.position
    room = LIMIT_TOLERANCE * (high - low) if math.isfinite(high - low) else 0.0
    if fact.position_min < low - room or fact.position_max > high + room:
        found.append(
            f"{fact.joint} goes from {fact.position_min:.3f} to {fact.position_max:.3f}, beyond its limits {low:g} and "
            f"{high:g}: are units, offset or sign right?"
        )
    if fact.max_speed > (1 + LIMIT_TOLERANCE) * limits.velocity:
        found.append(f"{fact.joint} reaches a speed of {fact.max_speed:.3f}, beyond its limit {limits.velocity:g}")
    largest = max(abs(fact.effort_min or 0.0), abs(fact.effort_max or 0.0))
    if largest > (1 + LIMIT_TOLERANCE) * limits.effort:
        found.append(f"{fact.joint} shows an effort of {largest:.3f}, beyond its limit {limits.effort:g}")
    return [Finding("beyond limits", WARNING, text, KEPT, (fact.joint,)) for text in found]


def _given(present: bool) -> str:
    return "given" if present else "none"


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
