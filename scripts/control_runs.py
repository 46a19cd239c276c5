"""The simulated RX-90 under each control law along one motion, and how far it strays.

`scripts/example_control` calls this; `scripts/control_report.py` tells what came of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from control_laws import OMEGA, PERIOD, Array, Law, adaptation_gain, adaptive, computed_torque, inertia_matrices, pd

import identify
from identify.errors import InputError
from identify.experiment.sensors import POSITION_NOISE, VELOCITY_CUTOFF_HZ
from identify.robot.library import robot_digest
from identify.robot.mjcf import to_mjcf
from identify.robot.payload import carrying
from identify.robot.robot import Link, Robot

STEPS = 2
"""Simulation steps of 0.5 ms in a control period; the torque is held meanwhile."""

WRONG = 0.3
"""A guess from drawings: inertia of each link and of each drive off by up to 30 % (seeded), friction not known."""

PAYLOAD = Link(mass=3.0, com=(0.06, -0.04, 0.20), inertia=(0.02, 0.0, 0.0, 0.02, 0.0, 0.01))
"""What the arm of (d) carries, in the frame of the last link. No controller reads this."""

TOOL = np.array([0.0, 0.0, 0.2])
"""The point in the last frame at which errors are stated in mm [m]."""

EVERY = 5
"""Ticks from one tool error to the next."""

GUESS_SEED, ENCODER_SEED = 0, 7

PD, GUESSED, IDENTIFIED = "PD", "computed torque, wrong parameters", "computed torque, identified"
LOADED, ADAPTIVE, FLOOR = "computed torque, identified, payload", "adaptive, payload", "computed torque, true, payload"
"""Names of the runs; the last is what is left when arm and payload are known exactly."""

Progress = Callable[[float, str], None] | None


def wrong_parameters(regressor: identify.Regressor) -> Array:
    """(p,) θ of the guess: each link's ten parameters times one factor, each drive's inertia times another."""
    factors = np.random.default_rng(GUESS_SEED).uniform(1 - WRONG, 1 + WRONG, (regressor.robot.n, 2))
    return regressor.theta(regressor.robot.standard * np.repeat(factors, [10, 1], axis=1).ravel(), {})


@dataclass(frozen=True, eq=False)
class Motion:
    """The reference at N ticks: time (N,) [s], q, q̇ and q̈ (N, n)."""

    time: Array
    q: Array
    dq: Array
    ddq: Array

    @staticmethod
    def of(trajectory: identify.Trajectory) -> Motion:
        time = np.arange(round(trajectory.duration / PERIOD)) * PERIOD
        return Motion(time, *trajectory.sample(time))


@dataclass(frozen=True, eq=False)
class Run:
    """What happened at N ticks: true q and q̇ (N, n), the law's theta (N, p), and how many torques were clipped."""

    q: Array
    dq: Array
    theta: Array
    clipped: int


