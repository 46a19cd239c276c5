"""How much a motion tells about a robot's parameters, with exact derivatives with respect to the motion.

Observation matrices of the torque model (one row a joint and sample) and of the energy model (one row a window),
rows weighted by the noise they carry, columns brought to one size. What a criterion asks of their entries is pulled
back to q, q̇ and q̈ by reverse mode through the graph that the entries are generated from; friction and motor
columns are pulled back by hand. Coulomb friction has a smooth sign here, so that all is differentiable.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.linalg import inv, qr

from identify.experiment.entries import Entries, Motion
from identify.regressor.columns import COUPLED, OWN
from identify.regressor.regressor import Regressor
from identify.symbolic.energy import energy_regressor
from identify.symbolic.expression import Graph
from identify.symbolic.newton_euler import torque_regressor

RIDGE = 1e-6
"""Weight of the row that is added for each column, of size 1: parameters that no motion excites then cost a constant
instead of making the criterion infinite."""

STILL = 1e-2
"""Noise of a window that stands still, as a share of the noise of one with every joint at its velocity limit."""

DISTINCT = 1e-10
"""Smallest singular value of column-scaled rows, as a share of the largest, that counts as information."""


def log_variance(rows: np.ndarray, reference: np.ndarray, known: np.ndarray | None = None) -> tuple[float, np.ndarray]:
    """What the estimate from an observation matrix A is worth, the smaller the better, and a symmetric M (p, p): its
    derivative with respect to A is A·M.

    rows (K, p): A, or what has the same AᵀA. known (r, p): rows that stand for what is known already, and count as A's.
    −log det(AᵀA)/p + log(tr((AᵀA)⁻¹·RᵀR)/p): the mean log variance of the parameters (D-optimal), which no scaling of
    the columns changes but for a constant, plus the log of the mean variance of what they predict on the reference
    rows R (V-optimal; Atkinson & Donev 1992).
    """
    p = rows.shape[1]
    root = inv(qr(np.concatenate([rows, RIDGE * np.eye(p)] + ([] if known is None else [known])), mode="r"))
    predicted = reference @ root
    total = float(np.sum(predicted**2))
    # AᵀA = (root·rootᵀ)⁻¹
    value = 2.0 * np.sum(np.log(np.abs(np.diag(root)))) / p + np.log(total / p)
    inner = np.eye(p) / p + predicted.T @ predicted / total
    return float(value), -2.0 * root @ inner @ root.T


def reference_factor(columns: np.ndarray) -> np.ndarray:
    """(p, p) triangular R with RᵀR the mean of rᵀr over the rows r of a matrix, transposed (p, K), to stand for them
    in `log_variance`."""
    return qr(columns.T, mode="r") / np.sqrt(columns.shape[1])


def scaled_condition(columns: np.ndarray) -> tuple[float, np.ndarray]:
    """Condition number of a matrix, transposed (p, K), with each column divided by its norm; infinite where columns
    can't be told apart, and which ones these are (p,)."""
    factor = qr(columns.T, mode="r")
    norm = np.linalg.norm(factor, axis=0)
    _, size, directions = np.linalg.svd(factor / np.where(norm > 0, norm, 1.0))
    told = np.zeros(len(columns), dtype=bool)
    told[: len(size)] = size > DISTINCT * size[0]
    lost = np.abs(directions[~told]).max(axis=0, initial=0.0) > 1e-6
    return (float("inf") if lost.any() else float(size[0] / size[-1])), lost


