"""Motions that excite a robot's parameters: Fourier series optimised within its limits (Swevers et al. 1997).

The rest constraints on the coefficients are eliminated, all other limits enter by an augmented Lagrangian on a
grid of samples, and each round is solved by L-BFGS with exact gradients. Work is bounded by counts, never by the
clock, so that a seed gives the same motion however busy the machine is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identify.errors import InputError
from identify.experiment.assessment import Assessment, assessed
from identify.experiment.criterion import CRITERIA
from identify.experiment.design import ALLOWED, FINER, Design
from identify.experiment.forecast import Forecast, forecast
from identify.experiment.knowledge import Knowledge, assumed
from identify.experiment.margins import Margins
from identify.experiment.trajectory import Trajectory
from identify.robot.robot import Robot
from identify.side_by_side import one_blas_thread

ROUNDS, LAST_ROUNDS = (20.0, 200.0), (2000.0, 20000.0)
"""Weights of the limits in the rounds of the augmented Lagrangian: of every start, and of the best one's end."""

ITERATIONS = 100
"""Steps of L-BFGS in each round."""

Progress = Callable[[float, str], None]


@dataclass(frozen=True, eq=False)
class Excitation:
    """A designed motion, what it is worth, and what to expect of a fit to it."""

    trajectory: Trajectory
    assessment: Assessment
    forecast: Forecast


def excite(
    robot: Robot, criterion: str = "torque", duration: float = 10.0, seed: int = 0, **options: Any
) -> Trajectory:
    """The motion of `designed_excitation`, which see for all arguments."""
    return designed_excitation(robot, criterion, duration, seed, **options).trajectory


def designed_excitation(
    robot: Robot,
    criterion: str = "torque",
    duration: float = 10.0,
    seed: int = 0,
    *,
    periods: int = 3,
    rest: float = 0.5,
    harmonics: int | None = None,
    starts: int = 3,
    collision: bool = True,
    known: Knowledge | None = None,
    progress: Progress | None = None,
) -> Excitation:
    """The motion of `duration` seconds a period that tells most about the robot's parameters within its limits.

    criterion: the model that the parameters will be estimated with: torque, energy, or both. Minimised is
    `information.log_variance`: the mean log variance of the parameters plus the log variance of the torque that
    they predict on random motions; with knowledge of earlier experiments, of all together, plus the log of the mean
    variance of the parameters in shares of their sizes, which the worst ones make. Position, velocity and
    acceleration hold their limits (`working_limits`), effort does for the parameters that the robot's description
    gives; every period starts and ends at rest. collision: a serial arm's links are kept off each other and off the
    floor (`Clearance`). harmonics: by default 5, and for the energy model `energy_harmonics`. The best of `starts`
    local searches from seeded random motions; the same arguments give the same motion, bit by bit.

    InputError for arguments out of range, and where no motion within the limits was found.
    """
    if criterion not in CRITERIA:
        raise InputError(f"criterion is {criterion!r}; choose one of {', '.join(CRITERIA)}")
    if not (np.isfinite(duration) and duration > 0):
        raise InputError(f"duration is {duration}; it must be a positive time in seconds")
    if harmonics is None:
        harmonics = 5 if criterion == "torque" else energy_harmonics(robot)
    for name, value, least in (
        ("harmonics", harmonics, 2),
        ("periods", periods, 1),
        ("starts", starts, 1),
        ("seed", seed, 0),
    ):
        if value < least:
            raise InputError(f"{name} is {value}; it must be a whole number of at least {least}")
    tell = progress or (lambda fraction, text: None)
    known = known or assumed(robot)
    with one_blas_thread():
        tell(0.0, "regressor")
        design = Design(robot, criterion, duration, harmonics, periods=periods, collision=collision, known=known)
        best = _search(design, starts, seed, tell)
        found = design.trajectory(best, periods, rest, seed)
        assessment = assessed(design, found)
        if not assessment.within_limits:
            raise InputError(_not_found(robot, duration, assessment.margins))
        model = "energy" if criterion == "energy" else "torque"
        samples, every = FINER * design.samples, FINER * design.every
        expected = forecast(design.regressor, found, known, model, samples, every)
    tell(1.0, assessment.summary())
    return Excitation(replace(found, note=assessment.summary()), assessment, expected)


def _not_found(robot: Robot, duration: float, margins: Margins) -> str:
    """Why no motion was found, in one line."""
    gap = min(margins.gaps.values(), default=0.0)
    why = f"the best one needs {100 * max(margins.use.values()):.0f} % of {margins.tightest}"
    mend = "mend the limits or inertias of the robot file, or give the motion more time"
    if gap < 0:
        why = f"in the best one {margins.nearest} overlap by {-1000 * gap:.0f} mm"
        mend = "mend floor, radius or tool in the robot file"
    if margins.gaps:
        mend += ", or leave floor and links out of it with --no-collision"
    return f"{robot.name}: no motion of {duration:g} s within the limits was found ({why}); {mend}"


def energy_harmonics(robot: Robot) -> int:
    """How many harmonics tell the energy model's columns well apart.

    The kinetic energy of every drive, its viscous work and its offset's work, and two cross terms a coupled motor,
    are trigonometric polynomials of degree 2 L that are at rest at both ends of a period: at most 4 L − 1 of them
    are independent. One harmonic more than that needs makes the condition number several times smaller.
    """
    columns = 3 * robot.n + 2 * len(robot.couplings)
    return max(5, -(-(columns + 4) // 4) + 1)


def _search(design: Design, starts: int, seed: int, tell: Progress) -> np.ndarray:
    """The best point of `starts` local searches that can be brought inside the limits; failing that, the nearest."""
    generator = np.random.Generator(np.random.PCG64(seed))
    found = []
    for start in range(1, starts + 1):
        tell(0.8 * (start - 1) / starts, f"start {start} of {starts}")
        x, multipliers = _descend(design, design.start(generator), 0.0, ROUNDS)
        value = design.lagrangian(x, ROUNDS[-1], multipliers)[0]
        tell(0.8 * start / starts, f"start {start} of {starts}: {design.condition(x)}")
        found.append((value, start, x, multipliers))
    near = []
    for _, start, x, multipliers in sorted(found, key=lambda one: one[:2]):
        x, excess = design.inside(_descend(design, x, multipliers, LAST_ROUNDS)[0])
        tell(0.95, f"start {start} brought inside the limits: {design.condition(x)}")
        if excess <= ALLOWED:
            return x
        near.append((excess, start, x))
    return min(near, key=lambda one: one[:2])[2]


def _descend(
    design: Design, x: np.ndarray, multipliers: np.ndarray | float, rounds: tuple[float, ...]
) -> tuple[np.ndarray, np.ndarray | float]:
    """Rounds of the augmented Lagrangian from a point, and the multipliers that they leave."""
    from scipy.optimize import minimize

    options = {"maxiter": ITERATIONS, "maxfun": 2 * ITERATIONS, "maxcor": 30, "ftol": 1e-8, "gtol": 1e-6}
    for weight in rounds:
        x = minimize(design.lagrangian, x, (weight, multipliers), jac=True, method="L-BFGS-B", options=options).x
        multipliers = np.maximum(0.0, multipliers + weight * design.excess(x))
    return x, multipliers