def run(robot: Robot, law: Law, theta: Array, motion: Motion) -> Run:
    """Let the simulated `robot` (a serial arm) track `motion` from rest under a law that starts with theta (p,)."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(to_mjcf(robot, position_gain=np.zeros(robot.n)))  # plain torque motors
    data = mujoco.MjData(model)
    data.qpos[:] = motion.q[0]
    limit = np.array([joint.limits.effort for joint in robot.joints])
    noise = POSITION_NOISE["standard"] * np.random.default_rng(ENCODER_SEED).standard_normal(motion.q.shape)
    fresh = 1 - np.exp(-2 * np.pi * VELOCITY_CUTOFF_HZ * PERIOD)  # share of the newest difference in the low-pass
    before, dq = motion.q[0] + noise[0], np.zeros(robot.n)
    true_q, true_dq, thetas = np.empty_like(motion.q), np.empty_like(motion.q), np.empty((len(motion.q), len(theta)))
    clipped = 0
    for k in range(len(motion.q)):
        true_q[k], true_dq[k], thetas[k] = data.qpos, data.qvel, theta
        q = true_q[k] + noise[k]
        dq = dq + fresh * ((q - before) / PERIOD - dq)
        before = q
        torque, theta = law(theta, q, dq, motion.q[k], motion.dq[k], motion.ddq[k])
        data.ctrl[:] = np.clip(torque, -limit, limit)
        clipped += int(np.count_nonzero(np.abs(torque) > limit))
        mujoco.mj_step(model, data, STEPS)
    return Run(true_q, true_dq, thetas, clipped)


def tool_places(robot: Robot, q: Array) -> Array:
    """(N, 3) where the tool is at q (N, n) [m]."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(to_mjcf(robot))
    data = mujoco.MjData(model)
    places = np.empty((len(q), 3))
    for place, row in zip(places, q, strict=True):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        place[:] = data.xpos[-1] + data.xmat[-1].reshape(3, 3) @ TOOL
    return places


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs by name along one motion; truth (p,) θ of the arm with its payload; gain P (p, p) of the adaptation."""

    result: identify.Identification
    regressor: identify.Regressor
    motion: Motion
    runs: dict[str, Run]
    truth: Array
    gain: Array

    def tool_error(self, name: str) -> Array:
        """Distance of the tool from where it should be, at every EVERY-th tick [m]."""
        places = (tool_places(self.regressor.robot, q[::EVERY]) for q in (self.runs[name].q, self.motion.q))
        return np.linalg.norm(np.subtract(*places), axis=1)

    def torque_error(self, theta: Array) -> Array:
        """(N,) norm of Y·(θ − truth) over norm of Y·truth along the whole motion, for each row of theta (N, p)."""
        m = self.motion
        y = self.regressor.torque(m.q[::10], m.dq[::10], m.ddq[::10]).reshape(-1, self.regressor.p)
        return np.linalg.norm((theta - self.truth) @ y.T, axis=1) / np.linalg.norm(y @ self.truth)

    def lyapunov(self, every: int = 10) -> Array:
        """(N / every,) V = ½·sᵀ·A·s + ½·θ̃ᵀ·P⁻¹·θ̃ of the adaptive run, with the true state and parameters."""
        run, rows = self.runs[ADAPTIVE], slice(None, None, every)
        s = run.dq[rows] - self.motion.dq[rows] + OMEGA * (run.q[rows] - self.motion.q[rows])
        inertia = inertia_matrices(self.regressor, self.truth, run.q[rows])
        apart = run.theta[rows] - self.truth
        stored = np.einsum("ki,ki->k", apart, np.linalg.solve(self.gain, apart.T).T)
        return (np.einsum("ki,kij,kj->k", s, inertia, s) + stored) / 2


def compare(result: identify.Identification, trajectory: identify.Trajectory, tell: Progress = None) -> Comparison:
    """Run every law along the trajectory: (a) and (b) know the guess, (c) and (d) the result of the fit.

    InputError where the result is of another robot.
    """
    robot = identify.load_robot("rx90")
    if robot_digest(result.robot) != robot_digest(robot):
        raise InputError(f"the result is of {result.robot.name}; this example wants a fit of the built-in rx90")
    regressor, motion = identify.Regressor(robot), Motion.of(trajectory)
    guess = wrong_parameters(regressor)
    inertia = np.einsum("kjj->kj", inertia_matrices(regressor, guess, motion.q[::50])).mean(axis=0)
    gain = adaptation_gain(regressor, result, motion.q[::50], motion.dq[::50], motion.ddq[::50])
    loaded = carrying(robot, PAYLOAD)
    truth = regressor.parameters
    truth[: len(regressor.base.names)] = regressor.base.matrix @ loaded.standard
    exact = computed_torque(regressor)
    tasks = {
        PD: (robot, pd(inertia), guess),
        GUESSED: (robot, exact, guess),
        IDENTIFIED: (robot, exact, result.parameters),
        LOADED: (loaded, exact, result.parameters),
        ADAPTIVE: (loaded, adaptive(regressor, inertia, gain), result.parameters),
        FLOOR: (loaded, exact, truth),
    }
    runs = {}
    for k, (name, (arm, law, theta)) in enumerate(tasks.items()):
        if tell:
            tell(k / len(tasks), name)
        runs[name] = run(arm, law, theta, motion)
    return Comparison(result, regressor, motion, runs, truth, gain)
