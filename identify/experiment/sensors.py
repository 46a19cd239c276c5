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
    check_noise(noise, seed)
    position, effort = run.position.copy(), run.effort.copy()
    if noise != "none":
        for j, joint in enumerate(robot.joints):
            level = (POSITION_NOISE if joint.revolute else SLIDE_NOISE)[noise]
            limit = joint.limits.effort
            full_scale = limit if np.isfinite(limit) else np.abs(run.effort[:, j]).max()
            position[:, j] += level * _normal(seed, _POSITION, j, len(position))
            effort[:, j] += EFFORT_NOISE[noise] * full_scale * _normal(seed, _EFFORT, j, len(effort))
    rate = (len(run.time) - 1) / (run.time[-1] - run.time[0])
    cutoff = min(VELOCITY_CUTOFF_HZ, 0.2 * rate)
    return Log(
        time=run.time.copy(),
        position=position,
        velocity=_reported_velocity(position, rate, cutoff),
        effort=effort,
        joints=run.joints,
        findings=run.findings,
        metadata={
            "simulated": "true",
            "robot": robot.name,
            "noise": noise,
            "seed": str(seed),
            "rate_hz": f"{rate:.10g}",
            "generator": f"identify {__version__}, numpy {np.__version__} PCG64",
            "position": _described(noise, f"{np.rad2deg(POSITION_NOISE[noise]):g} deg or {SLIDE_NOISE[noise]:g} m"),
            "effort": _described(noise, f"{100 * EFFORT_NOISE[noise]:g} % of the effort limit"),
            "velocity": f"backward differences of the measured position, causal first-order low-pass at {cutoff:g} Hz",
            **run.facts,
            **({"findings": "; ".join(run.findings)} if run.findings else {}),
        },
    )


def check_noise(noise: str, seed: int) -> None:
    """InputError unless `noise` is one of NOISE and `seed` a whole number of at least 0."""
    if noise not in NOISE:
        raise InputError(f"noise is {noise!r}; choose one of {', '.join(NOISE)}")
    if seed < 0:
        raise InputError(f"seed is {seed}; it must be a whole number of at least 0")


def _normal(seed: int, channel: int, joint: int, samples: int) -> np.ndarray:
    """(samples,) standard normal noise of one joint's channel."""
    sequence = np.random.SeedSequence(seed, spawn_key=(channel, joint))
    return np.random.Generator(np.random.PCG64(sequence)).standard_normal(samples)


def _described(noise: str, level: str) -> str:
    return "exact" if noise == "none" else f"white Gaussian noise, standard deviation {level}"


def _reported_velocity(position: np.ndarray, rate: float, cutoff: float) -> np.ndarray:
    """(N, n) velocity as a drive makes it from position (N, n) sampled at `rate` [Hz]; 0 at the first sample."""
    from scipy.signal import butter, lfilter

    numerator, denominator = butter(1, cutoff, fs=rate)
    return lfilter(numerator, denominator, np.diff(position, axis=0, prepend=position[:1]) * rate, axis=0)
