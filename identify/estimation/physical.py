"""Standard parameters that a rigid robot can have, nearest to an estimate of base parameters.

Base parameters fitted by least squares may belong to no possible robot. A semidefinite programme finds the standard
parameters whose base, friction and transmission parameters θ are nearest to the estimate in the norm of its
information matrix, over robots whose links have a pseudo-inertia [[½tr(I)·1 − I, h], [hᵀ, m]] ≻ 0 and whose drives
have inertia ≥ 0 and friction that resists (Sousa & Cortesão 2014; Traversaro et al. 2016; Wensing, Kim & Slotine
2018). What the data leave open, as how a mass splits between links, is settled by a weak pull towards reference bodies
in the constant pull-back metric ‖L⁻¹(P − P₀)L⁻ᵀ‖² with P₀ = L·Lᵀ (Lee, Wensing & Park 2020), which knows no frame and
no unit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.errors import InputError
from identify.estimation.reference import DESCRIPTION, Reference
from identify.estimation.resistance import resisting
from identify.estimation.settings import STILL
from identify.experiment.knowledge import root_of
from identify.regressor.columns import JointColumns, column_kind, smooth_sign
from identify.regressor.friction import Sign
from identify.regressor.regressor import Regressor

PULL = 1e-3
"""Weight of the pull: a body twice its reference adds this much to the cost, in which one σ of a parameter adds 1."""

LEFT_OUT = 30.0
"""How much harder columns that the regressor left out are pulled to nothing: they serve where no body can."""

LEAST = 1e-5
"""Share of its reference body that every link keeps: P ⪰ LEAST·P₀, which is ≻ 0."""

DRIVEN = 1e-4
"""Share of a joint's largest friction that may drive it."""

EVERY = 48
"""Of the speeds at which friction has to resist, the programme looks at every so many-th, then at those where it would
drive all the same."""

LOOKS = 6
"""How often it does so at most."""

PRECISION = 1e-8
"""Relative standard deviation of the best known parameter below which no information is taken seriously."""

NOT_NEGATIVE = ("Fv", "Fs", "Iam", "Fvm", "Fsm")
"""Kinds of columns whose parameter is an inertia or takes energy away. Beside further forms of friction viscous and
Coulomb parameters may be negative, as long as all forms together resist."""

WIDTH = 11


@dataclass(frozen=True, eq=False)
class Consistent:
    """Standard parameters that physics allows, and what they cost.

    standard (11 n,) in the order of Robot.standard_names; extra {column: value} of friction, offset and transmission,
    those included that the regressor left out; parameters (p,) = θ of both, in the order of Regressor.names.
    resistance: least friction of a joint or motor, all forms together, in shares of its largest, over both directions
    and speeds up to its limit (see `resistance`).
    cost: δᵀ·Λ·δ with δ how far they are from the estimate and Λ its information matrix, so that one parameter off by
    one standard deviation costs 1; pull: how far links, actuators and columns left out are from their references,
    unweighted. eigenvalues (n,): smallest of each link's pseudo-inertia, SI. primal_residual, dual_residual, gap,
    iterations, seconds: the solver's own account.
    """

    standard: np.ndarray
    extra: dict[str, float]
    parameters: np.ndarray
    resistance: float
    cost: float
    pull: float
    eigenvalues: np.ndarray
    primal_residual: float
    dual_residual: float
    gap: float
    iterations: int
    seconds: float

    @property
    def possible(self) -> bool:
        """Whether every link is a possible body, no drive has a negative inertia and no friction drives."""
        motors = [value for name, value in self.extra.items() if column_kind(name) == "Iam"]
        return bool(
            self.eigenvalues.min() > 0 and min([*self.standard[10::WIDTH], *motors]) >= 0 and self.resistance >= -DRIVEN
        )


