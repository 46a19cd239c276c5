"""The load on the last link, from a fit of the arm without it and logs of the arm with it.

A load is a body fixed to the last link: its ten parameters φ add to that link's own, so that the base parameters of
the loaded arm are θ + K·φ, K being the base parameters' matrix in the last link's columns. Friction changes with load:
the loaded log has friction of its own, δ away from the fit's. One weighted least-squares problem holds it all,

    Γ = W·(θ + K·φ + E·δ) + noise,    θ ~ N(θ_fit, C_fit),    δ ~ N(0, (100 % of the friction)²),    φ free,

so that what the fit does not know of the arm goes into the covariance of the load, errors common to both included
(Bayes' rule for linear models; Swevers, Verdonck & De Schutter 2007 compare ways to take the unloaded arm into
account). What neither the arm nor the motion tells of φ is told as such.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.errors import UnsupportedLogError
from identify.estimation.least_squares import rows_per_effective_sample
from identify.estimation.observation import torque_blocks, torque_residual
from identify.estimation.reduction import Reduction, reduced
from identify.estimation.settings import Settings
from identify.estimation.spectra import coloured_covariance
from identify.logs.log import Log
from identify.regressor.columns import TAKING, column_kind
from identify.regressor.regressor import Regressor
from identify.robot.robot import LINK_PARAMETERS

TEN = len(LINK_PARAMETERS)

FRICTION_CHANGE = 1.0
"""Standard deviation of how far a load may change a joint's friction, as a share of that friction; that of an offset
counts in shares of the joint's Coulomb friction."""

SILENT = 1e-7
"""Singular values of the load's column-scaled equations below this share of the largest say nothing."""

PASSES = 4
"""Times that the noise of each joint is taken anew from the residual."""


@dataclass(frozen=True, eq=False)
class Unloaded:
    """What is known of the arm without a load: a fit's parameters (p,) and covariance (p, p) in the order of the
    regressor's names, and the settings by which a log becomes rows."""

    regressor: Regressor
    settings: Settings
    parameters: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False)
class LoadEstimate:
    """The load, and what the loaded logs say of the arm beside it.

    parameters (10,) XX XY XZ YY YZ ZZ MX MY MZ M of the load about O_n in the axes of R_n [kg·m², kg·m, kg] and their
    covariance (10, 10), both zero along `untold` (10, k), orthonormal combinations of the ten in `units` (10,) about
    which these logs say nothing.
    arm (p,): θ of the arm without its load, by the fit and the loaded logs together; change, change_std {column}: how
    far friction under load is from the fit's [its unit]; loaded (p,): θ of the arm with its load and that friction;
    settings: how the loaded logs became rows, and are predicted.
    condition_number of the load's column-scaled equations; sigma, inflation (n,) of each joint's residual and rows per
    effective sample; rows, effective_samples; chi_squared, degrees: how much worse the logs are explained than by
    parameters of their own, in effective samples, and how much worse chance would have it; None where that is unknown.
    """

    parameters: np.ndarray
    covariance: np.ndarray
    untold: np.ndarray
    units: np.ndarray
    arm: np.ndarray
    change: dict[str, float]
    change_std: dict[str, float]
    loaded: np.ndarray
    condition_number: float
    sigma: np.ndarray
    inflation: np.ndarray
    rows: int
    effective_samples: float
    chi_squared: float | None
    degrees: int | None
    settings: Settings

    @property
    def told(self) -> np.ndarray:
        """(k, 10) rows that span the combinations of the ten that the logs tell, each of order one."""
        whole = np.linalg.svd(self.untold.T)[2] if self.untold.shape[1] else np.eye(TEN)
        return whole[self.untold.shape[1] :] / self.units

    def tells(self, gradient: np.ndarray) -> bool:
        """Whether the logs tell a quantity of this gradient (10,) in the ten parameters."""
        scaled = gradient * self.units
        return bool(np.linalg.norm(scaled @ self.untold) < 1e-6 * np.linalg.norm(scaled))


def load_matrix(regressor: Regressor) -> np.ndarray:
    """(p, 10) what each of a load's parameters XX … M on the last link adds to the arm's θ."""
    last = 11 * (regressor.robot.n - 1)
    matrix = np.zeros((regressor.p, TEN))
    matrix[: len(regressor.base.names)] = regressor.base.matrix[:, last : last + TEN]
    return matrix


def estimate_load(unloaded: Unloaded, logs: Sequence[Log], friction: bool = True) -> LoadEstimate:
    """The load that logs of the loaded arm hold. friction: whether it may have changed with the load.

    The arm swings otherwise than in the fit's logs: settings are those that suit any motion.
    UnsupportedLogError where no row is left.
    """
    unloaded = replace(unloaded, settings=unloaded.settings.any_motion)
    found = _estimate(unloaded, logs, friction)
    if unloaded.settings.load_parameters is None:
        return found
    # Friction that grows with the load on a joint grows with what the arm carries.
    base = found.loaded[: len(unloaded.regressor.base.names)]
    settings = replace(unloaded.settings, load_parameters=tuple(base.tolist()))
    regressor = settings.suited(unloaded.regressor)
    return _estimate(replace(unloaded, regressor=regressor, settings=settings), logs, friction)


