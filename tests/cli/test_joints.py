"""`--joints` and `--gravity`: an arm fitted without its gripper, from a log that has the gripper too."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from conftest import SLIDE, table

from identify.estimation.identification import Identification

GRIPPER = SLIDE.replace("slide", "gripper")


def test_an_arm_is_fitted_without_its_gripper(run, arm, result) -> None:
    Path("whole.toml").write_text(arm.robot.read_text(encoding="utf-8") + GRIPPER, encoding="utf-8")
    for name, log in (("train.mcap", arm.log), ("test.mcap", arm.unseen)):
        finger = np.full((log.samples, 1), 0.03)
        columns = {key: np.hstack([finger, getattr(log, key)[:, ::-1]]) for key in ("position", "velocity", "effort")}
        replace(log, joints=("gripper", "elbow", "shoulder"), **columns).save(name)
    told = run("fit", "train.mcap", "--robot", "whole.toml", "--joints", "shoulder,elbow", "-o", "part")
    assert told.status == 0
    part, alone = Identification.load("part"), Identification.load(result)
    # The log came from the arm alone: with the gripper held it is the same problem.
    assert part.names == alone.names
    np.testing.assert_allclose(part.parameters, alone.parameters, rtol=1e-9, atol=1e-9)
    assert part.robot.joint_names == ("shoulder", "elbow")
    record = json.loads(Path("part/parameters.json").read_text(encoding="utf-8"))
    assert "'gripper' at 0" in record["robot"]["note"]
    assert run("predict", "part", "test.mcap", "-o", "torque.csv").status == 0
    header, rows = table(Path("torque.csv"))
    assert header == ["t", "tau1", "tau2"]
    np.testing.assert_allclose(rows[:, 1:], alone.predict(arm.unseen), rtol=0, atol=1e-6)


def test_every_command_that_takes_a_robot_takes_a_part_of_it(run) -> None:
    assert run("check", "rx90", "--joints", "joint_1,joint_2", "--json").json["joints"] == ["joint_1", "joint_2"]
    assert "ZZR1" in run("model", "rx90", "--what", "base-parameters", "--joints", "joint_1").out
    assert run("codegen", "rx90", "--joints", "joint_2,joint_3", "--language", "python", "-o", "code").status == 0
    wall = run("check", "rx90", "--gravity=0,-9.81,0", "--json").json
    assert (wall["base_parameters"], wall["agree"]) == (42, True)
    told = run("check", "rx90", "--gravity", "1,2")
    assert (told.status, told.out) == (2, "")
    assert "'1,2' is not three numbers with commas between" in told.err
    told = run("check", "rx90", "--joints", "joint_7")
    assert told.err.count("\n") == 1
    assert "no joint 'joint_7'; did you mean" in told.err
