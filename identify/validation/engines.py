"""Two independent engines for cross-checks, Pinocchio and MuJoCo, built from a Robot's geometry and any parameters.

`standard` (11 n,) is in the order of `Robot.standard_names`: per link XX XY XZ YY YZ ZZ MX MY MZ M about
O_j in the axes of R_j, then Ia, SI. Torques are the rigid ones with actuator inertia, Γ = A·q̈ + C·q̇ + Q
with Ia on the diagonal of A: no friction, no limits, no contact. The world of both models is R_0, where
Robot.gravity is given; `Robot.base` and `Robot.tool` play no part in torques.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from identify.errors import RobotError
from identify.robot.mjcf import depth_first, to_mjcf
from identify.robot.mjcf_compile import quiet
from identify.robot.robot import Robot
from identify.robot.transforms import joint_transform

WIDTH = 11
"""Standard parameters of a joint and its link."""

FROM_PINOCCHIO = (4, 5, 7, 6, 8, 9, 1, 2, 3, 0)
"""Where XX XY XZ YY YZ ZZ MX MY MZ M stand in Pinocchio's m mx my mz Ixx Ixy Iyy Ixz Iyz Izz."""

FARTHEST = 10.0
"""Distance of a centre of mass from O_j [m] beyond which the mass is too small to carry the first moments."""


def pinocchio_model(robot: Robot, standard: np.ndarray) -> Any:
    """pinocchio.Model of the robot, joints in its order, world = R_0, Ia as `armature`.

    Negative masses and impossible inertias go in as they are. ValueError naming the link where Pinocchio,
    which stores a centre of mass, can't hold it: first moments on (next to) no mass.
    """
    links = _links(robot, standard)
    for joint, link in zip(robot.joints, links, strict=True):
        if not _has_centre(link):
            raise ValueError(f"link of {joint.name}: first moments without mass; Pinocchio stores a centre of mass")
    return _model(robot, links, _actuators(robot, standard))