def _estimate(unloaded: Unloaded, logs: Sequence[Log], friction: bool) -> LoadEstimate:
    regressor, settings = unloaded.regressor, unloaded.settings
    reduction = reduced(torque_blocks(regressor, logs, settings))
    if not reduction.weight.any():
        raise UnsupportedLogError("no joint moves for long enough to give a single equation")
    problem = _Problem.of(unloaded, free_friction(regressor) if friction else ())
    noise = _Noise(np.maximum(np.sqrt((reduction.effort**2).mean(axis=0)), 1e-12), np.ones(regressor.robot.n))
    for _ in range(PASSES):
        solved = problem.solve(reduction, noise.weights)
        remainder = torque_residual(regressor, logs, settings, solved.loaded)
        noise = _Noise.of(reduction, remainder, TEN + len(problem.freed))
    solved = problem.solve(reduction, noise.weights)
    # Parameters of the log's own, for comparison: those that explain it best, whatever the fit.
    own = _own(*reduction.weighted(noise.weights))[0]
    left = torque_residual(regressor, logs, settings, own)
    rows, right = reduction.weighted(_Noise.of(reduction, left, regressor.p).weights)
    basis = _own(rows, right)[1]
    excess = float(np.sum((basis.T @ (right - rows @ solved.loaded)) ** 2))
    covariance = _covariance(problem, solved, reduction, noise.weights, remainder)
    deviations = np.sqrt(np.diag(covariance))[regressor.p : -TEN]
    return LoadEstimate(
        parameters=solved.unknowns[-TEN:],
        covariance=covariance[-TEN:, -TEN:],
        untold=solved.untold,
        units=solved.units,
        arm=solved.unknowns[: regressor.p],
        change=dict(zip(problem.freed, solved.unknowns[regressor.p : -TEN].tolist(), strict=True)),
        change_std=dict(zip(problem.freed, deviations.tolist(), strict=True)),
        loaded=solved.loaded,
        condition_number=solved.condition_number,
        sigma=noise.deviation,
        inflation=noise.inflation,
        rows=reduction.equations,
        effective_samples=float((reduction.weight.sum(axis=0) / noise.inflation).sum()),
        chi_squared=excess + solved.held,
        degrees=max(basis.shape[1] - (TEN - solved.untold.shape[1]) - len(problem.freed), 1),
        settings=settings,
    )


def free_friction(regressor: Regressor) -> tuple[str, ...]:
    """Columns of friction and offset, which a load may change."""
    return tuple(name for name in regressor.names if column_kind(name) in TAKING)


def friction_scales(regressor: Regressor, parameters: np.ndarray, freed: Collection[str]) -> np.ndarray:
    """(f,) how large the freed friction columns' parameters are at most, by parameters (p,)."""
    values = dict(zip(regressor.names, np.abs(parameters), strict=True))
    scales = []
    for name in freed:
        kind = column_kind(name)
        coulomb = "Fsm" if kind.endswith("m") else "Fs"
        beside = values.get(coulomb + name.removeprefix(kind), 0.0) if kind == "off" else 0.0
        scales.append(max(values[name], beside))
    return np.array(scales)


@dataclass(frozen=True, eq=False)
class _Noise:
    """deviation (n,) of each joint's rows [N·m or N], and inflation (n,): rows per effective sample."""

    deviation: np.ndarray
    inflation: np.ndarray

    @staticmethod
    def of(reduction: Reduction, left: np.ndarray, unknowns: int) -> _Noise:
        """From residuals (rows, n) that so many unknowns left."""
        counts = reduction.weight.sum(axis=0) - unknowns / left.shape[1]
        deviation = np.maximum(np.sqrt((left**2).sum(axis=0) / np.maximum(counts, 1.0)), 1e-12)
        each = [rows_per_effective_sample(r, reduction.rate) for r in np.ascontiguousarray(left.T)]
        return _Noise(deviation, np.array(each))

    @property
    def weights(self) -> np.ndarray:
        """(n,) one over the deviation of an effective sample."""
        return 1 / (self.deviation * np.sqrt(self.inflation))


@dataclass(frozen=True, eq=False)
class _Solved:
    """Least squares of one weighting: unknowns (u,) = θ, δ, φ; root (u, k) with root·rootᵀ the inverse of its normal
    equations; untold and units as in LoadEstimate; loaded (p,); held: what is known beforehand, as it is then off."""

    unknowns: np.ndarray
    root: np.ndarray
    untold: np.ndarray
    units: np.ndarray
    loaded: np.ndarray
    condition_number: float
    held: float


