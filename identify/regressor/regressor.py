"""The regressor at run time: Γ = Y(q, q̇, q̈)·θ and H = h(q, q̇)·θ, linear in base and friction parameters."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from identify.regressor.backend import Backend
from identify.regressor.columns import JointColumns
from identify.regressor.dependence import dependent_columns
from identify.regressor.friction import LOAD, USUAL, FrictionConstants, Presliding, Sign, further_forms
from identify.regressor.kernel import Kernel, blocks
from identify.robot.robot import Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.energy import energy_regressor
from identify.symbolic.expression import Graph, Scalar
from identify.symbolic.joint_effort import joint_parameters, shared_energy
from identify.symbolic.newton_euler import direct_torque, torque_regressor
from identify.symbolic.operations import lifted
from identify.symbolic.polarisation import bilinear_in_rates


class Regressor:
    """Torque and energy regressors of a robot, generated from its symbolic models.

    `names` (p,) base parameters, then per joint Fv, Fs, offset, then the transmission's columns; with
    friction=False the base parameters alone. friction may also name forms of friction, of those in
    `identify.regressor.friction`: "cube_root", Fc·sign(q̇)·|q̇|^⅓, "presliding", Fp·z with z of `presliding`,
    "stribeck", "asymmetric" and "load". Their columns stand behind all others, per joint and then per coupled motor
    with Coulomb friction (Fcm, Fpm …); the plain forms are always there. constants: what they depend on beside their
    parameters. `units` (p,). All arrays are on the joint side, SI, in the robot's joint order; q, dq, ddq are (n,) for
    one sample or (N, n) for many. Nothing beyond the result and one block of samples is held in memory.

    `forms`: the further forms of friction. `dropped` {column: {kept column: factor}}: columns left out because they
    are combinations of others: the inertia of a motor coupled to two parallel axes, say, or the offset of a vertical
    sliding joint, whose mass and actuator inertia make the same constant force. A kept column's parameter then holds
    factor × the dropped one besides its own: gravity and energy computed with it include that offset.
    """

    def __init__(
        self,
        robot: Robot,
        friction: bool | Collection[str] = True,
        compiler: bool | None = None,
        constants: FrictionConstants | None = None,
    ) -> None:
        self.robot = robot
        self.base = base_parameters(robot)
        self._compiler = compiler
        self._backend = Backend(compiler)
        self.forms = further_forms(friction)
        self.extra = JointColumns.of(robot) if friction is not False else None
        self.dropped: dict[str, dict[str, float]] = {}
        candidates = self.extra.doubtful if self.extra else ()
        if self.extra and candidates:
            self.dropped = dependent_columns(self._random_samples(), self.names, candidates)
            self.extra = self.extra.without(self.dropped)
            if self.dropped or self.forms:
                del self._torque, self.names, self.p  # made with all plain columns
        if self.extra:
            self.extra = replace(self.extra.with_forms(self.forms), constants=constants or USUAL)

    def with_forms(self, forms: Collection[str], constants: FrictionConstants | None = None) -> Regressor:
        """The same robot's regressor with these further forms of friction and their constants."""
        if self.extra is None or further_forms(forms) != self.forms:
            return Regressor(self.robot, forms, self._compiler, constants)
        other = copy(self)  # shares what was generated, which knows no constants
        other.extra = replace(self.extra, constants=constants or USUAL)
        return other

    @property
    def constants(self) -> FrictionConstants:
        """What friction depends on beside its parameters."""
        return self.extra.constants if self.extra else USUAL

    @property
    def backend(self) -> str:
        """What computes: "C (its compiler)", or "NumPy" with the reason."""
        return str(self._backend)

    @cached_property
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

    @cached_property
    def p(self) -> int:
        """Number of columns."""
        return len(self.names)

    @property
    def parameters(self) -> np.ndarray:
        """(p,) θ as the robot's description states it: links, drives and coupled motors."""
        return self.theta(self.robot.standard, joint_parameters(self.robot))

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
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        out: np.ndarray | None = None,
        sign: Sign = np.sign,
        slip: np.ndarray | None = None,
    ) -> np.ndarray:
        """Torque regressor Y: (n, p) for one sample, (N, n, p) for many.

        `out` takes the result without allocating it: a float array of that shape, contiguous or not. `sign` is the
        Coulomb columns' function of the velocity, exact by default (sign(0) = 0). `slip` is what presliding columns
        read, as `presliding` gives it; by default the sign, which is its value in steady sliding.
        """
        q, dq, ddq, single = _samples(self.robot.n, q, dq, ddq)
        if single:
            if out is not None:
                _check(out, (self.robot.n, self.p))
            return self._torque.one(out, q, dq, ddq, *self._signals(q, dq, ddq, sign, slip))
        if out is None:
            out = np.empty((len(q), self.robot.n, self.p))
        _check(out, (len(q), self.robot.n, self.p))
        fill = self._torque.filler(out)
        for rows in blocks(len(q)):
            fill(rows, q[rows], dq[rows], ddq[rows], *self._signals(q[rows], dq[rows], ddq[rows], sign, slip, rows))
        return out

    def energy(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """Energy functions h [2.93] of the base parameters, up to a constant: (p,) for one sample, (N, p) for many.

        State functions alone: friction and offset columns are zero.
        """
        q, dq, single = _samples(self.robot.n, q, dq)
        if single:
            return self._energy.one(None, q, dq)[0]
        full = np.empty((len(q), 1, self.p))
        fill = self._energy.filler(full)
        for rows in blocks(len(q)):
            fill(rows, q[rows], dq[rows])
        return full[:, 0]

    def power(
        self,
        dq: np.ndarray,
        sign: Sign = np.sign,
        slip: np.ndarray | None = None,
        load: np.ndarray | None = None,
    ) -> np.ndarray:
        """Power q̇ᵀΓ [W] per unit of each friction and offset parameter, zero for inertial ones: (p,) or (N, p).

        q̇ᵀΓ = d(energy·θ)/dt + power·θ. load: as `load` gives it, by default the mean.
        """
        dq, single = _samples(self.robot.n, dq)
        if single:
            return self.power(dq[None], sign, *(None if x is None else x[None] for x in (slip, load)))[0]
        full = np.zeros((len(dq), self.p))
        if self.extra:
            for rows in blocks(len(dq)):
                states = (None if x is None else x[rows] for x in (slip, load))
                self.extra.power(full[rows, len(self.base.names) :], dq[rows], sign, *states)
        return full

    def slotine_li(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        dq_ref: np.ndarray,
        ddq_ref: np.ndarray,
        sign: Sign = np.sign,
        slip: np.ndarray | None = None,
    ) -> np.ndarray:
        """(n, p) or (N, n, p): A(q)·q̈_ref + C(q,q̇)·q̇_ref + Q(q) = Ys·θ, C by Christoffel symbols, friction at q̇.

        The Christoffel form is the symmetric bilinear form of the quadratic C(q,u)·u, so that polarisation gives
        it: C(q,u)·v = ¼ [C(q,u+v)·(u+v) − C(q,u−v)·(u−v)] (Slotine & Li 1987).
        """
        q, dq, dq_ref, ddq_ref, single = _samples(self.robot.n, q, dq, dq_ref, ddq_ref)
        if single:
            signals = self._signals(q, dq, ddq_ref, sign, slip)
            return self._slotine_li.one(None, q, dq, dq_ref, ddq_ref, *signals)
        full = np.empty((len(q), self.robot.n, self.p))
        fill = self._slotine_li.filler(full)
        for rows in blocks(len(q)):
            signals = self._signals(q[rows], dq[rows], ddq_ref[rows], sign, slip, rows)
            fill(rows, q[rows], dq[rows], dq_ref[rows], ddq_ref[rows], *signals)
        return full

    def inverse_dynamics(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        theta: np.ndarray,
        sign: Sign = np.sign,
        slip: np.ndarray | None = None,
    ) -> np.ndarray:
        """Joint effort Γ = Y·θ without storing Y: (n,) for one sample, (N, n) for many.

        theta (p,) in the order of `names`.
        """
        q, dq, ddq, single = _samples(self.robot.n, q, dq, ddq)
        theta = np.asarray(theta, dtype=float)
        if theta.shape != (self.p,):
            raise ValueError(f"theta has shape {theta.shape}; expected ({self.p},), in the order of Regressor.names")
        if single:
            return self._recurrence.one(None, q, dq, ddq, *self._signals(q, dq, ddq, sign, slip), constants=theta)[:, 0]
        effort = np.empty((len(q), self.robot.n, 1))
        fill = self._recurrence.filler(effort)
        for rows in blocks(len(q)):
            signals = self._signals(q[rows], dq[rows], ddq[rows], sign, slip, rows)
            fill(rows, q[rows], dq[rows], ddq[rows], *signals, constants=theta)
        return effort[:, :, 0]

    @cached_property
    def supports(self) -> tuple[np.ndarray, ...]:
        """Of each joint, the columns (s,) that its row of the torque regressor touches: those of the links it moves."""
        kernel = self._torque
        return tuple(kernel.column[kernel.row == j] for j in range(self.robot.n))

    def rows(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        effort: np.ndarray,
        sign: Sign = np.sign,
        slip: np.ndarray | None = None,
    ) -> Iterator[list[np.ndarray]]:
        """Block by block of samples, each joint's rows of Γ = Y·θ, transposed: (s + 1, m) for m samples, the columns
        of its support and then the effort. Signals and effort (N, n). The next block takes the place of the last."""
        q, dq, ddq, effort, single = _samples(self.robot.n, q, dq, ddq, effort)
        if single:
            q, dq, ddq, effort = q[None], dq[None], ddq[None], effort[None]
        ends = np.cumsum([len(support) + 1 for support in self.supports])
        kernel = self._torque
        evaluate = kernel.workspace(len(q), np.arange(len(kernel.row)) + kernel.row, int(ends[-1]))
        for block in blocks(len(q)):
            signals = self._signals(q[block], dq[block], ddq[block], sign, slip, block)
            values = evaluate(q[block], dq[block], ddq[block], *signals)
            values[ends - 1] = effort[block].T
            yield np.split(values, ends[:-1])

    def presliding(self, distance: float) -> Presliding:
        """What gives `slip` along positions, called with one after the other or with many.

        distance [rad or m]: how far a joint creeps before it slides. A controller makes one, `slide`, and calls
        `inverse_dynamics(q, dq, ddq, theta, sign, slide(q))` every tick.
        """
        return Presliding(distance, self.extra.speeds if self.extra else np.asarray)

    def _signals(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        sign: Sign,
        slip: np.ndarray | None,
        rows: slice | None = None,
    ) -> tuple[np.ndarray, ...]:
        """The signals that friction columns read, as one more input where there are any; slip's rows are dq's."""
        if self.extra is None:
            return ()
        states = slip if slip is None or rows is None else slip[rows]
        return (self.extra.signals(dq, sign, states, self.load(q, dq, ddq)),)

    def load(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray | None:
        """(n,) or (N, n) magnitude of each joint's load in units of its mean; None where no friction grows with it, or
        the constants hold no load."""
        parameters, mean = self.constants.load_parameters, self.constants.mean_load
        if LOAD not in self.forms or parameters is None or mean is None:
            return None
        return np.abs(self._rigid.inverse_dynamics(q, dq, ddq, np.array(parameters))) / np.array(mean)

    @cached_property
    def _rigid(self) -> Regressor:
        """The base parameters alone."""
        return Regressor(self.robot, False, self._compiler)

    def _kernel(
        self, graph: Graph, entries: Mapping[tuple[int, int], Scalar], prefixes: Sequence[str], **more: Any
    ) -> Kernel:
        signs = self.extra.signs if self.extra and len(prefixes) > 2 else 0
        return Kernel(graph, entries, self.robot.n, prefixes, signs=signs, backend=self._backend, **more)

    def _with_columns(
        self, graph: Graph, entries: dict[tuple[int, int], Scalar], accelerations: str = "ddq"
    ) -> dict[tuple[int, int], Scalar]:
        """The entries of the base parameters' columns, and those of the joints' columns behind them, row by row."""
        columns = self.extra.entries(graph, "dq", accelerations) if self.extra else {}
        inertial = len(self.base.names)
        return dict(sorted((entries | {(i, inertial + at): e for (i, at), e in columns.items()}).items()))

    def _inertial(self, graph: Graph) -> dict[tuple[int, int], Scalar]:
        column = {standard: at for at, standard in enumerate(self.base.kept)}
        return {(i, column[c]): e for (i, c), e in torque_regressor(graph, self.robot, self.base.kept).items()}

    @cached_property
    def _torque(self) -> Kernel:
        graph = Graph()
        entries = self._with_columns(graph, self._inertial(graph))
        return self._kernel(graph, entries, ("q", "dq", "ddq"), shape=(self.robot.n, self.p))

    @cached_property
    def _energy(self) -> Kernel:
        graph = Graph()
        energies = energy_regressor(graph, self.robot)
        entries: dict[tuple[int, int], Scalar] = {(0, at): energies[c] for at, c in enumerate(self.base.kept)}
        for at, column in enumerate(self.extra.columns if self.extra else (), len(self.base.names)):
            if column.kind == "Iam":
                entries[0, at] = shared_energy(graph, column)
        return self._kernel(graph, entries, ("q", "dq"), shape=(1, self.p))

    @cached_property
    def _slotine_li(self) -> Kernel:
        graph = Graph()
        inertial = self._inertial(graph)
        polar = bilinear_in_rates(lifted(graph, inertial.values()), self.robot.n)
        entries = self._with_columns(graph, dict(zip(inertial, polar, strict=True)), "ddqr")
        return self._kernel(graph, entries, ("q", "dq", "dqr", "ddqr"), shape=(self.robot.n, self.p))

    @cached_property
    def _recurrence(self) -> Kernel:
        """The backward recurrence with the base parameters for the standard ones of their names, the others zero."""
        graph = Graph()
        standard: list[Scalar] = [0] * (11 * self.robot.n)
        for at, c in enumerate(self.base.kept):
            standard[c] = graph.symbol(f"K{at + 1}")
        effort = direct_torque(graph, self.robot, standard)
        if self.extra:
            for (j, at), column in self.extra.entries(graph).items():
                effort[j] = effort[j] + column * graph.symbol(f"K{len(self.base.names) + at + 1}")
        entries = {(j, 0): x for j, x in enumerate(effort)}
        return self._kernel(graph, entries, ("q", "dq", "ddq"), constants=self.p, shape=(self.robot.n, 1))

    def _random_samples(self) -> np.ndarray:
        """(rows, p) of the torque regressor at random states, twice as many rows as columns at least."""
        n, count = self.robot.n, 2 * self.p // self.robot.n + 10
        q, dq, ddq = np.random.default_rng(0).uniform(-1.0, 1.0, (3, count, n))
        turn = np.array([np.pi if joint.revolute else 1.0 for joint in self.robot.joints])
        return self.torque(turn * q, 2 * dq, 3 * ddq).reshape(count * n, self.p)


def _samples(n: int, *signals: np.ndarray) -> tuple:
    """The signals as arrays, (n,) or (N, n), and whether they are single samples."""
    try:
        shapes = [signal.shape for signal in signals]
    except AttributeError:
        signals = tuple(np.asarray(signal, dtype=float) for signal in signals)
        shapes = [signal.shape for signal in signals]
    shape = shapes[0]
    if shapes.count(shape) != len(shapes) or len(shape) not in (1, 2) or shape[-1] != n:
        raise ValueError(f"arrays of shapes {', '.join(map(str, shapes))}; expected ({n},) or (N, {n}), all alike")
    return (*signals, len(shape) == 1)


def _check(out: np.ndarray, shape: tuple[int, ...]) -> None:
    """ValueError unless `out` has the result's shape and is float."""
    if out.shape != shape or out.dtype != np.float64:
        raise ValueError(f"out is {out.dtype} of shape {out.shape}; expected float64 of shape {shape}")
