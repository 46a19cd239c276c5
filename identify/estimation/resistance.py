"""What it takes that friction resists: that of a joint or motor, all its forms together, never drives it.

Each form alone may: Stribeck friction that falls with speed is Coulomb friction less what faded, and a cube root that
bends down is viscous friction that grows more slowly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.regressor.columns import MORE
from identify.regressor.friction import ASYMMETRIC, LOAD, Sign, sliding_laws
from identify.regressor.regressor import Regressor

SPEEDS = 96
"""Speeds at which friction has to resist, from nearly rest to the joint's limit, each a step of the same ratio."""

SLOWEST = 1e-5
"""The slowest of them, in shares of the fastest."""

UNLIMITED = 10.0
"""The fastest where the robot has no limit [rad/s or m/s]."""

LOADS = (0.0, 3.0)
"""The loads under which it has to, in units of the mean load; between them friction is between."""


@dataclass(frozen=True)
class Arm:
    """A joint or coupled motor: rows (k, names) whose products with the parameters of these columns are its friction
    [N·m or N] against the direction of motion, at speeds, directions and loads."""

    names: tuple[str, ...]
    rows: np.ndarray


def resisting(regressor: Regressor, sign: Sign) -> list[Arm]:
    """Joint by joint, then motor by motor, what may not be negative."""
    extra = regressor.extra
    if extra is None:
        return []
    joints = regressor.robot.joints
    limits = np.array([x.limits.velocity if np.isfinite(x.limits.velocity) else UNLIMITED for x in joints])
    motors = [column for column in extra.columns if column.kind == "Fsm"]
    arms = [(f"{j + 1}", 0, limits[j], j) for j in range(len(joints))]
    arms += [(f"{motor.index + 1}", 1, float(np.abs(motor.ratios) @ limits), -1) for motor in motors]
    return [_arm(regressor, sign, number, motor, top, j) for number, motor, top, j in arms]


def _arm(regressor: Regressor, sign: Sign, number: str, motor: int, top: float, j: int) -> Arm:
    extra = regressor.extra
    assert extra is not None
    speeds = top * np.geomspace(SLOWEST, 1.0, SPEEDS)
    v = np.concatenate([speeds, -speeds]) if ASYMMETRIC in regressor.forms else speeds
    laws = sliding_laws(sign, regressor.constants.stribeck_velocity)
    columns: dict[str, np.ndarray] = {f"Fv{'m' * motor}{number}": v, f"Fs{'m' * motor}{number}": sign(v)}
    if j >= 0:  # what coupled motors put on a joint is theirs
        columns |= {c.name: -(c.ratios[j] ** 2) * v for c in extra.columns if c.kind == "Fvm"}
    columns |= {f"{MORE[form][motor]}{number}": laws[form](v) for form in regressor.forms if motor < len(MORE[form])}
    names = tuple(name for name in columns if name in extra.names)
    rows = np.column_stack([columns[name] for name in names]) * np.sign(v)[:, None]
    load = f"{MORE[LOAD][0]}{number}"
    if load in names and not motor:
        scaled = [rows * np.where([name == load for name in names], level, 1.0) for level in LOADS]
        rows = np.concatenate(scaled)
    return Arm(names, rows)
