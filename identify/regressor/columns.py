"""Columns that are not inertial: friction and offset of every joint, and what coupled motors add."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identify.robot.robot import Robot
from identify.symbolic.expression import Expression, Graph

Sign = Callable[[np.ndarray], np.ndarray]

OWN = ("Fv", "Fs", "off")
"""Columns of every joint: viscous friction, Coulomb friction, offset [2.63]."""

COUPLED = ("Iam", "Fvm", "Fsm")
"""Columns of every coupled motor: inertia, viscous friction, Coulomb friction."""

TURNING = {"Fv": "N·m·s/rad", "Fs": "N·m", "off": "N·m", "Iam": "kg·m²", "Fvm": "N·m·s/rad", "Fsm": "N·m"}
SLIDING = {"Fv": "N·s/m", "Fs": "N", "off": "N", "Iam": "kg", "Fvm": "N·s/m", "Fsm": "N"}


def smooth_sign(velocity: float) -> Sign:
    """The sign function with a linear passage through zero: clip(q̇ / velocity, −1, 1); velocity in rad/s or m/s."""
    return lambda speed: np.clip(speed / velocity, -1.0, 1.0)


@dataclass(frozen=True)
class Column:
    """One column: its kind, the index of its joint or motor, and for a coupled motor k its ratios (n,).

    The motor turns at ṁ = ratios·q̇ in units of joint k, so that ratios[k] = 1.
    """

    kind: str
    index: int
    ratios: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        return f"{self.kind}{self.index + 1}"


@dataclass(frozen=True)
class JointColumns:
    """Fv, Fs and offset of each joint, then Iam, Fvm and Fsm of each coupled motor.

    Of a coupled motor's inertia, ½ Iam ṁ², and viscous friction, Fvm ṁ², what falls on single joints is already in
    their Ia and Fv: the columns hold the cross terms. Its Coulomb friction adds ratiosᵀ·sign(ṁ), whole.
    """

    columns: tuple[Column, ...]
    revolute: tuple[bool, ...]

    @staticmethod
    def of(robot: Robot) -> JointColumns:
        own = (Column(kind, j) for j in range(robot.n) for kind in OWN)
        coupled = (Column(kind, k, ratios) for k, ratios in robot.couplings for kind in COUPLED)
        return JointColumns((*own, *coupled), tuple(joint.revolute for joint in robot.joints))

    def without(self, names: Collection[str]) -> JointColumns:
        """The same, less the columns of these names."""
        return replace(self, columns=tuple(column for column in self.columns if column.name not in names))

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(column.name for column in self.columns)

    @property
    def doubtful(self) -> tuple[str, ...]:
        """Columns that other columns may make up: the motors', and the offset of a sliding joint, as gravity can pull
        evenly along a line; about an axis it can't."""
        return tuple(
            c.name for c in self.columns if c.kind in COUPLED or (c.kind == "off" and not self.revolute[c.index])
        )

    @property
    def units(self) -> tuple[str, ...]:
        return tuple((TURNING if self.revolute[column.index] else SLIDING)[column.kind] for column in self.columns)

    def entries(self, graph: Graph, rates: str = "dq", accelerations: str = "ddq") -> dict[tuple[int, int], Expression]:
        """{(joint, column): effort per unit of the parameter}, of the symbols rates1 …, accelerations1 … and sign1 …"""
        found: dict[tuple[int, int], Expression] = {}
        for at, column in enumerate(self.columns):
            j, rho = column.index, column.ratios
            match column.kind:
                case "Fv":
                    found[j, at] = graph.symbol(f"{rates}{j + 1}")
                case "Fs":
                    found[j, at] = graph.symbol(f"sign{j + 1}")
                case "off":
                    found[j, at] = graph.constant(1.0)
                case "Fsm":
                    motor = len(self.revolute) + self._motors.index(rho)
                    found |= {(i, at): graph.symbol(f"sign{motor + 1}") * r for i, r in enumerate(rho)}
                case _:
                    x = accelerations if column.kind == "Iam" else rates
                    for i, r in enumerate(rho):
                        others = (graph.symbol(f"{x}{k + 1}") * (r * s) for k, s in enumerate(rho) if k != i)
                        found[i, at] = sum(others, graph.constant(0.0))
        return found

    @cached_property
    def _motors(self) -> list[tuple[float, ...]]:
        """Ratios of the coupled motors that have a Coulomb column."""
        return [column.ratios for column in self.columns if column.kind == "Fsm"]

    @property
    def signs(self) -> int:
        """Number of signs: of each joint, then of each coupled motor."""
        return len(self.revolute) + len(self._motors)

    def speeds(self, dq: np.ndarray) -> np.ndarray:
        """(…, signs) speeds of the joints and of the coupled motors, whose signs the Coulomb columns hold."""
        return np.concatenate([dq, dq @ np.transpose(self._motors)], axis=-1) if self._motors else dq

    def energy(self, out: np.ndarray, dq: np.ndarray) -> None:
        """Fill out (N, len(names)) with stored energy: the cross terms of coupled motors' inertia, zero elsewhere."""
        out[...] = 0.0
        for at, column in enumerate(self.columns):
            if column.kind == "Iam":
                out[:, at] = 0.5 * (dq * _cross_terms(dq, np.array(column.ratios))).sum(axis=1)

    def power(self, out: np.ndarray, dq: np.ndarray, sign: Sign) -> None:
        """Fill out (N, len(names)) with the power q̇ᵀΓ that friction and offset take per unit of each parameter,
        zero for inertias."""
        for at, column in enumerate(self.columns):
            j, rho = column.index, np.array(column.ratios)
            match column.kind:
                case "Fv":
                    out[:, at] = dq[:, j] ** 2
                case "Fs":
                    out[:, at] = dq[:, j] * sign(dq[:, j])
                case "off":
                    out[:, at] = dq[:, j]
                case "Iam":
                    out[:, at] = 0.0
                case "Fvm":
                    out[:, at] = (dq * _cross_terms(dq, rho)).sum(axis=1)
                case "Fsm":
                    out[:, at] = dq @ rho * sign(dq @ rho)


def _cross_terms(x: np.ndarray, rho: np.ndarray) -> np.ndarray:
    """(N, n) ratiosᵀ·(ratios·x) without each joint's own share, for x (N, n)."""
    return (x @ rho)[:, None] * rho - x * rho**2
