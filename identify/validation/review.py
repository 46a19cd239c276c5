"""What predictions make of a log, all of them in one pass, as it may be long: sums, curves to draw, what was used."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from identify.estimation.motion import Motion
from identify.estimation.prediction import Predictor, Stretch, stretches
from identify.estimation.scoring import CUTOFF_HZ, Place, Smooth, Tally, piece_at, places
from identify.logs.log import Log
from identify.side_by_side import mapped
from identify.validation.motion_distance import States

CURVE_ROWS = 3000
"""Most rows a curve is stored with."""

STATES_HZ = 40.0
"""Rate that states of the motion are kept at [Hz], about."""


@dataclass(frozen=True, eq=False)
class Review:
    """One log under one or more predictions, by their names; the first is the one that is drawn.

    tallies: of each, piece by piece. curves: arrays (m, n), (m,) for "time" and "moving", on the log's even clock, at
    most CURVE_ROWS rows, efforts low-passed at 10 Hz, SI. residual (M, n) at residual_rate [Hz]: the first one's,
    low-passed, rows at rest set to zero. lowest, highest, speed, acceleration (n,) of the motion, arm_speed (arms,) of
    joints and coupled motors, as the first takes it; states: the same motion, thinned.
    """

    log: Log
    tallies: dict[str, list[Tally]]
    curves: dict[str, np.ndarray]
    residual: np.ndarray
    residual_rate: float
    lowest: np.ndarray
    highest: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    arm_speed: np.ndarray
    states: States


@dataclass(frozen=True, eq=False)
class _Part:
    """A piece's share of all that a review holds."""

    tallies: list[Tally]
    curves: dict[str, np.ndarray]
    residual: np.ndarray
    extremes: list[np.ndarray]
    states: list[np.ndarray]


def reviewed(log: Log, predictors: Mapping[str, Predictor]) -> Review:
    """The log, of the robot's joints in its order and with effort, under these predictions."""
    every = list(predictors.values())
    step = max(1, int(np.ceil(log.samples / CURVE_ROWS)))
    thin = max(1, int(log.rate_hz / (8 * CUTOFF_HZ)))
    sparse = max(1, round(log.rate_hz / STATES_HZ))
    first = every[0]
    inertial = np.arange(first.regressor.p) < len(first.regressor.base.names)
    rigid = Predictor(first.regressor, np.where(inertial, first.parameters, 0.0), first.settings)

    def look(where: tuple[Place, Stretch]) -> _Part:
        place, stretch = where
        piece = piece_at(log, place, [stretch.effort(predictor, k) for k, predictor in enumerate(every)])
        motion = stretch.motions[0]
        around = slice(place.around.start - stretch.rows.start, place.around.stop - stretch.rows.start)
        smooth = Smooth.of(piece, rigid.effort(motion, None)[around])
        inside = slice(place.rows.start - stretch.rows.start, place.rows.stop - stretch.rows.start)
        drawn = {
            "time": motion.time[inside],
            "moving": smooth.moves,
            "measured": smooth.effort,
            "predicted": smooth.effort - smooth.errors[0],
            "rigid": smooth.more[0],
            "position": motion.q[inside],
            "velocity": motion.dq[inside],
            "acceleration": motion.ddq[inside],
        }
        kept = slice(-place.rows.start % step, None, step)
        curves = {name: _small(name, values[kept]) for name, values in drawn.items()}
        residual = smooth.moving_errors[0][-place.rows.start % thin :: thin].copy()
        tallies = [smooth.tally(k) for k in range(len(every))]
        few = slice(-place.rows.start % sparse, None, sparse)
        states = [drawn[name][few].astype(np.float32) for name in ("position", "velocity", "acceleration")]
        return _Part(tallies, curves, residual, _extremes(first, motion, inside), states)

    def along() -> Iterator[tuple[Place, Stretch]]:
        every_place = list(places(log))
        yield from zip(every_place, stretches(log, every, (place.part for place in every_place)), strict=True)

    parts = list(mapped(look, along()))
    q, dq, ddq = (np.concatenate([part.states[k] for part in parts]) for k in range(3))
    lowest, highest, speed, acceleration, arm_speed = (
        np.array(values) for values in zip(*(part.extremes for part in parts), strict=True)
    )
    return Review(
        log,
        {name: [part.tallies[k] for part in parts] for k, name in enumerate(predictors)},
        {name: np.concatenate([part.curves[name] for part in parts]) for name in parts[0].curves},
        np.concatenate([part.residual for part in parts]),
        log.rate_hz / thin,
        lowest.min(axis=0),
        highest.max(axis=0),
        speed.max(axis=0),
        acceleration.max(axis=0),
        arm_speed.max(axis=0),
        States(q, dq, ddq, log.rate_hz / sparse),
    )


def _small(name: str, values: np.ndarray) -> np.ndarray:
    """A copy that holds on to no more than itself, of single precision where a curve needs no more."""
    return values.copy() if name in ("time", "moving") else values.astype(np.float32)


def _extremes(predictor: Predictor, motion: Motion, inside: slice) -> list[np.ndarray]:
    q, dq, ddq = motion.q[inside], motion.dq[inside], motion.ddq[inside]
    extra = predictor.regressor.extra
    arms = dq if extra is None else extra.speeds(dq)
    return [q.min(axis=0), q.max(axis=0), *(np.abs(values).max(axis=0) for values in (dq, ddq, arms))]
