"""From logs to estimates: both models on the same logs, with the settings chosen inside them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identify.errors import InputError, UnsupportedLogError
from identify.estimation.energy import (
    energy_least_squares,
    energy_observation,
    energy_residual_percent,
    stacked_energy,
)
from identify.estimation.least_squares import Estimate, ordinary_least_squares, weighted_least_squares
from identify.estimation.observation import torque_blocks, torque_residual
from identify.estimation.reduction import Reduction, reduced
from identify.estimation.selection import choose_settings, choose_window
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.logs.slicing import window
from identify.regressor.columns import TAKING, column_kind
from identify.regressor.regressor import Regressor

MODELS = ("torque", "energy")
ESTIMATORS = {"ols": "ordinary least squares", "wls": "weighted least squares, one noise level a joint"}
DEFAULT_ESTIMATOR = "wls"
ALL = "all"
"""Asks for every estimator side by side; the default one gives the result."""
ENERGY_ESTIMATOR = "weighted least squares, noise of each window by the motion in it"

CHANCE = 1e-3
"""Probability under pure noise above which a fit is taken to explain nothing."""

SETTINGS_S = 120.0
"""Settings are chosen on at most this much of each log [s], where it moves most; the fit itself takes all of it."""

Progress = Callable[[float, str], None] | None


@dataclass(frozen=True)
class ModelFit:
    """One model's estimate, the regressor whose parameters it has, the settings it was made with, what it is called,
    and for energy its residual [%]."""

    model: str
    regressor: Regressor
    estimate: Estimate
    settings: Settings
    estimator: str
    energy_residual_percent: float | None = None


@dataclass(frozen=True)
class Fit:
    """Both models on the same logs; one may be missing, and then `reasons` says why. `tried`: candidate settings."""

    torque: ModelFit | None
    energy: ModelFit | None
    reasons: dict[str, str]
    tried: list[dict[str, Any]]


def check_choice(model: str, estimator: str | None) -> None:
    """InputError for a model or estimator that there is not."""
    if model not in MODELS:
        raise InputError(f"model is {model!r}; choose one of {', '.join(MODELS)}")
    if estimator is not None and estimator not in (*ESTIMATORS, ALL):
        raise InputError(f"estimator is {estimator!r}; choose one of {', '.join(ESTIMATORS)} or {ALL}")


def fit_models(
    regressor: Regressor,
    logs: Sequence[Log],
    model: str,
    estimator: str | None = None,
    friction: Collection[str] | None = None,
    progress: Progress = None,
) -> Fit:
    """Fit the torque and the energy model. UnsupportedLogError where the one asked for finds no support in the logs.

    friction: further forms of friction for the torque model, chosen by cross-validation where it is None. The energy
    model keeps the plain ones of the regressor: a joint does no work at rest, and a window's few rows carry no more.
    """
    reasons: dict[str, str] = {}
    sample = [liveliest(log, SETTINGS_S) for log in logs]
    settings, tried = choose_settings(regressor, sample, friction=friction, progress=progress)
    torque = energy = None
    try:
        used = regressor if settings.friction == regressor.forms else regressor.with_forms(settings.friction)
        torque = fit_torque(used, logs, settings, DEFAULT_ESTIMATOR if estimator in (None, ALL) else estimator)
    except UnsupportedLogError as error:
        if model == "torque":
            raise
        reasons["torque"] = str(error)
    if progress:
        progress(0.95, "energy model")
    try:
        energy, windows = fit_energy(regressor, logs, sample, settings)
        tried = tried + windows
    except UnsupportedLogError as error:
        if model == "energy":
            raise
        reasons["energy"] = str(error)
    return Fit(torque, energy, reasons, tried)


def liveliest(log: Log, seconds: float) -> Log:
    """The part of at most `seconds` in which the joints go the longest way, each in shares of its range."""
    if log.duration <= seconds:
        return log
    span = np.maximum(np.ptp(log.position, axis=0), 1e-12)
    step = np.zeros(log.samples - 1)
    for position, width in zip(log.position.T, span, strict=True):  # one joint at a time: a log may be long
        step += np.abs(np.diff(position)) / width
    way = np.concatenate([[0.0], np.cumsum(step)])
    starts = log.time[log.time <= log.time[-1] - seconds]
    first = int(np.argmax(np.interp(starts + seconds, log.time, way) - way[: len(starts)]))
    return window(log, starts[first], starts[first] + seconds)


def fit_torque(regressor: Regressor, logs: Sequence[Log], settings: Settings, estimator: str) -> ModelFit:
    """The torque model with given settings."""
    reduction = reduced(torque_blocks(regressor, logs, settings))
    solve = {"ols": ordinary_least_squares, "wls": weighted_least_squares}[estimator]
    estimate = solve(reduction, lambda parameters: torque_residual(regressor, logs, settings, parameters))
    require_explained(reduction, estimate)
    return ModelFit("torque", regressor, estimate, settings, ESTIMATORS[estimator])


def require_explained(reduction: Reduction, estimate: Estimate) -> None:
    """UnsupportedLogError where the motion explains no more of the effort than as many random columns would.

    F-test of the regression against one constant a joint, each joint's rows in units of its residual's standard
    deviation, on effective samples: where chance would do as well once in a thousand, the effort is not that of these
    joints, or noise alone.
    """
    from scipy.special import fdtrc

    variance = np.maximum(estimate.sigma, 1e-300) ** 2
    left = float((reduction.residual_power(estimate.parameters) / variance).sum())
    total = 0.0
    for b, counted, v in zip(reduction.effort.T, reduction.weight.T, variance, strict=True):
        total += (b @ b - (counted @ b) ** 2 / max(counted @ counted, 1e-300)) / v
    free = max(estimate.effective_samples - len(estimate.parameters), 1.0)
    p = len(estimate.parameters) - len(variance)
    if left > 0 and fdtrc(p, free, (total - left) / p / (left / free)) > CHANCE:
        raise UnsupportedLogError(
            "the motion does not explain the effort better than chance would: "
            "is it the effort of these joints, in their order, at the same time as the positions?"
        )


def fit_energy(
    regressor: Regressor, logs: Sequence[Log], sample: Sequence[Log], settings: Settings
) -> tuple[ModelFit, list[dict[str, Any]]]:
    """The energy model, its window chosen on a sample of the training logs; and the windows tried."""
    plain = replace(settings, coulomb_velocity=None, friction=(), presliding_distance=None)
    chosen, tried = choose_window(regressor, sample, plain)
    observation = stacked_energy([energy_observation(regressor, log, chosen) for log in logs])
    estimate = energy_least_squares(observation)
    residual = energy_residual_percent(observation, estimate.parameters)
    return ModelFit("energy", regressor, estimate, chosen, ENERGY_ESTIMATOR, residual), tried


def agreement(torque: Estimate, energy: Estimate) -> dict[str, Any]:
    """How far the two models' estimates are apart, in standard deviations of their difference.

    Where the torque model has further forms of friction, its friction is another quantity: the inertial parameters are
    compared alone.
    """
    names = torque.names
    if names != energy.names:
        names = tuple(name for name in names if name in energy.names and column_kind(name) not in TAKING)
    z = np.empty(len(names))
    for k, name in enumerate(names):
        a, b = torque.names.index(name), energy.names.index(name)
        z[k] = abs(torque.parameters[a] - energy.parameters[b]) / np.hypot(torque.std[a], energy.std[b])
    worst = int(z.argmax())
    return {
        "largest_z": float(z[worst]),
        "name": names[worst],
        "within_2_sigma_percent": float(100 * (z <= 2).mean()),
    }
