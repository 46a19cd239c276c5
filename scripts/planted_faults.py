"""Faults that a log of the RX-90 may have, one by one: `scripts/check_triage` plants them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import identify
from identify.experiment.plant import run_plant
from identify.experiment.sensors import measure
from identify.experiment.trajectory import random_trajectory
from identify.logs.log import Log

ROBOT = identify.load_robot("rx90")


@dataclass(frozen=True)
class Fault:
    """kinds: names of findings that name the fault; joint: its index where it is in one alone; spoil plants it."""

    what: str
    kinds: tuple[str, ...]
    joint: int | None
    spoil: Callable[[Log, np.random.Generator], Log]


def column(what: str, joint: int, change: Callable[[np.ndarray, np.random.Generator], np.ndarray]) -> Callable:
    """A spoiler that changes one channel of one joint, x (N,)."""

    def spoil(log: Log, random: np.random.Generator) -> Log:
        values = getattr(log, what).copy()
        values[:, joint] = change(values[:, joint].copy(), random)
        return replace(log, **{what: values})

    return spoil


def everywhere(what: str, change: Callable[[np.ndarray, np.random.Generator], np.ndarray]) -> Callable:
    """A spoiler that changes a whole array of the log."""
    return lambda log, random: replace(log, **{what: change(getattr(log, what).copy(), random)})


def rows(log: Log, keep: np.ndarray) -> Log:
    """The log of some of its rows, in that order."""
    return replace(
        log, time=log.time[keep], position=log.position[keep], velocity=log.velocity[keep], effort=log.effort[keep]
    )


def put(x: np.ndarray, at: np.ndarray | slice, value: float | np.ndarray) -> np.ndarray:
    x[at] = value
    return x


def some(random: np.random.Generator, count: int, samples: int) -> np.ndarray:
    return random.choice(np.arange(1000, samples - 1000), count, replace=False)


def gaps(log: Log, random: np.random.Generator) -> Log:
    keep = np.ones(log.samples, dtype=bool)
    for start in some(random, 3, log.samples):
        keep[start : start + 150] = False
    return rows(log, np.flatnonzero(keep))


def duplicates(log: Log, random: np.random.Generator) -> Log:
    return rows(log, np.sort(np.concatenate([np.arange(log.samples), some(random, 200, log.samples)])))


def backward(log: Log, random: np.random.Generator) -> Log:
    time = log.time.copy()
    time[some(random, 40, log.samples)] -= 0.05
    return replace(log, time=time)


def two_rates(log: Log, random: np.random.Generator) -> Log:
    half = log.samples // 2
    return rows(log, np.concatenate([np.arange(half), np.arange(half, log.samples, 4)]))


def jitter(time: np.ndarray, random: np.random.Generator) -> np.ndarray:
    return time + random.uniform(-2e-4, 2e-4, len(time))


def late(joints: slice, seconds: float) -> Callable:
    """A spoiler that delays efforts."""

    def spoil(log: Log, random: np.random.Generator) -> Log:
        effort = log.effort.copy()
        for x in effort.T[joints]:
            x[:] = np.interp(log.time - seconds, log.time, x.copy())
        return replace(log, effort=effort)

    return spoil


def slow_clock(log: Log, random: np.random.Generator) -> Log:
    effort = np.column_stack([np.interp(1.001 * log.time, log.time, x) for x in log.effort.T])
    return replace(log, effort=effort)


def swapped(*channels: str) -> Callable:
    """A spoiler that exchanges joints 3 and 5."""

    def spoil(log: Log, random: np.random.Generator) -> Log:
        order = [0, 1, 4, 3, 2, 5]
        return replace(log, **{name: getattr(log, name)[:, order] for name in channels})

    return spoil


def still(log: Log, random: np.random.Generator) -> Log:
    """Joint 4 keeps its place, and shows the effort that holds it, with its sensors' noise."""
    position, velocity, effort = log.position.copy(), log.velocity.copy(), log.effort.copy()
    position[:, 3] = position[0, 3] + 1e-5 * random.standard_normal(log.samples)
    velocity[:, 3] = 0.01 * random.standard_normal(log.samples)
    effort[:, 3] = effort[0, 3] + 0.06 * random.standard_normal(log.samples)
    return replace(log, position=position, velocity=velocity, effort=effort)


