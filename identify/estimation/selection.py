"""Which processing suits these logs: decided inside the training logs, by cross-validation over short blocks.

Three choices are made, one after the other. How to treat velocities near zero: leave out rows at rest and take
the exact sign, or count every row and smooth the sign. Then the forms of friction (see `friction_choice`): one form is
added after the other as long as it lowers the residual beyond doubt. Then the cut-offs of the position (see
`cutoff_choice`). Each candidate is fitted on four fifths of the training logs and predicts the effort of the rest, five
times over. The treatment of rest is judged on all samples, cut-offs on those where the joint moves, both by the rule of
`scoring`; friction on all samples where rest is counted, else on those where the joint moves. Test logs are never
looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from identify.errors import UnsupportedLogError
from identify.estimation.cutoff_choice import Validation, choose_cutoffs
from identify.estimation.energy import energy_least_squares, energy_observation, stacked_energy
from identify.estimation.friction_choice import SMOOTHING, WORTH_IT, choose_friction, with_friction
from identify.estimation.least_squares import solution, weights_by_noise
from identify.estimation.motion import Smoothing, clock, low_pass, motion_at
from identify.estimation.observation import END_S, Observation, Signals, signals, stacked, torque_blocks
from identify.estimation.prediction import EFFORT_HZ
from identify.estimation.reduction import reduced
from identify.estimation.scoring import CUTOFF_HZ, SPEED_CUTOFF_HZ, relative
from identify.estimation.settings import CONSTANTS, STILL, Settings
from identify.logs.log import Log
from identify.regressor.friction import FURTHER, LOAD, PRESLIDING, further_forms
from identify.regressor.regressor import Regressor
from identify.side_by_side import mapped

FOLDS = 5
BLOCK_S = 0.5
"""Length of the blocks that are dealt out to the folds in turn; short, so that every fold sees the whole motion."""

GAP_S = 0.1
"""Rows this close to a block left out are left out with it: the filters would carry it over."""

CHOOSING = "choosing how rest, friction and noise are met"

WINDOWS_S = (0.05, 0.1, 0.2)
MANY = 30
"""Settings that are about tried in all, for the progress that is told."""

ENERGY_CUTOFFS_HZ = (5.0, 8.0, 10.0, 15.0, 20.0, 40.0)

Progress = Callable[[float, str], None] | None


IMPOSSIBLE = Validation(dict.fromkeys(("all_percent", "moving_percent"), np.inf), {})
"""Of settings under which the logs can't tell the parameters apart."""


def choose_settings(
    regressor: Regressor,
    logs: Sequence[Log],
    start: Settings | None = None,
    friction: Collection[str] | None = None,
    progress: Progress = None,
) -> tuple[Settings, list[dict[str, Any]]]:
    """Settings of the torque model for these logs, and what was tried: [{settings, all_percent, moving_percent}].

    friction: the further forms of friction to have, which are chosen too where it is None.
    """
    base = start or Settings()
    tried: list[dict[str, Any]] = []
    models = {regressor.forms: regressor}
    known: dict[Settings, Validation] = {}

    def judged(candidates: Sequence[Settings], share: float, until: float, needed: bool = True) -> list[Validation]:
        fresh = [candidate for candidate in dict.fromkeys(candidates) if candidate not in known]
        for candidate in fresh:
            if candidate.friction not in models:
                models[candidate.friction] = candidate.suited(regressor)

        def found(candidate: Settings) -> Validation:
            try:
                return validated(candidate.suited(models[candidate.friction]), logs, candidate)
            except UnsupportedLogError:
                if needed:
                    raise
                return IMPOSSIBLE

        for k, (candidate, validation) in enumerate(zip(fresh, mapped(found, fresh), strict=True)):
            known[candidate] = validation
            if validation is not IMPOSSIBLE:
                shown = {name: x for name, x in candidate.to_dict().items() if name not in CONSTANTS[LOAD]}
                tried.append({"settings": shown, **validation.percent})
            if progress:
                progress(share + (until - share) * k / len(fresh), CHOOSING)
        return [known[candidate] for candidate in candidates]

    asked = None if friction is None else further_forms(friction)
    smooth = [replace(base, coulomb_velocity=v, rest_counted=True) for v in SMOOTHING]
    # The presliding state is told by rest and by what is near to it.
    treatments = smooth if asked is not None and PRESLIDING in asked else [base, *smooth]
    scores = judged(treatments, 0.0, 0.3)
    best = _least(scores, "all_percent")
    chosen = treatments[best]
    figure = "all_percent" if chosen.rest_counted else "moving_percent"
    if progress:
        progress(0.3, CHOOSING)
    if asked is not None:
        chosen = with_friction(regressor, logs, chosen, asked)
    else:

        def better(simple: Settings, more: Settings) -> bool:
            before, after = judged([simple, more], 0.4, 0.6, needed=False)
            return _surely_better(before, after, figure)

        open_to = [form for form in FURTHER if form != PRESLIDING or chosen.rest_counted]
        chosen = choose_friction(regressor, logs, chosen, open_to, better)

    def noise_met(candidate: Settings) -> Validation:
        share = 0.6 + 0.4 * min(1.0, len(tried) / MANY)
        return judged([candidate], share, share)[0]

    return choose_cutoffs(noise_met, chosen), tried


