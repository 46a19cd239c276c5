"""A robot written in another format stays the robot: same regressor and inverse dynamics, and what is lost is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_mjcf_reading import random_mjcf
from test_mjcf_reading import reference as by_mujoco
from test_urdf import random_urdf
from test_urdf import reference as by_pinocchio

from identify.errors import InputError, RobotError
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.robot import Robot
from identify.robot.writing import not_carried, written
from identify.workflow import export

AGREE = 1e-12


def states(robot: Robot, count: int = 8) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    q, dq, ddq = np.random.default_rng(7).uniform(-1.5, 1.5, (3, count, robot.n))
    return q, dq, ddq


def plain_parameters(regressor: Regressor) -> np.ndarray:
    """Those of the description without friction, which the engines are not asked for."""
    return np.where(np.arange(regressor.p) < len(regressor.base.names), regressor.parameters, 0.0)


@pytest.mark.parametrize(("seed", "tree"), [(1, False), (2, False), (3, True), (4, True), (8, True)])
def test_urdf_to_toml_and_back_is_the_same_robot(seed: int, tree: bool, tmp_path: Path) -> None:
    """Chains and trees with fixed joints and slides, any axis: against Pinocchio's reading of the URDF itself."""
    text = random_urdf(np.random.default_rng(seed), 7, special=False, tree=tree)
    source, target = tmp_path / "arm.urdf", tmp_path / "arm.toml"
    source.write_text(text)
    assert export(source, "toml", target) == ()
    was, now = load_robot(source), load_robot(target)
    assert now == replace(was, source=str(target))
    q, dq, ddq = states(was)
    before, after = Regressor(was), Regressor(now)
    assert after.names == before.names
    np.testing.assert_array_equal(after.torque(q, dq, ddq), before.torque(q, dq, ddq))
    found = after.inverse_dynamics(q, dq, ddq, plain_parameters(after))
    expected = np.array([by_pinocchio(text, now, *state)[0] for state in zip(q, dq, ddq, strict=True)])
    assert np.abs(found - expected).max() <= AGREE * np.abs(expected).max()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_mjcf_to_toml_is_the_same_robot(seed: int, tmp_path: Path) -> None:
    text = random_mjcf(np.random.default_rng(seed), 5)
    source, target = tmp_path / "arm.xml", tmp_path / "arm.toml"
    source.write_text(text)
    export(source, "toml", target)
    now = load_robot(target)
    regressor = Regressor(now)
    q, dq, ddq = states(now)
    found = regressor.inverse_dynamics(q, dq, ddq, plain_parameters(regressor))
    expected = np.array([by_mujoco(text, now, *state) for state in zip(q, dq, ddq, strict=True)])
    assert np.abs(found - expected).max() <= 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize(("form", "ending"), [("urdf", "urdf"), ("mjcf", "xml"), ("toml", "toml")])
def test_a_part_of_an_arm_on_a_wall_is_written_as_such(form: str, ending: str, tmp_path: Path) -> None:
    target = tmp_path / f"arm.{ending}"
    joints, gravity = "joint_2,joint_3,joint_5", (-9.81, 0.0, 0.0)
    export("rx90", form, target, joints=joints, gravity=gravity)
    was, now = load_robot("rx90", joints, gravity), load_robot(target)
    assert now.joint_names == was.joint_names == ("joint_2", "joint_3", "joint_5")
    q, dq, ddq = states(was)
    torque = [Regressor(robot).inverse_dynamics(q, dq, ddq, Regressor(robot).parameters) for robot in (was, now)]
    np.testing.assert_allclose(torque[1], torque[0], rtol=0, atol=1e-10 * np.abs(torque[0]).max())


def test_what_a_format_has_no_place_for_is_said_and_stands_in_the_file() -> None:
    robot = load_robot("tx40")
    assert not_carried(robot, "toml") == ()
    lost = not_carried(robot, "urdf")
    assert any("transmission from motors" in line for line in lost)
    text = written(robot, "urdf", lost)
    assert all(f"Not carried: {line}." in text for line in lost)
    guarded = replace(load_robot("rx90"), floor=-0.4)
    assert [line for line in not_carried(guarded, "mjcf") if line.startswith("floor")]
    with pytest.raises(InputError, match="choose one of toml, urdf, mjcf"):
        written(robot, "sdf", ())
    with pytest.raises(RobotError, match="joint_1"):
        written(robot, "mjcf", ())
