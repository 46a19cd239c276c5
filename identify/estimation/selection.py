"""Which processing suits these logs: decided inside the training logs, by cross-validation over short blocks.

Two choices are made, one after the other. How to treat velocities near zero: leave out rows at rest and take
the exact sign, or count every row and smooth the sign. Then the cut-off of the position. Each candidate is fitted
on four fifths of the training logs and predicts the effort of the rest, five times over. The treatment of rest is
judged on all samples, the cut-off on those where the joint moves, both by the rule of `scoring`. Test logs are
never looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from identify.errors import UnsupportedLogError
from identify.estimation.energy import energy_least_squares, energy_observation, stacked_energy
from identify.estimation.least_squares import solution, weights_by_noise
from identify.estimation.motion import low_pass
from identify.estimation.observation import END_S, Observation, moving, signals, stacked, torque_blocks
from identify.estimation.reduction import reduced
from identify.estimation.scoring import CUTOFF_HZ, relative
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.regressor.regressor import Regressor

FOLDS = 5
BLOCK_S = 0.5
"""Length of the blocks that are dealt out to the folds in turn; short, so that every fold sees the whole motion."""

GAP_S = 0.1
"""Rows this close to a block left out are left out with it: the filters would carry it over."""

SMOOTHING = (0.02, 0.05, 0.1)
CUTOFFS_HZ = (15.0, 20.0, 25.0, 30.0, 40.0, 60.0, 100.0)
WINDOWS_S = (0.05, 0.1, 0.2)
ENERGY_CUTOFFS_HZ = (5.0, 8.0, 10.0, 15.0, 20.0, 40.0)

Progress = Callable[[float, str], None] | None


def choose_settings(
    regressor: Regressor, logs: Sequence[Log], start: Settings | None = None, progress: Progress = None
) -> tuple[Settings, list[dict[str, Any]]]:
    """Settings of the torque model for these logs, and what was tried: [{settings, score_percent, …}]."""
    base = start or Settings()
    treatments = [base] + [replace(base, coulomb_velocity=v, rest_counted=True) for v in SMOOTHING]
    tried: list[dict[str, Any]] = []

    def best(candidates: Sequence[Settings], figure: str, share: float) -> Settings:
        scores = []
        for k, candidate in enumerate(candidates):
            if progress:
                progress(share + 0.5 * k / len(candidates), "choosing the treatment of rest and the filter")
            scores.append(cross_validated(regressor, logs, candidate))
            tried.append({"settings": candidate.to_dict(), **scores[-1]})
        return candidates[int(np.argmin([s[figure] for s in scores]))]

    treatment = best(treatments, "all_percent", 0.0)
    others = [replace(treatment, position_cutoff_hz=f, guard_s=min(0.05, 1 / f)) for f in CUTOFFS_HZ]
    return best(others, "moving_percent", 0.5), tried


def cross_validated(regressor: Regressor, logs: Sequence[Log], settings: Settings) -> dict[str, float]:
    """Residuals [%] of the effort in blocks that the fit has not seen: over all samples, and moving."""
    observations = [stacked(torque_blocks(regressor, [log], settings)) for log in logs]
    pieces = [signals(log, settings) for log in logs]
    whole = stacked(observations)
    offsets = np.cumsum([0.0, *(log.duration + 10 * BLOCK_S for log in logs)])
    time = np.concatenate([o.time + t for o, t in zip(observations, offsets, strict=False)])
    fold = (time // BLOCK_S).astype(int) % FOLDS
    near = (((time - GAP_S) // BLOCK_S).astype(int) % FOLDS, ((time + GAP_S) // BLOCK_S).astype(int) % FOLDS)
    predicted = [np.zeros_like(s.effort) for s in pieces]
    for k in range(FOLDS):
        kept = (fold != k) & (near[0] != k) & (near[1] != k)
        part = Observation(
            tuple(a[kept] for a in whole.matrix),
            tuple(b[kept] for b in whole.effort),
            whole.time[kept],
            whole.weight[kept],
            whole.rate,
            whole.names,
        )
        reduction = reduced([part])
        parameters = solution(reduction, weights_by_noise(reduction))[2]
        for s, t, hat in zip(pieces, offsets, predicted, strict=False):
            here = ((s.time + t) // BLOCK_S).astype(int) % FOLDS == k
            hat[here] = regressor.inverse_dynamics(s.q[here], s.dq[here], s.ddq[here], parameters, settings.sign)
    return _residuals(pieces, predicted)


def choose_window(
    regressor: Regressor, logs: Sequence[Log], settings: Settings
) -> tuple[Settings, list[dict[str, Any]]]:
    """Settings of the energy model: window and cut-off whose parameters predict the training logs' effort best."""
    tried: list[dict[str, Any]] = []
    pieces = [signals(log, settings) for log in logs]
    for cutoff, window in product(ENERGY_CUTOFFS_HZ, WINDOWS_S):
        candidate = replace(settings, window_s=window, energy_cutoff_hz=cutoff)
        try:
            rows = stacked_energy([energy_observation(regressor, log, candidate) for log in logs])
            parameters = energy_least_squares(rows).parameters
        except UnsupportedLogError as error:
            reason = error
            continue
        predicted = [regressor.inverse_dynamics(s.q, s.dq, s.ddq, parameters, settings.sign) for s in pieces]
        tried.append({"settings": candidate.to_dict(), **_residuals(pieces, predicted)})
    if not tried:
        raise reason
    return Settings.from_dict(min(tried, key=lambda t: t["moving_percent"])["settings"]), tried


def _residuals(pieces: Sequence[Any], predicted: Sequence[np.ndarray]) -> dict[str, float]:
    """Residuals [%] over the logs' insides: all samples, and those where the joint moves."""
    totals = {"all": [[], []], "moving": [[], []]}  # type: dict[str, list[list[np.ndarray]]]
    for s, hat in zip(pieces, predicted, strict=True):
        end = round(END_S * s.rate)
        inside = slice(end, len(s.time) - end)
        for name, mask in (("all", np.ones_like(hat, dtype=bool)), ("moving", moving(s.dq, 0))):
            for at, effort in enumerate((s.effort, hat)):
                totals[name][at].append(low_pass(effort * mask, CUTOFF_HZ, s.rate)[inside])
    percent = {name: relative(np.concatenate(a), np.concatenate(b)) or 0.0 for name, (a, b) in totals.items()}
    return {
        "all_percent": percent["all"],
        "moving_percent": percent["moving"],
    }
