"""An arm in a closed loop with its joint-space controller, step by step in MuJoCo."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from identify.errors import InputError
from identify.experiment.trajectory import Trajectory
from identify.robot.mjcf import depth_first, to_mjcf
from identify.robot.robot import Robot

TIMESTEP = 0.0005
"""Integration and control step [s]."""

SEGMENT = 500
"""Steps after which what has happened is handed on."""

CORIOLIS_EVERY = 8
"""Steps between the instants at which the Coriolis effort along the reference is computed."""


def steps_of(trajectory: Trajectory) -> np.ndarray:
    """(steps + 1,) instants of a trajectory [s] at which the loop is closed."""
    return np.arange(round(trajectory.duration / TIMESTEP) + 1) * TIMESTEP


def closed_loop(
    arm: Robot,
    trajectory: Trajectory,
    command: np.ndarray,
    stiffness: np.ndarray,
    damping: np.ndarray,
    each: Callable[[slice, np.ndarray, np.ndarray], None] | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and the force that makes up for the time step, (steps + 1, n), of `arm` from rest.

    Effort = command − stiffness·q − damping·q̇, with command (steps + 1, n) = Kp·q_ref + Kd·q̇_ref + Γ_ff
    [N·m or N] and gains (n,) [N·m/rad, N·m·s/rad or N/m, N·s/m]. each: gets the rows of every quarter of a second, with
    their position and velocity, as soon as it is over. `plant` says how time is stepped.
    InputError if the loop diverges; RobotError if MuJoCo can't hold an inertia.
    """
    import mujoco
    from mujoco import rollout

    time = steps_of(trajectory)
    steps, n = len(time) - 1, arm.n
    correction = _half_step_of_coriolis(arm, trajectory, time)
    order = list(depth_first(arm))
    back = np.argsort(order)
    model = mujoco.MjModel.from_xml_string(
        to_mjcf(arm, timestep=TIMESTEP, position_gain=stiffness, velocity_gain=damping)
    )
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    model.dof_armature += model.dof_damping * TIMESTEP / 2
    data = mujoco.MjData(model)
    data.qpos[:] = trajectory.sample(time[:1])[0][0, order]
    everything = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.empty(mujoco.mj_stateSize(model, everything))
    mujoco.mj_getState(model, data, start, everything)
    # MuJoCo would answer divergence with a file in the current folder; it is told below instead
    mujoco.set_mju_user_warning(lambda text: None)
    controls = (command + correction)[None, :-1, order]
    states = np.empty((steps + 1, len(start)))  # time, q, q̇
    states[0] = start
    warm = None
    try:
        for begin in range(0, steps, SEGMENT):
            end = min(begin + SEGMENT, steps)
            part = slice(begin + 1, end + 1)
            # The solver's first guess goes along, so that the segments are one run bit by bit.
            states[part] = rollout.rollout(model, data, states[begin], controls[:, begin:end], initial_warmstart=warm)[
                0
            ][0]
            warm = data.qacc_warmstart.copy()
            if each is not None and np.all(np.isfinite(states[part])):
                rows = slice(0 if begin == 0 else begin + 1, end + 1)
                each(rows, states[rows, 1 : 1 + n][:, back], states[rows, 1 + n : 1 + 2 * n][:, back])
    finally:
        mujoco.set_mju_user_warning(None)
    if not (np.all(np.isfinite(states)) and abs(states[-1, 0] - time[-1]) < TIMESTEP):
        raise InputError(f"{arm.name}: the simulated robot became unstable; look at its inertias, or ask for less")
    return states[:, 1 : 1 + n][:, back], states[:, 1 + n : 1 + 2 * n][:, back], correction


def rigid_effort(robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(N, n) effort of the arm without friction along q, q̇, q̈ (N, n), by MuJoCo's inverse dynamics."""
    import mujoco

    order = list(depth_first(robot))
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot, friction=False, limits=False))
    data = mujoco.MjData(model)
    rigid = np.empty_like(q)
    position, velocity, acceleration, effort = data.qpos, data.qvel, data.qacc, data.qfrc_inverse
    inverse = mujoco.mj_inverse
    for k, (row_q, row_dq, row_ddq) in enumerate(zip(q[:, order], dq[:, order], ddq[:, order], strict=True)):
        position[:], velocity[:], acceleration[:] = row_q, row_dq, row_ddq
        inverse(model, data)
        rigid[k] = effort
    return rigid[:, np.argsort(order)]


def _half_step_of_coriolis(robot: Robot, trajectory: Trajectory, time: np.ndarray) -> np.ndarray:
    """(N, n) C(q,q̇)·q̇ along the reference with q̇ half a step old, less the same with q̇ of the instant.

    It varies as slowly as the reference does, so every CORIOLIS_EVERY-th step is computed and the rest interpolated.
    """
    coarse = time[::CORIOLIS_EVERY]
    q, dq, ddq = trajectory.sample(coarse)
    still = np.zeros_like(q)
    old = rigid_effort(robot, q, dq - ddq * TIMESTEP / 2, still)
    difference = old - rigid_effort(robot, q, dq, still)
    return np.column_stack([np.interp(time, coarse, column) for column in difference.T])
