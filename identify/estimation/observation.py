"""The observation matrix of the torque model: Γ = Y·θ over a log, filtered in parallel and decimated."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.estimation.motion import PIECE_S, clock, decimated, resampled, settled, thinned
from identify.estimation.settings import STILL, Settings
from identify.logs.log import Log
from identify.regressor.friction import Presliding
from identify.regressor.regressor import Regressor
from identify.side_by_side import mapped

WORKING_RATE_HZ = 400.0
"""Logs are brought down to about this rate, by a zero-phase low-pass, before regressors are built."""

END_S = 0.1
"""Cut from both ends of every log, where zero-phase filters have no neighbours."""


@dataclass(frozen=True)
class Observation:
    """Rows of Γ = W·θ, joint by joint.

    matrix: n arrays (rows, p); effort: n arrays (rows,) [N·m or N]; time (rows,) [s] from the log's first sample;
    weight (rows, n): share of each row that is not at rest, in 0 … 1; rate of the rows [Hz]; names (p,).
    """

    matrix: tuple[np.ndarray, ...]
    effort: tuple[np.ndarray, ...]
    time: np.ndarray
    weight: np.ndarray
    rate: float
    names: tuple[str, ...]


@dataclass(frozen=True)
class Signals:
    """A log's filtered motion and raw effort at the working rate, all (N, n) but time (N,), whole or a piece of it.

    slip (N, arms): presliding states of joints and coupled motors, None where no friction reads them.
    first: which row of the whole the first one is; inside: the rows that are the piece's own. Those around them are
    there for filters to settle. total: rows of the whole.
    """

    time: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    effort: np.ndarray
    slip: np.ndarray | None
    rate: float
    first: int
    inside: range
    total: int


def signals(log: Log, settings: Settings, regressor: Regressor | None = None) -> Signals:
    """The whole log in one piece: position filtered and differentiated at the log's rate; then all is brought down to
    the working rate."""
    (whole,) = signal_pieces(log, settings, regressor, length=np.inf)
    return whole


def signal_pieces(
    log: Log,
    settings: Settings,
    regressor: Regressor | None = None,
    margin: float | None = None,
    length: float | None = None,
) -> Iterator[Signals]:
    """The log piece by piece of `length` [s], PIECE_S by default, each with `margin` [s] of settled signals around it,
    by default what the parallel filter needs; less at the log's ends. The regressor is that of presliding states."""
    measured = log.effort
    assert measured is not None
    time, rate, regular = clock(log)
    factor = max(1, int(rate // WORKING_RATE_HZ))
    total = -(-len(time) // factor)
    smoothing = settings.smoothing
    around = settled(settings.effort_cutoff_hz, rate / factor) if margin is None else round(margin * rate / factor)
    step = total if length == np.inf else max(1, round((length or PIECE_S) * rate / factor))
    states = States(settings.presliding(regressor))
    lead = -(-max(smoothing.settled(rate), settled(0.4 * rate / factor, rate)) // factor)

    def filtered(start: int) -> tuple[Signals, np.ndarray]:
        """The piece that starts there, without presliding states, and the positions that these follow."""
        # In rows at the working rate: the piece, what its margin reaches, and what the position's filter needs.
        inside = range(start, min(start + step, total))
        shown = range(max(0, inside.start - around), min(total, inside.stop + around))
        needed = range(max(0, shown.start - lead), min(total, shown.stop + lead))
        samples = slice(needed.start * factor, min(len(time), needed.stop * factor))
        position, effort = log.position[samples], measured[samples]
        if not regular:
            position, effort = resampled(log, time[samples], log.position, measured)
        q, dq, ddq = smoothing(position, rate)
        kept = slice(shown.start - needed.start, shown.stop - needed.start)
        # The motion is already low-passed: taking every factor-th row of it is enough where the cut-off allows.
        found = Signals(
            time=time[samples][::factor][kept],
            q=q[::factor][kept],
            dq=dq[::factor][kept],
            ddq=ddq[::factor][kept],
            effort=decimated(effort, factor, rate)[kept],
            slip=None,
            rate=rate / factor,
            first=shown.start,
            inside=range(inside.start - shown.start, inside.stop - shown.start),
            total=total,
        )
        return found, q[kept.start * factor : kept.stop * factor]

    for piece, q in mapped(filtered, range(0, total, step)):
        yield replace(piece, slip=states(q, piece.first * factor, factor))


class States:
    """Presliding states of pieces that overlap, one after the other, at the log's rate."""

    def __init__(self, presliding: Presliding | None) -> None:
        self.presliding = presliding
        self.known: np.ndarray | None = None
        self.stop = 0

    def __call__(self, q: np.ndarray, start: int, factor: int) -> np.ndarray | None:
        """(N, arms) at every factor-th sample of positions q (M, n), whose first is sample `start` of the log."""
        if self.presliding is None:
            return None
        old = 0 if self.known is None else self.stop - start
        new = self.presliding(q[old:])
        self.known = new if self.known is None else np.concatenate([self.known[len(self.known) - old :], new])
        self.stop = start + len(q)
        return self.known[::factor]


def moving(dq: np.ndarray, guard: int) -> np.ndarray:
    """(N, n) bool: the joint is faster than STILL, and with a guard, no rest or reversal is within `guard` samples.

    A fast reversal may fall between two samples, neither of them slow: a change of sign tells it.
    """
    from scipy.ndimage import maximum_filter1d

    still = np.abs(dq) <= STILL
    if not guard:
        return ~still
    reversal = dq[1:] * dq[:-1] < 0
    still[1:] |= reversal
    still[:-1] |= reversal
    return maximum_filter1d(still.astype(np.uint8), 2 * guard + 1, axis=0) == 0


@dataclass(frozen=True)
class Thinning:
    """How a piece's signals become rows: rest left out, low-passed in parallel, and every step-th row kept."""

    mask: np.ndarray
    rows: range
    cutoff: float
    rate: float
    step: int

    @staticmethod
    def of(s: Signals, settings: Settings) -> Thinning:
        mask = np.ones_like(s.dq, dtype=bool)
        if not settings.rest_counted:
            mask = moving(s.dq, round(settings.guard_s * s.rate))
        step = max(1, round(s.rate / settings.decimated_rate_hz))
        end = round(END_S * s.rate)
        # Rows end, end + step … of the whole log.
        begin = s.first + s.inside.start
        start = end + step * max(0, -(-(begin - end) // step))
        stop = min(s.first + s.inside.stop, s.total - end)
        return Thinning(mask.T, range(start - s.first, stop - s.first, step), settings.effort_cutoff_hz, s.rate, step)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """(c, rows) of signals x (c, N)."""
        return thinned(x, self.rows, self.cutoff, self.rate)


def torque_blocks(regressor: Regressor, logs: Sequence[Log], settings: Settings) -> Iterator[Observation]:
    """The logs' rows of the torque model, block by block: the one way in which they are made."""

    def block(s: Signals) -> Observation | None:
        thin = Thinning.of(s, settings)
        if not thin.rows:
            return None
        matrices, efforts = [], []
        for rows, support, mask in zip(_rows(regressor, s, settings), regressor.supports, thin.mask, strict=True):
            rows *= mask
            kept = thin(rows)
            matrix = np.zeros((len(thin.rows), regressor.p))
            matrix[:, support] = kept[:-1].T
            matrices.append(matrix)
            efforts.append(kept[-1])
        weight = np.clip(thin(thin.mask.astype(float)), 0, 1).T
        rate = s.rate / thin.step
        return Observation(tuple(matrices), tuple(efforts), s.time[thin.rows], weight, rate, regressor.names)

    for log in logs:
        for found in mapped(block, signal_pieces(log, settings, regressor)):
            if found is not None:
                yield found


def torque_residual(
    regressor: Regressor, logs: Sequence[Log], settings: Settings, parameters: np.ndarray
) -> np.ndarray:
    """(rows, n) effort − matrix·parameters of the rows of `torque_blocks`, without any matrix."""

    def part(s: Signals) -> np.ndarray:
        thin = Thinning.of(s, settings)
        if not thin.rows:
            return np.empty((0, regressor.robot.n))
        predicted = regressor.inverse_dynamics(s.q, s.dq, s.ddq, parameters, settings.sign, s.slip)
        return thin((s.effort - predicted).T * thin.mask).T

    return np.concatenate([x for log in logs for x in mapped(part, signal_pieces(log, settings, regressor))])


def _rows(regressor: Regressor, s: Signals, settings: Settings) -> list[np.ndarray]:
    """Each joint's rows at the working rate, transposed: (support + 1, N), the effort last."""
    whole = [np.empty((len(support) + 1, len(s.time))) for support in regressor.supports]
    at = 0
    for block in regressor.rows(s.q, s.dq, s.ddq, s.effort, settings.sign, s.slip):
        for rows, part in zip(whole, block, strict=True):
            rows[:, at : at + part.shape[1]] = part
        at += block[0].shape[1]
    return whole


def stacked(blocks: Iterable[Observation]) -> Observation:
    """All blocks as one, for logs short enough."""
    observations = list(blocks)
    first = observations[0]
    return Observation(
        matrix=tuple(np.concatenate([o.matrix[j] for o in observations]) for j in range(len(first.matrix))),
        effort=tuple(np.concatenate([o.effort[j] for o in observations]) for j in range(len(first.effort))),
        time=np.concatenate([o.time for o in observations]),
        weight=np.concatenate([o.weight for o in observations]),
        rate=first.rate,
        names=first.names,
    )