@dataclass(frozen=True, eq=False)
class _Problem:
    """Unknowns (θ, δ, φ) of p, f and 10. `mixing` (p, p + f + 10) makes of them the loaded arm's parameters; known
    (p + f, p + f + 10) and wanted (p + f,) are rows of what is known beforehand, in standard deviations."""

    mixing: np.ndarray
    known: np.ndarray
    wanted: np.ndarray
    freed: tuple[str, ...]

    @staticmethod
    def of(unloaded: Unloaded, freed: tuple[str, ...]) -> _Problem:
        regressor, p, f = unloaded.regressor, unloaded.regressor.p, len(freed)
        effects = np.zeros((p, f))
        effects[[regressor.names.index(name) for name in freed], range(f)] = 1.0
        root = root_of_information(unloaded.covariance)
        # A friction of nothing may still change by what it is uncertain by.
        own = np.sqrt(np.diag(unloaded.covariance))[[regressor.names.index(name) for name in freed]]
        spread = np.maximum(FRICTION_CHANGE * friction_scales(regressor, unloaded.parameters, freed) + own, 1e-12)
        known = np.zeros((p + f, p + f + TEN))
        known[:p, :p] = root
        known[range(p, p + f), range(p, p + f)] = 1 / spread
        wanted = np.concatenate([root @ unloaded.parameters, np.zeros(f)])
        return _Problem(np.hstack([np.eye(p), effects, load_matrix(regressor)]), known, wanted, freed)

    def solve(self, reduction: Reduction, weights: np.ndarray) -> _Solved:
        """Least squares with joint j's rows times weights[j], one over the noise of an effective sample."""
        rows, right = reduction.weighted(weights)
        p, f = len(self.mixing), len(self.freed)
        matrix = np.vstack([rows @ self.mixing, self.known])
        wanted = np.concatenate([right, self.wanted])
        scale = np.linalg.norm(matrix, axis=0)
        scale[scale == 0] = 1.0
        triangle = np.asarray(np.linalg.qr(np.column_stack([matrix / scale, wanted]), mode="r"))
        # The load comes last, so that its rows of the triangle are what is left for it of all that is known.
        corner, side = triangle[p + f : -1, p + f : -1], triangle[p + f : -1, -1]
        size = np.linalg.norm(corner, axis=0)
        size[size == 0] = 1.0
        u, s, vt = np.linalg.svd(corner / size)
        kept = s > SILENT * s[0]
        units = 1 / (size * scale[p + f :])
        half = units[:, None] * (vt[kept].T / s[kept])
        load = half @ (u[:, kept].T @ side)
        others, mixed = np.linalg.inv(triangle[: p + f, : p + f]), triangle[: p + f, p + f : -1]
        rest = others @ (triangle[: p + f, -1] - mixed @ (load * scale[p + f :]))
        unknowns = np.concatenate([rest / scale[: p + f], load])
        carried = -others @ mixed @ (half * scale[p + f :][:, None])
        root = np.zeros((len(unknowns), p + f + half.shape[1]))
        root[: p + f] = np.hstack([others, carried]) / scale[: p + f, None]
        root[p + f :, p + f :] = half
        return _Solved(
            unknowns=unknowns,
            root=root,
            untold=vt[~kept].T,
            units=units,
            loaded=self.mixing @ unknowns,
            condition_number=float(s[0] / s[kept][-1]),
            held=float(np.sum((self.known @ unknowns - self.wanted) ** 2)),
        )


def _covariance(
    problem: _Problem, solved: _Solved, reduction: Reduction, weights: np.ndarray, left: np.ndarray
) -> np.ndarray:
    """(u, u) covariance of the unknowns, for noise of the colour that residuals (rows, n) have."""
    assert reduction.spectra is not None
    reached = problem.mixing @ solved.root
    _, variance = coloured_covariance(reached @ reached.T, weights, reduction.spectra, left, reduction.weight)
    middle = np.einsum("j,jb,jbkl->kl", weights**4, variance, reduction.spectra.products, optimize=True)
    known = problem.known @ solved.root
    return solved.root @ (reached.T @ middle @ reached + known.T @ known) @ solved.root.T


def root_of_information(covariance: np.ndarray) -> np.ndarray:
    """(p, p) R with RᵀR the inverse of a covariance, whatever the units of its parameters."""
    deviation = np.maximum(np.sqrt(np.diag(covariance)), 1e-300)
    values, axes = np.linalg.eigh(covariance / np.outer(deviation, deviation))
    return (axes / np.sqrt(np.maximum(values, 1e-14 * values[-1]))).T / deviation


def _own(rows: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares solution of rows·x = right, zero where the rows are silent, and a basis of the rows' range."""
    size = np.linalg.norm(rows, axis=0)
    size[size == 0] = 1.0
    u, s, vt = np.linalg.svd(rows / size, full_matrices=False)
    kept = s > SILENT * s[0]
    basis = u[:, kept]
    return (vt[kept].T / s[kept]) @ (basis.T @ right) / size, basis
