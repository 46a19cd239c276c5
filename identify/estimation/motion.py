"""Positions made into motion: zero-phase filtering, differentiation, and one uniform clock."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from identify.logs.log import Log
from identify.logs.triage import REST_SPEED

JITTER = 0.02
"""Steps that differ from the mean step by more than this share of it are resampled onto the mean step."""

STAMP_S = 1e-9
"""Stamps are rounded to this [s]."""

REACH = 2.0
"""How far a record is continued at its ends before a filter, in periods of the filter's cut-off."""

PIECE_S = 20.0
"""Length of the pieces in which a long log is worked on, so that memory does not grow with it."""

FORGOTTEN = 1e-11
"""Share of what a low-pass met at an end of a record that may be left of it where the end counts as far away."""

BUSY, FADE = 0.6, 0.5
"""How far around a start, stop or reversal the higher of two cut-offs rules, and over how long the lower one takes its
place, in periods of the lower: so far it would spread what happens there."""

HEARD = 1.0
"""Over how many periods of the lower cut-off motion is told from noise."""

ABOVE, ABOVE_TURNING = 4.0, 1.2
"""What the lower one takes away counts as motion where its power is so many times that of the noise, and so many at a
start, stop or reversal, where some is to be expected."""

_BLOCK = 1 << 16

GROUP = 48
"""Thinned rows made in one product: more would multiply more zeros, fewer would be less of a matrix."""


@dataclass(frozen=True)
class Motion:
    """Filtered motion on a uniform clock: time (N,) [s]; q, dq, ddq (N, n), SI; rate [Hz]."""

    time: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    rate: float


def low_pass(x: np.ndarray, cutoff: float, rate: float) -> np.ndarray:
    """Zero-phase Butterworth low-pass of order 4, forwards and backwards along the first axis.

    cutoff [Hz] is held below 0.4 of the rate [Hz]. A record too short for the filter's start-up comes back as it is.
    """
    from scipy.signal import sosfiltfilt

    sections = _butterworth(min(cutoff, 0.4 * rate), rate)
    return sosfiltfilt(sections, x, axis=0) if len(x) > 3 * (2 * len(sections) + 1) else x


@lru_cache(maxsize=64)
def _butterworth(cutoff: float, rate: float) -> np.ndarray:
    """Sections of the filter; designing it takes longer than passing a short log through it."""
    from scipy.signal import butter

    return butter(4, cutoff, fs=rate, output="sos")


def clock(log: Log, jitter: float = JITTER) -> tuple[np.ndarray, float, bool]:
    """A uniform clock (N,) [s] for the log, its rate [Hz], and whether the samples lie on it as they are: where no step
    differs by more than `jitter` of itself. It is the log's own where that is uniform up to STAMP_S."""
    step = (log.time[-1] - log.time[0]) / (log.samples - 1)

    def even(start: int, stop: int) -> np.ndarray:
        return np.asarray(log.time[0] + step * np.arange(start, stop))

    off, uneven = 0.0, 0.0
    for start in range(0, log.samples, _BLOCK):  # a log may be long
        times = log.time[start : start + _BLOCK + 1]
        off = max(off, np.abs(even(start, start + len(times)) - times).max())
        uneven = max(uneven, np.abs(np.diff(times) - step).max(initial=0.0))
    if off <= STAMP_S:
        return log.time, 1 / step, True
    return even(0, log.samples), 1 / step, bool(uneven <= jitter * step and off <= step)


def beneath(samples: np.ndarray, time: np.ndarray) -> slice:
    """Those of the samples' times (N,), in order, between which times (m,), in order, lie."""
    first = max(0, int(np.searchsorted(samples, time[0], side="right")) - 1)
    return slice(first, min(max(int(np.searchsorted(samples, time[-1])) + 1, first + 1), len(samples)))


