"""How far a held-out motion is from the training motion, and whether it repeats it.

A test log that repeats the training motion tests little: what the model leaves out comes back the same way and has been
fitted. States (q, q̇, q̈) are compared in units of their spread over the training motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.estimation.settings import STILL

QUERIES = 2000
"""Most states of the test motion that are compared."""

CLOSE = 0.05
"""Root mean square distance [spreads of the training motion] up to which two states are the same."""

AROUND_S = (-0.6, -0.3, 0.0, 0.3, 0.6)
"""Times around a state at which the motion has to be the same too: states meet by chance, motions don't."""

LEAST = 0.01, 0.05, 0.1
"""Spreads of position, velocity and acceleration, SI, below which a joint counts as not moved by the training."""

REPEATED_PERCENT = 50.0
"""Share of a test motion that repeats the training motion, from which it is no test."""


@dataclass(frozen=True, eq=False)
class States:
    """A log's motion, on an even clock: q, dq, ddq (M, n) at rate [Hz]."""

    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    rate: float


def motion_distance(test: States, training: Sequence[States], paths: Sequence[str]) -> dict[str, Any]:
    """record["test"][k]["motion"]:

    repeat: {share_percent: of the moving time of the test log that repeats a training log, seconds: the same [s],
        training_log: the path of the one most of it repeats | null, repeats: whether it is too much for a test}
    distance: {median, largest: of the test's moving states to the nearest training state, in spreads of the training
        motion (root mean square over position, velocity and acceleration of every joint), told}
    told: both in a sentence. With null and a reason where the test log does not move.
    """
    scales = _spread(training)
    moving = np.flatnonzero((np.abs(test.dq) > STILL).any(axis=1))
    if not len(moving):
        return {"repeat": None, "distance": None, "told": None} | {
            f"{key}_reason": "no joint moves in it" for key in ("repeat", "distance", "told")
        }
    picked = moving[:: max(1, -(-len(moving) // QUERIES))]
    whole = [np.hstack([s.q / scales[0], s.dq / scales[1], s.ddq / scales[2]]) for s in training]
    mine = np.hstack([test.q / scales[0], test.dq / scales[1], test.ddq / scales[2]])
    distance = np.min([_nearest(states, mine[picked])[0] for states in whole], axis=0)
    plain = 2 * test.q.shape[1]
    shares = np.array(
        [
            _repeated(mine[:, :plain], test.rate, picked, states[:, :plain], s.rate)
            for states, s in zip(whole, training, strict=True)
        ]
    )
    share = float(100 * shares.any(axis=0).mean())
    most = int(shares.mean(axis=1).argmax())
    repeat = {
        "share_percent": share,
        "seconds": share / 100 * len(moving) / test.rate,
        "training_log": paths[most] if share > 0 else None,
        "repeats": share >= REPEATED_PERCENT,
    }
    if share == 0:
        repeat["training_log_reason"] = "no part of the test motion repeats a training motion"
    median, largest = float(np.median(distance)), float(distance.max())
    told = _told(median, largest)
    sentence = f"{share:.0f} % of the test motion repeats the training motion; {told}" if share >= 0.5 else told
    return {"repeat": repeat, "distance": {"median": median, "largest": largest, "told": told}, "told": sentence}


def _spread(training: Sequence[States]) -> list[np.ndarray]:
    """Standard deviation of each joint's position, root mean square of velocity and acceleration, over the training."""
    rows = [(s.q - s.q.mean(axis=0), s.dq, s.ddq) for s in training]
    count = sum(len(s.q) for s in training)
    squares = [sum((row[k].astype(float) ** 2).sum(axis=0) for row in rows) for k in range(3)]
    return [np.maximum(np.sqrt(total / count), least) for total, least in zip(squares, LEAST, strict=True)]


def _nearest(states: np.ndarray, queries: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Root mean square distance of each query (m, d) to the nearest of the states (M, d), and which one that is."""
    from scipy.spatial import cKDTree

    distance, which = cKDTree(states).query(queries)
    return distance / np.sqrt(states.shape[1]), which


def _repeated(mine: np.ndarray, rate: float, picked: np.ndarray, theirs: np.ndarray, their_rate: float) -> np.ndarray:
    """(picked,) whether the motion around each picked row of mine (M, d) is one around some row of theirs (K, d)."""
    _, which = _nearest(theirs, mine[picked])
    # To within a sample, by how far along its way the nearest state is off.
    way = np.gradient(theirs, axis=0)[which]
    ahead = np.einsum("ij,ij->i", mine[picked] - theirs[which], way)
    there = which + np.clip(ahead / np.maximum((way**2).sum(axis=1), 1e-300), -1.0, 1.0)
    same = np.ones(len(picked), dtype=bool)
    compared = np.zeros(len(picked), dtype=int)
    for shift in AROUND_S:
        a, b = picked + shift * rate, there + shift * their_rate
        inside = (a >= 0) & (a <= len(mine) - 1) & (b >= 0) & (b <= len(theirs) - 1)
        off = np.sqrt(((_at(mine, a) - _at(theirs, b)) ** 2).mean(axis=1))
        same &= ~inside | (off <= CLOSE)
        compared += inside
    return same & (compared >= 3)


def _at(x: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """x (M, d) between its rows, linearly."""
    rows = np.clip(rows, 0, len(x) - 1)
    low = np.minimum(rows.astype(int), max(len(x) - 2, 0))
    share = (rows - low)[:, None]
    return (1 - share) * x[low] + share * x[np.minimum(low + 1, len(x) - 1)]


def _told(median: float, largest: float) -> str:
    if median < CLOSE:
        word = "on the training motion"
    elif median < 0.5:
        word = "near the training motion"
    elif median < 1.0:
        word = "some way off the training motion"
    else:
        word = "far from the training motion, where the model is extrapolated"
    return f"{word}: {median:.2g} of its spread away (median; at most {largest:.2g})"
