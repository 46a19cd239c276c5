"""A quick torque model of a log: rows enough to tell whether motion and effort belong together, no more."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identify.estimation.motion import differentiated, low_pass, uniform
from identify.logs.log import Log
from identify.logs.slicing import window
from identify.logs.triage import REST_SPEED
from identify.regressor.columns import column_kind
from identify.regressor.regressor import Regressor

CUTOFF_HZ = 20.0
"""Low-pass of position and of effort."""
RATE_HZ = 50.0
"""Rate of the rows."""
GUARD_S = 0.06
"""Rows so near to rest or a reversal are left out: the low-pass spreads the step of friction, by about a period."""
PIECE_S, PIECES = 15.0, 4
"""A longer log is looked at in so many pieces of this length, spread evenly."""
END_S = 0.1
SHIFTS_S = 0.15
"""Effort is kept for so long before and after every row, to be shifted."""
_POSITIVE = ("Fv", "Fs", "Ia")


@dataclass(frozen=True)
class Rows:
    """Motion of R rows, and the effort around them.

    time (R,) [s]; q, dq, ddq (R, n), SI; counted (R, n): the joint moves; pieces: of each its effort's time (M,) [s],
    effort (M, n), and the slice of rows that lie in it.
    """

    time: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    counted: np.ndarray
    pieces: tuple[tuple[np.ndarray, np.ndarray, slice], ...]

    def effort(self, shift: float = 0.0) -> np.ndarray:
        """(R, n) effort `shift` seconds after each row."""
        parts = [
            np.column_stack([np.interp(self.time[rows] + shift, time, x) for x in effort.T])
            for time, effort, rows in self.pieces
        ]
        return np.concatenate(parts)

    def changed(self, order: np.ndarray, sign: np.ndarray) -> Rows:
        """The rows as if joint j had moved as sign[j] × joint order[j]; effort as it is."""
        q, dq, ddq = (sign * x[:, order] for x in (self.q, self.dq, self.ddq))
        return replace(self, q=q, dq=dq, ddq=ddq, counted=self.counted[:, order])


def rows_of(log: Log) -> Rows | None:
    """The rows of a log with effort; None where it is too short for any."""
    parts = []
    for piece in _pieces(log):
        assert piece.effort is not None
        time, (position, effort), rate = uniform(piece, piece.position, piece.effort)
        q, dq, ddq = differentiated(position, CUTOFF_HZ, rate)
        smooth = low_pass(effort, CUTOFF_HZ, rate)
        margin = round(END_S * rate)
        keep = np.arange(margin, len(time) - margin, max(1, round(rate / RATE_HZ)))
        parts.append((time, q[keep], dq[keep], ddq[keep], smooth, keep, _moving(dq, round(GUARD_S * rate))[keep]))
    if sum(len(part[5]) for part in parts) < 50:
        return None
    pieces, at = [], 0
    for time, _, _, _, effort, keep, _ in parts:
        pieces.append((time, effort, slice(at, at + len(keep))))
        at += len(keep)
    times = np.concatenate([part[0][part[5]] for part in parts])
    q, dq, ddq, counted = (np.concatenate([part[k] for part in parts]) for k in (1, 2, 3, 6))
    return Rows(times, q, dq, ddq, counted, tuple(pieces))


@dataclass(frozen=True)
class Equations:
    """W·θ = b of counted rows, all joints stacked and each in units of its own effort.

    basis (K, r): orthonormal basis of W's columns; matrix W (K, p); joint (K,) whose row it is; scale (n,).
    """

    matrix: np.ndarray
    basis: np.ndarray
    triangle: np.ndarray
    joint: np.ndarray
    counted: np.ndarray
    scale: np.ndarray
    names: tuple[str, ...]

    def side(self, effort: np.ndarray) -> np.ndarray:
        """(K,) b of efforts (R, n)."""
        return np.concatenate([effort[self.counted[:, j], j] / s for j, s in enumerate(self.scale)])

    def residual(self, b: np.ndarray) -> np.ndarray:
        """(K,) what W leaves of b."""
        return b - self.basis @ (self.basis.T @ b)

    def parameters(self, b: np.ndarray) -> np.ndarray:
        """(p,) θ of least squares, with friction and actuator inertia as positive as they are in any robot."""
        from scipy.optimize import lsq_linear

        lower = np.array([0.0 if column_kind(name) in _POSITIVE else -np.inf for name in self.names])
        # Where joints stand still the rows are silent on much, and trial steps that scipy then discards overflow.
        with np.errstate(invalid="ignore", over="ignore"):
            found = lsq_linear(self.triangle, self.basis.T @ b, (lower, np.inf))
        return np.asarray(found.x)

    def shares(self, residual: np.ndarray) -> np.ndarray:
        """(n,) rms of each joint's residual, as a share of its effort's standard deviation; NaN where it rests."""
        counts = np.bincount(self.joint, minlength=len(self.scale))
        squares = np.bincount(self.joint, residual**2, len(self.scale))
        return np.sqrt(squares / np.where(counts > 0, counts, np.nan))


def equations(regressor: Regressor, rows: Rows) -> Equations:
    """The equations of the rows; `rows.effort()` gives the scale of each joint's."""
    y = regressor.torque(rows.q, rows.dq, rows.ddq)
    effort = rows.effort()
    scale = np.array(
        [max(float(np.std(x[c])), 1e-12) if c.any() else 1.0 for x, c in zip(effort.T, rows.counted.T, strict=True)]
    )
    matrix = np.concatenate([y[rows.counted[:, j], j] / s for j, s in enumerate(scale)])
    joint = np.repeat(np.arange(len(scale)), rows.counted.sum(axis=0))
    length = np.linalg.norm(matrix, axis=0)
    used = length > 0
    basis, triangle = np.linalg.qr(matrix[:, used] / length[used])
    full = np.zeros((basis.shape[1], matrix.shape[1]))
    full[:, used] = triangle * length[used]
    return Equations(matrix, basis, full, joint, rows.counted, scale, regressor.names)


def _pieces(log: Log) -> list[Log]:
    if log.duration <= PIECE_S * PIECES:
        return [log]
    starts = log.time[0] + np.linspace(0, log.duration - PIECE_S, PIECES)
    found = []
    for start in starts:
        piece = window(log, start, start + PIECE_S)
        found.append(replace(piece, time=piece.time + start))
    return [piece for piece in found if piece.samples > 50]


def _moving(dq: np.ndarray, guard: int) -> np.ndarray:
    """(N, n) joints that move, no rest or reversal within `guard` samples."""
    still = np.abs(dq) <= REST_SPEED
    turned = dq[1:] * dq[:-1] < 0
    still[1:] |= turned
    near = np.cumsum(np.concatenate([np.zeros((1, dq.shape[1]), dtype=int), still.astype(int)]), axis=0)
    count = len(dq)
    after = np.minimum(np.arange(count) + guard + 1, count)
    before = np.maximum(np.arange(count) - guard, 0)
    return near[after] == near[before]
