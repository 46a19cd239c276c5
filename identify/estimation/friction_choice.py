"""Which forms of friction the training logs call for, and the constants that these depend on.

One form is added after the other. What a form can gain is seen without a fit of its own, by variable projection (Golub
& Pereyra 1973): what the columns so far explain is projected out of the form's columns and of the effort, and what is
left of these is fitted to what is left of that; a constant on which the columns depend in another way is where that
fits best. The form that gains most is then fitted on four fifths of the logs and predicts the rest, five times over,
and is kept only if that is surely better.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identify.estimation.least_squares import solution, weights_by_noise
from identify.estimation.observation import Signals, Thinning, signals, stacked, torque_blocks
from identify.estimation.reduction import reduced
from identify.estimation.settings import CONSTANTS, Settings
from identify.logs.log import Log
from identify.regressor.friction import FURTHER, LOAD, PRESLIDING, STRIBECK, sliding_laws
from identify.regressor.regressor import Regressor

WORTH_IT = 0.1
"""A form must lower the residual by so much [% of the torque]: below, the simpler model is as good and its parameters
clearer."""

SMOOTHING = (0.02, 0.05, 0.1)
"""Speeds up to which a smooth sign may grow [rad/s or m/s]."""

LOAD_PASSES = 2
"""How often the load is found again from a fit with the friction that it causes."""

GRIDS = {
    PRESLIDING: ("presliding_distance", np.geomspace(1e-5, 3e-3, 6)),
    STRIBECK: ("stribeck_velocity", np.geomspace(0.01, 0.3, 4)),
}
"""Constants of forms, and the values among which the best is looked for before it is refined: [rad or m], and
[rad/s or m/s], where what fades more slowly is told from viscous friction no more."""

Judge = Callable[[Settings, Settings], bool]
"""Whether the second is surely better than the first on blocks that no fit has seen."""


@dataclass(frozen=True)
class Grown:
    """Settings with one more form of friction, and the residual that is left of the training effort [%]."""

    settings: Settings
    percent: float


def choose_friction(
    regressor: Regressor, logs: Sequence[Log], settings: Settings, forms: Collection[str], better: Judge
) -> Settings:
    """The settings with those of `forms` that pay, each with its constants. regressor: with plain friction."""
    left = [form for form in FURTHER if form in forms]
    while left:
        rows = FrictionRows(regressor, logs, settings)
        found = sorted(((form, rows.grown(form)) for form in left), key=lambda each: each[1].percent)
        for form, candidate in found:
            if rows.percent - candidate.percent >= WORTH_IT and better(settings, candidate.settings):
                settings = refined(regressor, logs, candidate.settings)
                left.remove(form)
                break
        else:
            break
    return settings


def with_friction(regressor: Regressor, logs: Sequence[Log], settings: Settings, forms: Collection[str]) -> Settings:
    """The settings with all of `forms`, each with its constants. regressor: with plain friction."""
    for form in forms:
        known = form not in CONSTANTS
        settings = _with_form(settings, form) if known else FrictionRows(regressor, logs, settings).grown(form).settings
    return refined(regressor, logs, settings)


def refined(regressor: Regressor, logs: Sequence[Log], settings: Settings) -> Settings:
    """The settings, the width of a smooth sign and each form's constants fitted anew now that the others are there."""
    if settings.coulomb_velocity is not None and settings.friction:
        widths = [replace(settings, coulomb_velocity=width) for width in SMOOTHING]
        settings = min(widths, key=lambda each: FrictionRows(regressor, logs, each).percent)
    for form in settings.friction:
        if form in GRIDS:
            settings = FrictionRows(regressor, logs, _without_form(settings, form)).grown(form).settings
    for _ in range(LOAD_PASSES if LOAD in settings.friction else 0):
        settings = replace(settings, **FrictionRows(regressor, logs, settings).load())
    return settings


