"""What the functions return at a few states, by other code than theirs: the regressor run on NumPy and matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.codegen.functions import Models
from identify.regressor.columns import smooth_sign
from identify.robot.robot import Robot
from identify.symbolic.chain import place
from identify.symbolic.inverse_geometry import inverse_geometry

COUNT = 3
SEED = 0


@dataclass(frozen=True)
class Sample:
    """Signals of one state, {prefix: (n,)}, and the values expected of each function, {name: array}."""

    signals: dict[str, np.ndarray]
    expected: dict[str, np.ndarray]


def samples(models: Models) -> tuple[Sample, ...]:
    """COUNT random states, always the same ones, and what the functions return there."""
    robot, regressor, theta = models.robot, models.regressor, models.theta
    sign = np.sign if models.coulomb_velocity is None else smooth_sign(models.coulomb_velocity)
    rng = np.random.default_rng(SEED)
    base = regressor.base.matrix.shape[0]
    rigid = theta.copy()
    for at, name in enumerate(regressor.names[base:], base):
        if not name.startswith("Iam"):
            rigid[at] = 0.0
    unit, zero = np.eye(robot.n), np.zeros(robot.n)
    found = []
    for _ in range(COUNT):
        # Rounded to six decimals: the text stays readable and is read back exactly.
        signals = {name: np.round(rng.uniform(-1.5, 1.5, robot.n), 6) for name in ("q", "dq", "ddq", "dqr", "ddqr")}
        q, dq, ddq, dq_ref, ddq_ref = signals.values()

        def effort(v: np.ndarray, a: np.ndarray, q: np.ndarray = q) -> np.ndarray:
            return regressor.inverse_dynamics(q, v, a, rigid)

        weight = effort(zero, zero)
        tool, velocities = _tool(robot, q)
        expected = {
            "inverse_dynamics": regressor.inverse_dynamics(q, dq, ddq, theta, sign),
            "torque_regressor": regressor.torque(q, dq, ddq, sign=sign),
            "energy_regressor": regressor.energy(q, dq),
            "slotine_li_regressor": regressor.slotine_li(q, dq, dq_ref, ddq_ref, sign),
            "inertia_matrix": np.array([effort(zero, a) - weight for a in unit]).T,
            "coriolis": effort(dq, zero) - weight,
            "gravity": weight,
            "direct_geometry": tool,
            "jacobian": velocities,
        }
        found.append(Sample(signals, expected))
    return tuple(found)


@dataclass(frozen=True)
class PoseSample:
    """A pose (4, 4), the current position (n,) that reaches it, and what inverse geometry finds there.

    q (k, n), inside (k,): all solutions and whether they are inside the limits; None at a pose that may be singular,
    where rounding decides how many there are.
    """

    pose: np.ndarray
    current: np.ndarray
    q: np.ndarray | None
    inside: np.ndarray | None


def pose_samples(models: Models) -> tuple[PoseSample, ...]:
    """COUNT random poses and that of all joints at zero, a singular one of many arms; none without inverse geometry."""
    robot = models.robot
    if models.inverse is None:
        return ()
    rng = np.random.default_rng(SEED)
    found = []
    for _ in range(COUNT):
        current = np.round(rng.uniform(-1.5, 1.5, robot.n), 6)
        pose, _ = _tool(robot, current)
        solutions = inverse_geometry(robot, pose, current)
        q, inside = np.array([s.q for s in solutions]), np.array([s.inside_limits for s in solutions])
        found.append(PoseSample(pose, current, q, inside))
    pose, _ = _tool(robot, np.zeros(robot.n))
    return (*found, PoseSample(pose, np.zeros(robot.n), None, None))


def _tool(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(4, 4) transform of the tool in the world and (6, n) Jacobian of its origin, with plain matrices."""
    way = [robot.n - 1]
    while robot.joints[way[-1]].parent >= 0:
        way.append(robot.joints[way[-1]].parent)
    frame = np.array(robot.base)
    frames = {}
    for j in reversed(way):
        joint = robot.joints[j]
        theta, r = (joint.theta + q[j], joint.r) if joint.revolute else (joint.theta, joint.r + q[j])
        angles = ((np.cos(a), np.sin(a)) for a in (joint.gamma, joint.alpha, theta))
        gamma, alpha, turn = angles
        step = np.eye(4)
        step[:3] = np.column_stack(place(gamma, joint.b, alpha, joint.d, turn, r))  # type: ignore[arg-type]
        frame = frame @ step
        frames[j] = frame
    tool = frame @ np.array(robot.tool)
    columns = np.zeros((6, robot.n))
    for j, at in frames.items():
        if robot.joints[j].revolute:
            columns[:, j] = [*np.cross(at[:3, 2], tool[:3, 3] - at[:3, 3]), *at[:3, 2]]
        else:
            columns[:3, j] = at[:3, 2]
    return tool, columns
