"""Columns of friction and of coupled motors, against a coupled wrist worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from symbolic_models import states

from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.robot import Transmission


@pytest.fixture(scope="module")
def wrist() -> Regressor:
    return Regressor(load_robot("tx40"))


def test_the_wrist_of_the_tx40(wrist: Regressor) -> None:
    """Motor 6 turns at 32·(q̇5 + q̇6): its inertia and viscous friction tie rows 5 and 6 together, its Coulomb friction
    acts on both (../shared/data/tx40/README.md). What falls on one joint alone is in Ia5, Ia6, Fv5 and Fv6."""
    assert wrist.names[-3:] == ("Iam6", "Fvm6", "Fsm6")
    assert wrist.units[-3:] == ("kg·m²", "N·m·s/rad", "N·m")
    assert len(wrist.names) == 40 + 18 + 3
    q, dq, ddq = states(np.random.default_rng(0), wrist.robot, 50)
    dq[7, 4:] = [0.75, -0.75]
    dq[8] = 0.0
    torque = wrist.torque(q, dq, ddq)[:, :, -3:]
    expected = np.zeros((50, 6, 3))
    expected[:, 4, 0], expected[:, 5, 0] = ddq[:, 5], ddq[:, 4]
    expected[:, 4, 1], expected[:, 5, 1] = dq[:, 5], dq[:, 4]
    expected[:, 4, 2] = expected[:, 5, 2] = np.sign(dq[:, 4] + dq[:, 5])
    np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-15)
    assert not torque[7, :, 2].any()
    assert not torque[8, :, 1:].any()
    energy = wrist.energy(q, dq)
    np.testing.assert_allclose(energy[:, -3], dq[:, 4] * dq[:, 5], rtol=0, atol=1e-15)
    assert not energy[:, 40:-3].any()
    assert not energy[:, -2:].any()
    power = wrist.power(dq)[:, -3:]
    motor = dq[:, 4] + dq[:, 5]
    np.testing.assert_allclose(
        power, np.array([0 * motor, 2 * dq[:, 4] * dq[:, 5], np.abs(motor)]).T, rtol=0, atol=1e-14
    )


def test_a_motor_and_its_joints_add_up_to_the_motor(wrist: Regressor) -> None:
    """One unit of motor inertia, whole: ½(q̇5 + q̇6)² is the column Iam6 with one unit each of Ia5 and Ia6."""
    motor = np.zeros(wrist.p)
    at = {name: k for k, name in enumerate(wrist.names)}
    for name in ("Ia5", "Ia6", "Iam6"):
        motor[at[name]] = 1.0
    for name in ("Fv5", "Fv6", "Fvm6"):
        motor[at[name]] = 0.4
    motor[at["Fsm6"]] = 0.3
    q, dq, ddq = states(np.random.default_rng(1), wrist.robot, 20)
    acceleration, speed = ddq[:, 4] + ddq[:, 5], dq[:, 4] + dq[:, 5]
    force = acceleration + 0.4 * speed + 0.3 * np.sign(speed)
    expected = np.zeros((20, 6))
    expected[:, 4] = expected[:, 5] = force
    np.testing.assert_allclose(wrist.inverse_dynamics(q, dq, ddq, motor), expected, rtol=0, atol=1e-13)
    np.testing.assert_allclose(wrist.energy(q, dq) @ motor, 0.5 * speed**2, rtol=0, atol=1e-13)


def test_ratios_are_in_units_of_the_motors_own_joint() -> None:
    """A motor row (a, b) with b its own joint turns at q̇_b + (a/b)·q̇_a, whatever the signs."""
    robot = load_robot("rx90")
    matrix = np.diag([30.0, 30.0, -45.0, 48.0, 45.0, -32.0])
    matrix[5, 3], matrix[5, 4] = 8.0, 16.0
    coupled = Regressor(replace(robot, transmission=Transmission(tuple(map(tuple, matrix.tolist())))))
    q, dq, ddq = states(np.random.default_rng(2), robot, 10)
    assert coupled.names[-3:] == ("Iam6", "Fvm6", "Fsm6")
    speed = dq[:, 5] - 0.25 * dq[:, 3] - 0.5 * dq[:, 4]
    torque = coupled.torque(q, dq, ddq)[:, :, -3:]
    np.testing.assert_allclose(torque[:, 5, 2], np.sign(speed))
    np.testing.assert_allclose(torque[:, 4, 2], -0.5 * np.sign(speed))
    np.testing.assert_allclose(torque[:, 3, 2], -0.25 * np.sign(speed))
    np.testing.assert_allclose(torque[:, 3, 0], -0.25 * (ddq[:, 5] - 0.5 * ddq[:, 4]), atol=1e-15)
    np.testing.assert_allclose(torque[:, 5, 1], -0.25 * dq[:, 3] - 0.5 * dq[:, 4], atol=1e-15)
    assert not torque[:, :3].any()


def test_a_diagonal_transmission_adds_nothing() -> None:
    robot = load_robot("rx90")
    geared = replace(robot, transmission=Transmission(tuple(map(tuple, np.diag([30.0, -30, 45, 48, 45, 32]).tolist()))))
    assert Regressor(geared).names == Regressor(robot).names
