"""The regressor at run time: Γ = Y(q, q̇, q̈)·θ and H = h(q, q̇)·θ, linear in base and friction parameters."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from identify.regressor.columns import JointColumns, Sign
from identify.regressor.dependence import dependent_columns
from identify.regressor.kernel import Kernel, blocks
from identify.robot.robot import Drive, Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.energy import energy_regressor
from identify.symbolic.expression import Graph, Scalar
from identify.symbolic.newton_euler import direct_torque, torque_regressor


class Regressor:
    """Torque and energy regressors of a robot, generated from its symbolic models.

    `names` (p,) base parameters, then per joint Fv, Fs, offset, then the transmission's columns; with
    friction=False the base parameters alone. `units` (p,). All arrays are on the joint side, SI, in the robot's
    joint order; q, dq, ddq are (n,) for one sample or (N, n) for many. Nothing beyond the result and one block
    of samples is held in memory.

    `dropped` {column: {kept column: factor}}: columns left out because they are combinations of others: the inertia
    of a motor coupled to two parallel axes, say, or the offset of a vertical sliding joint, whose mass and actuator
    inertia make the same constant force. A kept column's parameter then holds factor × the dropped one besides its
    own.
    """

    def __init__(self, robot: Robot, friction: bool = True) -> None:
        self.robot = robot
        self.base = base_parameters(robot)
        n, kept = robot.n, self.base.kept
        graph = Graph()
        entries = torque_regressor(graph, robot, kept)
        column = {standard: at for at, standard in enumerate(kept)}
        self._torque = Kernel(graph, {(i, column[c]): e for (i, c), e in entries.items()}, n, ("q", "dq", "ddq"))
        energies = energy_regressor(graph, robot)
        self._energy = Kernel(graph, {(0, at): energies[c] for at, c in enumerate(kept)}, n, ("q", "dq"))
        self.extra = JointColumns.of(robot) if friction else None
        self.dropped: dict[str, dict[str, float]] = {}
        candidates = self.extra.doubtful if self.extra else ()
        if self.extra and candidates:
            self.dropped = dependent_columns(self._random_samples(), self.names, candidates)
            self.extra = self.extra.without(self.dropped)

    @property
    def names(self) -> tuple[str, ...]:
        """(p,) names of the columns."""
        return self.base.names + self._extra_names

    @property
    def _extra_names(self) -> tuple[str, ...]:
        return self.extra.names if self.extra else ()

    @property
    def units(self) -> tuple[str, ...]:
        """(p,) units of the parameters."""
        return self.base.units + (self.extra.units if self.extra else ())

    @property
    def p(self) -> int:
        """Number of columns."""
        return len(self.names)

    @property
    def parameters(self) -> np.ndarray:
        """(p,) θ as the robot's description states it: links and drives, no inertia or friction of coupled motors."""
        drives = {f"{c}{j + 1}": x for j, joint in enumerate(self.robot.joints) for c, x in _friction(joint.drive)}
        return self.theta(self.robot.standard, drives)

    def theta(self, standard: np.ndarray, extra: Mapping[str, float]) -> np.ndarray:
        """(p,) θ from standard parameters (11 n,) and values of friction, offset and transmission columns by name.

        A name that is not in `extra` counts as zero; dropped ones are folded into what they are combinations of.
        """
        theta = np.array([*(self.base.matrix @ standard), *(extra.get(name, 0.0) for name in self._extra_names)])
        for name, factors in self.dropped.items():
            for kept, factor in factors.items():
                theta[self.names.index(kept)] += factor * extra.get(name, 0.0)
        return theta

    def torque(
        self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, out: np.ndarray | None = None, sign: Sign = np.sign
    ) -> np.ndarray:
        """Torque regressor Y: (n, p) for one sample, (N, n, p) for many.

        `out` takes the result without allocating it: a float array of that shape, contiguous or not. `sign` is the
        Coulomb columns' function of the velocity, exact by default (sign(0) = 0).
        """
        q, dq, ddq, single = _samples(self.robot.n, q, dq, ddq)
        full = _destination(out, (len(q), self.robot.n, self.p), single)
        evaluate = self._torque.workspace(len(q))
        for rows in blocks(len(q)):
            values = evaluate(q[rows], dq[rows], ddq[rows])
            self._fill(full[rows], values, dq[rows], ddq[rows], sign)
        return full[0] if single and out is None else full if out is None else out

    def energy(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """Energy functions h [2.93] of the base parameters, up to a constant: (p,) for one sample, (N, p) for many.

        State functions alone: friction and offset columns are zero.
        """
        q, dq, single = _samples(self.robot.n, q, dq)
        full = np.zeros((len(q), self.p))
        inertial = len(self.base.names)
        evaluate = self._energy.workspace(len(q))
        for rows in blocks(len(q)):
            full[rows, self._energy.column] = evaluate(q[rows], dq[rows]).T
            if self.extra:
                self.extra.energy(full[rows, inertial:], dq[rows])
        return full[0] if single else full

    def power(self, dq: np.ndarray, sign: Sign = np.sign) -> np.ndarray:
        """Power q̇ᵀΓ [W] per unit of each friction and offset parameter, zero for inertial ones: (p,) or (N, p).

        q̇ᵀΓ = d(energy·θ)/dt + power·θ.
        """
        dq, single = _samples(self.robot.n, dq)
        full = np.zeros((len(dq), self.p))
        if self.extra:
            for rows in blocks(len(dq)):
                self.extra.power(full[rows, len(self.base.names) :], dq[rows], sign)
        return full[0] if single else full

    def slotine_li(
        self, q: np.ndarray, dq: np.ndarray, dq_ref: np.ndarray, ddq_ref: np.ndarray, sign: Sign = np.sign
    ) -> np.ndarray:
        """(n, p) or (N, n, p): A(q)·q̈_ref + C(q,q̇)·q̇_ref + Q(q) = Ys·θ, C by Christoffel symbols, friction at q̇.

        The Christoffel form is the symmetric bilinear form of the quadratic C(q,u)·u, so that polarisation gives
        it: C(q,u)·v = ¼ [C(q,u+v)·(u+v) − C(q,u−v)·(u−v)] (Slotine & Li 1987).
        """
        q, dq, dq_ref, ddq_ref, single = _samples(self.robot.n, q, dq, dq_ref, ddq_ref)
        full = _destination(None, (len(q), self.robot.n, self.p), single)
        evaluate = self._torque.workspace(len(q))
        for rows in blocks(len(q)):
            here, u, v = q[rows], dq[rows], dq_ref[rows]
            still = np.zeros_like(here)
            values = evaluate(here, still, ddq_ref[rows]).copy()
            values += 0.25 * evaluate(here, u + v, still)
            values -= 0.25 * evaluate(here, u - v, still)
            self._fill(full[rows], values, u, ddq_ref[rows], sign)
        return full[0] if single else full

    def inverse_dynamics(
        self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, theta: np.ndarray, sign: Sign = np.sign
    ) -> np.ndarray:
        """Joint effort Γ = Y·θ without storing Y: (n,) for one sample, (N, n) for many.

        theta (p,) in the order of `names`.
        """
        q, dq, ddq, single = _samples(self.robot.n, q, dq, ddq)
        theta = np.asarray(theta, dtype=float)
        if theta.shape != (self.p,):
            raise ValueError(f"theta has shape {theta.shape}; expected ({self.p},), in the order of Regressor.names")
        inertial = len(self.base.names)
        effort = np.zeros((len(q), self.robot.n))
        evaluate = self._recurrence.workspace(len(q))
        for rows in blocks(len(q)):
            values = evaluate(q[rows], dq[rows], ddq[rows], constants=theta[:inertial])
            effort[rows, self._recurrence.row] = values.T
            if self.extra:
                self.extra.add_effort(effort[rows], dq[rows], ddq[rows], theta[inertial:], sign)
        return effort[0] if single else effort

    @cached_property
    def _recurrence(self) -> Kernel:
        """The backward recurrence with the base parameters for the standard ones of their names, the others zero."""
        graph = Graph()
        standard: list[Scalar] = [0] * (11 * self.robot.n)
        for at, c in enumerate(self.base.kept):
            standard[c] = graph.symbol(f"K{at + 1}")
        entries = {(j, 0): effort for j, effort in enumerate(direct_torque(graph, self.robot, standard))}
        return Kernel(graph, entries, self.robot.n, ("q", "dq", "ddq"), len(self.base.kept))

    def _fill(self, full: np.ndarray, values: np.ndarray, dq: np.ndarray, ddq: np.ndarray, sign: Sign) -> None:
        """Put a block's entries (entries, m) and its friction columns where they belong in full (m, n, p)."""
        inertial = len(self.base.names)
        full[:, :, :inertial] = 0.0
        full[:, self._torque.row, self._torque.column] = values.T
        if self.extra:
            self.extra.torque(full[:, :, inertial:], dq, ddq, sign)

    def _random_samples(self) -> np.ndarray:
        """(rows, p) of the torque regressor at random states, twice as many rows as columns at least."""
        n, count = self.robot.n, 2 * self.p // self.robot.n + 10
        q, dq, ddq = np.random.default_rng(0).uniform(-1.0, 1.0, (3, count, n))
        turn = np.array([np.pi if joint.revolute else 1.0 for joint in self.robot.joints])
        return self.torque(turn * q, 2 * dq, 3 * ddq).reshape(count * n, self.p)


def _friction(drive: Drive) -> tuple[tuple[str, float], ...]:
    return ("Fv", drive.viscous), ("Fs", drive.coulomb), ("off", drive.offset)


def _samples(n: int, *signals: np.ndarray) -> tuple:
    """The signals as (N, n) float arrays, and whether they came as single samples."""
    arrays = [np.asarray(s, dtype=float) for s in signals]
    if any(a.shape != arrays[0].shape for a in arrays) or arrays[0].ndim not in (1, 2) or arrays[0].shape[-1] != n:
        shapes = ", ".join(str(a.shape) for a in arrays)
        raise ValueError(f"arrays of shapes {shapes}; expected ({n},) or (N, {n}), all alike")
    return (*(np.atleast_2d(a) for a in arrays), arrays[0].ndim == 1)


def _destination(out: np.ndarray | None, shape: tuple[int, int, int], single: bool) -> np.ndarray:
    """The array (N, n, p) to fill: a new one, or a view of `out`, which must have the result's shape and be float."""
    if out is None:
        return np.empty(shape)
    expected = shape[1:] if single else shape
    if out.shape != expected or out.dtype != np.float64:
        raise ValueError(f"out is {out.dtype} of shape {out.shape}; expected float64 of shape {expected}")
    return out[None] if single else out