def interpolated(time: np.ndarray, at: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(m, n): x (N, n) at times `at` (N,) interpolated linearly at times (m,)."""
    out = np.empty((len(time), x.shape[1]))
    for j, column in enumerate(x.T):
        out[:, j] = np.interp(time, at, column)
    return out


def resampled(log: Log, time: np.ndarray, *channels: np.ndarray) -> list[np.ndarray]:
    """The log's channels (N, n), interpolated linearly, at times (m,) in order."""
    part = beneath(log.time, time)
    return [interpolated(time, log.time[part], x[part]) for x in channels]


def uniform(log: Log, *channels: np.ndarray, jitter: float = JITTER) -> tuple[np.ndarray, list[np.ndarray], float]:
    """The clock (N,), the channels (N, n) on it, and its rate [Hz].

    Channels are as recorded where no step differs by more than `jitter` of itself, else interpolated linearly.
    """
    even, rate, regular = clock(log, jitter)
    return even, list(channels) if regular else resampled(log, even, *channels), rate


def differentiated(position: np.ndarray, cutoff: float, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, q̇, q̈ (N, n) of a position (N, n) low-passed at `cutoff` [Hz]; derivatives by central differences.

    Before the filter the record goes on at both ends as the parabola that it follows there: the filter's own
    continuation, a reflection, has no acceleration at the end, which a log cut out of a motion does have.
    """
    ahead = min(round(REACH * rate / cutoff), len(position) - 1)
    longer = np.concatenate([continuation(position, ahead)[::-1], position, continuation(position[::-1], ahead)])
    q = low_pass(longer, cutoff, rate)
    dq = np.gradient(q, 1 / rate, axis=0)
    inside = slice(ahead, ahead + len(position))
    return q[inside], dq[inside], np.gradient(dq, 1 / rate, axis=0)[inside]


def continuation(x: np.ndarray, length: int) -> np.ndarray:
    """(length, n): how x (N, n), N > length, went on before its first row, the row next to it first.

    The parabola fitted over half the length, and what it leaves of x reflected at the end, point and sign.
    """
    rows = np.arange(length + 1) / max(length, 1)
    fitted = max(length // 2 + 1, 4)
    basis = np.vander(rows, 3, increasing=True)
    parabola = np.linalg.lstsq(basis[:fitted], x[: min(fitted, length + 1)], rcond=None)[0]
    rest = x[: length + 1] - basis @ parabola
    return np.vander(-rows[1:], 3, increasing=True) @ parabola + 2 * rest[0] - rest[1:]


@dataclass(frozen=True)
class Smoothing:
    """How noise is taken out of positions: a low-pass at `cutoff` [Hz], and where `quiet` [Hz] is lower, at that where
    it takes nothing but noise away. Friction bends a motion at starts, stops and reversals; it may be fast elsewhere.

    The noise is taken as white, of the power that is left above `cutoff` there; coloured noise counts as motion.
    """

    cutoff: float
    quiet: float | None = None

    def __call__(self, position: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, q̇, q̈ (N, n) of a position (N, n)."""
        sharp = differentiated(position, self.cutoff, rate)
        if self.quiet is None or self.quiet >= self.cutoff:
            return sharp
        smooth = differentiated(position, self.quiet, rate)
        # One row a joint: filters along rows are several times faster.
        span = round(HEARD / self.quiet * rate)
        lost, noise = _mean_square((sharp[2] - smooth[2]).T, span), _mean_square((position - sharp[0]).T, span)
        noise *= _white(self.cutoff, self.quiet, rate)
        kept = (lost > ABOVE * noise) | ((lost > ABOVE_TURNING * noise) & _turning(np.ascontiguousarray(smooth[1].T)))
        share = np.ascontiguousarray(_around(kept, self.quiet, rate).T)
        for x, y in zip(sharp, smooth, strict=True):
            x -= y
            x *= share
            x += y
        return sharp

    def settled(self, rate: float) -> int:
        """Samples after which an end is forgotten."""
        if self.quiet is None or self.quiet >= self.cutoff:
            return settled(self.cutoff, rate)
        return settled(self.quiet, rate) + round((BUSY + FADE + HEARD) / self.quiet * rate)


def _turning(dq: np.ndarray) -> np.ndarray:
    """(n, N) bool: starts, stops and reversals of velocities (n, N), and the record's ends."""
    still = np.abs(dq) <= REST_SPEED
    forward = dq > 0
    turning = np.ones(dq.shape, dtype=bool)
    turning[:, 1:-1] = (still[:, 1:-1] != still[:, :-2]) | (forward[:, 1:-1] != forward[:, :-2])
    return turning


def _around(what: np.ndarray, quiet: float, rate: float) -> np.ndarray:
    """(n, N) 1 around what (n, N) is true for, 0 elsewhere, with slopes between."""
    from scipy.ndimage import maximum_filter1d, uniform_filter1d

    around = maximum_filter1d(what.astype(np.uint8), 2 * round(BUSY / quiet * rate) + 1, mode="nearest")
    return np.asarray(uniform_filter1d(around.astype(float), round(FADE / quiet * rate) | 1, mode="nearest"))


def _mean_square(x: np.ndarray, span: int) -> np.ndarray:
    """(n, N) mean square of x (n, N) over the `span` samples around each."""
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(np.square(x, order="C"), max(1, span), mode="nearest"))


@lru_cache(maxsize=64)
def _white(cutoff: float, quiet: float, rate: float) -> float:
    """What white noise of a position leaves between the accelerations of two low-passes, over what the higher one takes
    away of the position: the ratio of their variances."""
    impulse = np.zeros((2 * settled(quiet, rate) + 1, 1))
    impulse[len(impulse) // 2] = 1.0
    sharp, smooth = (differentiated(impulse, f, rate) for f in (cutoff, quiet))
    return float(np.sum((sharp[2] - smooth[2]) ** 2) / np.sum((impulse - sharp[0]) ** 2))


def motion_at(log: Log, rows: slice, smoothing: Smoothing, ticks: tuple[np.ndarray, float, bool]) -> Motion:
    """The log's motion at these rows, without step, of its even clock `ticks`, as `clock` gives it. Of a part of a log,
    as of the whole."""
    time, rate, regular = ticks
    margin = smoothing.settled(rate)
    around = slice(max(0, rows.start - margin), min(len(time), rows.stop + margin))
    position = log.position[around] if regular else resampled(log, time[around], log.position)[0]
    inside = slice(rows.start - around.start, rows.stop - around.start)
    q, dq, ddq = smoothing(position, rate)
    return Motion(time[rows], q[inside], dq[inside], ddq[inside], rate)


def decimated(x: np.ndarray, factor: int, rate: float) -> np.ndarray:
    """Every factor-th row after a zero-phase low-pass at 0.4 of the new rate."""
    return x if factor == 1 else low_pass(x, 0.4 * rate / factor, rate)[::factor]


@lru_cache(maxsize=64)
def settled(cutoff: float, rate: float) -> int:
    """Samples after which the low-pass at `cutoff` has forgotten an end, by its slowest pole."""
    poles = [np.abs(np.roots(section[3:])).max() for section in _butterworth(min(cutoff, 0.4 * rate), rate)]
    return int(np.ceil(np.log(FORGOTTEN) / np.log(max(poles))))


def thinned(x: np.ndarray, rows: range, cutoff: float, rate: float) -> np.ndarray:
    """(c, len(rows)) of signals x (c, N) low-passed as by `low_pass`, at these of their samples alone.

    Away from the ends this is one product with the filter's impulse response, a fraction of filtering every sample.
    """
    reach = settled(cutoff, rate)
    inner = [k for k, row in enumerate(rows) if reach <= row < x.shape[1] - reach]
    if len(inner) < GROUP:
        return low_pass(x.T, cutoff, rate)[rows].T
    out = np.empty((len(x), len(rows)))
    head, tail = range(inner[0]), range(inner[-1] + 1, len(rows))
    for ends, part in ((head, slice(0, 3 * reach)), (tail, slice(max(0, x.shape[1] - 3 * reach), x.shape[1]))):
        if ends:
            at = np.array([rows[k] for k in ends]) - part.start
            out[:, ends.start : ends.stop] = low_pass(x[:, part].T, cutoff, rate)[at].T
    response = _response(min(cutoff, 0.4 * rate), rate, reach, rows.step)
    for k in range(inner[0], inner[-1] + 1, GROUP):
        count = min(GROUP, inner[-1] + 1 - k)
        first = rows[k] - reach
        length = (count - 1) * rows.step + 2 * reach + 1
        out[:, k : k + count] = x[:, first : first + length] @ response[:length, :count]
    return out


@lru_cache(maxsize=8)
def _response(cutoff: float, rate: float, reach: int, step: int) -> np.ndarray:
    """(samples, GROUP): weights of the samples around GROUP outputs `step` apart, the first reach samples in."""
    impulse = np.zeros(6 * reach + 1)
    impulse[3 * reach] = 1.0
    weights = low_pass(impulse, cutoff, rate)[2 * reach : 4 * reach + 1]
    response = np.zeros(((GROUP - 1) * step + 2 * reach + 1, GROUP))
    for k in range(GROUP):
        response[k * step : k * step + 2 * reach + 1, k] = weights
    return response