def nearest_consistent(
    regressor: Regressor,
    estimate: np.ndarray,
    information: np.ndarray,
    reference: Reference,
    mass_bounds: np.ndarray | None = None,
    pull: float = PULL,
    coulomb_velocity: float | None = None,
) -> Consistent:
    """The possible robot nearest to estimate (p,) in the norm of its information matrix (p, p).

    The information is WᵀW of the weighted observation matrix, or the inverse of the estimate's covariance.
    reference: bodies and actuator inertias of the pull, for which `pull` is the weight, for neutral ones PULL at most:
    with a drawing's values, 1/σ² for a prior of about σ standard deviation in shares of them. mass_bounds (n, 2):
    lowest and highest mass of each link [kg], infinite where there is none. coulomb_velocity: speed up to which a
    smooth sign grows. InputError for bounds that no mass meets or if the solver finds no solution.
    """
    problem = _Problem(regressor, estimate, information, reference, pull, smooth_sign(coulomb_velocity or STILL))
    seconds = 0.0
    for _ in range(LOOKS):
        solution, unknowns, size = _solve(problem, mass_bounds)
        standard, extra = problem.read(unknowns)
        resistance = problem.resistance(extra)
        seconds += float(solution.solve_time)
        if resistance >= -DRIVEN:
            break
    parameters = regressor.theta(standard, extra)
    apart = (unknowns - problem.centre)[problem.pulled > 0]
    return Consistent(
        standard=standard,
        extra=extra,
        parameters=parameters,
        resistance=resistance,
        cost=float(np.sum((problem.root @ (parameters - estimate)) ** 2)),
        pull=float(np.sum(apart**2)),
        eigenvalues=smallest_eigenvalues(standard),
        primal_residual=float(solution.r_prim),
        dual_residual=float(solution.r_dual),
        gap=float(size**2 * abs(solution.obj_val - solution.obj_val_dual)),
        iterations=int(solution.iterations),
        seconds=seconds,
    )