class FrictionRows:
    """The logs' rows of the torque model with the settings' friction, ready for columns of one more form.

    percent: the residual that is left of the effort [%].
    """

    def __init__(self, plain: Regressor, logs: Sequence[Log], settings: Settings) -> None:
        self.settings = settings
        self.regressor = regressor = settings.suited(plain)
        observation = stacked(torque_blocks(regressor, logs, settings))
        reduction = reduced([observation], spectral=False)
        self.weights = weights_by_noise(reduction)
        self.parameters = solution(reduction, self.weights)[2]
        self.pieces = [signals(log, settings, regressor) for log in logs]
        self.basis = np.linalg.qr(self._weighted(observation.matrix))[0]
        effort = self._weighted([b[:, None] for b in observation.effort])
        self.left = effort - self.basis @ (self.basis.T @ effort)
        self.effort = float(np.linalg.norm(np.concatenate(observation.effort)))
        self.percent = self._percent(self.left)

    def grown(self, form: str) -> Grown:
        """The settings with this form, its constants those that leave the least residual."""
        if form not in GRIDS:
            return self._tried(self._with_constants(form))
        name, grid = GRIDS[form]
        found: dict[float, Grown] = {}

        def at(x: float) -> None:
            value = float(f"{np.exp(x):.2g}")
            if value not in found:
                found[value] = self._tried(_with_form(self.settings, form, {name: value}))

        places = np.log(grid)
        for x in places:
            at(x)
        heights = [found[float(f"{np.exp(x):.2g}")].percent for x in places]
        middle = int(np.clip(np.argmin(heights), 1, len(grid) - 2))
        low, mid, high = heights[middle - 1 : middle + 2]
        if low + high > 2 * mid:  # the vertex of the parabola through the three
            at(places[middle] + (places[1] - places[0]) * (low - high) / (2 * (low - 2 * mid + high)))
        return min(found.values(), key=lambda each: each.percent)

    def _with_constants(self, form: str) -> Settings:
        """The settings with a form whose constants, if any, follow from the fit so far."""
        return _with_form(self.settings, form, self.load() if form == LOAD else None)

    def load(self) -> dict[str, Any]:
        """Constants of load-dependent friction: the load is the effort of the fit's rigid bodies."""
        base = self.parameters[: len(self.regressor.base.names)]
        total = sum(self._load(s, base).sum(axis=0) for s in self.pieces)
        mean = np.maximum(total / sum(len(s.time) for s in self.pieces), 1e-9)
        return {"load_parameters": tuple(base.tolist()), "mean_load": tuple(mean.tolist())}

    def _load(self, s: Signals, base: np.ndarray) -> np.ndarray:
        """(N, n) magnitude of the effort of rigid bodies with base parameters (b,)."""
        theta = np.zeros(self.regressor.p)
        theta[: len(base)] = base
        return np.abs(self.regressor.inverse_dynamics(s.q, s.dq, s.ddq, theta))

    def _tried(self, settings: Settings) -> Grown:
        """What is left with the form that these settings have more."""
        form = next(form for form in settings.friction if form not in self.settings.friction)
        columns = self._weighted(self._columns(form, settings))
        columns -= self.basis @ (self.basis.T @ columns)
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        solved = np.linalg.lstsq(columns / scale, self.left, rcond=1e-6)[0]
        return Grown(settings, self._percent(self.left - columns / scale @ solved))

    def _columns(self, form: str, settings: Settings) -> list[np.ndarray]:
        """The form's columns, of each joint (rows, k), as `torque_blocks` makes rows."""
        extra = self.regressor.extra
        assert extra is not None
        n = self.regressor.robot.n
        ratios = np.vstack([np.eye(n), *([extra.motors] if len(extra.motors) else [])])
        ratios = ratios[: n if form == LOAD else len(ratios)]
        arms, joints = np.nonzero(ratios)
        parts = []
        for s in self.pieces:
            thin = Thinning.of(s, settings)
            signal = self._signal(form, settings, s).T
            kept = thin(signal[arms] * ratios[arms, joints][:, None] * thin.mask[joints])
            found = np.zeros((n, len(thin.rows), len(ratios)))
            found[joints, :, arms] = kept
            parts.append(found)
        return list(np.concatenate(parts, axis=1))

    def _signal(self, form: str, settings: Settings, s: Signals) -> np.ndarray:
        """(N, arms) what the form's columns read."""
        extra = self.regressor.extra
        assert extra is not None
        if form == PRESLIDING:
            assert settings.presliding_distance is not None
            return self.regressor.presliding(settings.presliding_distance)(s.q)
        velocity = settings.stribeck_velocity
        laws = sliding_laws(settings.sign, *([velocity] if velocity else []))
        signal = laws[form](extra.speeds(s.dq))
        if form == LOAD:
            load = self._load(s, np.array(settings.load_parameters)) / np.array(settings.mean_load)
            signal = signal[:, : self.regressor.robot.n] * load
        return signal

    def _weighted(self, matrices: Sequence[np.ndarray]) -> np.ndarray:
        return np.concatenate([a * w for a, w in zip(matrices, self.weights, strict=True)])

    def _percent(self, weighted: np.ndarray) -> float:
        """A weighted residual (n·rows, 1) in percent of the effort, without the weights."""
        rows = weighted.reshape(len(self.weights), -1) / self.weights[:, None]
        return 100 * float(np.linalg.norm(rows)) / max(self.effort, 1e-300)


def _with_form(settings: Settings, form: str, constants: dict[str, Any] | None = None) -> Settings:
    forms = tuple(f for f in FURTHER if f in (*settings.friction, form))
    return replace(settings, friction=forms, **constants or {})


def _without_form(settings: Settings, form: str) -> Settings:
    nothing: dict[str, Any] = dict.fromkeys(CONSTANTS[form])
    return replace(settings, friction=tuple(f for f in settings.friction if f != form), **nothing)
