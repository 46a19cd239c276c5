"""Drive gains from a load of known mass: what an effort that is a current has to be multiplied by to be a torque.

With Γ_j = g_j·i_j of joint j's logged effort i_j, an arm's log tells the ratios of the gains, as joints share links,
but not their scale: an arm of half the mass with half the gains draws the same currents. A load of known mass sets it
(Gautier & Briot 2014). All unknowns are estimated at once, from logs without and with the load,

    i_j = h_j·W_j·(θ + K·φ + E·δ) + noise,    h_j = 1/g_j,    φ_M known,    δ as in `payload`,

by maximum likelihood: the noise is that of the current, so that h stands on the side of the model. Least squares of
the form g_j·i_j = W_j·x, linear in its unknowns and biased by the noise, gives the start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.errors import UnsupportedLogError
from identify.estimation.least_squares import rows_per_effective_sample
from identify.estimation.observation import torque_blocks, torque_residual
from identify.estimation.payload import (
    FRICTION_CHANGE,
    TEN,
    LoadEstimate,
    free_friction,
    friction_scales,
    load_matrix,
)
from identify.estimation.reduction import Reduction, reduced
from identify.estimation.settings import Settings
from identify.estimation.spectra import Spectra, coloured_covariance
from identify.logs.log import Log
from identify.regressor.regressor import Regressor

STEPS = 50
CONVERGED = 1e-8
"""Steps of Gauss and Newton at most, and the relative size of one that counts as none."""

PASSES = 3
"""Times that the noise of each joint is taken anew from the residual."""

SINGULAR = 1e-9
"""Singular values of the column-scaled equations below this share of the largest count as zero."""


@dataclass(frozen=True, eq=False)
class DriveGains:
    """gains (n,), joint torque [N·m] or force [N] per unit of logged effort, and their covariance (n, n), for a mass
    [kg] without error: they are all wrong by the share by which it is. load: the load with that mass and the arm, SI
    all of it but `sigma`, which is in the unit of the logged effort."""

    gains: np.ndarray
    covariance: np.ndarray
    load: LoadEstimate


@dataclass(frozen=True, eq=False)
class _Side:
    """Logs without or with the load: their reduction, and what makes their θ of the unknowns x: fixed + mixing @ x."""

    logs: Sequence[Log]
    reduction: Reduction
    fixed: np.ndarray
    mixing: np.ndarray


def drive_gains(
    regressor: Regressor, settings: Settings, without: Sequence[Log], loaded: Sequence[Log], mass: float
) -> DriveGains:
    """The gains, from logs without and with a load of this mass [kg], all of one unknown effort unit per joint.

    Settings are taken as they suit any motion, as in `estimate_load`. UnsupportedLogError where the motion can't tell
    them.
    """
    settings = settings.any_motion
    freed, n, p = free_friction(regressor), regressor.robot.n, regressor.p
    f, matrix = len(freed), load_matrix(regressor)
    effects = np.zeros((p, f))
    effects[[regressor.names.index(name) for name in freed], range(f)] = 1.0
    plain = np.hstack([np.eye(p), np.zeros((p, f + TEN - 1))])
    carried = np.hstack([np.eye(p), effects, matrix[:, : TEN - 1]])
    sides = [
        _Side(logs, reduced(torque_blocks(regressor, logs, settings)), fixed, mixing)
        for logs, fixed, mixing in ((without, np.zeros(p), plain), (loaded, mass * matrix[:, -1], carried))
    ]
    power = sum((side.reduction.effort**2).sum(axis=0) for side in sides)
    scale = np.maximum(np.sqrt(power / sum(len(side.reduction.effort) for side in sides)), 1e-12)
    x, h = _start(sides, scale)
    deviation, inflation = scale.copy(), np.ones(n)
    for _ in range(PASSES):
        spread = FRICTION_CHANGE * np.maximum(friction_scales(regressor, x[:p], freed), 1e-9)
        x, h, root, condition, silent = _refined(sides, x, h, 1 / (deviation * np.sqrt(inflation)), spread, p)
        deviation, inflation, effective, lefts = _noise(regressor, settings, sides, x, h)
    if np.abs(silent[-n:]).max(initial=0.0) > 1e-6:
        raise UnsupportedLogError(
            "the motion can't tell the drive gains: move every joint, without the load and with it"
        )
    covariance = _covariance(sides, x, h, root, 1 / (deviation * np.sqrt(inflation)), lefts)
    gains, deviations = 1 / h, np.sqrt(np.diag(covariance))
    untold, units = _untold(silent[p + f : -n])
    load = LoadEstimate(
        parameters=np.append(x[p + f :], mass),
        covariance=np.pad(covariance[p + f : -n, p + f : -n], (0, 1)),
        untold=untold,
        units=units,
        arm=x[:p],
        change=dict(zip(freed, x[p : p + f].tolist(), strict=True)),
        change_std=dict(zip(freed, deviations[p : p + f].tolist(), strict=True)),
        loaded=sides[1].fixed + sides[1].mixing @ x,
        condition_number=condition,
        sigma=deviation,
        inflation=inflation,
        rows=sum(side.reduction.equations for side in sides),
        effective_samples=effective,
        chi_squared=None,
        degrees=None,
        settings=settings,
    )
    return DriveGains(gains, covariance[-n:, -n:] * np.outer(gains, gains) ** 2, load)


def _untold(silent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal directions (10, k) of the ten that nothing is known of, and units (10,), from theirs (9, s) among all
    unknowns; the mass is known."""
    u, s, _ = np.linalg.svd(silent, full_matrices=False)
    return np.pad(u[:, s > 1e-6], ((0, 1), (0, 0))), np.ones(TEN)


