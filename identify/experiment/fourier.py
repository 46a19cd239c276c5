"""A Fourier motion as a function of its free coefficients, all of whose values keep it at rest at both ends.

A point x holds, joint by joint, the mean position and the coordinates of a and of b in the null spaces of the rest
constraints Σ a_l = 0 and Σ l·b_l = 0, in units of what the joint's limits allow.
"""

from __future__ import annotations

import numpy as np

from identify.experiment.entries import Motion
from identify.experiment.limits import WorkingLimits
from identify.experiment.trajectory import Trajectory, at_rest


class Fourier:
    """Motions of `joints` with `harmonics` over one period of `duration` [s], on a grid of `samples`."""

    def __init__(
        self, joints: tuple[str, ...], limits: WorkingLimits, duration: float, harmonics: int, samples: int
    ) -> None:
        self.joints, self.limits, self.duration = joints, limits, duration
        self.harmonics, self.samples = harmonics, samples
        self.shape = (len(joints), 2 * harmonics - 1)
        order = np.arange(1, harmonics + 1)
        pulsation = 2 * np.pi * order / duration
        reach = (limits.half[:, None] * pulsation, limits.velocity[:, None], limits.acceleration[:, None] / pulsation)
        size = np.minimum(np.minimum(reach[0], reach[1]), reach[2]) / np.sqrt(harmonics)
        # From a point to a and b, (n, L, L − 1) each, and to the signals, (n, N, 2 L − 1) each.
        self._to_a = np.array([s[:, None] * _null_space(s) for s in size])
        self._to_b = np.array([s[:, None] * _null_space(s * order) for s in size])
        angle = 2 * np.pi * np.arange(samples)[:, None] / samples * order
        sine, cosine = np.sin(angle), np.cos(angle)
        none = np.zeros((len(joints), samples, 1))
        self._basis = tuple(
            np.concatenate([mean, by_a @ self._to_a, by_b @ self._to_b], axis=2)
            for mean, by_a, by_b in (
                (none + limits.half[:, None, None], sine / pulsation, -cosine / pulsation),
                (none, cosine, sine),
                (none, -sine * pulsation, cosine * pulsation),
            )
        )

    def signals(self, x: np.ndarray) -> Motion:
        """q, q̇, q̈ on the grid, each (n, N)."""
        columns = x.reshape(*self.shape, 1)
        q, dq, ddq = ((basis @ columns)[:, :, 0] for basis in self._basis)
        return q + self.limits.middle[:, None], dq, ddq

    def pull_back(self, motion: Motion) -> np.ndarray:
        """Derivative with respect to the point, of something whose derivatives with respect to q, q̇, q̈ are given."""
        total = np.zeros((*self.shape, 1))
        for basis, part in zip(self._basis, motion, strict=True):
            total += basis.transpose(0, 2, 1) @ part[:, :, None]
        return total.ravel()

    def trajectory(
        self, x: np.ndarray, periods: int = 1, rest: float = 0.0, criterion: str = "", seed: int = 0, note: str = ""
    ) -> Trajectory:
        """The motion of a point."""
        rows, free = x.reshape(self.shape), self.harmonics - 1
        a = np.einsum("jlc,jc->jl", self._to_a, rows[:, 1 : 1 + free])
        b = np.einsum("jlc,jc->jl", self._to_b, rows[:, 1 + free :])
        q0 = self.limits.middle + self.limits.half * rows[:, 0]
        return Trajectory(self.joints, q0, *at_rest(a, b), 1 / self.duration, periods, rest, criterion, seed, note)

    def smaller(self, x: np.ndarray, factor: float) -> np.ndarray:
        """The point of the motion about the same mean pose, `factor` times as large."""
        rows = x.reshape(self.shape).copy()
        rows[:, 1:] *= factor
        return rows.ravel()

    def about(self, x: np.ndarray, middle: np.ndarray) -> np.ndarray:
        """The point of the same motion about another mean pose, middle (n,) in shares of half the position ranges."""
        rows = x.reshape(self.shape).copy()
        rows[:, 0] = middle
        return rows.ravel()

    def random_point(self, generator: np.random.Generator, fill: float = 0.8) -> np.ndarray:
        """A random motion about the middle of the ranges, scaled joint by joint to `fill` of the first limit met."""
        rows = generator.standard_normal(self.shape)
        rows[:, 0] = 0.0
        q, dq, ddq = self.signals(rows.ravel())
        limits = self.limits
        shares = ((q - limits.middle[:, None]), limits.half), (dq, limits.velocity), (ddq, limits.acceleration)
        peaks = [np.abs(signal / scale[:, None]).max(axis=1) for signal, scale in shares]
        return (rows * (fill / np.max(peaks, axis=0))[:, None]).ravel()


def one_period(trajectory: Trajectory, samples: int) -> Motion:
    """q, q̇, q̈, each (n, samples), at even steps from the first rest's end, the period's end left out."""
    t = trajectory.rest + np.arange(samples) / samples * trajectory.period
    q, dq, ddq = (np.ascontiguousarray(signal.T) for signal in trajectory.sample(t))
    return q, dq, ddq


def _null_space(row: np.ndarray) -> np.ndarray:
    """(L, L − 1) orthonormal columns that a row (L,) is normal to."""
    return np.linalg.qr(np.column_stack([row, np.eye(len(row))[:, 1:]]))[0][:, 1:]
