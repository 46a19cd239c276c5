"""A Robot as a Pinocchio model, built transform by transform: an oracle that shares no code with the package."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from chains import random_chain

from identify.robot.robot import Robot


def pinocchio_model(robot: Robot) -> pin.Model:
    """Pinocchio model, rotor inertia as armature; joints branch by branch, which its composite-body algorithm needs."""
    model = pin.Model()
    model.gravity.linear = np.array(robot.gravity)
    numbers = {-1: 0}
    for index in branch_order(robot):
        joint = robot.joints[index]
        placement = (
            _turn_z(joint.gamma)
            * _shift(0, 0, joint.b)
            * _turn_x(joint.alpha)
            * _shift(joint.d, 0, 0)
            * _turn_z(joint.theta)
            * _shift(0, 0, joint.r)
        )
        kind = pin.JointModelRZ() if joint.revolute else pin.JointModelPZ()
        numbers[index] = model.addJoint(numbers[joint.parent], kind, placement, joint.name)
        xx, xy, xz, yy, yz, zz = joint.link.inertia
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        body = pin.Inertia(joint.link.mass, np.array(joint.link.com), inertia)
        model.appendBodyToJoint(numbers[index], body, pin.SE3.Identity())
    model.armature = np.array([robot.joints[index].drive.inertia for index in branch_order(robot)])
    return model


def random_arm(seed: int) -> tuple[Robot, pin.Model, list[int], np.ndarray]:
    """A random chain, by its seed special or a tree; its model by Pinocchio, its `branch_order`, positions (4, n)."""
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, 3 + seed % 5, special=seed % 2 == 0, tree=seed % 3 == 2)
    return robot, pinocchio_model(robot), branch_order(robot), rng.uniform(-2, 2, (4, robot.n))


def branch_order(robot: Robot) -> list[int]:
    """Indices of the joints, every branch to its end before the next one starts."""
    order: list[int] = []
    waiting = [index for index, joint in enumerate(robot.joints) if joint.parent == -1][::-1]
    while waiting:
        order.append(waiting.pop())
        waiting += [index for index, joint in enumerate(robot.joints) if joint.parent == order[-1]][::-1]
    return order


def inverse_dynamics(robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(N, n) rigid-body effort with actuator inertia, no friction, by Pinocchio."""
    model = pinocchio_model(robot)
    data = model.createData()
    order = branch_order(robot)
    rows = zip(q[:, order], dq[:, order], ddq[:, order], strict=True)
    effort = np.empty_like(q)
    effort[:, order] = [pin.rnea(model, data, *row).copy() for row in rows]
    return effort


def inertia_matrix(robot: Robot, q: np.ndarray) -> np.ndarray:
    """(n, n) inertia matrix with actuator inertia at q (n,), by Pinocchio."""
    model = pinocchio_model(robot)
    order = branch_order(robot)
    upper = np.triu(pin.crba(model, model.createData(), q[order]))
    matrix = np.empty_like(upper)
    matrix[np.ix_(order, order)] = upper + np.triu(upper, 1).T
    return matrix


def _turn_z(angle: float) -> pin.SE3:
    c, s = math.cos(angle), math.sin(angle)
    return pin.SE3(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3))


def _turn_x(angle: float) -> pin.SE3:
    c, s = math.cos(angle), math.sin(angle)
    return pin.SE3(np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]), np.zeros(3))


def _shift(x: float, y: float, z: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, z], dtype=float))