def _least(scores: Sequence[Validation], figure: str) -> int:
    return int(np.argmin([score.percent[figure] for score in scores]))


def _surely_better(simple: Validation, more: Validation, figure: str) -> bool:
    """Whether the gain is more than SURE of its standard errors, by its scatter over the blocks, and WORTH_IT."""
    if more is IMPOSSIBLE:
        return False
    return more.surely_below(simple, figure) and simple.percent[figure] - more.percent[figure] >= WORTH_IT


def validated(regressor: Regressor, logs: Sequence[Log], settings: Settings) -> Validation:
    """Residuals of fits with these settings on blocks that they have not seen, each block left out of one of FOLDS."""
    observations = [stacked(torque_blocks(regressor, [log], settings)) for log in logs]
    pieces = [signals(log, settings, regressor) for log in logs]
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
        reduction = reduced([part], spectral=False)
        parameters = solution(reduction, weights_by_noise(reduction))[2]
        for s, t, hat in zip(pieces, offsets, predicted, strict=False):
            here = ((s.time + t) // BLOCK_S).astype(int) % FOLDS == k
            slip = None if s.slip is None else s.slip[here]
            hat[here] = regressor.inverse_dynamics(s.q[here], s.dq[here], s.ddq[here], parameters, settings.sign, slip)
    return _residuals(logs, pieces, predicted)


def choose_window(
    regressor: Regressor, logs: Sequence[Log], settings: Settings
) -> tuple[Settings, list[dict[str, Any]]]:
    """Settings of the energy model: window and cut-off whose parameters predict the training logs' effort best."""
    tried: list[dict[str, Any]] = []
    pieces = [signals(log, settings) for log in logs]
    candidates = [
        replace(settings, window_s=window, energy_cutoff_hz=cutoff)
        for cutoff, window in product(ENERGY_CUTOFFS_HZ, WINDOWS_S)
    ]

    def judged(candidate: Settings) -> Validation | UnsupportedLogError:
        try:
            rows = stacked_energy([energy_observation(regressor, log, candidate) for log in logs])
            parameters = energy_least_squares(rows).parameters
        except UnsupportedLogError as error:
            return error
        predicted = [regressor.inverse_dynamics(s.q, s.dq, s.ddq, parameters, settings.sign) for s in pieces]
        return _residuals(logs, pieces, predicted)

    for candidate, found in zip(candidates, mapped(judged, candidates), strict=True):
        if isinstance(found, UnsupportedLogError):
            reason = found
        else:
            tried.append({"settings": candidate.to_dict(), **found.percent})
    if not tried:
        raise reason
    return Settings.from_dict(min(tried, key=lambda t: t["moving_percent"])["settings"]), tried


def _residuals(logs: Sequence[Log], pieces: Sequence[Signals], predicted: Sequence[np.ndarray]) -> Validation:
    """Residuals over the logs' insides: all samples, and those where the joint moves."""
    predicted = [low_pass(hat, EFFORT_HZ, s.rate) for s, hat in zip(pieces, predicted, strict=True)]
    moves = [_moves(log)[:: round(log.rate_hz / s.rate)] for s, log in zip(pieces, logs, strict=True)]
    percent, blocks = {}, {}
    for name in ("all_percent", "moving_percent"):
        measured, found, errors = [], [], []
        for s, hat, fast in zip(pieces, predicted, moves, strict=True):
            end = round(END_S * s.rate)
            inside = slice(end, len(s.time) - end)
            mask = fast if name == "moving_percent" else np.ones_like(fast)
            a, b = (low_pass(effort * mask, CUTOFF_HZ, s.rate)[inside] for effort in (s.effort, hat))
            measured.append(a)
            found.append(b)
            starts = range(0, len(a), max(1, round(BLOCK_S * s.rate)))
            errors.append(np.add.reduceat(((a - b) ** 2).sum(axis=1), starts) if len(a) else np.empty(0))
        percent[name] = relative(np.concatenate(measured), np.concatenate(found)) or 0.0
        blocks[name] = np.concatenate(errors)
    return Validation(percent, blocks)


def _moves(log: Log) -> np.ndarray:
    """(N, n) whether a joint moves, by its position alone: a logged velocity may be noisy or late."""
    dq = motion_at(log, slice(0, log.samples), Smoothing(SPEED_CUTOFF_HZ), clock(log)).dq
    return np.asarray(np.abs(dq) > STILL)