@dataclass(frozen=True, eq=False)
class JointTerms:
    """Friction, offset and motor columns as matrices, so that their derivatives are one line each.

    A column is S·q̇ (viscous) or S·q̈ (inertia) with a symmetric S, arms·sign(arms·q̇) (Coulomb), or 1 on one
    joint (offset). *_at (c,): where the columns stand among all; viscous, inertia (c, n, n); arms, offset (c, n);
    width (c,): speed over which each Coulomb column's sign turns.
    """

    viscous_at: list[int]
    viscous: np.ndarray
    inertia_at: list[int]
    inertia: np.ndarray
    coulomb_at: list[int]
    arms: np.ndarray
    width: np.ndarray
    offset_at: list[int]
    offset: np.ndarray

    @staticmethod
    def of(regressor: Regressor, width: np.ndarray) -> JointTerms:
        """The terms of a regressor; width (n,): speed over which the sign of each joint turns."""
        n, unit = regressor.robot.n, np.eye(regressor.robot.n)
        columns = regressor.extra.columns if regressor.extra else ()
        found: dict[str, dict[int, np.ndarray]] = {kind: {} for kind in (*OWN, *COUPLED)}
        for at, column in enumerate(columns, len(regressor.base.names)):
            rho = np.array(column.ratios) if column.ratios else unit[column.index]
            square = np.outer(rho, rho) - (np.diag(rho**2) if column.ratios else 0.0)
            found[column.kind][at] = rho if column.kind in ("Fs", "Fsm", "off") else square

        def stacked(kinds: dict[int, np.ndarray], *shape: int) -> tuple[list[int], np.ndarray]:
            return list(kinds), np.array(list(kinds.values())).reshape(-1, *shape)

        viscous, inertia = stacked(found["Fv"] | found["Fvm"], n, n), stacked(found["Iam"], n, n)
        coulomb, offset = stacked(found["Fs"] | found["Fsm"], n), stacked(found["off"], n)
        return JointTerms(*viscous, *inertia, *coulomb, np.abs(coulomb[1]) @ width, *offset)

    def signs(self, dq: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Speeds, their smooth signs and the slopes of these, each (c, N), of the Coulomb columns."""
        speed, width = self.arms @ dq, self.width[:, None]
        sign = np.tanh(speed / width)
        return speed, sign, (1 - sign**2) / width


class TorqueModel:
    """The torque regressor along N samples, transposed, and what a sum over its entries is worth to the motion.

    noise (n,): σ of each joint's effort, or what it is proportional to; rows count 1/σ, its `weight`. supports: columns
    that each joint's rows have.
    """

    def __init__(self, regressor: Regressor, samples: int, width: np.ndarray, noise: np.ndarray) -> None:
        robot, kept = regressor.robot, regressor.base.kept
        self.p = regressor.p
        self.terms = JointTerms.of(regressor, width)
        self.weight = 1.0 / noise
        self.supports = regressor.supports
        graph = Graph()
        column = {standard: at for at, standard in enumerate(kept)}
        entries = {(i, column[c]): e for (i, c), e in torque_regressor(graph, robot, kept).items()}
        self._entries = Entries(graph, entries, robot.n, ("q", "dq", "ddq"), samples)

    def columns(self, motion: Motion) -> np.ndarray:
        """(p, n, N) with smooth signs."""
        _, dq, ddq = motion
        terms, y = self.terms, np.zeros((self.p, *dq.shape))
        y[self._entries.column, self._entries.row] = self._entries.values(motion)
        y[terms.viscous_at] = terms.viscous @ dq
        y[terms.inertia_at] = terms.inertia @ ddq
        y[terms.coulomb_at] = terms.arms[:, :, None] * terms.signs(dq)[1][:, None, :]
        y[terms.offset_at] = terms.offset[:, :, None]
        return y

    def factors(self, columns: np.ndarray) -> Iterator[np.ndarray]:
        """Of columns (p, n, N), each joint's weighted rows as a triangle that has the same product, (s, p)."""
        for j, support in enumerate(self.supports):
            found = qr(columns[support, j].T, mode="r")
            factor = np.zeros((len(found), self.p))
            factor[:, support] = self.weight[j] * found
            yield factor

    def pull_back(self, motion: Motion, adjoint: np.ndarray) -> Motion:
        """Derivatives of Σ adjoint·columns, adjoint (p, n, N), with respect to the motion."""
        dq, terms = motion[1], self.terms
        to_q, to_dq, to_ddq = self._entries.pull_back(motion, adjoint[self._entries.column, self._entries.row])
        to_dq += np.sum(terms.viscous @ adjoint[terms.viscous_at], axis=0)
        to_ddq += np.sum(terms.inertia @ adjoint[terms.inertia_at], axis=0)
        to_sign = np.sum(terms.arms[:, :, None] * adjoint[terms.coulomb_at], axis=1)
        to_dq += terms.arms.T @ (to_sign * terms.signs(dq)[2])
        return to_q, to_dq, to_ddq


class EnergyModel:
    """The energy model's rows over windows of `every` samples of one period: Δh and the work of friction and offset.

    The period is closed: the last window ends at its first sample. A row counts 1/σ, σ² the variance that white
    noise on the effort leaves in its work, and STILL of the largest, in units of the largest there can be: `loudest`,
    that of a window with every joint at its `velocity` (n,) where noise (n,) is the root of the density [effort²·s].
    """

    def __init__(
        self,
        regressor: Regressor,
        samples: int,
        every: int,
        step: float,
        width: np.ndarray,
        velocity: np.ndarray,
        noise: np.ndarray,
    ) -> None:
        if samples % every:
            raise ValueError(f"{samples} samples don't divide into windows of {every}")
        robot, kept = regressor.robot, regressor.base.kept
        self.p, self.every, self.step = regressor.p, every, step
        self.terms = JointTerms.of(regressor, width)
        self.loudest = float(noise**2 @ velocity**2 * every * step)
        self.noise = noise**2 / self.loudest
        graph = Graph()
        functions = energy_regressor(graph, robot)
        entries = {(0, at): functions[c] for at, c in enumerate(kept)}
        self._entries = Entries(graph, entries, robot.n, ("q", "dq"), samples)

    def columns(self, motion: Motion) -> np.ndarray:
        """(p, K) weighted."""
        rows, variance = self.unweighted(motion)
        return rows / np.sqrt(variance)

    def unweighted(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Columns before weighting, (p, K), and the rows' variances as shares of the loudest possible one's, (K,)."""
        q, dq, _ = motion
        terms = self.terms
        stored, power = np.zeros((2, self.p, dq.shape[1]))
        stored[self._entries.column] = self._entries.values((q, dq))
        stored[terms.inertia_at] = 0.5 * np.sum(dq * (terms.inertia @ dq), axis=1)
        power[terms.viscous_at] = np.sum(dq * (terms.viscous @ dq), axis=1)
        speed, sign, _ = terms.signs(dq)
        power[terms.coulomb_at] = speed * sign
        power[terms.offset_at] = terms.offset @ dq
        edges = stored[:, :: self.every]
        columns = np.roll(edges, -1, axis=1) - edges + self._work(power)
        return columns, STILL + self.noise @ self._work(dq**2)

    def pull_back(self, motion: Motion, adjoint: np.ndarray) -> Motion:
        """Derivatives of Σ adjoint·columns, adjoint (p, K), with respect to the motion; to q̈ they are 0."""
        q, dq, _ = motion
        terms = self.terms
        columns, variance = self.unweighted(motion)
        to_columns = adjoint / np.sqrt(variance)
        to_variance = -0.5 * np.sum(to_columns * columns, axis=0) / variance
        to_stored = np.zeros((self.p, dq.shape[1]))
        to_stored[:, :: self.every] = np.roll(to_columns, 1, axis=1) - to_columns
        to_power = self._spread(to_columns)
        to_q, to_dq = self._entries.pull_back((q, dq), to_stored[self._entries.column])
        to_dq += np.sum(to_stored[terms.inertia_at, None] * (terms.inertia @ dq), axis=0)
        to_dq += 2 * np.sum(to_power[terms.viscous_at, None] * (terms.viscous @ dq), axis=0)
        speed, sign, slope = terms.signs(dq)
        to_dq += terms.arms.T @ (to_power[terms.coulomb_at] * (sign + speed * slope))
        to_dq += terms.offset.T @ to_power[terms.offset_at]
        to_dq += 2 * dq * self._spread(self.noise[:, None] * to_variance)
        return to_q, to_dq, np.zeros_like(dq)

    def _work(self, power: np.ndarray) -> np.ndarray:
        """(c, K) integrals of power (c, N) over the windows, by the trapezoidal rule."""
        windows = power.reshape(len(power), -1, self.every)
        first = windows[:, :, 0]
        return (windows.sum(axis=2) + 0.5 * (np.roll(first, -1, axis=1) - first)) * self.step

    def _spread(self, to_work: np.ndarray) -> np.ndarray:
        """The transpose of `_work`: (c, N) from (c, K)."""
        spread = np.repeat(to_work, self.every, axis=1)
        spread[:, :: self.every] = 0.5 * (to_work + np.roll(to_work, 1, axis=1))
        return spread * self.step
