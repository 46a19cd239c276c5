"""A load in numbers or in a file: read as it is meant, carried as a body of the last link, refused in one line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chains import random_chain, random_link
from oracle import inverse_dynamics, pinocchio_model

from identify.errors import RobotError
from identify.robot.payload import carrying, read_payload
from identify.robot.robot import Link

LOAD = """
mass = 5.0
com = [0.02, -0.03, 0.11]
inertia = [0.05, 0.002, -0.003, 0.04, 0.001, 0.03]
"""


def test_numbers_are_a_point_mass_and_a_file_a_body(tmp_path: Path) -> None:
    assert read_payload("5") == Link(5.0)
    assert read_payload("2.5,0.02,-0.03,0.1") == Link(2.5, (0.02, -0.03, 0.1))
    path = tmp_path / "load.toml"
    path.write_text(LOAD, encoding="utf-8")
    assert read_payload(path) == Link(5.0, (0.02, -0.03, 0.11), (0.05, 0.002, -0.003, 0.04, 0.001, 0.03))
    path.write_text("mass = 2", encoding="utf-8")
    assert read_payload(str(path)) == Link(2.0)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("heavy", "payload 'heavy': can't be read; give MASS"),
        ("5,0.1", "can't be read"),
        ("0", "mass: expected more than 0"),
        ("nan", "expected a finite number"),
        ("5,inf,0,0", "expected a finite number"),
        ("none.toml", "none.toml: no such file"),
    ],
)
def test_what_is_no_load_is_refused(text: str, told: str) -> None:
    with pytest.raises(RobotError, match=told) as refused:
        read_payload(text)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("mass = ", "not valid TOML"),
        ("com = [0, 0, 0]", "the load has no mass"),
        ("mass = 1\nmas = 2", "unknown key 'mas'"),
        ("mass = -1", "mass: expected more than 0"),
        ("mass = 1\ncom = [0, 0]", "com: expected 3 numbers"),
        ("mass = 1\ninertia = [1, 0, 0, 1, 0, 3]", "the largest exceeds the sum of the others"),
    ],
)
def test_a_file_that_describes_no_body_is_refused(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "load.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RobotError, match=told) as refused:
        read_payload(path)
    assert "load.toml" in str(refused.value)


@pytest.mark.parametrize("tree", [False, True])
def test_an_arm_that_carries_moves_as_pinocchio_says_of_two_bodies(tree: bool) -> None:
    """Pinocchio appends the load to the last joint as a body of its own."""
    import pinocchio as pin

    rng = np.random.default_rng(12)
    robot, load = random_chain(rng, 5, tree=tree), random_link(rng)
    robot = replace(robot, gravity=(1.0, -2.0, -9.0))
    model = pinocchio_model(robot)
    xx, xy, xz, yy, yz, zz = load.inertia
    body = pin.Inertia(load.mass, np.array(load.com), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    model.appendBodyToJoint(model.getJointId(robot.joints[-1].name), body, pin.SE3.Identity())
    order = [robot.joint_names.index(name) for name in list(model.names)[1:]]
    q, dq, ddq = rng.uniform(-2, 2, (3, 6, 5))
    rows = zip(q[:, order], dq[:, order], ddq[:, order], strict=True)
    expected = np.array([pin.rnea(model, model.createData(), *row) for row in rows])
    found = inverse_dynamics(carrying(robot, load), q, dq, ddq)[:, order]
    assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
