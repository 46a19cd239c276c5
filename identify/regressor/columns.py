"""Columns that are not inertial: friction and offset of every joint, and what coupled motors add."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from identify.robot.robot import Robot

Sign = Callable[[np.ndarray], np.ndarray]


def smooth_sign(velocity: float) -> Sign:
    """The sign function with a linear passage through zero: clip(q̇ / velocity, −1, 1); velocity in rad/s or m/s."""
    return lambda speed: np.clip(speed / velocity, -1.0, 1.0)


@dataclass(frozen=True)
class JointColumns:
    """Fv, Fs and offset of each joint, then Iam, Fvm and Fsm of each coupled motor.

    A coupled motor k turns at ṁ = ρ·q̇ in units of joint k. Of its inertia, ½ Iam ṁ², and viscous friction,
    what falls on single joints is already in their Ia and Fv; the columns hold the cross terms. Its Coulomb
    friction adds ρᵀ·sign(ṁ).
    """

    joints: int
    revolute: tuple[bool, ...]
    couplings: tuple[tuple[int, tuple[float, ...]], ...]

    @staticmethod
    def of(robot: Robot) -> JointColumns:
        return JointColumns(robot.n, tuple(j.revolute for j in robot.joints), robot.couplings)

    @property
    def names(self) -> tuple[str, ...]:
        own = [f"{c}{j + 1}" for j in range(self.joints) for c in ("Fv", "Fs", "off")]
        return (*own, *(f"{c}{k + 1}" for k, _ in self.couplings for c in ("Iam", "Fvm", "Fsm")))

    @property
    def units(self) -> tuple[str, ...]:
        turning = ("N·m·s/rad", "N·m", "N·m")
        sliding = ("N·s/m", "N", "N")
        own = [unit for revolute in self.revolute for unit in (turning if revolute else sliding)]
        coupled = [
            u
            for k, _ in self.couplings
            for u in (("kg·m²", *turning[:2]) if self.revolute[k] else ("kg", *sliding[:2]))
        ]
        return (*own, *coupled)

    def torque(self, out: np.ndarray, dq: np.ndarray, ddq: np.ndarray, sign: Sign) -> None:
        """Fill out (N, n, len(names)) from dq and ddq (N, n)."""
        out[...] = 0.0
        joints = np.arange(self.joints)
        out[:, joints, 3 * joints] = dq
        out[:, joints, 3 * joints + 1] = sign(dq)
        out[:, joints, 3 * joints + 2] = 1.0
        for at, (_, ratios) in zip(range(3 * self.joints, out.shape[2], 3), self.couplings, strict=True):
            rho = np.array(ratios)
            for column, x in ((at, ddq), (at + 1, dq)):
                out[:, :, column] = (x @ rho)[:, None] * rho - x * rho**2
            out[:, :, at + 2] = sign(dq @ rho)[:, None] * rho

    def energy(self, dq: np.ndarray) -> np.ndarray:
        """(N, len(names)) stored energy: the cross terms of coupled motors' inertia, zero elsewhere."""
        out = np.zeros((len(dq), len(self.names)))
        for at, (_, ratios) in zip(range(3 * self.joints, out.shape[1], 3), self.couplings, strict=True):
            rho = np.array(ratios)
            out[:, at] = 0.5 * ((dq @ rho) ** 2 - dq**2 @ rho**2)
        return out

    def power(self, dq: np.ndarray, sign: Sign) -> np.ndarray:
        """(N, len(names)) power q̇ᵀΓ that friction and offset take per unit of each parameter, zero for inertias."""
        out = np.zeros((len(dq), len(self.names)))
        own = 3 * self.joints
        out[:, 0:own:3] = dq**2
        out[:, 1:own:3] = dq * sign(dq)
        out[:, 2:own:3] = dq
        for at, (_, ratios) in zip(range(own, out.shape[1], 3), self.couplings, strict=True):
            rho = np.array(ratios)
            motor = dq @ rho
            out[:, at + 1] = motor**2 - dq**2 @ rho**2
            out[:, at + 2] = motor * sign(motor)
        return out
