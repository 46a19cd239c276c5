"""Symbolic models of a robot as plain numbers, for tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from identify.robot.robot import Robot
from identify.symbolic.expression import Expression, Graph, Scalar
from identify.symbolic.printing import compiled

GRAVITY = (2.1, -3.7, 8.3)
"""Along no axis of any frame."""


def tilted(robot: Robot) -> Robot:
    """The robot with gravity in a general direction."""
    return replace(robot, gravity=GRAVITY)


def function_of(graph: Graph, n: int, scalars: Sequence[Scalar]) -> Callable[..., np.ndarray]:
    """f(q, dq, ddq), (N, n) each, giving the values (N, len(scalars)) of expressions and numbers."""
    outputs = [x if isinstance(x, Expression) else graph.constant(x) for x in scalars]
    names = {f"{prefix}{j + 1}": i * n + j for i, prefix in enumerate(("q", "dq", "ddq")) for j in range(n)}
    function, rows = compiled("f", names, outputs)

    def evaluated(*signals: np.ndarray) -> np.ndarray:
        zero = np.zeros_like(signals[0])
        x = np.hstack([*signals, *[zero] * (3 - len(signals))]).T
        out = np.empty((len(outputs), x.shape[1]))
        function(x, out, np.empty((rows, x.shape[1])))
        return out.T

    return evaluated


def states(rng: np.random.Generator, robot: Robot, count: int) -> np.ndarray:
    """(3, count, n) random q, dq, ddq; sliding joints move by tenths of a metre."""
    scale = np.array([1.0 if joint.revolute else 0.3 for joint in robot.joints])
    return rng.uniform(-2, 2, (3, count, robot.n)) * scale


class Motion:
    """A smooth random motion q(t), seeded, sampled at Gauss-Legendre nodes of [0, 1] s."""

    def __init__(self, rng: np.random.Generator, n: int, monotonic: bool = False) -> None:
        self.amplitude = rng.uniform(0.1, 0.4, (3, n))
        self.phase = rng.uniform(0, 6, (3, n))
        self.slope = 4.0 if monotonic else 0.0
        nodes, weights = np.polynomial.legendre.leggauss(50)
        self.nodes, self.weights = (nodes + 1) / 2, weights / 2

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, dq, ddq (N, n) at times t (N,)."""
        w = np.array([1.0, 2.0, 3.0])[:, None]
        angle = w * np.asarray(t)[:, None, None] + self.phase
        a = self.amplitude
        q = (a * np.sin(angle)).sum(axis=1) + self.slope * np.asarray(t)[:, None]
        return q, (a * w * np.cos(angle)).sum(axis=1) + self.slope, -(a * w * w * np.sin(angle)).sum(axis=1)
