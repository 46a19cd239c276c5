"""Logs made without a simulator: an analytic motion, and effort by Pinocchio plus the friction law, exact."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import oracle
from chains import random_chain

from identify.estimation.identification import Identification
from identify.experiment.trajectory import Trajectory, random_trajectory
from identify.logs.log import Log
from identify.robot.robot import Drive, Robot
from identify.workflow import fit


def arm(seed: int = 1, n: int = 3) -> Robot:
    """A random arm with full inertias and nonzero offsets; seed 1: three revolute joints, seed 2: P R P."""
    return random_chain(np.random.default_rng(seed), n)


def friction(robot: Robot, dq: np.ndarray) -> np.ndarray:
    """(N, n) Fv·q̇ + Fs·sign(q̇) + offset of the robot's drives."""
    drives = [joint.drive for joint in robot.joints]
    viscous, coulomb, offset = np.array([(d.viscous, d.coulomb, d.offset) for d in drives]).T
    return viscous * dq + coulomb * np.sign(dq) + offset


def effort(robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(N, n) effort of the robot's own description."""
    return oracle.inverse_dynamics(robot, q, dq, ddq) + friction(robot, dq)


def motion(robot: Robot, seed: int = 1, periods: int = 1) -> Trajectory:
    """10 s a period, half a second of rest before and after."""
    return random_trajectory(robot, seed, periods=periods)


def exact_log(
    robot: Robot, seed: int = 1, rate: float = 250.0, noise: float = 0.0, periods: int = 1, source: str = "made.mcap"
) -> Log:
    """The log of `motion` at `rate`; noise: standard deviation of white noise on the effort [N·m or N]."""
    trajectory = motion(robot, seed, periods)
    time = np.arange(0.0, trajectory.duration + 0.5 / rate, 1 / rate)
    q, dq, ddq = trajectory.sample(time)
    measured = effort(robot, q, dq, ddq) + noise * np.random.default_rng(seed).standard_normal(q.shape)
    return Log(time, q, None, measured, robot.joint_names, source=source, sha256=f"{seed:064x}")


def unknown(robot: Robot) -> Robot:
    """The same geometry and limits with nothing said of inertia and friction."""
    nothing = type(robot.joints[0].link)()
    return replace(robot, joints=tuple(replace(joint, link=nothing, drive=Drive()) for joint in robot.joints))


@lru_cache(maxsize=1)
def fitted() -> Identification:
    """A fit of `arm(1)` with a held-out log, for tests that need any result; nobody may change it."""
    robot = arm(1)
    return fit(exact_log(robot, noise=0.02), robot, test=[exact_log(robot, 2, noise=0.02, source="test.mcap")])


@lru_cache(maxsize=1)
def fitted_with_dropped_column() -> Identification:
    """The same of `arm(2)`: prismatic, revolute, prismatic; the first offset can't be told from gravity."""
    robot = arm(2)
    return fit(exact_log(robot, noise=0.02), robot)
