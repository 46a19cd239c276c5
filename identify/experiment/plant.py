"""The simulated robot: MuJoCo closed loop of arm, friction, drives and a joint-space controller.

Time stepping and truth. MuJoCo's Euler step is q̇[k+1] = q̇[k] + h·q̈[k], q[k+1] = q[k] + h·q̇[k+1], with q̈[k]
from the effort held over that step. So q̈[k] is exactly the second difference of the positions about t[k],
while q̇[k] is their slope half a step earlier. Taking Fv·q̇ there would look, to anyone who only has the
positions, like an actuator inertia that is wrong by Fv·h/2 (0.1 to 0.3 % of Ia on the RX-90, a few standard
deviations of a 30 s log). The plant therefore integrates viscous friction by the trapezoidal rule,
Fv·(q̇[k] + q̇[k+1])/2: explicit damping, and Fv·h/2 added to the armature on the left-hand side. Then the
logged effort is rigid body + Ia·q̈ + Fv·q̇ + Fs·sign(q̇) + offset at the logged positions, but for the
centrifugal and Coriolis effort C(q,q̇)·q̇, which MuJoCo takes half a step old: up to 0.03 N·m rms on the RX-90,
three standard deviations of a parameter of a 30 s log. What that is worth along the reference is given back to the
arm as a force of its own, which no drive makes and no log holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from identify.errors import InputError
from identify.experiment.trajectory import Trajectory
from identify.robot.mjcf import depth_first, to_mjcf
from identify.robot.payload import carrying
from identify.robot.robot import Link, Robot

TIMESTEP = 0.0005
"""Integration and control step of the plant [s]."""

BANDWIDTH_HZ = 10.0
"""Natural frequency of each joint's critically damped position loop."""

STEP_DAMPING = 0.5
"""Largest share of a velocity that the controller takes away in one step, h·λmax(M⁻¹·Kd).

2 is the edge of stability, above 1 it rings. Viscous friction needs no room beside it: the trapezoidal rule
is stable at any step.
"""

SEGMENT = 500
"""Steps after which what has happened is handed on."""

CORIOLIS_EVERY = 8
"""Steps between the instants at which the Coriolis effort along the reference is computed."""

COULOMB_WIDTH = 0.01
"""Reference speed over which the feed-forward's Coulomb term changes sign [rad/s or m/s]."""


@dataclass(frozen=True, eq=False)
class PlantRun:
    """What really happened to n joints at N logged instants, free of sensor noise.

    time (N,) [s]; position, velocity (N, n) the state; effort (N, n) [N·m or N] the drives' effort at that
    state, held over the step that follows it; step_correction (N, n) the force beside it that no drive makes and that
    makes up for the time step (see above); reference (N, n) the position asked for; joints: n names.
    saturated (n,): at how many steps the effort went beyond its limit (it is never clipped). findings:
    sentences on limits that were broken. facts: how the plant was run.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    step_correction: np.ndarray
    reference: np.ndarray
    joints: tuple[str, ...]
    saturated: np.ndarray
    findings: tuple[str, ...]
    facts: dict[str, str]


def run_plant(
    robot: Robot,
    trajectory: Trajectory,
    *,
    every: int = 2,
    bandwidth_hz: float = BANDWIDTH_HZ,
    progress: Callable[[float, str], None] | None = None,
    each: Callable[[np.ndarray, np.ndarray, np.ndarray, dict[str, str]], None] | None = None,
    load: Link | None = None,
) -> PlantRun:
    """Let the robot follow `trajectory` from rest and keep every `every`-th step of 0.5 ms.

    load: what it carries, in R_n, of which the controller knows nothing, as a cell that has yet to learn its load.
    each: gets time (k,), position and effort (k, n) of every quarter of a second as soon as it is over, and how the
    plant is run.

    The controller is Γ = Kp·(q_ref − q) + Kd·(q̇_ref − q̇) + Γ_ff, Kp = ω²·M_jj and Kd = 2ω·M_jj with M_jj the
    mean diagonal of the inertia matrix over the motion and ω = 2π·bandwidth_hz, lowered where the coupling
    of the axes would make that unstable at this step. Γ_ff is `reference_effort`: the robot's own description.
    InputError if the trajectory is for other joints or the loop diverges; RobotError if MuJoCo can't hold an
    inertia.
    """
    import mujoco
    from mujoco import rollout

    tell = progress or (lambda fraction, text: None)
    trajectory = trajectory.for_robot(robot)
    steps = round(trajectory.duration / TIMESTEP)
    time = np.arange(steps + 1) * TIMESTEP
    tell(0.0, "feed-forward")
    q_ref, dq_ref, ddq_ref = trajectory.sample(time)
    feedforward = reference_effort(robot, q_ref, dq_ref, ddq_ref)
    omega, diagonal = _loop(robot, q_ref, 2 * np.pi * bandwidth_hz)
    stiffness, damping = omega**2 * diagonal, 2 * omega * diagonal
    command = stiffness * q_ref + damping * dq_ref + feedforward  # (steps + 1, n)
    arm = robot if load is None else carrying(robot, load)
    step_correction = _half_step_of_coriolis(arm, trajectory, time)

    tell(0.4, "plant")
    order = list(depth_first(robot))
    model = mujoco.MjModel.from_xml_string(
        to_mjcf(arm, timestep=TIMESTEP, position_gain=stiffness, velocity_gain=damping)
    )
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    model.dof_armature += model.dof_damping * TIMESTEP / 2
    data = mujoco.MjData(model)
    data.qpos[:] = q_ref[0, order]
    everything = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.empty(mujoco.mj_stateSize(model, everything))
    mujoco.mj_getState(model, data, start, everything)
    # MuJoCo would answer divergence with a file in the current folder; it is told below instead
    mujoco.set_mju_user_warning(lambda text: None)
    facts = {
        "plant": f"MuJoCo {mujoco.__version__}, Euler, step {TIMESTEP} s, viscous and Coriolis effort centred",
        "controller": f"joint-space PD, critically damped at {omega / (2 * np.pi):.3g} Hz, with feed-forward",
    }
    back = np.argsort(order)
    n, controls = robot.n, (command + step_correction)[None, :-1, order]
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
                rows = np.arange(0 if begin == 0 else begin + 1, end + 1)
                rows = rows[rows % every == 0]
                q, dq = states[rows, 1 : 1 + n][:, back], states[rows, 1 + n : 1 + 2 * n][:, back]
                each(rows / round(1 / TIMESTEP), q, command[rows] - stiffness * q - damping * dq, facts)
    finally:
        mujoco.set_mju_user_warning(None)

    position, velocity = states[:, 1 : 1 + n][:, back], states[:, 1 + n : 1 + 2 * n][:, back]
    if not (np.all(np.isfinite(states)) and abs(states[-1, 0] - time[-1]) < TIMESTEP):
        raise InputError(f"{robot.name}: the simulated robot became unstable; look at its inertias, or ask for less")
    effort = command - stiffness * position - damping * velocity
    saturated = _beyond(effort, np.array([joint.limits.effort for joint in robot.joints]))
    tell(1.0, "plant")
    kept = slice(None, None, every)
    return PlantRun(
        time=np.arange(0, steps + 1, every) / round(1 / TIMESTEP),
        position=position[kept],
        velocity=velocity[kept],
        effort=effort[kept],
        step_correction=step_correction[kept],
        reference=q_ref[kept],
        joints=robot.joint_names,
        saturated=saturated,
        findings=_findings(robot, position, velocity, effort, saturated),
        facts=facts,
    )


def reference_effort(robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(N, n) effort that the robot's own description asks for along q, q̇, q̈ (N, n): the feed-forward.

    Rigid-body inverse dynamics by MuJoCo on a copy without friction, plus Fv·q̇ + Fs·tanh(q̇/0.01) + offset.
    """
    drives = [joint.drive for joint in robot.joints]
    viscous = np.array([drive.viscous for drive in drives])
    coulomb = np.array([drive.coulomb for drive in drives])
    offset = np.array([drive.offset for drive in drives])
    return _rigid_effort(robot, q, dq, ddq) + viscous * dq + coulomb * np.tanh(dq / COULOMB_WIDTH) + offset


