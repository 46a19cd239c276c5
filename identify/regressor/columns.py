"""Columns that are not inertial: friction and offset of every joint, and what coupled motors add."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identify.regressor.friction import (
    ASYMMETRIC,
    CUBE_ROOT,
    LOAD,
    PRESLIDING,
    STRIBECK,
    USUAL,
    FrictionConstants,
    Sign,
    sliding_laws,
)
from identify.robot.robot import Robot
from identify.symbolic.expression import Expression, Graph
from identify.symbolic.joint_effort import DRIVE_FIELDS, MOTOR_FIELDS, Column, column_effort, joint_columns

OWN = tuple(DRIVE_FIELDS)
"""Columns of every joint: viscous friction, Coulomb friction, offset [2.63]."""

COUPLED = tuple(MOTOR_FIELDS)
"""Columns of every coupled motor: inertia, viscous friction, Coulomb friction."""

MORE = {
    CUBE_ROOT: ("Fc", "Fcm"),
    PRESLIDING: ("Fp", "Fpm"),
    STRIBECK: ("Fb", "Fbm"),
    ASYMMETRIC: ("Fa", "Fam"),
    LOAD: ("Fl",),
}
"""Columns of the further forms of friction: of every joint, and of every coupled motor with Coulomb friction, whose
load is that of its joints."""

READS = {"Fs": "sign", "Fsm": "sign"} | {kind: form for form, kinds in MORE.items() for kind in kinds}
"""The friction signal that a column reads, of its joint or motor."""

TAKING = ("Fv", "off", "Fvm", *READS)
"""Columns of friction and offset."""

_FORCES = dict.fromkeys(("Fs", "off", "Fsm", "Fp", "Fpm", "Fb", "Fbm", "Fl"), "N")
_TORQUES = dict.fromkeys(_FORCES, "N·m")
_BY_SPEED, _BY_ROOT = ("Fv", "Fvm", "Fa", "Fam"), ("Fc", "Fcm")
TURNING = _TORQUES | {"Iam": "kg·m²", **dict.fromkeys(_BY_SPEED, "N·m·s/rad")}
TURNING |= dict.fromkeys(_BY_ROOT, "N·m·∛(s/rad)")
SLIDING = _FORCES | {"Iam": "kg", **dict.fromkeys(_BY_SPEED, "N·s/m"), **dict.fromkeys(_BY_ROOT, "N·∛(s/m)")}


def column_kind(name: str) -> str:
    """The kind of a column by its name: Fv of Fv3."""
    return name.rstrip("0123456789")


def smooth_sign(velocity: float) -> Sign:
    """The sign function with a linear passage through zero: clip(q̇ / velocity, −1, 1); velocity in rad/s or m/s."""
    return lambda speed: np.clip(speed / velocity, -1.0, 1.0)


@dataclass(frozen=True)
class JointColumns:
    """Fv, Fs and offset of each joint, then Iam, Fvm and Fsm of each coupled motor, then further forms of friction.

    Of a coupled motor's inertia, ½ Iam ṁ², and viscous friction, Fvm ṁ², what falls on single joints is already in
    their Ia and Fv: the columns hold the cross terms. Its Coulomb friction adds ratiosᵀ·sign(ṁ), whole, and so do
    further forms of it with their own signal for the sign.
    """

    columns: tuple[Column, ...]
    revolute: tuple[bool, ...]
    forms: tuple[str, ...] = ()
    constants: FrictionConstants = USUAL

    @staticmethod
    def of(robot: Robot) -> JointColumns:
        return JointColumns(joint_columns(robot), tuple(joint.revolute for joint in robot.joints))

    def without(self, names: Collection[str]) -> JointColumns:
        """The same, less the columns of these names."""
        return replace(self, columns=tuple(column for column in self.columns if column.name not in names))

    def with_forms(self, forms: tuple[str, ...]) -> JointColumns:
        """The same, and behind them the columns of further forms of friction: joint by joint, then motor by motor."""
        motors = [c for c in self.columns if c.kind == "Fsm"]
        own = (Column(MORE[form][0], j) for j in range(len(self.revolute)) for form in forms)
        coupled = (Column(k, motor.index, motor.ratios) for motor in motors for form in forms for k in MORE[form][1:])
        return replace(self, columns=(*self.columns, *own, *coupled), forms=(*self.forms, *forms))

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
        """{(joint, column): effort per unit of the parameter}, of the symbols rates1 …, accelerations1 … and sign1 …,
        which stand for all friction signals."""
        found: dict[tuple[int, int], Expression] = {}
        for at, column in enumerate(self.columns):
            signal = f"sign{self._signal(column) + 1}" if column.kind in READS else ""
            effort = column_effort(graph, column, signal, rates, accelerations)
            found |= {(i, at): e for i, e in effort.items()}
        return found

    @cached_property
    def motors(self) -> list[tuple[float, ...]]:
        """Ratios of the coupled motors that have a Coulomb column."""
        return [column.ratios for column in self.columns if column.kind == "Fsm"]

    @property
    def signs(self) -> int:
        """Number of friction signals: the sign of each joint, then of each coupled motor; then the further forms'."""
        return self.arms * (1 + len(self.forms))

    @property
    def arms(self) -> int:
        """Number of joints and of coupled motors that have friction of their own."""
        return len(self.revolute) + len(self.motors)

    def speeds(self, dq: np.ndarray) -> np.ndarray:
        """(…, arms) speeds of the joints and of the coupled motors, whose signs the Coulomb columns hold; of positions,
        their positions."""
        return np.concatenate([dq, dq @ np.transpose(self.motors)], axis=-1) if self.motors else dq

    def signals(
        self, dq: np.ndarray, sign: Sign, slip: np.ndarray | None, load: np.ndarray | None = None
    ) -> np.ndarray:
        """(…, signs) friction signals at the joints' velocity (…, n).

        slip (…, arms): presliding states, by default those of a joint that slides on. load (…, n): magnitude of the
        joints' load in units of its mean, by default 1.
        """
        speeds = self.speeds(dq)
        signs = sign(speeds)
        if not self.forms:
            return signs
        laws = sliding_laws(sign, self.constants.stribeck_velocity)
        further = {form: laws[form](speeds) for form in self.forms if form not in (PRESLIDING, LOAD)}
        further[PRESLIDING] = signs if slip is None else slip
        if LOAD in self.forms:
            further[LOAD] = signs.copy()
            if load is not None:
                further[LOAD][..., : len(self.revolute)] *= load
        return np.concatenate([signs, *(further[form] for form in self.forms)], axis=-1)

    def _signal(self, column: Column) -> int:
        """Which of the friction signals the column reads."""
        arm = len(self.revolute) + self.motors.index(column.ratios) if column.ratios else column.index
        return ("sign", *self.forms).index(READS[column.kind]) * self.arms + arm

    def energy(self, out: np.ndarray, dq: np.ndarray) -> None:
        """Fill out (N, len(names)) with stored energy: the cross terms of coupled motors' inertia, zero elsewhere."""
        out[...] = 0.0
        for at, column in enumerate(self.columns):
            if column.kind == "Iam":
                out[:, at] = 0.5 * (dq * _cross_terms(dq, np.array(column.ratios))).sum(axis=1)

    def power(
        self,
        out: np.ndarray,
        dq: np.ndarray,
        sign: Sign,
        slip: np.ndarray | None = None,
        load: np.ndarray | None = None,
    ) -> None:
        """Fill out (N, len(names)) with the power q̇ᵀΓ that friction and offset take per unit of each parameter,
        zero for inertias."""
        speeds, signals = self.speeds(dq), self.signals(dq, sign, slip, load)
        for at, column in enumerate(self.columns):
            j, rho = column.index, np.array(column.ratios)
            match column.kind:
                case "Fv":
                    out[:, at] = dq[:, j] ** 2
                case "off":
                    out[:, at] = dq[:, j]
                case kind if kind in READS:
                    signal = self._signal(column)
                    out[:, at] = speeds[:, signal % self.arms] * signals[:, signal]
                case "Iam":
                    out[:, at] = 0.0
                case "Fvm":
                    out[:, at] = (dq * _cross_terms(dq, rho)).sum(axis=1)


def _cross_terms(x: np.ndarray, rho: np.ndarray) -> np.ndarray:
    """(N, n) ratiosᵀ·(ratios·x) without each joint's own share, for x (N, n)."""
    return (x @ rho)[:, None] * rho - x * rho**2
