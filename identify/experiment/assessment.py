"""What one period of a motion is worth, and how near it comes to the robot's limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.experiment.design import FINER, Design
from identify.experiment.fourier import one_period
from identify.experiment.information import scaled_condition
from identify.experiment.margins import Margins
from identify.experiment.trajectory import Trajectory
from identify.numbers import finite
from identify.robot.robot import Robot


@dataclass(frozen=True)
class Assessment:
    """What one period of a motion is worth, and how near it comes to the robot's limits.

    torque_condition, energy_condition: condition numbers of the observation matrices, each column divided by its
    norm, rows not weighted, exact sign of Coulomb friction, windows of `window` seconds. criterion, value: what
    `excite` minimises. unexcited: columns that this motion can't tell apart in the criterion's models; the condition
    number is then infinite.
    """

    criterion: str
    value: float
    torque_condition: float
    energy_condition: float
    window: float
    margins: Margins
    unexcited: tuple[str, ...]

    @property
    def within_limits(self) -> bool:
        """Whether every limit holds and nothing touches."""
        return self.margins.within

    def summary(self) -> str:
        """One line for people."""
        text = f"torque cond {self.torque_condition:.3g}, energy cond {self.energy_condition:.3g}"
        text += f" with {1000 * self.window:.3g} ms windows"
        near = self.margins
        if near.tightest:
            text += f", {100 * max(near.use.values()):.1f} % of {near.tightest}"
        if near.gaps:
            text += f", {1000 * min(near.gaps.values()):.0f} mm between {near.nearest}"
        return f"{text}; can't tell apart {', '.join(self.unexcited)}" if self.unexcited else text

    def as_dict(self) -> dict[str, Any]:
        """All of it for JSON, null for what is infinite."""
        return {
            "criterion": self.criterion,
            "value": self.value,
            "torque_condition": finite(self.torque_condition),
            "energy_condition": finite(self.energy_condition),
            "window_s": self.window,
            "use": self.margins.use,
            "tightest": self.margins.tightest,
            "gaps_m": self.margins.gaps,
            "nearest": self.margins.nearest,
            "unexcited": list(self.unexcited),
        }


def assess(robot: Robot, trajectory: Trajectory, criterion: str = "both", collision: bool = True) -> Assessment:
    """Look over one period of a motion, on a grid ten times finer than the design's."""
    trajectory = trajectory.for_robot(robot)
    design = Design(robot, criterion, trajectory.period, trajectory.harmonics, collision=collision)
    return assessed(design, trajectory)


def assessed(design: Design, trajectory: Trajectory) -> Assessment:
    """`assess`, with the design at hand."""
    regressor, samples, every = design.regressor, FINER * design.samples, FINER * design.every
    q, dq, ddq = (signal.T for signal in one_period(trajectory, samples))
    power, energy = regressor.power(dq), regressor.energy(q[::every], dq[::every])
    work = (power + np.roll(power, -1, axis=0)).reshape(-1, every, regressor.p).sum(axis=1)
    rows = np.roll(energy, -1, axis=0) - energy + work / 2 * (trajectory.period / samples)
    energy_condition, energy_lost = scaled_condition(rows.T)
    torque_rows = regressor.torque(q[::4], dq[::4], ddq[::4]).reshape(-1, regressor.p)
    torque_condition, torque_lost = scaled_condition(torque_rows.T)
    name = design.criterion.name
    lost = {"torque": torque_lost, "energy": energy_lost, "both": torque_lost | energy_lost}[name]
    return Assessment(
        criterion=name,
        value=design.criterion.value(one_period(trajectory, design.samples)),
        torque_condition=torque_condition,
        energy_condition=energy_condition,
        window=every * trajectory.period / samples,
        margins=design.margins(trajectory),
        unexcited=tuple(np.array(regressor.names)[lost].tolist()),
    )
