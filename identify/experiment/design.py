"""One period of a Fourier motion by its free coefficients: what it tells, and what it asks of the robot."""

from __future__ import annotations

from math import ceil, floor

import numpy as np

from identify.experiment.clearance import Clearance
from identify.experiment.criterion import Criterion
from identify.experiment.entries import Motion
from identify.experiment.fourier import Fourier
from identify.experiment.knowledge import Knowledge, assumed
from identify.experiment.limits import working_limits
from identify.experiment.margins import Margins, margins
from identify.experiment.trajectory import Trajectory
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot

WINDOW = 0.05
"""Length of the energy model's windows [s], where the period is neither very short nor very long."""

PER_CYCLE = 40
"""Samples to a cycle of the highest harmonic, at least."""

MOST_SAMPLES = 2000
"""Samples of one period beyond which windows get longer instead."""

MARGIN = 0.025
"""Share of each limit that a design leaves free: for what happens between samples and in the control loop."""

APART = 0.02
"""Gap that a design leaves between links and above the floor, as a share of the reach, for the same."""

DEPTH = 0.05
"""Overlap of two links, as a share of the reach, that counts like twice a limit: enough to keep a search from passing
one through the other."""

ATTEMPTS = 50
"""Random mean poses that a start may take until its links are clear of each other."""

ALLOWED = 0.99
"""Share of each limit that a finished design may use, looked at between the samples too."""

FINER = 10
"""How many times finer than the design's the grid is that a finished motion is judged on."""


