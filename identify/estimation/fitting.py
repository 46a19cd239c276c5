"""From logs to estimates: both models on the same logs, with the settings chosen inside them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identify.errors import UnsupportedLogError
from identify.estimation.energy import energy_residual_percent
from identify.estimation.estimators.problem import Problem
from identify.estimation.estimators.registry import DEFAULTS, ESTIMATORS, MODELS, Estimator, choice
from identify.estimation.least_squares import Estimate
from identify.estimation.prediction import Predictor
from identify.estimation.reduction import Reduction
from identify.estimation.selection import choose_settings, choose_window
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.logs.slicing import window
from identify.regressor.columns import TAKING, column_kind
from identify.regressor.regressor import Regressor
from identify.side_by_side import give_back

CHANCE = 1e-3
"""Probability under pure noise above which a fit is taken to explain nothing."""

SETTINGS_S = 120.0
"""Settings are chosen on at most this much of each log [s], where it moves most; the fit itself takes all of it."""

Progress = Callable[[float, str], None] | None


@dataclass(frozen=True)
class ModelFit:
    """One model's estimate, the regressor whose parameters it has, the settings it was made with, the estimator, and
    for energy its residual [%]."""

    regressor: Regressor
    estimate: Estimate
    settings: Settings
    by: Estimator
    energy_residual_percent: float | None = None

    @property
    def model(self) -> str:
        """ "torque" or "energy"."""
        return self.by.model

    @property
    def estimator(self) -> str:
        """The estimator in words."""
        return self.by.title

    @property
    def predictor(self) -> Predictor:
        """What predicts effort by it."""
        return Predictor(self.regressor, self.estimate.parameters, self.settings)


@dataclass(frozen=True)
class Fit:
    """Both models on the same logs; one may be missing, and then `reasons` says why. `tried`: candidate settings.
    chosen: the fit that was asked for; problem: what it was made from."""

    chosen: ModelFit
    torque: ModelFit | None
    energy: ModelFit | None
    reasons: dict[str, str]
    tried: list[dict[str, Any]]
    problem: Problem


def fit_models(
    regressor: Regressor,
    logs: Sequence[Log],
    model: str | None = None,
    estimator: str | None = None,
    friction: Collection[str] | None = None,
    progress: Progress = None,
) -> Fit:
    """Fit the torque and the energy model. UnsupportedLogError where the one asked for finds no support in the logs.

    model, estimator: see `registry.choice`; the other model is fitted by its default. friction: further forms of
    friction for the torque model, chosen by cross-validation where it is None. The energy model keeps the plain ones of
    the regressor: a joint does no work at rest, and a window's few rows carry no more.
    """
    wanted = choice(model, estimator)
    sample = [liveliest(log, SETTINGS_S) for log in logs]
    problem, tried = posed(regressor, logs, sample, friction, progress)
    give_back()
    found: dict[str, ModelFit] = {}
    reasons: dict[str, str] = {}
    for name in MODELS:
        by = wanted if wanted.model == name else ESTIMATORS[DEFAULTS[name]]
        if progress:
            progress(0.9 + 0.05 * len(found), by.title)
        try:
            found[name] = fitted(problem, by)
        except UnsupportedLogError as error:
            if by is wanted:
                raise
            reasons[name] = str(error)
    return Fit(found[wanted.model], found.get("torque"), found.get("energy"), reasons, tried, problem)


def posed(
    regressor: Regressor,
    logs: Sequence[Log],
    sample: Sequence[Log],
    friction: Collection[str] | None = None,
    progress: Progress = None,
) -> tuple[Problem, list[dict[str, Any]]]:
    """The problem that estimators solve, its settings chosen on a sample of the logs; and the settings tried."""
    tell = progress or (lambda share, text: None)
    settings, tried = choose_settings(
        regressor, sample, friction=friction, progress=lambda share, text: tell(0.8 * share, text)
    )
    used = settings.suited(regressor)
    plain = replace(settings.plain, coulomb_velocity=None)
    windows, reason = None, ""
    tell(0.85, "windows of the energy model")
    try:
        windows, more = choose_window(regressor, sample, plain)
        tried = tried + more
    except UnsupportedLogError as error:
        reason = str(error)
    return Problem(used, logs, settings, regressor, windows, reason), tried


def fitted(problem: Problem, by: Estimator) -> ModelFit:
    """The estimate of one estimator. UnsupportedLogError where the logs don't support it."""
    estimate = by.estimate(problem)
    if by.model == "torque":
        require_explained(problem.reduction, estimate)
        return ModelFit(problem.regressor, estimate, problem.settings, by)
    residual = energy_residual_percent(problem.energy, estimate.parameters)
    return ModelFit(problem.plain, estimate, problem.windows, by, residual)


def liveliest(log: Log, seconds: float) -> Log:
    """The part of at most `seconds` in which the joints go the longest way, each in shares of its range."""
    if log.duration <= seconds:
        return log
    span = np.maximum(np.ptp(log.position, axis=0), 1e-12)
    # In steps of half a second, as a log may be long.
    edges = np.arange(0, log.samples, max(1, round(0.5 * log.rate_hz)))
    parts = zip(edges, np.append(edges[1:] + 1, log.samples), strict=True)
    step = [float((np.abs(np.diff(log.position[a:b], axis=0)).sum(axis=0) / span).sum()) for a, b in parts]
    time, way = log.time[edges], np.concatenate([[0.0], np.cumsum(step[:-1])])
    starts = time[time <= log.time[-1] - seconds]
    first = int(np.argmax(np.interp(starts + seconds, time, way) - way[: len(starts)]))
    return window(log, starts[first], starts[first] + seconds)


def fit_torque(regressor: Regressor, logs: Sequence[Log], settings: Settings, estimator: str = "wls") -> ModelFit:
    """The torque model with given settings."""
    problem = Problem(regressor, logs, settings, regressor, None, "the settings have no window")
    return fitted(problem, ESTIMATORS[estimator])


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
