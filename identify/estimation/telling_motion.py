"""Which motion tells a parameter: by which kinds of motion of which joints its column of the regressor lives.

The torque regressor is a sum: of what acts at rest (gravity, offsets), of terms linear in one joint's acceleration, of
terms quadratic in one joint's velocity or bilinear in two's (chapter 2, Γ = A·q̈ + C·q̇ + Q), and friction. Each term's
size is taken at the robot's own limits, over random positions, in units of the effort noise that the fit found: how
much information that motion could give.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from identify.regressor.columns import column_kind
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot

POSITIONS, SEED = 24, 0
"""Random positions that a term's size is averaged over."""

SPEED, ACCELERATION, FAR = 2.0, 5.0, 100.0
"""Where the robot has no limit [rad/s, rad/s²; m/s, m/s²]; positions beyond FAR have none."""

MATTERS = 0.5
"""Share of the most telling motion's information from which another motion is named beside it."""


@dataclass(frozen=True)
class Motion:
    """One kind of motion: "gravity" of a pose, "acceleration" of one joint, "velocity" of one joint or of two at once,
    "reversal" of one joint (friction in both directions); joints: their indices."""

    kind: str
    joints: tuple[int, ...]


def telling_motions(regressor: Regressor, columns: Sequence[int], noise: np.ndarray) -> list[tuple[Motion, ...]]:
    """Of each of the columns, the motions that tell most of it, the most telling first; noise (n,): the standard
    deviation of each joint's rows."""
    wanted = [k for k in columns if k < len(regressor.base.names)]
    found: dict[int, tuple[Motion, ...]] = {}
    if wanted:
        sizes = _information(regressor, np.array(wanted), noise)
        motions, table = list(sizes), np.array(list(sizes.values()))
        for at, k in enumerate(wanted):
            order = np.argsort(-table[:, at], kind="stable")
            found[k] = tuple(motions[i] for i in order if table[i, at] >= MATTERS * table[order[0], at] > 0)
    return [found[k] if k in found else _of_drive(regressor, k) for k in columns]


def _of_drive(regressor: Regressor, column: int) -> tuple[Motion, ...]:
    """Of a column of friction, offset or a coupled motor."""
    assert regressor.extra is not None
    of = regressor.extra.columns[column - len(regressor.base.names)]
    joints = tuple(int(j) for j in np.flatnonzero(of.ratios)) if of.ratios else (of.index,)
    kind = {"Fv": "velocity", "Fvm": "velocity", "Iam": "acceleration"}.get(column_kind(regressor.names[column]))
    return (Motion(kind or "reversal", joints),)


def _information(regressor: Regressor, columns: np.ndarray, noise: np.ndarray) -> dict[Motion, np.ndarray]:
    """{motion: (columns,) mean square of its term over the random positions, in units of the noise}."""
    robot, n = regressor.robot, regressor.robot.n
    q, speed, acceleration = _states(robot)
    zero, units = np.zeros_like(q), np.eye(n)

    def at(dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        rows = regressor.torque(q, np.broadcast_to(dq, q.shape), np.broadcast_to(ddq, q.shape))[:, :, columns]
        return np.asarray(rows / noise[:, None])

    still = at(zero[0], zero[0])
    found = {Motion("gravity", ()): still}
    for j in range(n):
        found[Motion("acceleration", (j,))] = at(zero[0], acceleration[j] * units[j]) - still
    alone = [at(speed[j] * units[j], zero[0]) - still for j in range(n)]
    found |= {Motion("velocity", (j,)): term for j, term in enumerate(alone)}
    totals = {motion: (term**2).mean(axis=(0, 1)) for motion, term in found.items()}
    for i, j in combinations(range(n), 2):
        term = at(speed[i] * units[i] + speed[j] * units[j], zero[0]) - still - alone[i] - alone[j]
        totals[Motion("velocity", (i, j))] = (term**2).mean(axis=(0, 1))
    return totals


def _states(robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random positions (POSITIONS, n) inside the limits, highest speed and acceleration (n,) of each joint."""
    low, high = np.array([joint.limits.position for joint in robot.joints]).T
    reach = np.array([np.pi if joint.revolute else 1.0 for joint in robot.joints])
    low, high = np.where(np.abs(low) < FAR, low, -reach), np.where(np.abs(high) < FAR, high, reach)
    q = np.random.default_rng(SEED).uniform(np.minimum(low, high), np.maximum(low, high), (POSITIONS, robot.n))
    speed = np.array([joint.limits.velocity for joint in robot.joints])
    acceleration = np.array([joint.limits.acceleration for joint in robot.joints])
    return (
        q,
        np.where(np.isfinite(speed) & (speed > 0), speed, SPEED),
        np.where(np.isfinite(acceleration) & (acceleration > 0), acceleration, ACCELERATION),
    )
