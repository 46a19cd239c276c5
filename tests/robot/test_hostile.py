"""Robot files that are damaged, absurd or meant to harm: a robot or one line, quickly, and nothing left behind."""

from __future__ import annotations

import math
import os
import time
from pathlib import Path

import numpy as np
import pytest
from mutations import mutated, robot_files

from identify.errors import RobotError
from identify.robot.files import LARGEST_FILE
from identify.robot.library import load_robot
from identify.robot.toml import read_toml
from identify.robot.urdf import read_urdf

SECONDS = 10.0


def one_line(path: Path) -> str:
    """What a file is refused with."""
    start = time.process_time()
    with pytest.raises(RobotError) as caught:
        load_robot(path)
    assert time.process_time() - start < SECONDS
    told = str(caught.value)
    assert "\n" not in told
    assert len(told) < 1000
    return told.removeprefix(f"{path}: ")


def test_damaged_files_give_a_robot_or_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    files, outcomes, told = robot_files(), {"read": 0, "refused": 0}, ""
    for k in range(700):
        name, text = files[k % len(files)]
        Path(name).write_bytes(mutated(np.random.default_rng(k), text).encode("utf-8", "surrogatepass"))
        try:
            robot = load_robot(name)
        except RobotError as error:
            told = str(error)
            outcomes["refused"] += 1
        else:
            assert robot.n > 0
            assert np.isfinite(robot.standard).all()
            outcomes["read"] += 1
        assert "\n" not in told
        assert len(told) < 1000
    # Neither outcome may be what hides the other.
    assert min(outcomes.values()) > 100
    assert set(os.listdir()) <= {name for name, _ in files}


def links(count: int, kind: str) -> str:
    """A URDF chain of `count` joints of a type."""
    parts = [
        f'<link name="l{k}"/><joint name="j{k}" type="{kind}"><parent link="l{k - 1}"/><child link="l{k}"/></joint>'
        for k in range(1, count + 1)
    ]
    return f'<robot name="long"><link name="l0"/>{"".join(parts)}</robot>'


REPLICA = '<replicate count="1000"><body><joint/><geom size="1"/></body></replicate>'
HUGE = {
    "deep.urdf": ("<a>" * 100_000, "elements lie more than 200 deep"),
    "many.urdf": (links(60_000, "revolute"), "more than 200,000 elements"),
    "laughs.urdf": ('<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]><robot name="&b;"/>', "DOCTYPE or ENTITY"),
    "outside.urdf": ('<!DOCTYPE r SYSTEM "file:///etc/passwd"><robot name="a"/>', "DOCTYPE or ENTITY"),
    "name.urdf": (links(1, "revolute").replace("j1", "j" * 10_000), "longer than 200 characters: 'jjjj"),
    "length.urdf": (
        links(1, "revolute").replace("</joint>", '<origin xyz="1e200 0 0"/></joint>'),
        "origin: xyz: expected a number up to 1e+10, found 1e+200",
    ),
    "copies.xml": (
        f"<mujoco><worldbody>{REPLICA.replace('<body>', '<body>' + REPLICA)}</worldbody></mujoco>",
        "more than 10,000 bodies, joints and shapes",
    ),
    "memory.xml": (
        '<mujoco><size memory="100T"/><custom><numeric name="n" size="2000000000"/></custom><worldbody/></mujoco>',
        "no moving joint",
    ),
    "deep.toml": ("name = " + "[" * 100_000, "brackets nested too deeply"),
    "dots.toml": ("name." + "a." * 20_000 + "b = 1", "a key of more than 100 parts"),
    "digits.toml": ('name = "a"\n[[joint]]\nname = "j"\nd = 0x' + "f" * 6000, "found a int out of all proportion"),
    "name.toml": ('name = "' + "a" * 10_000 + '"\n[[joint]]\nname = "j"', "name: longer than 200 characters: 'aaaa"),
}


@pytest.mark.parametrize("name", HUGE)
def test_files_out_of_all_proportion_are_refused(name: str, tmp_path: Path) -> None:
    text, message = HUGE[name]
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert message in one_line(tmp_path / name)


def test_large_files_and_what_is_no_file(tmp_path: Path) -> None:
    large = tmp_path / "large.toml"
    with large.open("wb") as stream:
        stream.truncate(LARGEST_FILE + 1)
    assert one_line(large).startswith("larger than 50 MB")
    (tmp_path / "zeros.urdf").symlink_to("/dev/zero")
    assert "is no file that can be read twice" in one_line(tmp_path / "zeros.urdf")


def test_long_chains_are_read_in_time_that_grows_with_them() -> None:
    times = []
    for count in (500, 2000):
        start = time.process_time()
        assert read_urdf(links(count, "revolute")).n == count
        times.append(time.process_time() - start)
    assert times[1] < 10 * times[0] + 0.5
    assert read_toml('name = "long"\n' + "".join(f'[[joint]]\nname = "j{k}"\n' for k in range(2000))).n == 2000


def test_macros_in_comments_and_plugins_do_no_harm() -> None:
    text = links(2, "continuous").replace("</robot>", "<!-- ${x} --><gazebo><plugin>${y}</plugin></gazebo></robot>")
    assert read_urdf(text).n == 2
    assert read_urdf(text.replace("<robot", '<robot xmlns:xacro="http://wiki.ros.org/xacro"')).n == 2


def test_limits_without_bound_stay_limits() -> None:
    text = links(1, "revolute").replace("</joint>", '<limit lower="-1e16" upper="1e16" effort="1e20"/></joint>')
    limits = read_urdf(text).joints[0].limits
    assert (limits.position, limits.effort) == ((-1e16, 1e16), 1e20)
    assert limits.velocity == math.inf
