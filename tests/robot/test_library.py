"""Robots by name and by file: the shipped numbers, and a helpful line for whatever is no robot."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from beside import shared

from identify.errors import RobotError
from identify.robot.library import built_in, load_robot, robot_digest
from identify.robot.robot import Drive, Link
from identify.robot.toml import write_toml

ARM = '<robot name="arm"><link name="a"/><link name="b"/>' + (
    '<joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint></robot>'
)


def test_built_in_robots_carry_no_machine_path() -> None:
    assert built_in() == ("rx90", "tx40")
    for name in built_in():
        robot = load_robot(name)
        assert robot.source == f"built-in {name}"
        assert robot.note


def test_rx90_holds_the_public_facts() -> None:
    facts = json.loads(shared("facts", "rx90.json").read_text(encoding="utf-8"))
    robot = load_robot("rx90")
    assert robot.gravity == tuple(facts["gravity"])
    symbols = {f"{joint.name}.{key}": letter for joint in robot.joints for key, letter in joint.symbols}
    assert symbols == facts["symbols"]
    for joint, fact in zip(robot.joints, facts["joints"], strict=True):
        assert joint.name == fact["name"]
        assert (joint.d, joint.r) == (fact["d"], fact["r"])
        assert (joint.alpha, joint.theta) == (math.radians(fact["alpha_deg"]), math.radians(fact["theta_deg"]))
        assert joint.limits.position == tuple(map(math.radians, fact["position_limit_deg"]))
        assert joint.limits.velocity == math.radians(fact["velocity_limit_deg_s"])
        assert joint.limits.acceleration == fact["acceleration_limit_rad_s2"]
        assert joint.limits.effort == fact["effort_limit_Nm"]
        inertia = tuple(fact["inertia_about_com_xx_xy_xz_yy_yz_zz"])
        assert joint.link == Link(fact["mass_kg"], tuple(fact["com_m"]), inertia)
        assert joint.drive == Drive(fact["actuator_inertia"], fact["viscous"], fact["coulomb"])
    assert "not measured" in robot.note


def test_tx40_knows_its_coupled_wrist_and_invents_no_inertia() -> None:
    robot = load_robot("tx40")
    assert [(motor, tuple(map(float, ratios))) for motor, ratios in robot.couplings] == [(5, (0, 0, 0, 0, 1, 1))]
    assert not np.any(robot.standard)
    assert "not known" in robot.note


def test_tx40_limits_hold_the_logged_motion() -> None:
    robot = load_robot("tx40")
    motor = np.loadtxt(shared("data", "tx40", "motor_position.csv"), delimiter=",", skiprows=1)[::50]
    assert robot.transmission is not None
    zero = np.array([0, -math.pi / 2, math.pi / 2, 0, 0, 0])
    position = np.linalg.solve(robot.transmission.array, motor.T).T + zero
    low, high = np.array([joint.limits.position for joint in robot.joints]).T
    assert np.all(position > low)
    assert np.all(position < high)


def test_a_file_by_path_or_text(tmp_path: Path) -> None:
    robot = load_robot("rx90")
    path = tmp_path / "mine.toml"
    path.write_text(write_toml(robot), encoding="utf-8")
    assert load_robot(path) == load_robot(str(path)) == replace(robot, source=str(path))


def test_xml_is_read_as_urdf(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM, encoding="utf-8")
    assert load_robot(path).joint_names == ("j",)


def test_a_built_in_name_wins_over_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "rx90").mkdir()
    monkeypatch.chdir(tmp_path)
    assert load_robot("rx90").source == "built-in rx90"


def refusal(name_or_path: str | Path) -> str:
    with pytest.raises(RobotError) as caught:
        load_robot(name_or_path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_unknown_names_list_the_known(tmp_path: Path) -> None:
    said = refusal("rx9")
    assert said.startswith("unknown robot 'rx9': did you mean 'rx90'?")
    assert "built-in robots: rx90, tx40" in said
    assert "built-in robots: rx90, tx40" in refusal("puma")
    assert refusal("folder/puma").startswith("unknown robot 'folder/puma': no such file")


def test_unusable_files(tmp_path: Path) -> None:
    (tmp_path / "arm.txt").write_text("name = 'arm'")
    (tmp_path / "empty.toml").write_text("")
    (tmp_path / "empty.urdf").write_text("")
    (tmp_path / "scene.xml").write_text("<mujoco model='arm'><worldbody/></mujoco>")
    (tmp_path / "page.xml").write_text("<html/>")
    expected = {
        "missing.toml": "no such file; give a robot file, or a built-in robot: rx90, tx40",
        "missing.urdf": "no such file",
        "arm.txt": "can't tell the format; a robot file ends in .toml, .urdf or .xml",
        "empty.toml": "the robot has no name",
        "empty.urdf": "not valid XML: no element found",
        "scene.xml": "no moving joint",
        "page.xml": "not a URDF: expected the element <robot> at the top, found <html>",
    }
    for name, message in expected.items():
        assert re.match(re.escape(f"{tmp_path / name}: ") + ".*" + re.escape(message), refusal(tmp_path / name))
    assert refusal(tmp_path).startswith(f"{tmp_path}: is a folder")
    assert refusal("").startswith("no robot given")
    assert refusal("x" * 5000 + ".toml").endswith("built-in robot: rx90, tx40")


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text("\ufeff" + write_toml(load_robot("rx90")), encoding="utf-8")
    (tmp_path / "arm.urdf").write_text("\ufeff" + ARM, encoding="utf-8")
    assert load_robot(tmp_path / "arm.toml").joints == load_robot("rx90").joints
    assert load_robot(tmp_path / "arm.urdf").joint_names == ("j",)


def test_digest_tells_robots_apart_and_ignores_where_they_came_from() -> None:
    robot = load_robot("rx90")
    assert re.fullmatch("[0-9a-f]{64}", robot_digest(robot))
    assert robot_digest(replace(robot, source="elsewhere")) == robot_digest(robot)
    longer = (*robot.joints[:2], replace(robot.joints[2], d=0.4500000000000001), *robot.joints[3:])
    assert robot_digest(replace(robot, joints=longer)) != robot_digest(robot)
