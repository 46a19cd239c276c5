"""The regressor at run time: Γ = Y(q, q̇, q̈)·θ and H = h(q, q̇)·θ, linear in base and friction parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from identify.regressor.columns import JointColumns, Sign
from identify.robot.robot import Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.energy import energy_regressor
from identify.symbolic.expression import Expression, Graph, Scalar
from identify.symbolic.newton_euler import torque_regressor
from identify.symbolic.printing import compiled

BLOCK = 512
"""Samples worked on at a time: small enough for the cache, large enough to hide NumPy's overhead."""


class Regressor:
    """Torque and energy regressors of a robot, generated from its symbolic models.

    `names` (p,) base parameters, then per joint Fv, Fs, offset, then the transmission's columns; with
    friction=False the base parameters alone. `units` (p,). All arrays are on the joint side, SI, in the robot's
    joint order; q, dq, ddq are (n,) for one sample or (N, n) for many. Nothing beyond the result and one block
    of samples is held in memory.
    """

    def __init__(self, robot: Robot, friction: bool = True) -> None:
        self.robot = robot
        self.base = base_parameters(robot)
        self.extra = JointColumns.of(robot) if friction else None
        self.names: tuple[str, ...] = self.base.names + (self.extra.names if self.extra else ())
        self.units: tuple[str, ...] = self.base.units + (self.extra.units if self.extra else ())
        n, kept = robot.n, self.base.kept
        graph = Graph()
        entries = torque_regressor(graph, robot, kept)
        column = {standard: at for at, standard in enumerate(kept)}
        self._torque = _Kernel(graph, {(i, column[c]): e for (i, c), e in entries.items()}, n, ("q", "dq", "ddq"))
        energies = energy_regressor(graph, robot)
        self._energy = _Kernel(graph, {(0, at): energies[c] for at, c in enumerate(kept)}, n, ("q", "dq"))

    @property
    def p(self) -> int:
        """Number of columns."""
        return len(self.names)

    def torque(
        self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, out: np.ndarray | None = None, sign: Sign = np.sign
    ) -> np.ndarray:
        """Torque regressor Y: (n, p) for one sample, (N, n, p) for many.

        `out` takes the result without allocating it; `sign` is the Coulomb columns' function of the velocity,
        exact by default (sign(0) = 0).
        """
        q, dq, ddq, single = _samples(self.robot.n, q, dq, ddq)
        shape = (len(q), self.robot.n, self.p)
        full = np.empty(shape) if out is None else out.reshape(shape)
        inertial = len(self.base.names)
        full[:, :, :inertial] = 0.0
        for rows, values in self._torque.blocks(q, dq, ddq):
            full[rows, self._torque.row, self._torque.column] = values.T
        if self.extra:
            self.extra.torque(full[:, :, inertial:], dq, ddq, sign)
        return full[0] if single and out is None else full if out is None else out

    def energy(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """Energy functions h [2.93] of the base parameters, up to a constant: (p,) for one sample, (N, p) for many.

        State functions alone: friction and offset columns are zero.
        """
        q, dq, single = _samples(self.robot.n, q, dq)
        full = np.zeros((len(q), self.p))
        for rows, values in self._energy.blocks(q, dq):
            full[rows, self._energy.column] = values.T
        if self.extra:
            full[:, len(self.base.names) :] = self.extra.energy(dq)
        return full[0] if single else full

    def power(self, dq: np.ndarray, sign: Sign = np.sign) -> np.ndarray:
        """Power q̇ᵀΓ per unit of each friction and offset parameter, zero for inertial ones: (N, p) from dq (N, n)."""
        full = np.zeros((len(dq), self.p))
        if self.extra:
            full[:, len(self.base.names) :] = self.extra.power(dq, sign)
        return full

    def slotine_li(self, q: np.ndarray, dq: np.ndarray, dq_ref: np.ndarray, ddq_ref: np.ndarray) -> np.ndarray:
        """(n, p) or (N, n, p): A(q)·q̈_ref + C(q,q̇)·q̇_ref + Q(q) = Ys·θ, C by Christoffel symbols, friction at q̇.

        The Christoffel form is the symmetric bilinear form of the quadratic C(q,u)·u, so that polarisation gives
        it: C(q,u)·v = ¼ [C(q,u+v)·(u+v) − C(q,u−v)·(u−v)] (Slotine & Li 1987).
        """
        q, dq, dq_ref, ddq_ref, single = _samples(self.robot.n, q, dq, dq_ref, ddq_ref)
        still = np.zeros_like(q)
        full = self.torque(q, still, ddq_ref)
        inertial = len(self.base.names)
        full[:, :, :inertial] += 0.25 * (
            self.torque(q, dq + dq_ref, still)[:, :, :inertial] - self.torque(q, dq - dq_ref, still)[:, :, :inertial]
        )
        if self.extra:
            self.extra.torque(full[:, :, inertial:], dq, ddq_ref, np.sign)
        return full[0] if single else full

    def inverse_dynamics(
        self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, theta: np.ndarray, sign: Sign = np.sign
    ) -> np.ndarray:
        """Joint effort Γ = Y·θ without storing Y: (n,) for one sample, (N, n) for many; theta (p,) in the order of names."""
        q, dq, ddq, single = _samples(self.robot.n, q, dq, ddq)
        theta = np.asarray(theta, dtype=float)
        if theta.shape != (self.p,):
            raise ValueError(f"theta has shape {theta.shape}; expected ({self.p},), in the order of Regressor.names")
        inertial = len(self.base.names)
        weights = np.zeros((self.robot.n, len(self._torque.row)))
        weights[self._torque.row, np.arange(len(self._torque.row))] = theta[self._torque.column]
        effort = np.empty((len(q), self.robot.n))
        for rows, values in self._torque.blocks(q, dq, ddq):
            effort[rows] = (weights @ values).T
            if self.extra:
                block = np.empty((values.shape[1], self.robot.n, self.p - inertial))
                self.extra.torque(block, dq[rows], ddq[rows], sign)
                effort[rows] += block @ theta[inertial:]
        return effort[0] if single else effort


class _Kernel:
    """Generated code for the entries of a regressor that are not zero, and where they belong."""

    def __init__(self, graph: Graph, entries: dict[tuple[int, int], Scalar], n: int, inputs: Sequence[str]) -> None:
        live: dict[tuple[int, int], Expression] = {}
        for at, entry in entries.items():
            expression = entry if isinstance(entry, Expression) else graph.constant(entry)
            if expression.value != 0:
                live[at] = expression
        self.row = np.array([i for i, _ in live], dtype=int)
        self.column = np.array([k for _, k in live], dtype=int)
        names = {f"{prefix}{j + 1}": i * n + j for i, prefix in enumerate(inputs) for j in range(n)}
        self.function: Callable
        self.function, self.work = compiled("regressor", names, list(live.values()))

    def blocks(self, *signals: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
        """Sample ranges, and the entries' values (entries, samples) there, in a buffer that is used again."""
        size = min(BLOCK, len(signals[0]))
        x = np.empty((sum(s.shape[1] for s in signals), size))
        out, work = np.empty((len(self.row), size)), np.empty((self.work, size))
        for start in range(0, len(signals[0]), BLOCK):
            rows = slice(start, min(start + BLOCK, len(signals[0])))
            m = rows.stop - start
            np.concatenate([s[rows].T for s in signals], out=x[:, :m])
            self.function(x[:, :m], out[:, :m], work[:, :m])
            yield rows, out[:, :m]


def _samples(n: int, *signals: np.ndarray) -> tuple:
    """The signals as (N, n) float arrays, and whether they came as single samples."""
    arrays = [np.asarray(s, dtype=float) for s in signals]
    if any(a.shape != arrays[0].shape for a in arrays) or arrays[0].ndim not in (1, 2) or arrays[0].shape[-1] != n:
        shapes = ", ".join(str(a.shape) for a in arrays)
        raise ValueError(f"arrays of shapes {shapes}; expected ({n},) or (N, {n}), all alike")
    return (*(np.atleast_2d(a) for a in arrays), arrays[0].ndim == 1)
