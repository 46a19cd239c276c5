"""Drives and limits of a joint from a compiled MuJoCo model, which spreads them over joint and actuators."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from identify.robot.robot import Drive, Limits


def drive(model: Any, k: int) -> Drive:
    """Inertia and friction of joint k, those of its actuators through their gear included.

    A constant force against a torque motor, the first number of its affine bias, is an offset of its friction.
    """
    import mujoco

    dof = model.jnt_dofadr[k]
    inertia, viscous, offset = float(model.dof_armature[dof]), float(model.dof_damping[dof]), 0.0
    for i in _actuators(model, k):
        gear = float(model.actuator_gear[i, 0]) ** 2
        inertia += gear * float(model.actuator_armature[i])
        viscous += gear * float(model.actuator_damping[i])
        bias, *feedback = (float(x) for x in model.actuator_biasprm[i, :3])
        if model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_AFFINE and not any(feedback):
            offset -= float(model.actuator_gear[i, 0]) * bias
    return Drive(inertia, viscous, float(model.dof_frictionloss[dof]), offset + 0.0)


def limits(model: Any, k: int) -> Limits:
    """Position and effort limits of joint k."""
    low, high = (float(x) for x in model.jnt_range[k]) if model.jnt_limited[k] else (-math.inf, math.inf)
    position = (low, high) if low < high else (-math.inf, math.inf)
    efforts = [_effort(model, i) for i in _actuators(model, k)]
    effort = sum(efforts) or math.inf
    if model.jnt_actfrclimited[k]:
        effort = min(effort, _magnitude(model.jnt_actfrcrange[k]) or math.inf)
    return Limits(position, effort=effort)


def _actuators(model: Any, k: int) -> list[int]:
    """The actuators that drive joint k."""
    import mujoco

    direct = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
    return [i for i in range(model.nu) if model.actuator_trntype[i] in direct and model.actuator_trnid[i, 0] == k]


def _effort(model: Any, i: int) -> float:
    """The largest effort of an actuator at its joint [N·m or N], infinite where the file does not limit it."""
    import mujoco

    gear = abs(float(model.actuator_gear[i, 0]))
    found = math.inf
    if model.actuator_forcelimited[i]:
        found = gear * _magnitude(model.actuator_forcerange[i])
    fixed = model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_FIXED
    plain = model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE
    if fixed and plain and model.actuator_ctrllimited[i]:
        gain = abs(float(model.actuator_gainprm[i, 0]))
        found = min(found, gear * gain * _magnitude(model.actuator_ctrlrange[i]))
    return found


def _magnitude(bounds: np.ndarray) -> float:
    """What a range reaches on both sides, or on its only one."""
    low, high = (float(x) for x in bounds)
    return min(-low, high) if low < 0 < high else max(abs(low), abs(high))
