"""Three engines on one robot: the generated regressor, Pinocchio and MuJoCo, which share no code."""

from __future__ import annotations

from typing import Any

import numpy as np

from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot
from identify.symbolic.base_parameters import base_parameters
from identify.validation.engines import mujoco_torque, pinocchio_regressor, pinocchio_torque

SAMPLES, SEED = 1000, 0
"""Random states that engines are compared on."""

AGREE = 1e-9
"""Engines that differ by no more than this, relative to the largest value, agree."""

BLOCK = 100

FAR = 100.0
"""Position limits from here on [rad or m] count as none."""
RANK_SAMPLES = 40
"""Random states a joint, for up to six joints, whose regressors the rank is of: several times as many rows as columns,
and each joint's own row as often as there can be functions in it."""


def random_states(robot: Robot, samples: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, dq, ddq (samples, n): positions inside the limits (else ±π, ±1 m), speeds up to ±2, accelerations ±5, SI.

    Limits beyond FAR are none: digits of an angle that large are lost in its cosine.
    """
    rng = np.random.default_rng(seed)
    reach = np.array([np.pi if joint.revolute else 1.0 for joint in robot.joints])
    low, high = np.array([j.limits.position for j in robot.joints]).T
    low, high = np.where(np.abs(low) < FAR, low, -reach), np.where(np.abs(high) < FAR, high, reach)
    q = rng.uniform(np.minimum(low, high), np.maximum(low, high), (samples, robot.n))
    return q, rng.uniform(-2, 2, q.shape), rng.uniform(-5, 5, q.shape)


def consistent_links(robot: Robot, seed: int) -> np.ndarray:
    """(11 n,) standard parameters of invented, physically possible links with full inertias: point masses at random."""
    rng = np.random.default_rng(seed)
    standard = []
    for _ in range(robot.n):
        points, masses = rng.uniform(-0.3, 0.3, (6, 3)), rng.uniform(0.3, 2.0, 6)
        second = (masses[:, None] * points).T @ points
        inertia = np.trace(second) * np.eye(3) - second
        standard += [*inertia[np.triu_indices(3)], *(masses @ points), masses.sum(), rng.uniform(0.1, 2.0)]
    return np.array(standard)


def cross_check_regressor(robot: Robot, samples: int = SAMPLES) -> dict[str, Any]:
    """Largest disagreement of the regressor with Pinocchio's (every entry) and with MuJoCo's inverse dynamics (torque
    of invented links), relative to the largest value, over random samples."""
    regressor = Regressor(robot, friction=False)
    q, dq, ddq = random_states(robot, samples, SEED)
    worst = scale = 0.0
    for start in range(0, samples, BLOCK):
        part = slice(start, start + BLOCK)
        theirs = pinocchio_regressor(robot, q[part], dq[part], ddq[part])
        ours = regressor.torque(q[part], dq[part], ddq[part]) @ regressor.base.matrix
        worst, scale = max(worst, float(np.abs(ours - theirs).max())), max(scale, float(np.abs(theirs).max()))
    standard = consistent_links(robot, SEED)
    ours_torque = regressor.inverse_dynamics(q, dq, ddq, regressor.base.matrix @ standard)
    theirs_torque = mujoco_torque(robot, standard, q, dq, ddq)
    return {
        "pinocchio": {
            "max_abs_error": worst / scale,
            "samples": samples,
            "what": "every entry of the regressor against computeJointTorqueRegressor, relative to the largest entry",
        },
        "mujoco": {
            "max_abs_error": _relative(ours_torque, theirs_torque),
            "samples": samples,
            "what": "torque of invented, consistent links against mj_inverse, relative to the largest torque",
        },
    }


def cross_check_identified(
    robot: Robot, base: np.ndarray, consistent: np.ndarray | None, samples: int = SAMPLES
) -> dict[str, Any]:
    """The identified inertial model in Pinocchio, as any standard set that maps to base (p,), and the links that
    physics allows, consistent (11 n,), in MuJoCo, which loads no others. Largest torque differences relative to the
    largest torque."""
    regressor = Regressor(robot, friction=False)
    states = random_states(robot, samples, SEED)
    ours = regressor.inverse_dynamics(*states, base)
    in_pinocchio = pinocchio_torque(robot, any_standard(robot, base), *states)
    result: dict[str, Any] = {
        "pinocchio": {"max_abs_error": _relative(ours, in_pinocchio), "samples": samples},
        "mujoco": None,
    }
    if consistent is None:
        result["mujoco_reason"] = "no links that physics allows were found, and MuJoCo loads no others"
    else:
        possible = regressor.inverse_dynamics(*states, regressor.base.matrix @ consistent)
        result["mujoco"] = {
            "max_abs_error": _relative(possible, mujoco_torque(robot, consistent, *states)),
            "samples": samples,
            "what": "torque of the identified links that physics allows, relative to the largest torque",
        }
    return result


def any_standard(robot: Robot, base: np.ndarray) -> np.ndarray:
    """(11 n,) the standard parameters nearest to unit-mass links without inertia that map to base (p,)."""
    matrix = base_parameters(robot).matrix
    start = np.tile([0.0] * 9 + [1.0, 0.0], robot.n)
    return start + np.linalg.lstsq(matrix, base - matrix @ start, rcond=None)[0]


def check_robot(robot: Robot, samples: int = SAMPLES) -> dict[str, Any]:
    """Whether the models of a robot can be trusted: count of base parameters against the rank of Pinocchio's regressor,
    and the three engines against one another."""
    check = cross_check_regressor(robot, samples)
    count = len(Regressor(robot, friction=False).names)
    rank = _rank(robot)
    errors = [check[engine]["max_abs_error"] for engine in ("pinocchio", "mujoco")]
    return {
        "robot": robot.name,
        "joints": list(robot.joint_names),
        "base_parameters": count,
        "rank": rank,
        **check,
        "agree": bool(count == rank and max(errors) <= AGREE),
    }


def _rank(robot: Robot) -> int:
    """Rank of Pinocchio's regressor over random samples, columns scaled."""
    stacked = pinocchio_regressor(robot, *random_states(robot, RANK_SAMPLES * min(max(robot.n, 2), 6), SEED + 1))
    columns = stacked.reshape(-1, stacked.shape[2])
    scale = np.linalg.norm(columns, axis=0)
    scale[scale < 1e-9 * max(scale.max(), 1e-300)] = np.inf
    singular = np.linalg.svd(np.linalg.qr(columns / scale, mode="r"), compute_uv=False)
    return int((singular > 1e-9 * singular[0]).sum())


def _relative(ours: np.ndarray, theirs: np.ndarray) -> float:
    size = np.abs(theirs).max()
    return float(np.abs(ours - theirs).max() / size) if size > 0 else float(np.abs(ours).max())
