"""What the drives would report of a plant run: noisy position and effort, and a velocity made from positions."""

from __future__ import annotations

import numpy as np

from identify import __version__
from identify.errors import InputError
from identify.experiment.plant import PlantRun
from identify.logs.log import Log
from identify.robot.robot import Robot

NOISE = ("none", "standard", "high")
"""Levels of sensor noise."""

POSITION_NOISE = {"none": 0.0, "standard": np.deg2rad(1e-3), "high": np.deg2rad(1e-2)}
"""Standard deviation of a revolute joint's position [rad]."""

SLIDE_NOISE = {"none": 0.0, "standard": 1e-5, "high": 1e-4}
"""Standard deviation of a prismatic joint's position [m]."""

EFFORT_NOISE = {"none": 0.0, "standard": 1e-3, "high": 1e-2}
"""Standard deviation of the effort, as a share of the effort limit."""

VELOCITY_CUTOFF_HZ = 100.0
"""Cut-off of the drive's velocity filter, where the log is fast enough for it."""

_POSITION, _EFFORT = 0, 1


def measure(run: PlantRun, noise: str, seed: int, robot: Robot) -> Log:
    """The log that drives with `noise` sensors write of `run`; the same arguments give the same bits.

    White Gaussian noise on position and effort, one seeded generator for each joint and channel, so that no
    channel's noise depends on another. Where an effort limit is infinite the largest |effort| of the run
    stands for it. Velocity: backward differences of the measured position through a causal first-order low-pass
    at 100 Hz, late by about 2 ms. noise "none": position and effort are the plant's, bit by
    bit. The metadata says all this; findings are the plant's. InputError for an unknown noise or seed.
    """
    rate = (len(run.time) - 1) / (run.time[-1] - run.time[0])
    position, velocity, effort = Sensors(robot, noise, seed, rate, np.abs(run.effort).max(axis=0)).read(
        run.position, run.effort
    )
    return Log(
        time=run.time.copy(),
        position=position,
        velocity=velocity,
        effort=effort,
        joints=run.joints,
        findings=run.findings,
        metadata=provenance(robot, noise, seed, rate, run.facts) | findings_entry(run.findings),
        attachments={} if run.control is None else run.control.attachments(),
    )


class Sensors:
    """The drives' sensors as they read one part of a run after the other; the parts make no difference to the bits.

    rate [Hz]; largest (n,): |effort| of the run, which stands for an infinite effort limit [N·m or N].
    """

    def __init__(self, robot: Robot, noise: str, seed: int, rate: float, largest: np.ndarray | None = None) -> None:
        check_noise(noise, seed)
        self._noise = noise
        self._rate = rate
        self._levels = []
        for j, joint in enumerate(robot.joints):
            limit = joint.limits.effort
            full_scale = limit if np.isfinite(limit) or largest is None else largest[j]
            level = (POSITION_NOISE if joint.revolute else SLIDE_NOISE)[noise]
            self._levels.append((level, EFFORT_NOISE[noise] * full_scale))
        self._generators = [(_generator(seed, _POSITION, j), _generator(seed, _EFFORT, j)) for j in range(robot.n)]
        self._last: np.ndarray | None = None
        self._filter: np.ndarray | None = None

    def read(self, position: np.ndarray, effort: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position, velocity and effort (k, n) as measured, of the true position and effort (k, n) that come next."""
        position, effort = position.copy(), effort.copy()
        if self._noise != "none":
            for j, ((fine, coarse), (first, second)) in enumerate(zip(self._levels, self._generators, strict=True)):
                position[:, j] += fine * first.standard_normal(len(position))
                effort[:, j] += coarse * second.standard_normal(len(effort))
        return position, self._velocity(position), effort

    def _velocity(self, position: np.ndarray) -> np.ndarray:
        """(k, n) velocity as a drive makes it from position (k, n); 0 at the run's first sample."""
        from scipy.signal import butter, lfilter

        before = position[:1] if self._last is None else self._last
        numerator, denominator = butter(1, _cutoff(self._rate), fs=self._rate)
        state = np.zeros((1, position.shape[1])) if self._filter is None else self._filter
        differences = np.diff(position, axis=0, prepend=before) * self._rate
        velocity, self._filter = lfilter(numerator, denominator, differences, axis=0, zi=state)
        self._last = position[-1:]
        return velocity


def provenance(robot: Robot, noise: str, seed: int, rate: float, facts: dict[str, str]) -> dict[str, str]:
    """What a log says of its origin: how it was made, and what its channels are."""
    return {
        "simulated": "true",
        "robot": robot.name,
        "noise": noise,
        "seed": str(seed),
        "rate_hz": f"{rate:.10g}",
        "generator": f"identify {__version__}, numpy {np.__version__} PCG64",
        "position": _described(noise, f"{np.rad2deg(POSITION_NOISE[noise]):g} deg or {SLIDE_NOISE[noise]:g} m"),
        "effort": _described(noise, f"{100 * EFFORT_NOISE[noise]:g} % of the effort limit"),
        "velocity": f"backward differences of the measured position, causal first-order low-pass at "
        f"{_cutoff(rate):g} Hz",
        **facts,
    }


def findings_entry(findings: tuple[str, ...]) -> dict[str, str]:
    """What the plant found, as an entry of the provenance; none where it found nothing."""
    return {"findings": "; ".join(findings)} if findings else {}


def check_noise(noise: str, seed: int) -> None:
    """InputError unless `noise` is one of NOISE and `seed` a whole number of at least 0."""
    if noise not in NOISE:
        raise InputError(f"noise is {noise!r}; choose one of {', '.join(NOISE)}")
    if seed < 0:
        raise InputError(f"seed is {seed}; it must be a whole number of at least 0")


def _generator(seed: int, channel: int, joint: int) -> np.random.Generator:
    """The source of noise of one joint's channel."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(channel, joint))))


def _cutoff(rate: float) -> float:
    return min(VELOCITY_CUTOFF_HZ, 0.2 * rate)


def _described(noise: str, level: str) -> str:
    return "exact" if noise == "none" else f"white Gaussian noise, standard deviation {level}"