def stuck_bit(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Bit 13 of a 20 bit encoder over ±π flips now and then."""
    at = some(random, 12, len(x))
    counts = np.round((x + np.pi) / (2 * np.pi) * 2**20).astype(int)
    x[at] = (counts[at] ^ (1 << 13)) / 2**20 * 2 * np.pi - np.pi
    return x


def frozen(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    at = int(np.abs(np.gradient(x)).argmax())
    return put(x, slice(at, at + 300), x[at])


def nan_run(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    start = int(some(random, 1, len(x))[0])
    return put(x, slice(start, start + 400), np.nan)


def clipped(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    return np.clip(x, *np.quantile(x, [0.03, 0.97]))


def held(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    return x[np.arange(len(x)) // 10 * 10]


def offset_later(value: float) -> Callable:
    """Changes x from the middle on."""
    return lambda x, random: x + value * (np.arange(len(x)) > len(x) // 2)


def rounded(step: float) -> Callable:
    return lambda x, random: np.round(x / step) * step


def slow(log: Log, random: np.random.Generator) -> Log:
    """Another experiment: so slow that inertias make no effort."""
    motion = random_trajectory(ROBOT, 77, fundamental_hz=0.01, periods=1)
    return measure(run_plant(ROBOT, motion), "high", 0, ROBOT)


FAULTS = (
    Fault("3 gaps of 0.15 s", ("gap",), None, gaps),
    Fault("200 rows twice", ("duplicate time",), None, duplicates),
    Fault("40 stamps 50 ms too early", ("backward time",), None, backward),
    Fault("stamps jitter by ±0.2 ms", ("jitter",), None, everywhere("time", jitter)),
    Fault("second half at a quarter of the rate", ("mixed rates",), None, two_rates),
    Fault("effort of joint 5 constant", ("dead effort",), 4, column("effort", 4, lambda x, r: 0 * x + 1.5)),
    Fault("effort of joint 2 clipped", ("saturation",), 1, column("effort", 1, clipped)),
    Fault("position of joint 3 clipped", ("saturation",), 2, column("position", 2, clipped)),
    Fault(
        "position of joint 3 in steps of 0.1°", ("quantisation",), 2, column("position", 2, rounded(np.deg2rad(0.1)))
    ),
    Fault("effort of joint 4 in steps of 2 N·m", ("quantisation",), 3, column("effort", 3, rounded(2.0))),
    Fault(
        "20 efforts of 1e293",
        ("corrupt values",),
        None,
        column("effort", 2, lambda x, r: put(x, some(r, 20, len(x)), 1e293)),
    ),
    Fault("400 positions in a row NaN", ("corrupt values",), None, column("position", 1, nan_run)),
    Fault("a bit of joint 1's encoder flips 12 times", ("spikes",), 0, column("position", 0, stuck_bit)),
    Fault(
        "8 spikes in the effort of joint 6",
        ("spikes",),
        5,
        column("effort", 5, lambda x, r: put(x, some(r, 8, len(x)), 15.0)),
    ),
    Fault("encoder of joint 4 wraps by 2π", ("wrap",), 3, column("position", 3, offset_later(-2 * np.pi))),
    Fault("joint 1 gets an offset of 0.05 rad midway", ("jump",), 0, column("position", 0, offset_later(0.05))),
    Fault("position of joint 2 frozen for 0.3 s", ("frozen",), 1, column("position", 1, frozen)),
    Fault("positions in degrees", ("degrees",), None, everywhere("position", lambda x, r: np.rad2deg(x))),
    Fault("effort of joint 6 with the wrong sign", ("sign",), 5, column("effort", 5, lambda x, r: -x)),
    Fault("effort of joint 2 with the wrong sign", ("sign",), 1, column("effort", 1, lambda x, r: -x)),
    Fault("joint 3 counted the wrong way round", ("sign",), 2, column("position", 2, lambda x, r: -x)),
    Fault("joints 3 and 5 under each other's name", ("swap",), 2, swapped("position", "velocity", "effort")),
    Fault("efforts of joints 3 and 5 exchanged", ("swap",), 2, swapped("effort")),
    Fault("velocity of joint 4 in deg/s", ("velocity",), 3, column("velocity", 3, lambda x, r: np.rad2deg(x))),
    Fault("velocity of joint 2 with the wrong sign", ("velocity",), 1, column("velocity", 1, lambda x, r: -x)),
    Fault("velocities of joints 3 and 5 exchanged", ("velocity",), 2, swapped("velocity")),
    Fault("all efforts 10 ms late", ("delay",), None, late(slice(None), 0.01)),
    Fault("effort of joint 3 alone 20 ms late", ("delay",), 2, late(slice(2, 3), 0.02)),
    Fault("effort's clock 0.1 % slow", ("clock apart",), None, slow_clock),
    Fault("effort of joint 1 held for 10 ms", ("mixed rates",), 0, column("effort", 0, held)),
    Fault("joint 4 does not move", ("no motion",), 3, still),
    Fault("so slow that inertia makes no effort", ("under-excited",), None, slow),
    Fault("efforts are currents, 15 N·m/A", ("effort unit",), None, everywhere("effort", lambda x, r: x / 15)),
    Fault(
        "effort of joint 3 is a copy of joint 2's",
        ("copied channel",),
        2,
        lambda log, r: replace(log, effort=log.effort[:, [0, 1, 1, 3, 4, 5]]),
    ),
    Fault(
        "effort of joint 2 is noise",
        ("unexplained effort",),
        1,
        column("effort", 1, lambda x, r: 50 * r.standard_normal(len(x))),
    ),
    Fault(
        "three times as fast: joint 5 beyond its limit",
        ("beyond limits",),
        4,
        lambda log, r: replace(log, time=log.time / 3),
    ),
)
