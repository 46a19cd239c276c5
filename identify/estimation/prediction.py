"""The effort that parameters predict along a log, whatever its length and its clock."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.estimation.motion import PIECE_S, Motion, beneath, clock, interpolated, low_pass, motion_at, settled
from identify.estimation.observation import States
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.regressor.regressor import Regressor
from identify.side_by_side import mapped

EFFORT_HZ = 50.0
"""Low-pass of predicted efforts, five times as high as that which they are judged by. At a reversal the effort of a
drive passes smoothly, while the sign of the velocity jumps and the acceleration has been low-passed."""


@dataclass(frozen=True, eq=False)
class Predictor:
    """Parameters (p,) in the order of the regressor's names, and the settings that they were found with."""

    regressor: Regressor
    parameters: np.ndarray
    settings: Settings

    def effort(self, motion: Motion, slip: np.ndarray | None) -> np.ndarray:
        """(N, n) effort [N·m or N] of the motion; slip (N, arms): its presliding states, None where none are read."""
        hat = self.regressor.inverse_dynamics(
            motion.q, motion.dq, motion.ddq, self.parameters, self.settings.sign, slip
        )
        return low_pass(hat, EFFORT_HZ, motion.rate)


@dataclass(frozen=True, eq=False)
class Stretch:
    """Samples `part` of a log; rows of its even clock between which they lie, and around them as many as predictions
    need to settle; of each predictor the motion of these rows and its presliding states.

    between: times (m,) [s] of the samples where they are not the rows themselves.
    """

    part: slice
    rows: slice
    motions: tuple[Motion, ...]
    slips: tuple[np.ndarray | None, ...]
    between: np.ndarray | None

    def effort(self, predictor: Predictor, k: int = 0) -> np.ndarray:
        """(m, n) what the k-th predictor says of the samples."""
        hat = predictor.effort(self.motions[k], self.slips[k])
        if self.between is None:
            return hat[self.part.start - self.rows.start :][: self.part.stop - self.part.start]
        return interpolated(self.between, self.motions[k].time, hat)


def stretches(log: Log, predictors: Sequence[Predictor], parts: Iterable[slice]) -> Iterator[Stretch]:
    """The log at these samples, which may overlap but come in order; positions are low-passed and differentiated as
    for the fits."""
    ticks = clock(log)
    states = [States(predictor.settings.presliding(predictor.regressor)) for predictor in predictors]
    smoothings = [predictor.settings.smoothing for predictor in predictors]
    margin = settled(EFFORT_HZ, ticks[1])

    def moved(part: slice) -> Stretch:
        between = None if ticks[0] is log.time else log.time[part]
        beside = part if between is None else beneath(ticks[0], between)
        rows = slice(max(0, beside.start - margin), min(len(ticks[0]), beside.stop + margin))
        found = {smoothing: motion_at(log, rows, smoothing, ticks) for smoothing in set(smoothings)}
        return Stretch(part, rows, tuple(found[smoothing] for smoothing in smoothings), (), between)

    for stretch in mapped(moved, parts):
        slips = (s(motion.q, stretch.rows.start, 1) for s, motion in zip(states, stretch.motions, strict=True))
        yield replace(stretch, slips=tuple(slips))


def predicted_effort(regressor: Regressor, log: Log, parameters: np.ndarray, settings: Settings) -> np.ndarray:
    """(N, n) effort of the parameters at the log's samples, position low-passed and differentiated as for the fit."""
    effort = np.empty(log.position.shape)
    predictor = Predictor(regressor, parameters, settings)
    step = max(1, round(PIECE_S * log.rate_hz))
    parts = (slice(start, min(start + step, log.samples)) for start in range(0, log.samples, step))

    def fill(stretch: Stretch) -> None:
        effort[stretch.part] = stretch.effort(predictor)

    for _ in mapped(fill, stretches(log, [predictor], parts)):
        pass
    return effort