class _Problem:
    """The estimate in unknowns of order one.

    Per link the pseudo-inertia in units of its reference, L⁻¹·P·L⁻ᵀ as a triangle of ten with off-diagonals times √2,
    then the actuator inertias in units of theirs, then friction and transmission in units of their estimates. Columns
    that the regressor left out are among these: the offset of a vertical slide is not to be taken for a mass.
    """

    def __init__(
        self,
        regressor: Regressor,
        estimate: np.ndarray,
        information: np.ndarray,
        reference: Reference,
        pull: float,
        sign: Sign,
    ) -> None:
        n, m = regressor.robot.n, len(regressor.base.names)
        self.n = n
        every = JointColumns.of(regressor.robot).columns
        kept = regressor.extra.columns if regressor.extra else ()
        self.columns = (*kept, *(column for column in every if column.name in regressor.dropped))
        self.names = tuple(column.name for column in self.columns)
        self.forms = regressor.forms
        self.arms = resisting(regressor, sign)
        self.watched = [set(range(0, len(arm.rows), EVERY)) if self.forms else set() for arm in self.arms]
        self.actuators = reference.actuators
        self.maps = np.array([_from_triangle(np.linalg.cholesky(body)) for body in reference.bodies])
        self.root = _root(information, estimate)
        effects = np.eye(len(estimate), m + len(self.names))[:, m:]
        for factors, effect in zip(regressor.dropped.values(), effects[:, len(kept) :].T, strict=True):
            effect[[regressor.names.index(name) for name in factors]] = list(factors.values())
        known = np.maximum(np.abs(estimate), 1 / np.linalg.norm(self.root, axis=0))
        self.units = np.array([max(known[at] / abs(e[at]) for at in np.flatnonzero(e)) for e in effects.T])
        bases = regressor.base.matrix.reshape(m, n, WIDTH)
        links = np.einsum("pni,nik->pnk", bases[:, :, :10], self.maps).reshape(m, 10 * n)
        self.matrix = np.zeros((len(estimate), 11 * n + len(self.names)))
        self.matrix[:m, : 10 * n] = links
        self.matrix[:m, 10 * n : 11 * n] = bases[:, :, 10] * self.actuators
        self.matrix[:, 11 * n :] = effects * self.units
        kinds = (*np.repeat(reference.kinds, 10), *reference.actuator_kinds)
        weak = np.sqrt(min(pull, PULL))  # a neutral body is no knowledge
        links_pulled = [np.sqrt(pull) if kind == DESCRIPTION else weak for kind in kinds]
        left_out = len(self.columns) - len(kept)
        self.pulled = np.array([*links_pulled, *[0.0] * len(kept), *[weak * LEFT_OUT] * left_out])
        self.centre = np.concatenate([np.tile(_EYE, n), np.ones(n), np.zeros(len(self.names))])
        self.estimate = estimate

    def read(self, unknowns: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
        """Standard parameters (11 n,), friction and transmission by name; what may not be negative alone is not."""
        n = self.n
        bodies = np.array([_raised(triangle) for triangle in unknowns[: 10 * n].reshape(n, 10)])
        links = np.einsum("nik,nk->ni", self.maps, bodies)
        actuators = np.maximum(unknowns[10 * n : 11 * n], 0.0) * self.actuators
        extra = dict(zip(self.names, (unknowns[11 * n :] * self.units).tolist(), strict=True))
        alone = self._alone
        extra = {name: max(value, 0.0) if column_kind(name) in alone else value for name, value in extra.items()}
        return np.column_stack([links, actuators]).ravel(), extra

    @property
    def _alone(self) -> tuple[str, ...]:
        """Kinds of columns whose parameter may not be negative, whatever the others are."""
        return ("Iam",) if self.forms else NOT_NEGATIVE

    def resistance(self, extra: dict[str, float]) -> float:
        """The least friction of a joint or motor in shares of its largest; from now on where it drives is watched."""
        shares = [0.0]
        for arm, watched in zip(self.arms, self.watched, strict=True):
            total = arm.rows @ np.array([extra.get(name, 0.0) for name in arm.names])
            worst = int(total.argmin())
            shares.append(float(total[worst] / max(np.abs(total).max(), 1e-300)))
            if self.forms and shares[-1] < -DRIVEN:
                watched.add(worst)
        return min(shares)

    def not_negative(self) -> np.ndarray:
        """(rows, unknowns) whose product with the unknowns may not be negative.

        Actuator inertias and friction; of a coupled motor, what it puts on each of its joints is part of theirs.
        """
        n, size = self.n, self.matrix.shape[1]
        rows = list(np.eye(size)[10 * n : 11 * n])
        at = {(column.kind, column.index): 11 * n + k for k, column in enumerate(self.columns)}
        whole = {("Iam", j): rows[j] * self.actuators[j] for j in range(n)}
        if not self.forms:
            whole |= {("Fvm", j): self._unit(at["Fv", j]) for j in range(n) if ("Fv", j) in at}
        shared = {key: row.copy() for key, row in whole.items()}
        for column in self.columns:
            if column.kind in self._alone:
                rows.append(self._unit(at[column.kind, column.index]))
            for j, ratio in enumerate(column.ratios):
                if (column.kind, j) in shared:
                    shared[column.kind, j] -= ratio**2 * self._unit(at[column.kind, column.index])
        rows += [row for key, row in shared.items() if not np.array_equal(row, whole[key])]
        for arm, watched in zip(self.arms, self.watched, strict=True):
            places = [11 * n + self.names.index(name) for name in arm.names]
            part = np.zeros((len(watched), size))
            part[:, places] = arm.rows[sorted(watched)] * self.units[[k - 11 * n for k in places]]
            rows += list(part)
        return np.array([row / np.abs(row).max() for row in rows])

    def masses(self) -> np.ndarray:
        """(n, unknowns) whose product with the unknowns is the mass of each link [kg]."""
        rows = np.zeros((self.n, self.matrix.shape[1]))
        for j in range(self.n):
            rows[j, 10 * j : 10 * j + 10] = self.maps[j][9]
        return rows

    def _unit(self, at: int) -> np.ndarray:
        row = np.zeros(self.matrix.shape[1])
        row[at] = self.units[at - 11 * self.n]
        return row


def _solve(problem: _Problem, mass_bounds: np.ndarray | None) -> tuple[Any, np.ndarray, float]:
    """Clarabel's account, the unknowns, and the unit of the root of its objective.

    It counts from the unconstrained optimum, where the objective is what the constraints cost and nothing else.
    """
    import clarabel
    from scipy import sparse

    stacked = np.vstack([problem.root @ problem.matrix, np.diag(problem.pulled)])
    wanted = np.concatenate([problem.root @ problem.estimate, problem.pulled * problem.centre])
    start = np.linalg.lstsq(stacked, wanted, rcond=None)[0]
    n = problem.n
    rows, least = [problem.not_negative()], [np.zeros(len(problem.not_negative()))]
    if mass_bounds is not None:
        masses, bounds = problem.masses(), np.asarray(mass_bounds, dtype=float)
        if bounds.shape != (n, 2) or np.any(bounds[:, 0] > bounds[:, 1]) or np.any(bounds[:, 1] <= 0):
            raise InputError(f"mass bounds {bounds.tolist()}: expected a lowest and a highest mass [kg] for {n} links")
        for sign, side in ((1.0, bounds[:, 0]), (-1.0, bounds[:, 1])):
            finite = np.isfinite(side)
            rows.append(sign * masses[finite])
            least.append(sign * side[finite])
    linear, floor = np.vstack(rows), np.concatenate(least)
    # unknowns = start + stretch @ w turns the objective into ‖w‖², whatever the spread of what is known how well.
    triangle = np.linalg.qr(stacked, mode="r")
    stretch = np.linalg.inv(triangle)
    # Minimise ½ vᵀ2v with b − A v in the cones, w = size·v.
    constraints = np.vstack([-linear @ stretch, -stretch[: 10 * n]])
    right = np.concatenate([linear @ start - floor, start[: 10 * n] - np.tile(LEAST * _EYE, n)])
    cones = [clarabel.NonnegativeConeT(len(linear)), *(clarabel.PSDTriangleConeT(4) for _ in range(n))]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    hessian = 2 * sparse.eye(len(start), format="csc")
    # The references are a solution, if not the best: should the solver lose its way, they say how large w may be.
    largest = float(np.linalg.norm(triangle @ (problem.centre - start)))
    for size in (1.0, np.sqrt(max(largest, 1.0)), max(largest, 1.0)):
        matrix = sparse.csc_matrix(size * constraints)
        solution = clarabel.DefaultSolver(hessian, np.zeros(len(start)), matrix, right, cones, settings).solve()
        if str(solution.status) in ("Solved", "AlmostSolved"):
            return solution, start + size * stretch @ np.array(solution.x), size
    raise InputError(f"no possible robot was found near the estimate: the solver ended with {solution.status}")


def smallest_eigenvalues(standard: np.ndarray) -> np.ndarray:
    """(n,) smallest eigenvalue of each link's pseudo-inertia, from standard parameters (11 n,); SI."""
    return np.linalg.eigvalsh(pseudo_inertias(standard))[:, 0]


def pseudo_inertias(standard: np.ndarray) -> np.ndarray:
    """(n, 4, 4) pseudo-inertia ∫ [x; 1][x; 1]ᵀ dm of each link, from standard parameters (11 n,)."""
    result = np.empty((len(standard) // WIDTH, 4, 4))
    for body, (xx, xy, xz, yy, yz, zz, mx, my, mz, mass, _) in zip(result, standard.reshape(-1, WIDTH), strict=True):
        half = (xx + yy + zz) / 2
        body[:] = [
            [half - xx, -xy, -xz, mx],
            [-xy, half - yy, -yz, my],
            [-xz, -yz, half - zz, mz],
            [mx, my, mz, mass],
        ]
    return result


def _raised(triangle: np.ndarray) -> np.ndarray:
    """(10,) the triangle with what the solver's precision left below LEAST raised to it."""
    scale = np.where(_EYE > 0, 1.0, np.sqrt(0.5))
    body = np.zeros((4, 4))
    body[_UPPER[1], _UPPER[0]] = body[_UPPER] = triangle * scale
    values, axes = np.linalg.eigh(body)
    if values[0] >= LEAST:
        return triangle
    return ((axes * np.maximum(values, LEAST)) @ axes.T)[_UPPER] / scale


def _from_triangle(factor: np.ndarray) -> np.ndarray:
    """(10, 10) takes the triangle of Z to XX … M of the body whose pseudo-inertia is factor·Z·factorᵀ."""
    columns = []
    for k in range(10):
        z = np.zeros((4, 4))
        z[_UPPER[1][k], _UPPER[0][k]] = z[_UPPER[0][k], _UPPER[1][k]] = 1.0 if _EYE[k] else np.sqrt(0.5)
        body = factor @ z @ factor.T
        inertia = np.trace(body[:3, :3]) * np.eye(3) - body[:3, :3]
        columns.append([*inertia[np.triu_indices(3)], *body[:3, 3], body[3, 3]])
    return np.array(columns).T


def information_of(covariance: np.ndarray) -> np.ndarray:
    """(p, p) inverse of a covariance, whatever the units of its parameters."""
    deviation = np.maximum(np.sqrt(np.diag(covariance)), 1e-300)
    scale = np.outer(deviation, deviation)
    return np.linalg.pinv(covariance / scale, rcond=1e-14, hermitian=True) / scale


def _root(information: np.ndarray, estimate: np.ndarray) -> np.ndarray:
    """(p, p) R with RᵀR the information, capped where a parameter would be known better than to PRECISION."""
    best = np.max(np.sqrt(np.diag(information)) * np.abs(estimate))
    return root_of(information) / max(1.0, best * PRECISION)


# The upper triangle, column by column, as Clarabel wants it.
_UPPER = tuple(np.array([(i, j) for j in range(4) for i in range(j + 1)]).T)
_EYE = np.array([1.0, 0, 1, 0, 0, 1, 0, 0, 0, 1])
