"""`identify model ROBOT --what inverse-geometry --pose POSE`: the solutions for one pose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identify.robot.library import load_robot
from identify.symbolic.geometry import direct_geometry

Q = np.array([0.3, -0.7, 1.1, 0.4, 0.8, 0.2])


def text_of(pose: np.ndarray, rows: int = 4, digits: int = 17) -> str:
    return " ".join(f"{x:.{digits}g}" for x in pose[:rows].ravel())


def solve(run, pose: str, *more: str):
    return run("model", "rx90", "--what", "inverse-geometry", f"--pose={pose}", *more)


@pytest.mark.parametrize("rows", [3, 4])
def test_every_solution_reaches_the_pose(run, tmp_path: Path, rows: int) -> None:
    robot = load_robot("rx90")
    pose = direct_geometry(robot, Q)[0]
    table = solve(run, text_of(pose, rows), "--format", "json").json
    assert table["method"] == "Paul"
    assert len(table["solutions"]) == 8
    found = np.array([s["q"] for s in table["solutions"]])
    np.testing.assert_allclose(direct_geometry(robot, found), np.broadcast_to(pose, (8, 4, 4)), rtol=0, atol=1e-12)
    assert np.abs(found - Q).max(axis=1).min() < 1e-12
    np.testing.assert_allclose([s["degrees"] for s in table["solutions"]], found * 180 / np.pi, rtol=1e-14)
    for s, q in zip(table["solutions"], found, strict=True):
        bounds = [joint.limits.position for joint in robot.joints]
        out = [j.name for j, x, (a, b) in zip(robot.joints, q, bounds, strict=True) if not a <= x <= b]
        assert s["outside"] == out
        assert s["inside_limits"] == (not out)
        assert s["undetermined"] == []
    file = tmp_path / "pose.txt"
    file.write_text(str(pose[:rows].tolist()))
    assert solve(run, str(file), "--format", "json").json["solutions"] == table["solutions"]
    shown = solve(run, text_of(pose, rows))
    assert "8 solutions (Paul's method)" in shown.out
    assert shown.out.count(" rad ") == shown.out.count(" deg ") == shown.out.count("residual") == 8
    assert "0.300000" in shown.out
    assert "17.1887" in shown.out


def test_a_singular_pose_keeps_the_current_position_and_says_what_is_open(run) -> None:
    q = np.where(np.arange(6) == 4, 0.0, Q)
    pose = text_of(direct_geometry(load_robot("rx90"), q)[0])
    shown = solve(run, pose, "--current=0,0,0,0.9,0,0")
    assert "singular: joint_4, joint_6 undetermined" in shown.out
    table = solve(run, pose, "--current=0,0,0,0.9,0,0", "--format", "json").json
    first = table["solutions"][0]
    assert first["undetermined"] == ["joint_4", "joint_6"]
    np.testing.assert_allclose(first["q"], [0.3, -0.7, 1.1, 0.9, 0.0, -0.3], rtol=0, atol=1e-9)


def test_a_pose_of_few_digits_is_brought_to_a_rotation(run) -> None:
    pose = direct_geometry(load_robot("rx90"), Q)[0]
    shown = solve(run, text_of(pose, digits=5))
    assert "8 solutions" in shown.out
    assert "brought to the nearest orthonormal one" in shown.out


def test_out_of_reach_is_said(run) -> None:
    shown = solve(run, "1 0 0 9  0 1 0 0  0 0 1 0")
    assert shown.status == 0
    assert "0 solutions" in shown.out
    assert "out of reach" in shown.out
    assert solve(run, "1 0 0 9  0 1 0 0  0 0 1 0", "--format", "json").json["solutions"] == []


@pytest.mark.parametrize(
    ("pose", "more", "told"),
    [
        ("1 0 0", (), "--pose: 3 numbers; give 16 or 12 numbers, row by row"),
        ("nowhere.txt", (), "nowhere.txt: No such file"),
        (".", (), "--pose: '.' is no number"),
        ("1 0 0 0 0 1 0 0 0 0 -1 0", (), "is no rotation"),
        ("1 0 0 0 0 1 0 0 0 0 1 0 1 0 0 1", (), "the last row is not 0 0 0 1"),
        ("1 0 0 0 0 1 0 0 0 0 1 1e999", (), "not finite"),
        ("1 0 0 0 0 1 0 0 0 0 1 0", ("--current=1,2",), "--current: 2 numbers; give one position for each of the 6"),
        ("1 0 0 0 0 1 0 0 0 0 1 0", ("--current=1,x,2,3,4,5",), "--current: 'x' is no number"),
        ("1 0 0 0 0 1 0 0 0 0 1 0", ("--format", "c"), "choose text or json"),
    ],
)
def test_what_is_no_pose_is_told_in_one_line(run, pose: str, more: tuple[str, ...], told: str) -> None:
    shown = solve(run, pose, *more)
    assert (shown.status, shown.out, shown.err.count("\n")) == (2, "", 1)
    assert told in shown.err


def test_pose_and_current_belong_to_inverse_geometry(run) -> None:
    other = run("model", "rx90", "--what", "jacobian", "--pose", "x")
    alone = run("model", "rx90", "--what", "inverse-geometry", "--current=1,2,3,4,5,6")
    assert (other.status, alone.status) == (2, 2)
    assert "jacobian takes no pose" in other.err
    assert "add --pose" in alone.err
