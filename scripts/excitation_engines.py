"""The RX-90's observation matrices, limits and rest a second time, by Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio

import identify
from identify.experiment.trajectory import Trajectory
from identify.validation.engines import FROM_PINOCCHIO, pinocchio_model

ROBOT = identify.load_robot("rx90")
REGRESSOR = identify.Regressor(ROBOT)
SAMPLES = 2000
"""Of a period, for condition numbers and limits; windows are whole numbers of them."""


class ByPinocchio:
    """Observation matrices from Pinocchio's regressors of standard parameters, our base matrix, and friction written
    out."""

    def __init__(self) -> None:
        self.model = pinocchio_model(ROBOT, ROBOT.standard)
        self.data = self.model.createData()
        matrix = REGRESSOR.base.matrix  # (p, m): base = matrix @ standard, so that Y_standard = Y_base @ matrix
        self.to_base = matrix.T @ np.linalg.inv(matrix @ matrix.T)
        self.columns = np.array([10 * j + k for j in range(ROBOT.n) for k in FROM_PINOCCHIO])

    def standard(self, links: np.ndarray, motors: np.ndarray) -> np.ndarray:
        """(N, …, 11 n) columns in the order of `Robot.standard_names`, of the links' and the drives' inertia."""
        n = ROBOT.n
        whole = np.empty((*links.shape[:-1], n, 11))
        whole[..., :10] = links[..., self.columns].reshape(*links.shape[:-1], n, 10)
        whole[..., 10] = motors
        return whole.reshape(*links.shape[:-1], 11 * n)

    def torque(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """(N, n, p)."""
        n = ROBOT.n
        rows = zip(q, dq, ddq, strict=True)
        links = np.array([pinocchio.computeJointTorqueRegressor(self.model, self.data, *row) for row in rows])
        rigid = self.standard(links, ddq[:, :, None] * np.eye(n)) @ self.to_base
        friction = np.zeros((len(q), n, 3 * n))
        for j in range(n):
            friction[:, j, 3 * j : 3 * j + 3] = np.column_stack([dq[:, j], np.sign(dq[:, j]), np.ones(len(q))])
        return np.concatenate([rigid, friction], axis=2)

    def energy(self, q: np.ndarray, dq: np.ndarray, every: int, step: float) -> np.ndarray:
        """(windows, p): energies at the ends of windows of a closed period, and the work of friction in them."""
        links = np.array(
            [
                pinocchio.computeKineticEnergyRegressor(self.model, self.data, *row)
                + pinocchio.computePotentialEnergyRegressor(self.model, self.data, row[0])
                for row in zip(q[::every], dq[::every], strict=True)
            ]
        )
        stored = self.standard(links, dq[::every] ** 2 / 2) @ self.to_base
        power = np.stack([dq**2, np.abs(dq), dq], axis=2).reshape(len(q), -1)
        closed = np.concatenate([power, power[:1]])
        ends = range(0, len(q), every)
        work = np.array([np.trapezoid(closed[a : a + every + 1], dx=step, axis=0) for a in ends])
        return np.concatenate([np.roll(stored, -1, axis=0) - stored, work], axis=1)

    def effort(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """(N, n) by the recursive Newton-Euler algorithm, drives' inertia in it, and friction as described."""
        rows = zip(q, dq, ddq, strict=True)
        rigid = np.array([pinocchio.rnea(self.model, self.data, *row).copy() for row in rows])
        drives = [joint.drive for joint in ROBOT.joints]
        return (
            rigid
            + dq * [d.viscous for d in drives]
            + np.sign(dq) * [d.coulomb for d in drives]
            + [d.offset for d in drives]
        )


ENGINE = ByPinocchio()


def condition(rows: np.ndarray) -> float:
    """Largest over smallest singular value, each column divided by its norm, rows as they are."""
    rows = rows.reshape(-1, rows.shape[-1])
    sizes = np.linalg.svd(rows / np.linalg.norm(rows, axis=0), compute_uv=False)
    return float(sizes[0] / sizes[-1])


def one_period(trajectory: Trajectory, samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return trajectory.sample(trajectory.rest + np.arange(samples) / samples * trajectory.period)


def worst_share(trajectory: Trajectory) -> float:
    """Largest share of a limit on position, velocity, acceleration and effort, by Pinocchio."""
    q, dq, ddq = one_period(trajectory, 5 * SAMPLES)
    limits = [joint.limits for joint in ROBOT.joints]
    low, high = np.array([limit.position for limit in limits]).T
    shares = [np.abs(2 * q - low - high) / (high - low)]
    signals = {"velocity": dq, "acceleration": ddq, "effort": ENGINE.effort(q, dq, ddq)}
    shares += [np.abs(signal) / [getattr(limit, name) for limit in limits] for name, signal in signals.items()]
    return float(np.max(shares))


def rest_error(trajectory: Trajectory) -> float:
    """Largest |q̇| and |q̈| a nanosecond inside the beginnings and ends of the periods [rad/s, rad/s²]."""
    edges = trajectory.rest + trajectory.period * np.arange(trajectory.periods + 1)
    _, dq, ddq = trajectory.sample(np.concatenate([edges[:-1] + 1e-9, edges[1:] - 1e-9]))
    return float(max(np.abs(dq).max(), np.abs(ddq).max()))
