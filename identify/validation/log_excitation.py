"""Whether a log's motion tells the inertia of every joint, and every combination of parameters from noise."""

from __future__ import annotations

import numpy as np

from identify.logs.finding import KEPT, WARNING, Finding
from identify.logs.wording import first
from identify.regressor.regressor import Regressor
from identify.validation.log_rows import Equations, Rows

CERTAIN = 5.0
"""An inertia that is told is so many of its standard deviations above zero."""
POSES = 100
"""Poses over which the inertia that a joint feels is averaged."""


def excitation(regressor: Regressor, rows: Rows, built: Equations, b: np.ndarray) -> list[Finding]:
    """Joints whose inertia the motion does not tell, and parameters that noise drowns.

    The mean inertia that a joint feels is linear in the parameters and positive on any robot: where it is not
    CERTAIN standard deviations above zero, the joint's acceleration makes no effort that is seen. In columns of equal
    length the combination of the k-th singular vector has the standard deviation σ/s_k, drowned where that is more
    than the parameters contribute on average.
    """
    length = np.linalg.norm(built.matrix, axis=0)
    used = np.flatnonzero(length > 0)
    triangle = built.triangle[:, used] / length[used]
    residual = built.residual(b)
    sigma = max(np.sqrt(float(residual @ residual) / max(len(b) - len(used), 1)), 1e-300)
    x = built.parameters(b)[used] * length[used]
    _, sizes, vectors = np.linalg.svd(triangle, full_matrices=False)
    findings = []
    weak = np.flatnonzero(sigma * len(sizes) ** 0.5 > np.linalg.norm(x) * sizes)
    if len(weak):
        share = (vectors[weak] ** 2).sum(axis=0)
        order = np.argsort(-share)
        names = [built.names[used[k]] for k in order if share[k] > 0.5] or [built.names[used[k]] for k in order[:3]]
        told = f"the motion tells {len(weak)} of {len(used)} combinations of parameters no better than noise"
        text = f"{told}: {first(names, 6)}"
        findings.append(Finding("under-excited", WARNING, text, KEPT))
    weak_joints = []
    for j, mean in enumerate(_mean_inertia(regressor, rows)):
        if not built.counted[:, j].any():
            continue
        # Directions without information make the standard deviation infinite.
        directions = vectors @ (mean[used] / length[used])
        error = sigma * float(np.linalg.norm(directions / np.maximum(sizes, 1e-300)))
        if mean[used] @ (x / length[used]) < CERTAIN * error:
            weak_joints.append(regressor.robot.joint_names[j])
    if weak_joints:
        text = f"too little acceleration: the inertia at {', '.join(weak_joints)} can't be told from zero"
        findings.append(Finding("under-excited", WARNING, text, f"{KEPT}; move faster", tuple(weak_joints)))
    return findings


def _mean_inertia(regressor: Regressor, rows: Rows) -> np.ndarray:
    """(n, p): the inertia that each joint feels on average over the poses of the rows, per unit of each parameter."""
    q = rows.q[:: max(1, len(rows.q) // POSES)]
    rest = np.zeros_like(q)
    still = regressor.torque(q, rest, rest)
    means = []
    for j in range(regressor.robot.n):
        unit = rest.copy()
        unit[:, j] = 1.0
        means.append((regressor.torque(q, rest, unit) - still)[:, j].mean(axis=0))
    return np.array(means)