def pinocchio_torque(robot: Robot, standard: np.ndarray, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(N, n) joint torque [N·m or N] by pinocchio.rnea at N samples q, dq, ddq (N, n), SI.

    Any standard vector serves. Where a link has first moments on no mass, a mass is lent to it at O_j and
    its torque, computed in a second model, taken away again: torque is linear in the parameters.
    """
    links, actuators = _links(robot, standard), _actuators(robot, standard)
    q, dq, ddq = _samples(robot, q, dq, ddq)
    lent = np.zeros_like(links)
    for link, loan in zip(links, lent, strict=True):
        if not _has_centre(link):
            loan[9] = max(1.0, float(np.linalg.norm(link[6:9])))
    torque = _rnea(_model(robot, links + lent, actuators), q, dq, ddq)
    if np.any(lent):
        torque -= _rnea(_model(robot, lent, np.zeros(robot.n)), q, dq, ddq)
    return torque


def pinocchio_regressor(robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(N, n, 11 n) torque regressor of the standard parameters: torque = regressor @ standard.

    Columns in the order of `Robot.standard_names`; the column of Ia_j is q̈_j in row j.
    """
    import pinocchio

    model = _model(robot, np.zeros((robot.n, WIDTH - 1)), np.zeros(robot.n))
    data = model.createData()
    q, dq, ddq = _samples(robot, q, dq, ddq)
    result = np.zeros((len(q), robot.n, robot.n, WIDTH))
    for k in range(len(q)):
        columns = pinocchio.computeJointTorqueRegressor(model, data, q[k], dq[k], ddq[k])
        result[k, :, :, :10] = columns.reshape(robot.n, robot.n, 10)[:, :, FROM_PINOCCHIO]
    joints = np.arange(robot.n)
    result[:, joints, joints, 10] = ddq
    return result.reshape(len(q), robot.n, WIDTH * robot.n)


def mujoco_torque(robot: Robot, standard: np.ndarray, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(N, n) joint torque [N·m or N] by MuJoCo's mj_inverse at N samples q, dq, ddq (N, n), SI.

    MuJoCo holds possible bodies only: ValueError naming the link whose inertia is not one, or is not known.
    """
    import mujoco

    try:
        text = to_mjcf(robot, _vector(robot, standard), friction=False, limits=False)
    except RobotError as error:
        raise ValueError(str(error)) from None
    with quiet():
        model = mujoco.MjModel.from_xml_string(text)
        flags = mujoco.mjtDisableBit
        # mj_inverse adds the forces of joint stops and friction, which are no part of the rigid model.
        model.opt.disableflags |= flags.mjDSBL_LIMIT | flags.mjDSBL_CONTACT | flags.mjDSBL_FRICTIONLOSS
        data = mujoco.MjData(model)
        q, dq, ddq = _samples(robot, q, dq, ddq)
        order = list(depth_first(robot))
        torque = np.empty_like(q)
        for k in range(len(q)):
            data.qpos[:], data.qvel[:], data.qacc[:] = q[k, order], dq[k, order], ddq[k, order]
            mujoco.mj_inverse(model, data)
            torque[k, order] = data.qfrc_inverse
    return torque


def _vector(robot: Robot, standard: np.ndarray) -> np.ndarray:
    values = np.asarray(standard, dtype=float)
    if values.shape != (WIDTH * robot.n,):
        raise ValueError(f"{values.shape} standard parameters given, ({WIDTH * robot.n},) needed")
    return values


def _links(robot: Robot, standard: np.ndarray) -> np.ndarray:
    """(n, 10) the inertial parameters of each link."""
    return _vector(robot, standard).reshape(robot.n, WIDTH)[:, :10].copy()


def _actuators(robot: Robot, standard: np.ndarray) -> np.ndarray:
    """(n,) actuator inertias Ia."""
    return _vector(robot, standard).reshape(robot.n, WIDTH)[:, 10].copy()


def _samples(robot: Robot, *arrays: np.ndarray) -> list[np.ndarray]:
    """The sample arrays as (N, n) floats; a single sample (n,) becomes one row."""
    rows = [np.atleast_2d(np.asarray(array, dtype=float)) for array in arrays]
    shapes = {row.shape for row in rows}
    if len(shapes) > 1 or rows[0].ndim != 2 or rows[0].shape[1] != robot.n:
        raise ValueError(f"samples of shapes {[row.shape for row in rows]} given, (N, {robot.n}) needed")
    return rows


def _has_centre(link: np.ndarray) -> bool:
    """Whether mass and first moments of a link (10,) give a centre of mass that arithmetic can bear."""
    moments = float(np.linalg.norm(link[6:9]))
    return moments == 0.0 or moments <= FARTHEST * abs(link[9])


def _model(robot: Robot, links: np.ndarray, actuators: np.ndarray) -> Any:
    """pinocchio.Model with the inertias links (n, 10) about O_j, each with a centre of mass, and armature (n,)."""
    import pinocchio

    model = pinocchio.Model()
    model.name = robot.name
    model.gravity.linear = np.array(robot.gravity)
    for joint in robot.joints:
        # The constant parts of θ and r commute with the variable: both are about or along z_j.
        place = joint_transform(joint, 0.0)
        kind = pinocchio.JointModelRZ() if joint.revolute else pinocchio.JointModelPZ()
        model.addJoint(joint.parent + 1, kind, pinocchio.SE3(place[:3, :3], place[:3, 3]), joint.name)
    for j, link in enumerate(links):
        model.inertias[j + 1] = _inertia(link)
    model.armature = actuators
    return model


def _inertia(link: np.ndarray) -> Any:
    """pinocchio.Inertia of the parameters (10,); set part by part, because the constructor refuses what is no body."""
    import pinocchio

    xx, xy, xz, yy, yz, zz, *moments, mass = link
    about_origin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    com = np.array(moments) / mass if mass else np.zeros(3)
    result = pinocchio.Inertia.Zero()
    result.mass = mass
    result.lever = com
    result.inertia = about_origin - mass * (com @ com * np.eye(3) - np.outer(com, com))
    return result


def _rnea(model: Any, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(N, n) torque of the model at samples (N, n)."""
    import pinocchio

    data = model.createData()
    # rnea hands out its own buffer: each row is copied into place before the next call.
    torque = np.empty_like(q)
    for k in range(len(q)):
        torque[k] = pinocchio.rnea(model, data, q[k], dq[k], ddq[k])
    return torque