def _start(sides: Sequence[_Side], scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unknowns x and h (n,) by least squares of g_j·i_j − W_j·mixing·x = W_j·fixed, joint j's rows over scale[j]."""
    n = len(scale)
    rows, right = [], []
    for side in sides:
        for j, factor in enumerate(side.reduction.factors):
            own = np.zeros((len(factor), n))
            own[:, j] = factor[:, -1]
            rows.append(np.hstack([-factor[:, :-1] @ side.mixing, own]) / scale[j])
            right.append(factor[:, :-1] @ side.fixed / scale[j])
    known = np.concatenate(right)
    if not known.any():
        raise UnsupportedLogError("the motion can't tell the drive gains: nothing of the load's mass is felt in it")
    found, _, _, silent = _solution(np.vstack(rows), known)
    _refuse_silent(silent[-n:])
    if (found[-n:] <= 0).any():
        raise UnsupportedLogError("the effort of a joint works against the motion of the arm: is its sign right?")
    return found[:-n], 1 / found[-n:]


def _refuse_silent(gains: np.ndarray) -> None:
    """UnsupportedLogError where directions of unknowns that nothing is known of reach into the gains' part (n, k)."""
    if np.abs(gains).max(initial=0.0) > 1e-6:
        raise UnsupportedLogError("the motion can't tell the drive gains: move every joint, with and without load")


def _refined(
    sides: Sequence[_Side], x: np.ndarray, h: np.ndarray, weights: np.ndarray, spread: np.ndarray, p: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, np.ndarray]:
    """x, h, and what `_solution` says of both beside them, by Gauss and Newton's steps from x and h."""
    n, f = len(h), len(spread)
    held = np.zeros((f, len(x) + n))
    held[range(f), range(p, p + f)] = 1 / spread
    for _ in range(STEPS):
        rows, right = [held], [-x[p : p + f] / spread]
        for side in sides:
            theta = side.fixed + side.mixing @ x
            for j, factor in enumerate(side.reduction.factors):
                modelled = factor[:, :-1] @ theta
                own = np.zeros((len(factor), n))
                own[:, j] = modelled
                rows.append(weights[j] * np.hstack([h[j] * factor[:, :-1] @ side.mixing, own]))
                right.append(weights[j] * (factor[:, -1] - h[j] * modelled))
        step, root, condition, silent = _solution(np.vstack(rows), np.concatenate(right))
        # No step may take more than half of a gain, so that none turns its sign.
        share = 0.5 / max(0.5, float(np.max(-step[-n:] / h)))
        x, h = x + share * step[:-n], h + share * step[-n:]
        if np.linalg.norm(step[-n:] / h) < CONVERGED:
            break
    else:
        raise UnsupportedLogError("the drive gains do not settle: the logs hold too little of the load's mass")
    return x, h, root, condition, silent


def _solution(rows: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    """Least squares of rows·x = right, a root of its (AᵀA)⁻¹, the condition number of the scaled columns, and the
    directions (columns, k) of scaled unknowns that the rows say nothing about, which are left at zero."""
    size = np.linalg.norm(rows, axis=0)
    size[size == 0] = 1.0
    u, s, vt = np.linalg.svd(rows / size, full_matrices=False)
    kept = s > SINGULAR * s[0]
    root = vt[kept].T / s[kept] / size[:, None]
    return root @ (u[:, kept].T @ right), root, float(s[0] / s[kept][-1]), vt[~kept].T


def _noise(
    regressor: Regressor, settings: Settings, sides: Sequence[_Side], x: np.ndarray, h: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float, list[np.ndarray]]:
    """(n,) standard deviation of the logged effort's residual, (n,) rows per effective sample, effective samples, and
    the residuals (rows, n) of each side."""
    lefts, counts, inflations = [], [], []
    for side in sides:
        theta = side.fixed + side.mixing @ x
        scaled = [calibrated(log, 1 / h) for log in side.logs]
        left = torque_residual(regressor, scaled, settings, theta) * h
        lefts.append(left)
        counts.append(side.reduction.weight.sum(axis=0))
        inflations.append([rows_per_effective_sample(r, side.reduction.rate) for r in np.ascontiguousarray(left.T)])
    count = np.sum(counts, axis=0)
    freedom = np.maximum(count - (len(x) + len(h)) / len(h), 1.0)
    deviation = np.maximum(np.sqrt((np.concatenate(lefts) ** 2).sum(axis=0) / freedom), 1e-12)
    inflation = np.max(inflations, axis=0)
    return deviation, inflation, float((count / inflation).sum()), lefts


def _covariance(
    sides: Sequence[_Side],
    x: np.ndarray,
    h: np.ndarray,
    root: np.ndarray,
    weights: np.ndarray,
    lefts: Sequence[np.ndarray],
) -> np.ndarray:
    """Covariance of x and h, for noise of the colour that the residuals (rows, n) of each side have."""
    n = len(h)
    middle = np.eye(root.shape[1])
    for side, left in zip(sides, lefts, strict=True):
        spectra = side.reduction.spectra
        assert spectra is not None
        theta = side.fixed + side.mixing @ x
        for j in range(n):
            # What the unknowns change in W_j's parameters, through the roots of their own spread.
            reached = h[j] * side.mixing @ root[:-n] + np.outer(theta, root[len(x) + j])
            own = Spectra(spectra.products[j : j + 1], spectra.stretches)
            counted = side.reduction.weight[:, j : j + 1]
            inverse, weight = reached @ reached.T, weights[j : j + 1]
            variance = coloured_covariance(inverse, weight, own, left[:, j : j + 1], counted)[1][0]
            coloured = weights[j] ** 4 * np.tensordot(variance, own.products[0], 1)
            rows = weights[j] * side.reduction.factors[j, :, :-1] @ reached
            # All that is known makes one; the rows' share of it gives way to what their noise makes of it.
            middle += reached.T @ coloured @ reached - rows.T @ rows
    return root @ middle @ root.T


def calibrated(log: Log, gains: np.ndarray) -> Log:
    """The log with joint j's effort multiplied by gains[j]."""
    assert log.effort is not None
    return replace(log, effort=log.effort * gains)
