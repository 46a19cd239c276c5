"""A fit of a small arm and logs of the same arm with a load: exact efforts with a little noise, no simulator."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from exact_logs import arm, exact_log, fitted, friction
from oracle import inverse_dynamics

from identify.estimation.payload_result import Payload
from identify.logs.log import Log
from identify.payload_workflow import payload
from identify.robot.payload import carrying
from identify.robot.robot import Link

LOAD = Link(1.5, (0.06, -0.14, 0.11), (0.03, 0.004, -0.003, 0.025, 0.002, 0.02))


def loaded_log(seed: int = 2, source: str = "loaded.mcap") -> Log:
    return replace(exact_log(carrying(arm(1), LOAD), seed, noise=0.02, source=source), sha256=f"{100 + seed:064x}")


def one_joint_moving(joint: int) -> Log:
    """The loaded arm with one joint alone in motion (0-based), the others held where they are."""
    log, robot = loaded_log(), carrying(arm(1), LOAD)
    position = np.tile(log.position[:1], (log.samples, 1))
    position[:, joint] = log.position[:, joint]
    dq = np.gradient(position, log.time, axis=0)
    effort = inverse_dynamics(robot, position, dq, np.gradient(dq, log.time, axis=0)) + friction(robot, dq)
    noise = 0.02 * np.random.default_rng(5).standard_normal(effort.shape)
    return replace(log, position=position, effort=effort + noise)


@lru_cache(maxsize=1)
def carried() -> Payload:
    """The load of `loaded_log`, with a further log as a test, for tests that need any result; nobody may change it."""
    return payload(fitted(), loaded_log(), test=[loaded_log(3, "other.mcap")], command="identify payload …")


def currents(log: Log, gains: np.ndarray) -> Log:
    """The log with effort in a unit of which gains [N·m] make one."""
    assert log.effort is not None
    return replace(log, effort=log.effort / gains)
