"""Joints that a pose leaves open: where two axes fall into one, and not at the edge of the workspace."""

from __future__ import annotations

import numpy as np
from arms import PUMA, SCARA, STANFORD
from chains import random_chain

from identify.robot.library import load_robot
from identify.symbolic.jacobian import jacobian
from identify.symbolic.undetermined import undetermined


def test_axes_in_line_are_open_a_stretched_arm_is_not() -> None:
    robot = load_robot("rx90")
    regular = [0.3, -0.7, 1.1, 0.4, 0.8, 0.2]
    wrist = [0.3, -0.7, 1.1, 0.4, 0.0, 0.2]
    elbow = [0.3, -0.7, -np.pi / 2, 0.4, 0.8, 0.2]
    both = [0.3, -0.7, -np.pi / 2, 0.4, 0.0, 0.2]
    found = undetermined(robot, np.array([regular, wrist, elbow, both]))
    four_and_six = [False, False, False, True, False, True]
    np.testing.assert_array_equal(found, [[False] * 6, four_and_six, [False] * 6, four_and_six])


def test_a_wrist_centre_on_the_first_axis_leaves_the_shoulder_open() -> None:
    """RX-90: D3 cos q2 = RL4 sin(q2 + q3) puts the centre of the wrist on z1; joint 1 and the wrist turn together."""
    robot = load_robot("rx90")
    # sin(q2 + q3) = cos q2 with the arm not folded.
    q = np.array([0.3, -0.7, np.pi / 2 + 1.4, 0.4, 0.8, 0.2])
    np.testing.assert_array_equal(undetermined(robot, q)[0], [True, False, False, True, True, True])


def test_ordinary_positions_leave_nothing_open() -> None:
    rng = np.random.default_rng(4)
    for robot in (PUMA, STANFORD, SCARA, random_chain(rng, 6)):
        assert not undetermined(robot, rng.uniform(0.4, 1.2, (10, robot.n))).any(), robot.name


def test_a_redundant_arm_is_open_where_its_null_space_is() -> None:
    robot, q = random_chain(np.random.default_rng(5), 7), np.linspace(0.2, 1.1, 7)
    (null,) = np.linalg.svd(jacobian(robot, q)[0])[2][6:]
    found = undetermined(robot, q)[0]
    assert found.any()
    np.testing.assert_array_equal(found, np.abs(null) > 1e-9)
