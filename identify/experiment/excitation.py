"""Motions that excite a robot's parameters: Fourier series optimised within its limits (Swevers et al. 1997).

The rest constraints on the coefficients are eliminated, all other limits enter by an augmented Lagrangian on a
grid of samples, and each round is solved by L-BFGS with exact gradients. Work is bounded by counts, never by the
clock, so that a seed gives the same motion however busy the machine is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from identify.errors import InputError
from identify.experiment.design import ALLOWED, FINER, Design, one_period
from identify.experiment.information import scaled_condition
from identify.experiment.trajectory import Trajectory
from identify.robot.robot import Robot

CRITERIA = ("torque", "energy", "both")

ROUNDS, LAST_ROUNDS = (20.0, 200.0), (2000.0, 20000.0)
"""Weights of the limits in the rounds of the augmented Lagrangian: of every start, and of the best one's end."""

ITERATIONS = 100
"""Steps of L-BFGS in each round."""

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Assessment:
    """What one period of a motion is worth, and how near it comes to the robot's limits.

    torque_condition, energy_condition: condition numbers of the observation matrices, each column divided by its
    norm, rows not weighted, exact sign of Coulomb friction, windows of `window` seconds. criterion, value: what
    `excite` minimises. use: worst share of each kind of limit, 0 where there is none; effort is what the robot's
    description asks for. tightest: joint and kind of the largest share. unexcited: columns that this motion can't
    tell apart in the criterion's models; the condition number is then infinite.
    """

    criterion: str
    value: float
    torque_condition: float
    energy_condition: float
    window: float
    use: dict[str, float]
    tightest: str
    unexcited: tuple[str, ...]

    @property
    def within_limits(self) -> bool:
        """Whether every limit holds."""
        return max(self.use.values()) <= 1.0

    def summary(self) -> str:
        """One line for people."""
        text = f"torque cond {self.torque_condition:.3g}, energy cond {self.energy_condition:.3g}"
        text += f" with {1000 * self.window:.3g} ms windows"
        if self.tightest:
            text += f", {100 * max(self.use.values()):.1f} % of {self.tightest}"
        return f"{text}; can't tell apart {', '.join(self.unexcited)}" if self.unexcited else text


def excite(
    robot: Robot,
    criterion: str = "torque",
    duration: float = 10.0,
    seed: int = 0,
    *,
    periods: int = 3,
    rest: float = 0.5,
    harmonics: int | None = None,
    starts: int = 3,
    progress: Progress | None = None,
) -> Trajectory:
    """The motion of `duration` seconds a period that tells most about the robot's parameters within its limits.

    criterion: the model that the parameters will be estimated with: torque, energy, or both. Minimised is
    `information.log_variance`: the mean log variance of the parameters plus the log variance of the torque that
    they predict on random motions. Position, velocity and acceleration hold their limits (`working_limits`), effort
    does for the parameters that the robot's description gives; every period starts and ends at rest. harmonics:
    by default 5, and for the energy model `energy_harmonics`. The best of `starts` local searches from seeded
    random motions; the same arguments give the same motion, bit by bit.

    InputError for arguments out of range, and where no motion within the limits was found.
    """
    import scipy.optimize  # noqa: F401  before the limit on threads, which reaches only what is loaded by then
    from threadpoolctl import threadpool_limits

    if criterion not in CRITERIA:
        raise InputError(f"criterion is {criterion!r}; choose one of {', '.join(CRITERIA)}")
    if not (np.isfinite(duration) and duration > 0):
        raise InputError(f"duration is {duration}; it must be a positive time in seconds")
    if harmonics is None:
        harmonics = 5 if criterion == "torque" else energy_harmonics(robot)
    for name, value, least in (("harmonics", harmonics, 2), ("starts", starts, 1), ("seed", seed, 0)):
        if value < least:
            raise InputError(f"{name} is {value}; it must be a whole number of at least {least}")
    tell = progress or (lambda fraction, text: None)
    # Threads cost more than they bring on matrices of this size, and would make the sums' order a matter of chance.
    with threadpool_limits(1, "blas"):
        tell(0.0, "regressor")
        design = Design(robot, criterion, duration, harmonics)
        best = _search(design, starts, seed, tell)
        found = design.trajectory(best, periods, rest, seed)
        assessment = _assessment(design, found)
    if not assessment.within_limits:
        raise InputError(
            f"{robot.name}: no motion of {duration:g} s within the limits was found (the best one needs "
            f"{100 * max(assessment.use.values()):.0f} % of {assessment.tightest}); "
            "mend the limits or inertias of the robot file, or give the motion more time"
        )
    tell(1.0, assessment.summary())
    return design.trajectory(best, periods, rest, seed, assessment.summary())


def energy_harmonics(robot: Robot) -> int:
    """How many harmonics tell the energy model's columns well apart.

    The kinetic energy of every drive, its viscous work and its offset's work, and two cross terms a coupled motor,
    are trigonometric polynomials of degree 2 L that are at rest at both ends of a period: at most 4 L − 1 of them
    are independent. One harmonic more than that needs makes the condition number several times smaller.
    """
    columns = 3 * robot.n + 2 * len(robot.couplings)
    return max(5, -(-(columns + 4) // 4) + 1)


def assess(robot: Robot, trajectory: Trajectory, criterion: str = "both") -> Assessment:
    """Look over one period of a motion, on a grid ten times finer than the design's."""
    trajectory = trajectory.for_robot(robot)
    return _assessment(Design(robot, criterion, trajectory.period, trajectory.harmonics), trajectory)


def _assessment(design: Design, trajectory: Trajectory) -> Assessment:
    regressor, samples, every = design.regressor, FINER * design.samples, FINER * design.every
    q, dq, ddq = (signal.T for signal in one_period(trajectory, samples))
    power, energy = regressor.power(dq), regressor.energy(q[::every], dq[::every])
    work = (power + np.roll(power, -1, axis=0)).reshape(-1, every, regressor.p).sum(axis=1)
    rows = np.roll(energy, -1, axis=0) - energy + work / 2 * (trajectory.period / samples)
    energy_condition, energy_lost = scaled_condition(rows.T)
    torque_rows = regressor.torque(q[::4], dq[::4], ddq[::4]).reshape(-1, regressor.p)
    torque_condition, torque_lost = scaled_condition(torque_rows.T)
    lost = {"torque": torque_lost, "energy": energy_lost, "both": torque_lost | energy_lost}[design.criterion]
    use, tightest = design.use(trajectory)
    return Assessment(
        criterion=design.criterion,
        value=design.value(one_period(trajectory, design.samples)),
        torque_condition=torque_condition,
        energy_condition=energy_condition,
        window=every * trajectory.period / samples,
        use=use,
        tightest=tightest,
        unexcited=tuple(np.array(regressor.names)[lost].tolist()),
    )


def _search(design: Design, starts: int, seed: int, tell: Progress) -> np.ndarray:
    """The best point of `starts` local searches that can be brought inside the limits; failing that, the nearest."""
    generator = np.random.Generator(np.random.PCG64(seed))
    found = []
    for start in range(1, starts + 1):
        x, multipliers = _descend(design, design.random_point(generator), 0.0, ROUNDS)
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
