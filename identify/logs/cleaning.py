"""A log as recorded made into one that can be computed with: what is unusable goes, and is counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.errors import LogError
from identify.logs.log import Log
from identify.logs.slicing import counted_from
from identify.logs.wording import counted, printable

MOST_DROPPED = 0.05
"""Share of rows that may be dropped for being NaN, or for running backward in time."""
_BLOCK = 1 << 14
ABSURD = 1e9
"""A position, velocity or effort beyond this (SI) is a corrupt value, and counts as NaN."""


def clean(log: Log) -> Log:
    """A log with finite rows, time strictly increasing, and channels that hold something.

    Time counts from the first row with a finite time and position, whether or not its effort is: so a log has
    one clock, be its effort read or not.

    Values beyond ABSURD count as not finite. Rows whose position, effort or time is not finite are dropped,
    as are those whose time repeats or runs backward; the findings count them. A channel without a finite
    value counts as absent. A velocity sample that is not finite is derived from position; above 5 % the whole
    channel is. Raises LogError above 5 % of rows that are not finite or that run backward.
    """
    findings = list(log.findings)
    if not log.samples:
        raise LogError(f"{log.source}: holds no samples; record while the robot runs")
    if np.isfinite(log.time).all() and _forward(log.time) and all(map(_all_usable, _channels(log).values())):
        return counted_from(log, float(log.time[0]))
    usable = {name: _usable(values) for name, values in _channels(log).items()}
    if not usable["position"].any():
        raise LogError(f"{log.source}: too many NaN: no position is a finite number; check the recording")
    effort = log.effort
    if effort is not None and not usable["effort"].any():
        findings.append("no effort is a finite number, so the log counts as one without effort")
        effort = None
    finite = _finite_rows(replace(log, effort=effort), usable, findings)
    forward = _forward_rows(log, finite, findings)
    whole = bool(finite.all() and forward.all())
    pick = slice(None) if whole else np.flatnonzero(finite)[forward]
    origin = _origin(log, usable["position"])
    cleaned = replace(
        log,
        time=log.time[pick],
        position=log.position[pick],
        velocity=None if log.velocity is None else log.velocity[pick],
        effort=None if effort is None else effort[pick],
    )
    cleaned = replace(cleaned, dropped=log.dropped + log.samples - cleaned.samples)
    velocity = _usable_velocity(cleaned, None if log.velocity is None else usable["velocity"][pick], findings)
    cleaned = replace(cleaned, velocity=velocity, findings=tuple(findings))
    return counted_from(cleaned, min(origin, float(cleaned.time[0])))


def _channels(log: Log) -> dict[str, np.ndarray]:
    named = {"position": log.position, "velocity": log.velocity, "effort": log.effort}
    return {name: values for name, values in named.items() if values is not None}


def _origin(log: Log, usable: np.ndarray) -> float:
    """Time of the first row that has a time and a position [s]; usable (N, n): which positions are numbers."""
    # A channel that holds nothing at all does not count.
    moving = np.isfinite(log.time) & (usable | ~usable.any(axis=0)).all(axis=1)
    return float(log.time[moving.argmax()])


def _forward(time: np.ndarray) -> bool:
    return bool((time[1:] > time[:-1]).all())


def _all_usable(values: np.ndarray) -> bool:
    """Whether all are numbers that a robot can have; the common case, told without an array of answers."""
    return all(
        bool(np.abs(values[start : start + _BLOCK]).max(initial=0.0) <= ABSURD)
        for start in range(0, len(values), _BLOCK)
    )


def _usable(values: np.ndarray) -> np.ndarray:
    """Which values are numbers that a robot can have."""
    found = np.empty(values.shape, dtype=bool)
    # A comparison with NaN is false. In blocks, as a whole column's copies would cost more than the log.
    for start in range(0, len(values), _BLOCK):
        part = slice(start, start + _BLOCK)
        np.less_equal(np.abs(values[part]), ABSURD, out=found[part])
    return found


def _finite_rows(log: Log, usable: dict[str, np.ndarray], findings: list[str]) -> np.ndarray:
    """(N,) rows whose time, position and effort are finite; columns without a finite value do not count."""
    if log.effort is None:
        usable = {"position": usable["position"]}
    if np.isfinite(log.time).all() and all(usable[name].all() for name in usable if name != "velocity"):
        return np.ones(log.samples, dtype=bool)
    bad = {"time": ~np.isfinite(log.time)}
    for name in ("position", "effort"):
        if name not in usable:
            continue
        missing = ~usable[name]
        for joint, column in zip(log.joints, missing.T, strict=True):
            if column.all():
                findings.append(f"the {name} of {printable(joint)} is NaN throughout")
            else:
                bad[f"{name} of {printable(joint)}"] = column
    dropped = np.any(list(bad.values()), axis=0)
    share = dropped.mean()
    if share > MOST_DROPPED:
        worst = max(bad, key=lambda name: bad[name].sum())
        raise LogError(
            f"{log.source}: too many NaN: {100 * share:.1f} % of the rows are not finite, most of them in the {worst} "
            f"({100 * bad[worst].mean():.1f} %); at most {100 * MOST_DROPPED:.0f} % can be dropped, so record again"
        )
    if dropped.any():
        share_dropped = f"{dropped.sum():,} of {counted(log.samples, 'row')} dropped"
        findings.append(f"{share_dropped}: position, effort or time is not finite, or absurd")
    return ~dropped


def _forward_rows(log: Log, finite: np.ndarray, findings: list[str]) -> np.ndarray:
    """Which of the finite rows keep time strictly increasing."""
    time = log.time if finite.all() else log.time[finite]
    keep = np.ones(len(time), dtype=bool)
    if _forward(time):
        return keep
    step = np.diff(time)
    repeated = np.concatenate([[False], step == 0])
    # A stamp ahead of its neighbours would take all that follow with it: it goes first.
    keep[1:-1] = ~((step[1:] < 0) & (time[2:] > time[:-2]))
    latest = np.maximum.accumulate(np.where(keep, time, -np.inf))
    keep[1:] &= time[1:] > latest[:-1]
    backward = int((~keep & ~repeated).sum())
    if backward > MOST_DROPPED * len(time):
        worst = int(step.argmin())
        raise LogError(
            f"{log.source}: time runs backward in {100 * backward / len(time):.1f} % of the rows, first by "
            f"{-step[worst]:.3f} s after row {worst}; split the recording there, or mend its clock"
        )
    if (repeated & ~keep).any():
        findings.append(
            f"{(repeated & ~keep).sum():,} of {counted(log.samples, 'row')} dropped: their time repeats the one before"
        )
    if backward:
        findings.append(f"{backward:,} of {counted(log.samples, 'row')} dropped: their time runs backward")
    return keep


def _usable_velocity(log: Log, usable: np.ndarray | None, findings: list[str]) -> np.ndarray | None:
    """The velocity without gaps; None where it is better derived from position altogether."""
    if log.velocity is None or usable is None or usable.all():
        return log.velocity
    missing = ~usable
    share = missing.any(axis=1).mean()
    if missing.all():
        findings.append("the velocity is NaN throughout and is derived from position")
        return None
    if share > MOST_DROPPED or log.samples < 3:
        findings.append(f"the velocity is NaN in {100 * share:.1f} % of the rows; all of it is derived from position")
        return None
    findings.append(f"{counted(int(missing.sum()), 'velocity sample')} not finite and derived from position")
    return np.where(missing, np.gradient(log.position, log.time, axis=0), log.velocity)