def _rigid_effort(robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
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
    old = _rigid_effort(robot, q, dq - ddq * TIMESTEP / 2, still)
    difference = old - _rigid_effort(robot, q, dq, still)
    return np.column_stack([np.interp(time, coarse, column) for column in difference.T])


def inertia_matrices(robot: Robot, q: np.ndarray) -> np.ndarray:
    """(N, n, n) inertia matrices at q (N, n), actuator inertia included [kg·m², kg·m, kg]."""
    import mujoco

    order = list(depth_first(robot))
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot, friction=False, limits=False))
    data = mujoco.MjData(model)
    matrices = np.empty((len(q), robot.n, robot.n))
    for matrix, row in zip(matrices, q[:, order], strict=True):
        data.qpos[:] = row
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, matrix)
    back = np.argsort(order)
    return matrices[:, back][:, :, back]


def _loop(robot: Robot, q: np.ndarray, omega: float) -> tuple[float, np.ndarray]:
    """Natural frequency [rad/s], lowered where the step demands it, and mean inertia diagonal (n,) along q (N, n)."""
    matrices = inertia_matrices(robot, q[:: max(1, len(q) // 50)])
    diagonal = np.einsum("kjj->kj", matrices).mean(axis=0)
    # λmax of M⁻¹·diag(M): how much livelier the coupled arm is than its joints one by one
    liveliest = max(np.abs(np.linalg.eigvals(np.linalg.solve(matrix, np.diag(diagonal)))).max() for matrix in matrices)
    return min(omega, STEP_DAMPING / (2 * TIMESTEP * liveliest)), diagonal


def _beyond(values: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """(n,) number of rows of |values| (N, n) above limits (n,)."""
    return np.count_nonzero(np.abs(values) > limits, axis=0)


def _findings(
    robot: Robot, position: np.ndarray, velocity: np.ndarray, effort: np.ndarray, saturated: np.ndarray
) -> tuple[str, ...]:
    """Sentences on efforts, positions and velocities (N, n) beyond the limits, of all steps."""
    found = []
    for j, joint in enumerate(robot.joints):
        limits, unit = joint.limits, joint.position_unit
        if saturated[j]:
            found.append(
                f"{joint.name}: effort beyond its limit of {limits.effort:g} {joint.effort_unit} at {saturated[j]} of "
                f"{len(effort)} steps (peak {np.abs(effort[:, j]).max():.4g}); a real drive would saturate"
            )
        low, high = limits.position
        outside = np.count_nonzero((position[:, j] < low) | (position[:, j] > high))
        if outside:
            found.append(
                f"{joint.name}: pressed against its stop at {outside} of {len(position)} steps "
                f"(limits {low:.4g} to {high:.4g} {unit}); the effort there is not the arm's alone"
            )
        fast = np.count_nonzero(np.abs(velocity[:, j]) > limits.velocity)
        if fast:
            found.append(
                f"{joint.name}: faster than its limit of {limits.velocity:.4g} {unit}/s "
                f"at {fast} of {len(velocity)} steps"
            )
    return tuple(found)
