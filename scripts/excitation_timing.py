"""Time of one objective with its gradient: ours by reverse mode, and finite differences over Pinocchio."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pinocchio
from excitation_engines import ENGINE, REGRESSOR, ROBOT

from identify.experiment.design import Design
from identify.validation.engines import FROM_PINOCCHIO

DURATION = 10.0
POINTS, COEFFICIENTS = 500, 66
FASTER = 50.0
"""The bar."""


def best(work: Callable[[], object], repeats: int, calls: int = 1) -> float:
    """Shortest process time of a call over a few repeats [ms]."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        for _ in range(calls):
            work()
        times.append((time.process_time() - start) / calls)
    return 1000 * min(times)


class UsersWay:
    """Sampled coefficients (66,): per joint q0, a and b; Pinocchio's regressor in a Python loop, the base columns,
    friction columns, rows over the effort limits; then a figure of the matrix."""

    def __init__(self) -> None:
        order = np.arange(1, 6)
        pulsation = 2 * np.pi / DURATION * order
        angle = np.arange(POINTS)[:, None] / POINTS * DURATION * pulsation
        sine, cosine = np.sin(angle), np.cos(angle)
        one, none = np.ones((POINTS, 1)), np.zeros((POINTS, 1))
        self.basis = (
            np.hstack([one, sine / pulsation, -cosine / pulsation]),
            np.hstack([none, cosine, sine]),
            np.hstack([none, -sine * pulsation, cosine * pulsation]),
        )
        kept = REGRESSOR.base.kept
        self.place = [at for at, c in enumerate(kept) if c % 11 < 10]
        self.columns = [10 * (c // 11) + FROM_PINOCCHIO[c % 11] for c in kept if c % 11 < 10]
        self.motors = [(at, c // 11) for at, c in enumerate(kept) if c % 11 == 10]
        self.noise = np.array([joint.limits.effort for joint in ROBOT.joints])
        self.rows = np.zeros((POINTS, ROBOT.n, REGRESSOR.p))

    def matrix(self, x: np.ndarray) -> np.ndarray:
        """(POINTS·n, p)."""
        coefficients = x.reshape(ROBOT.n, -1).T
        q, dq, ddq = (np.ascontiguousarray(basis @ coefficients) for basis in self.basis)
        w, count = self.rows, len(REGRESSOR.base.names)
        for k in range(POINTS):
            full = pinocchio.computeJointTorqueRegressor(ENGINE.model, ENGINE.data, q[k], dq[k], ddq[k])
            w[k][:, self.place] = full[:, self.columns]
        for at, j in self.motors:
            w[:, j, at] = ddq[:, j]
        for j in range(ROBOT.n):
            at = count + 3 * j
            w[:, j, at], w[:, j, at + 1], w[:, j, at + 2] = dq[:, j], np.sign(dq[:, j]), 1.0
        return (w / self.noise[:, None]).reshape(-1, REGRESSOR.p)

    def log_det(self, x: np.ndarray) -> float:
        w = self.matrix(x)
        return -float(np.linalg.slogdet(w.T @ w)[1])

    def cond(self, x: np.ndarray) -> float:
        w = self.matrix(x)
        return float(np.linalg.cond(w / np.linalg.norm(w, axis=0)))


def finite_differences(figure: Callable[[np.ndarray], float], x: np.ndarray, central: bool) -> np.ndarray:
    """The figure and its gradient as a user gets them."""
    step, middle, gradient = 1e-6, figure(x), np.empty(len(x))
    for k in range(len(x)):
        moved = np.zeros(len(x))
        moved[k] = step
        gradient[k] = (figure(x + moved) - (figure(x - moved) if central else middle)) / (2 * step if central else step)
    return gradient


def objectives(repeats: int) -> tuple[list[list[str]], bool, float]:
    """Rows of the table of times, whether the bar is met, and the error of our gradient along a random line."""
    plain, whole = (
        Design(ROBOT, "torque", DURATION, 5, samples=POINTS, collision=collision) for collision in (False, True)
    )
    x = whole.start(np.random.default_rng(0))
    motion = plain.fourier.trajectory(x)
    coefficients = np.concatenate([motion.q0[:, None], motion.a, motion.b], axis=1).ravel()
    assert len(coefficients) == COEFFICIENTS
    users = UsersWay()
    model = plain.criterion.torque
    rows = model.columns(plain.fourier.signals(x)).transpose(2, 1, 0)
    scale = np.abs(users.matrix(coefficients)).max(axis=0)
    smooth = [k for k, name in enumerate(REGRESSOR.names) if not name.startswith("Fs")]
    apart = np.abs(users.matrix(coefficients) - (rows / users.noise[:, None]).reshape(-1, REGRESSOR.p)) / scale
    assert apart[:, smooth].max() < 1e-9, "both ways build the same matrix"

    def criterion() -> object:
        motion = plain.fourier.signals(x)
        columns = model.columns(motion)
        _, to_columns, _ = plain.criterion.worth(motion, columns)
        return plain.fourier.pull_back(model.pull_back(motion, to_columns))

    ours = best(criterion, repeats, 10)
    limited = best(lambda: plain.lagrangian(x, 200.0), repeats, 10)
    constrained = best(lambda: whole.lagrangian(x, 200.0), repeats, 10)
    table = [["ours: log det and predicted variance, with gradient", f"{ours:.2f}", ""]]
    table.append(["ours, with limits on q, q̇, q̈, torque", f"{limited:.2f}", ""])
    table.append(["ours, with floor and self-collision too", f"{constrained:.2f}", ""])
    met = True
    for label, figure in (("log det", users.log_det), ("condition number", users.cond)):
        for central in (False, True):
            spent = best(lambda f=figure, c=central: finite_differences(f, coefficients, c), max(1, repeats // 4))
            met &= spent / ours >= FASTER
            kind = "central" if central else "forward"
            table.append([f"Pinocchio, {label}, {kind} differences", f"{spent:.0f}", f"{spent / ours:.0f}"])
    line = np.random.default_rng(1).standard_normal(len(x)) / np.sqrt(len(x))

    def slope(h: float) -> float:
        return (whole.lagrangian(x + h * line, 200.0)[0] - whole.lagrangian(x - h * line, 200.0)[0]) / (2 * h)

    gradient = whole.lagrangian(x, 200.0)[1] @ line
    return table, met, abs((4 * slope(1e-5) - slope(2e-5)) / 3 / gradient - 1)
