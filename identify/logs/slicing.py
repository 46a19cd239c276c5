"""Part of a log: some of its joints, some of its time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identify.errors import LogError
from identify.logs.log import MOTION_START, START_TIME, Log
from identify.logs.wording import listed


def select(log: Log, joint_names: Sequence[str]) -> Log:
    """The log of these joints alone, in this order. Raises LogError, with the joints there are, if one is missing."""
    names = tuple(joint_names)
    if names == log.joints:
        return log
    if any(name not in log.joints for name in names):
        raise no_such_joint(log.source or "log", names, log.joints)
    columns = [log.joints.index(name) for name in names]
    velocity, effort = (None if values is None else values[:, columns] for values in (log.velocity, log.effort))
    return replace(log, position=log.position[:, columns], velocity=velocity, effort=effort, joints=names)


def window(log: Log, start: float | None = None, stop: float | None = None) -> Log:
    """The samples from `start` up to but without `stop` [s from the first sample], time counted anew from zero.

    Raises LogError where there are none.
    """
    if start is None and stop is None:
        return log
    begin = -np.inf if start is None else start
    end = np.inf if stop is None else stop
    kept = (log.time >= begin) & (log.time < end)
    if not kept.any():
        raise LogError(
            f"{log.source or 'log'}: has no sample from {begin:g} to {end:g} s; it lasts {log.time[-1]:.3f} s, "
            "and both count from its first sample"
        )
    velocity, effort = (None if values is None else values[kept] for values in (log.velocity, log.effort))
    part = replace(log, time=log.time[kept], position=log.position[kept], velocity=velocity, effort=effort)
    return counted_from(part, float(part.time[0]))


def counted_from(log: Log, origin: float) -> Log:
    """The log with time counted from `origin` [s]; its start, and that of its motion, move along where known."""
    if origin == 0:
        return log
    metadata = dict(log.metadata)
    if START_TIME in metadata:
        metadata[START_TIME] = str(int(metadata[START_TIME]) + round(origin * 1e9))
    if log.attachments:
        metadata[MOTION_START] = repr(float(metadata.get(MOTION_START, "0")) - origin)
    return replace(log, time=log.time - origin, metadata=metadata)


def no_such_joint(source: str, wanted: Sequence[str], joints: Sequence[str]) -> LogError:
    """The error that names the first joint wanted which is not among a log's joints, and those that are."""
    missing = next(name for name in wanted if name not in joints)
    return LogError(
        f"{source}: has no joint {missing!r}; it has {listed(joints)}: "
        "name the robot's joints as the log does, or choose some with --joints"
    )
