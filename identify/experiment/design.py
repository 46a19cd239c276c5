"""One period of a Fourier motion as a function of its free coefficients: what it tells, and what it asks of the robot.

A point x holds, joint by joint, the mean position and the coordinates of a and of b in the null spaces of the rest
constraints Σ a_l = 0 and Σ l·b_l = 0, in units of what the joint's limits allow.
"""

from __future__ import annotations

from math import ceil, floor

import numpy as np

from identify.experiment.information import (
    EnergyModel,
    Motion,
    TorqueModel,
    log_variance,
    reference_factor,
    scaled_condition,
)
from identify.experiment.limits import working_limits
from identify.experiment.trajectory import Trajectory, at_rest, random_trajectory
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

ALLOWED = 0.99
"""Share of each limit that a finished design may use, looked at between the samples too."""

FINER = 10
"""How many times finer than the design's the grid is that a finished motion is judged on."""

REFERENCES = 6
"""Random motions whose torque the parameters are meant to predict."""


class Design:
    """What a point is worth under a criterion ("torque", "energy" or "both"), with exact derivatives."""

    def __init__(self, robot: Robot, criterion: str, duration: float, harmonics: int) -> None:
        self.robot, self.criterion, self.duration, self.harmonics = robot, criterion, duration, harmonics
        self.regressor = Regressor(robot)
        self.limits = limits = working_limits(robot)
        self.samples, self.every = _grid(duration, harmonics, self.regressor.p)
        self.shape = (robot.n, 2 * harmonics - 1)
        step = duration / self.samples
        width = np.maximum(limits.acceleration * step, 0.01 * limits.velocity)
        self.torque = TorqueModel(self.regressor, self.samples, width)
        self.energy = EnergyModel(self.regressor, self.samples, self.every, step, width, limits.velocity)
        self._set_basis()
        self._set_effort()
        self._set_reference()

    def _set_basis(self) -> None:
        """Maps from a point to a and b, (n, L, L − 1) each, and to the signals, (n, N, 2 L − 1) each."""
        limits, order = self.limits, np.arange(1, self.harmonics + 1)
        pulsation = 2 * np.pi * order / self.duration
        reach = (limits.half[:, None] * pulsation, limits.velocity[:, None], limits.acceleration[:, None] / pulsation)
        size = np.minimum(np.minimum(reach[0], reach[1]), reach[2]) / np.sqrt(self.harmonics)
        self.to_a = np.array([s[:, None] * _null_space(s) for s in size])
        self.to_b = np.array([s[:, None] * _null_space(s * order) for s in size])
        angle = 2 * np.pi * np.arange(self.samples)[:, None] / self.samples * order
        sine, cosine = np.sin(angle), np.cos(angle)
        none = np.zeros((self.robot.n, self.samples, 1))
        self.basis = tuple(
            np.concatenate([mean, by_a @ self.to_a, by_b @ self.to_b], axis=2)
            for mean, by_a, by_b in (
                (none + limits.half[:, None, None], sine / pulsation, -cosine / pulsation),
                (none, cosine, sine),
                (none, -sine * pulsation, cosine * pulsation),
            )
        )
        self.scales = (limits.half[:, None], limits.velocity[:, None], limits.acceleration[:, None])

    def _set_effort(self) -> None:
        """Parameters of the effort but for Coulomb friction, and limits (n,) less the most that this can add."""
        terms = self.torque.terms
        self.smooth = self.regressor.parameters.copy()
        coulomb = np.abs(self.smooth[terms.coulomb_at]) @ np.abs(terms.arms)
        self.smooth[terms.coulomb_at] = 0.0
        self.room = np.maximum(self.limits.effort - coulomb / (1 - MARGIN), 0.05 * self.limits.effort)

    def _set_reference(self) -> None:
        """Sizes of the columns, and the rows that stand for the torque of motions of this kind."""
        hz, order = 1 / self.duration, self.harmonics
        random = (
            random_trajectory(self.robot, 1000 + k, fundamental_hz=hz, harmonics=order) for k in range(REFERENCES)
        )
        motions = [one_period(trajectory, self.samples) for trajectory in random]
        weight, p = self.torque.weight[:, None], self.regressor.p
        torque = np.concatenate([(self.torque.columns(m) * weight).reshape(p, -1) for m in motions], axis=1)
        energy = np.concatenate([self.energy.columns(m) for m in motions], axis=1)
        self.torque_scale, self.energy_scale = (_column_scale(columns, REFERENCES) for columns in (torque, energy))
        self.reference = reference_factor(torque)

    def signals(self, x: np.ndarray) -> Motion:
        """q, q̇, q̈ on the grid, each (n, N)."""
        columns = x.reshape(*self.shape, 1)
        q, dq, ddq = ((basis @ columns)[:, :, 0] for basis in self.basis)
        return q + self.limits.middle[:, None], dq, ddq

    def trajectory(
        self, x: np.ndarray, periods: int = 1, rest: float = 0.0, seed: int = 0, note: str = ""
    ) -> Trajectory:
        """The motion of a point."""
        rows, free = x.reshape(self.shape), self.harmonics - 1
        a = np.einsum("jlc,jc->jl", self.to_a, rows[:, 1 : 1 + free])
        b = np.einsum("jlc,jc->jl", self.to_b, rows[:, 1 + free :])
        q0 = self.limits.middle + self.limits.half * rows[:, 0]
        names = self.robot.joint_names
        return Trajectory(names, q0, *at_rest(a, b), 1 / self.duration, periods, rest, self.criterion, seed, note)

    def random_point(self, generator: np.random.Generator, fill: float = 0.8) -> np.ndarray:
        """A random motion about the middle of the ranges, scaled joint by joint to `fill` of the first limit met."""
        rows = generator.standard_normal(self.shape)
        rows[:, 0] = 0.0
        q, dq, ddq = self.signals(rows.ravel())
        motion = (q - self.limits.middle[:, None], dq, ddq)
        peaks = [np.abs(signal / scale).max(axis=1) for signal, scale in zip(motion, self.scales, strict=True)]
        return (rows * (fill / np.max(peaks, axis=0))[:, None]).ravel()

    def value(self, motion: Motion) -> float:
        """The criterion of a motion on the grid, in log variance a parameter: the smaller the better."""
        return self._worth(motion, self.torque.columns(motion))[0]

    def condition(self, x: np.ndarray) -> str:
        """Column-scaled condition numbers of the criterion's models, in words."""
        motion, words = self.signals(x), []
        if self.criterion != "energy":
            columns = self.torque.columns(motion).reshape(self.regressor.p, -1)
            words.append(f"torque cond {scaled_condition(columns)[0]:.3g}")
        if self.criterion != "torque":
            columns = self.energy.unweighted(motion)[0]
            words.append(f"energy cond {scaled_condition(columns)[0]:.3g}")
        return ", ".join(words)

    def excess(self, x: np.ndarray) -> np.ndarray:
        """(4 n, N) how far position, velocity, acceleration and effort of each joint are beyond the limits less
        MARGIN, as shares of the limits; negative inside."""
        motion = self.signals(x)
        return np.abs(self._shares(motion, self.torque.columns(motion))) - (1 - MARGIN)

    def lagrangian(
        self, x: np.ndarray, weight: float, multipliers: np.ndarray | float = 0.0
    ) -> tuple[float, np.ndarray]:
        """Augmented Lagrangian (Rockafellar 1973) of criterion and limits, and its gradient.

        weight of the squared excesses, multipliers (4 n, N) of the excesses; both count as means over the samples.
        """
        motion = self.signals(x)
        columns = self.torque.columns(motion)
        value, to_columns, to_motion = self._worth(motion, columns)
        shares = self._shares(motion, columns)
        force = np.maximum(0.0, multipliers + weight * (np.abs(shares) - (1 - MARGIN)))
        value += np.sum(force**2 - np.square(multipliers)) / (2 * weight * self.samples)
        *direct, by_effort = np.split(force * np.sign(shares) / self.samples, 4)
        to_columns += self.smooth[:, None, None] * (by_effort / self.room[:, None])
        pulled = self.torque.pull_back(motion, to_columns)
        total = np.zeros((*self.shape, 1))
        for basis, one, other, third, scale in zip(self.basis, pulled, to_motion, direct, self.scales, strict=True):
            total += basis.transpose(0, 2, 1) @ (one + other + third / scale)[:, :, None]
        return value, total.ravel()

    def use(self, trajectory: Trajectory) -> tuple[dict[str, float], str]:
        """Worst share of the robot's own limits of each kind over a period, 0 where there is none; and the largest
        one's joint and kind."""
        q, dq, ddq = (signal.T for signal in one_period(trajectory, FINER * self.samples))
        effort = self.regressor.inverse_dynamics(q, dq, ddq, self.regressor.parameters)
        own = [joint.limits for joint in self.robot.joints]
        middle, half = self.limits.middle, self.limits.half
        below = np.where([np.isfinite(limits.position[0]) for limits in own], (middle - q) / half, 0.0)
        above = np.where([np.isfinite(limits.position[1]) for limits in own], (q - middle) / half, 0.0)
        shares = {
            "position": np.maximum(below, above),
            "velocity": np.abs(dq) / [limits.velocity for limits in own],
            "acceleration": np.abs(ddq) / [limits.acceleration for limits in own],
            "effort": np.abs(effort) / [limits.effort for limits in own],
        }
        worst = {kind: float(np.max(share)) for kind, share in shares.items()}
        kind = max(worst, key=lambda kind: worst[kind])
        joint = int(np.argmax(shares[kind].max(axis=0)))
        return worst, f"{self.robot.joint_names[joint]}'s {kind}" if worst[kind] > 0 else ""

    def inside(self, x: np.ndarray) -> tuple[np.ndarray, float]:
        """The point with its motion about the mean pose made smaller, as little as it takes to hold all limits; and
        the worst share of a limit that is left."""

        def smaller(factor: float) -> tuple[np.ndarray, float]:
            rows = x.reshape(self.shape).copy()
            rows[:, 1:] *= factor
            return rows.ravel(), max(self.use(self.trajectory(rows.ravel()))[0].values())

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

    def _shares(self, motion: Motion, columns: np.ndarray) -> np.ndarray:
        """(4 n, N) position, velocity, acceleration and effort, each as a signed share of its limit."""
        q, dq, ddq = motion
        effort = np.tensordot(self.smooth, columns, 1)
        signals = (q - self.limits.middle[:, None], dq, ddq, effort)
        scales = (*self.scales, self.room[:, None])
        return np.concatenate([signal / scale for signal, scale in zip(signals, scales, strict=True)])

    def _worth(self, motion: Motion, columns: np.ndarray) -> tuple[float, np.ndarray, Motion]:
        """The criterion, and its derivatives with respect to the torque model's columns and, by way of the energy
        model, to the motion."""
        value, to_columns = 0.0, np.zeros_like(columns)
        to_motion: Motion = (np.zeros_like(motion[0]),) * 3
        share = 0.5 if self.criterion == "both" else 1.0
        if self.criterion != "energy":
            scale = np.outer(self.torque_scale / np.sqrt(self.samples), self.torque.weight)[:, :, None]
            rows = (columns * scale).reshape(len(columns), -1)
            worth, to_rows = log_variance(rows, self.reference * self.torque_scale)
            value += share * worth
            to_columns = to_rows.reshape(columns.shape) * (share * scale)
        if self.criterion != "torque":
            scale = (self.energy_scale / np.sqrt(self.samples // self.every))[:, None]
            worth, to_rows = log_variance(self.energy.columns(motion) * scale, self.reference * self.energy_scale)
            value += share * worth
            to_motion = self.energy.pull_back(motion, share * to_rows * scale)
        return float(value), to_columns, to_motion


def one_period(trajectory: Trajectory, samples: int) -> Motion:
    """q, q̇, q̈, each (n, samples), at even steps from the first rest's end, the period's end left out."""
    t = trajectory.rest + np.arange(samples) / samples * trajectory.period
    q, dq, ddq = (np.ascontiguousarray(signal.T) for signal in trajectory.sample(t))
    return q, dq, ddq


def _grid(duration: float, harmonics: int, p: int) -> tuple[int, int]:
    """Samples of a period, and of a window: enough for the harmonics, and half as many windows again as columns."""
    samples = max(PER_CYCLE * harmonics, min(MOST_SAMPLES, ceil(duration / WINDOW)), ceil(1.5 * p))
    every = max(1, min(floor(WINDOW * samples / duration + 1e-9), samples // ceil(1.5 * p)))
    return every * ceil(samples / every), every


def _null_space(row: np.ndarray) -> np.ndarray:
    """(L, L − 1) orthonormal columns that a row (L,) is normal to."""
    return np.linalg.qr(np.column_stack([row, np.eye(len(row))[:, 1:]]))[0][:, 1:]


def _column_scale(columns: np.ndarray, motions: int) -> np.ndarray:
    """(p,) factors that bring the norm of each column (p, K) over one of several motions to 1 on average."""
    norm = np.sqrt(np.sum(columns**2, axis=1) / motions)
    return 1 / np.where(norm > 0, norm, 1.0)