class Design:
    """Criterion ("torque", "energy" or "both"), limits and clearance of a point, with exact derivatives.

    A point is one of `Fourier`. collision: whether links are kept off each other and off the floor. samples of the
    period: by default what harmonics, windows and parameters need.
    """

    def __init__(
        self,
        robot: Robot,
        criterion: str,
        duration: float,
        harmonics: int,
        *,
        periods: int = 3,
        collision: bool = True,
        known: Knowledge | None = None,
        samples: int | None = None,
    ) -> None:
        self.robot = robot
        self.regressor = Regressor(robot)
        self.limits = limits = working_limits(robot)
        self.samples, self.every = _grid(duration, harmonics, self.regressor.p) if samples is None else (samples, 1)
        self.fourier = Fourier(robot.joint_names, limits, duration, harmonics, self.samples)
        known = known or assumed(robot)
        self.criterion = Criterion(
            self.regressor, criterion, limits, duration, harmonics, self.samples, self.every, known, periods
        )
        self.clearance = Clearance.of(robot) if collision else None
        self.rows = 4 * robot.n + (self.clearance.rows if self.clearance else 0)
        self._depth = DEPTH * self.clearance.reach if self.clearance else 1.0
        self._scales = (limits.half[:, None], limits.velocity[:, None], limits.acceleration[:, None])
        self._set_effort()

    def _set_effort(self) -> None:
        """Parameters of the effort but for Coulomb friction, and limits (n,) less the most that this can add."""
        terms = self.criterion.torque.terms
        self._smooth = self.regressor.parameters.copy()
        coulomb = np.abs(self._smooth[terms.coulomb_at]) @ np.abs(terms.arms)
        self._smooth[terms.coulomb_at] = 0.0
        self._room = np.maximum(self.limits.effort - coulomb / (1 - MARGIN), 0.05 * self.limits.effort)

    def start(self, generator: np.random.Generator) -> np.ndarray:
        """A random motion to start from, as large as it can be with all links clear: a search would not find its way
        out of links that pass through each other."""
        first = x = self.fourier.random_point(generator)
        for _ in range(ATTEMPTS if self.clearance else 0):
            for factor in 0.8 ** np.arange(12):
                tried = self.fourier.smaller(x, factor)
                if self._lack(self.fourier.signals(tried)[0]).max() < 0:
                    return tried
            x = self.fourier.about(x, generator.uniform(-0.5, 0.5, self.robot.n))
        return first

    def trajectory(
        self, x: np.ndarray, periods: int = 1, rest: float = 0.0, seed: int = 0, note: str = ""
    ) -> Trajectory:
        """The motion of a point."""
        return self.fourier.trajectory(x, periods, rest, self.criterion.name, seed, note)

    def condition(self, x: np.ndarray) -> str:
        """Column-scaled condition numbers of the criterion's models, in words."""
        return self.criterion.condition(self.fourier.signals(x))

    def margins(self, trajectory: Trajectory) -> Margins:
        """How near a motion comes to the limits, looked at between the samples too."""
        return margins(self.regressor, self.clearance, trajectory, FINER * self.samples)

    def excess(self, x: np.ndarray) -> np.ndarray:
        """(rows, N) how far position, velocity, acceleration and effort of each joint are beyond the limits less
        MARGIN, as shares of the limits; then what gaps lack of APART, in units of DEPTH. Negative inside."""
        motion = self.fourier.signals(x)
        found = [np.abs(self._shares(motion, self.criterion.torque.columns(motion))) - (1 - MARGIN)]
        if self.clearance:
            found.append(self._lack(motion[0]))
        return np.concatenate(found)

    def lagrangian(
        self, x: np.ndarray, weight: float, multipliers: np.ndarray | float = 0.0
    ) -> tuple[float, np.ndarray]:
        """Augmented Lagrangian (Rockafellar 1973) of criterion and excesses, and its gradient.

        weight of the squared excesses, multipliers (rows, N) of the excesses; both count as means over the samples.
        """
        motion, torque = self.fourier.signals(x), self.criterion.torque
        columns = torque.columns(motion)
        value, to_columns, to_motion = self.criterion.worth(motion, columns)
        shares = self._shares(motion, columns)
        given = np.broadcast_to(multipliers, (self.rows, self.samples))
        sides = np.maximum(0.0, given[: len(shares)] + weight * (np.abs(shares) - (1 - MARGIN)))
        value += (np.sum(sides**2) - np.sum(given**2)) / (2 * weight * self.samples)
        *direct, by_effort = np.split(sides * np.sign(shares) / self.samples, 4)
        for j, support in enumerate(torque.supports):
            to_columns[support, j] += np.outer(self._smooth[support], by_effort[j] / self._room[j])
        pulled = torque.pull_back(motion, to_columns)
        q, dq, ddq = (
            one + other + third / scale
            for one, other, third, scale in zip(pulled, to_motion, direct, self._scales, strict=True)
        )
        if self.clearance:
            gaps, pull_back = self.clearance.along(motion[0])
            lack = np.maximum(0.0, given[len(shares) :] + weight * (APART * self.clearance.reach - gaps) / self._depth)
            value += np.sum(lack**2) / (2 * weight * self.samples)
            q += pull_back(-lack / (self._depth * self.samples))
        return float(value), self.fourier.pull_back((q, dq, ddq))

    def inside(self, x: np.ndarray) -> tuple[np.ndarray, float]:
        """The point with its motion about the mean pose made smaller, as little as it takes to hold all limits; and
        the worst share of a limit that is left."""

        def smaller(factor: float) -> tuple[np.ndarray, float]:
            point = self.fourier.smaller(x, factor)
            return point, self.margins(self.trajectory(point)).worst

        found = smaller(1.0)
        low, high = 0.5, 1.0
        if found[1] <= ALLOWED:
            return found
        while high - low > 1e-3:
            middle = (low + high) / 2
            tried = smaller(middle)
            low, high = (middle, high) if tried[1] <= ALLOWED else (low, middle)
        best = smaller(low)
        return best if best[1] <= ALLOWED else found

    def _lack(self, q: np.ndarray) -> np.ndarray:
        """(gaps, N) what gaps lack of APART at positions q (n, N), in units of DEPTH."""
        assert self.clearance is not None
        return (APART * self.clearance.reach - self.clearance.gaps(q)) / self._depth

    def _shares(self, motion: Motion, columns: np.ndarray) -> np.ndarray:
        """(4 n, N) position, velocity, acceleration and effort, each as a signed share of its limit."""
        q, dq, ddq = motion
        effort = np.tensordot(self._smooth, columns, 1)
        signals = (q - self.limits.middle[:, None], dq, ddq, effort)
        scales = (*self._scales, self._room[:, None])
        return np.concatenate([signal / scale for signal, scale in zip(signals, scales, strict=True)])


def _grid(duration: float, harmonics: int, p: int) -> tuple[int, int]:
    """Samples of a period, and of a window: enough for the harmonics, and half as many windows again as columns."""
    samples = max(PER_CYCLE * harmonics, min(MOST_SAMPLES, ceil(duration / WINDOW)), ceil(1.5 * p))
    every = max(1, min(floor(WINDOW * samples / duration + 1e-9), samples // ceil(1.5 * p)))
    return every * ceil(samples / every), every
