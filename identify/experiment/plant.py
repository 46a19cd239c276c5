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
from importlib.metadata import version

import numpy as np

from identify.experiment.closed_loop import TIMESTEP, closed_loop, rigid_effort, steps_of
from identify.experiment.control import Control
from identify.experiment.trajectory import Trajectory
from identify.robot.mjcf import depth_first, to_mjcf
from identify.robot.payload import carrying
from identify.robot.robot import Link, Robot

BANDWIDTH_HZ = 10.0
"""Natural frequency of each joint's critically damped position loop."""

STEP_DAMPING = 0.5
"""Largest share of a velocity that the controller takes away in one step, h·λmax(M⁻¹·Kd).

2 is the edge of stability, above 1 it rings. Viscous friction needs no room beside it: the trapezoidal rule
is stable at any step.
"""

COULOMB_WIDTH = 0.01
"""Reference speed over which the feed-forward's Coulomb term changes sign [rad/s or m/s]."""


@dataclass(frozen=True, eq=False)
class PlantRun:
    """What really happened to n joints at N logged instants, free of sensor noise.

    time (N,) [s]; position, velocity (N, n) the state; effort (N, n) [N·m or N] the drives' effort at that
    state, held over the step that follows it; step_correction (N, n) the force beside it that no drive makes and that
    makes up for the time step (see above); reference (N, n) the position asked for; joints: n names.
    saturated (n,): at how many steps the effort went beyond its limit (it is never clipped). findings:
    sentences on limits that were broken. facts: how the plant was run; control: its controller.
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
    control: Control | None = None


def run_plant(
    robot: Robot,
    trajectory: Trajectory,
    *,
    every: int = 2,
    bandwidth_hz: float = BANDWIDTH_HZ,
    progress: Callable[[float, str], None] | None = None,
    each: Callable[[np.ndarray, np.ndarray, np.ndarray, dict[str, str], Control], None] | None = None,
    load: Link | None = None,
) -> PlantRun:
    """Let the robot follow `trajectory` from rest and keep every `every`-th step of 0.5 ms.

    load: what it carries, in R_n, of which the controller knows nothing, as a cell that has yet to learn its load.
    each: gets time (k,), position and effort (k, n) of every quarter of a second as soon as it is over, how the plant
    is run, and its controller.

    The controller is Γ = Kp·(q_ref − q) + Kd·(q̇_ref − q̇) + Γ_ff, Kp = ω²·M_jj and Kd = 2ω·M_jj with M_jj the
    mean diagonal of the inertia matrix over the motion and ω = 2π·bandwidth_hz, lowered where the coupling
    of the axes would make that unstable at this step. Γ_ff is `reference_effort`: the robot's own description.
    InputError if the trajectory is for other joints or the loop diverges; RobotError if MuJoCo can't hold an
    inertia.
    """
    tell = progress or (lambda fraction, text: None)
    trajectory = trajectory.for_robot(robot)
    time = steps_of(trajectory)
    tell(0.0, "feed-forward")
    q_ref, dq_ref, ddq_ref = trajectory.sample(time)
    feedforward = reference_effort(robot, q_ref, dq_ref, ddq_ref)
    omega, diagonal = _loop(robot, q_ref, 2 * np.pi * bandwidth_hz)
    stiffness, damping = omega**2 * diagonal, 2 * omega * diagonal
    command = stiffness * q_ref + damping * dq_ref + feedforward  # (steps + 1, n)
    kept = slice(None, None, every)
    control = Control(trajectory, stiffness, damping, feedforward[kept], 1 / (every * TIMESTEP))

    tell(0.4, "plant")
    facts = {
        "plant": f"MuJoCo {version('mujoco')}, Euler, step {TIMESTEP} s, viscous and Coriolis effort centred",
        "controller": f"joint-space PD, critically damped at {omega / (2 * np.pi):.3g} Hz, with feed-forward",
        **control.metadata(),
    }

    def told(rows: slice, q: np.ndarray, dq: np.ndarray) -> None:
        assert each is not None
        logged = np.arange(rows.start, rows.stop)
        logged = logged[logged % every == 0]
        q, dq = q[logged - rows.start], dq[logged - rows.start]
        each(logged / round(1 / TIMESTEP), q, command[logged] - stiffness * q - damping * dq, facts, control)

    arm = robot if load is None else carrying(robot, load)
    position, velocity, step_correction = closed_loop(
        arm, trajectory, command, stiffness, damping, each=None if each is None else told
    )
    effort = command - stiffness * position - damping * velocity
    saturated = _beyond(effort, np.array([joint.limits.effort for joint in robot.joints]))
    tell(1.0, "plant")
    return PlantRun(
        time=np.arange(0, len(time), every) / round(1 / TIMESTEP),
        position=position[kept],
        velocity=velocity[kept],
        effort=effort[kept],
        step_correction=step_correction[kept],
        reference=q_ref[kept],
        joints=robot.joint_names,
        saturated=saturated,
        findings=_findings(robot, position, velocity, effort, saturated),
        facts=facts,
        control=control,
    )


def reference_effort(robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(N, n) effort that the robot's own description asks for along q, q̇, q̈ (N, n): the feed-forward.

    Rigid-body inverse dynamics by MuJoCo on a copy without friction, plus Fv·q̇ + Fs·tanh(q̇/0.01) + offset.
    """
    drives = [joint.drive for joint in robot.joints]
    viscous = np.array([drive.viscous for drive in drives])
    coulomb = np.array([drive.coulomb for drive in drives])
    offset = np.array([drive.offset for drive in drives])
    return rigid_effort(robot, q, dq, ddq) + viscous * dq + coulomb * np.tanh(dq / COULOMB_WIDTH) + offset


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
