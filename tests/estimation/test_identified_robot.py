"""From a result to a robot file and back: the same parameters, and the same torques in other engines."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from copy import deepcopy
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np
import oracle
import pinocchio
import pytest
from exact_logs import exact_log, fitted, fitted_with_dropped_column, friction, motion, unknown

from identify import workflow
from identify.errors import InputError, OutputError
from identify.estimation.identification import Identification
from identify.estimation.identified_robot import exported, identified_robot, with_standard
from identify.estimation.motion import low_pass
from identify.estimation.scoring import scored
from identify.experiment.plant import reference_effort
from identify.experiment.simulation import simulate
from identify.experiment.trajectory import Trajectory, random_trajectory
from identify.logs.log import Log
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.robot import Robot, Transmission
from identify.robot.toml import read_toml
from identify.robot.urdf import read_urdf
from identify.robot.urdf_writing import to_urdf
from identify.robot.writing import FORMATS

AGREE = 1e-10


@lru_cache(maxsize=1)
def rx90() -> Identification:
    """A fit of the simulated RX-90 at noise `standard`, 10 s of random motion, tested on another."""
    robot = load_robot("rx90")
    train, test = (simulate(robot, random_trajectory(robot, seed), "standard", seed)[0] for seed in (3, 4))
    return workflow.fit(train, robot, test=[test])


@lru_cache(maxsize=1)
def coupled() -> Identification:
    """A fit of an arm whose third motor turns with joints 2 and 3: Iam 0.2, Fvm 0.15 and Fsm 0.8."""
    plain = fitted().robot
    robot = replace(plain, transmission=Transmission(((10.0, 0, 0), (0, 12.0, 0), (0, 15.0, 15.0))))
    log, trajectory = exact_log(plain, noise=0.02), motion(plain)
    _, dq, ddq = trajectory.sample(log.time)
    added = np.zeros_like(dq)
    added[:, 1:] = 0.2 * ddq[:, :0:-1] + 0.15 * dq[:, :0:-1] + 0.8 * np.sign(dq[:, 1:].sum(axis=1, keepdims=True))
    assert log.effort is not None
    return workflow.fit(replace(log, effort=log.effort + added), robot)


def results() -> list[Identification]:
    return [fitted(), fitted_with_dropped_column(), rx90(), coupled()]


def parameters(result: Identification) -> np.ndarray:
    return np.array(result.record["physical"]["parameters"])


def rigid(robot: Robot) -> Robot:
    """Without what the oracle of rigid bodies leaves out."""
    return with_standard(robot, robot.standard, {})


def text_of(result: Identification, form: str) -> str:
    return exported(result, form)[0]


@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("form", ["toml", "mjcf", "urdf"])
def test_parameters_come_back_from_every_format(number: int, form: str, tmp_path: Path) -> None:
    """URDF and MJCF give frames of their own, so that the same robot in those frames is what must come back."""
    result = results()[number]
    if number == 3:
        told = " ".join(exported(result, form)[1])
        assert ("coupled motors" in told) == (form != "toml")
        if form != "toml":
            return
    path = tmp_path / f"robot{FORMATS[form][0]}"
    path.write_text(text_of(result, form), encoding="utf-8")
    again = load_robot(path)
    robot = identified_robot(result)
    assert again.joint_names == robot.joint_names
    q, dq, ddq = np.random.default_rng(number).uniform(-1.5, 1.5, (3, 30, robot.n))
    expected = Regressor(robot).inverse_dynamics(q, dq, ddq, parameters(result))
    regressor = Regressor(again)
    torque = regressor.inverse_dynamics(q, dq, ddq, regressor.parameters)
    np.testing.assert_allclose(torque, expected, rtol=0, atol=AGREE * np.abs(expected).max())
    same = [[getattr(joint, key) for key in ("alpha", "d", "theta", "r")] for joint in robot.joints]
    if np.allclose(same, [[getattr(j, key) for key in ("alpha", "d", "theta", "r")] for j in again.joints], atol=1e-12):
        np.testing.assert_allclose(
            regressor.parameters, parameters(result), rtol=0, atol=AGREE * np.abs(parameters(result)).max()
        )
    else:
        assert form != "toml"


@pytest.mark.parametrize("number", range(3))
def test_engines_move_the_exported_files_alike(number: int) -> None:
    """Inverse dynamics of each file as its own engine reads it against Pinocchio on the identified robot."""
    result = results()[number]
    robot = identified_robot(result)
    q, dq, ddq = np.random.default_rng(5).uniform(-1.5, 1.5, (3, 30, robot.n))
    expected = oracle.inverse_dynamics(robot, q, dq, ddq)
    bare = oracle.inverse_dynamics(rigid(robot), q, dq, ddq) - rigid_actuators(robot) * ddq
    scale = np.abs(expected).max()

    model = pinocchio.buildModelFromXML(text_of(result, "urdf"))
    data = model.createData()
    plain = np.array([pinocchio.rnea(model, data, *state) for state in zip(q, dq, ddq, strict=True)])
    np.testing.assert_allclose(plain, bare, rtol=0, atol=AGREE * scale)
    model.armature = rigid_actuators(robot)
    armed = np.array([pinocchio.rnea(model, model.createData(), *state) for state in zip(q, dq, ddq, strict=True)])
    np.testing.assert_allclose(armed, expected, rtol=0, atol=AGREE * scale)

    for form, wanted in (("mjcf", expected), ("urdf", bare)):
        theirs = mujoco.MjModel.from_xml_string(text_of(result, form))
        flags = mujoco.mjtDisableBit
        theirs.opt.disableflags |= flags.mjDSBL_LIMIT | flags.mjDSBL_CONTACT | flags.mjDSBL_FRICTIONLOSS
        np.testing.assert_allclose(theirs.dof_damping, [j.drive.viscous for j in robot.joints], rtol=1e-12)
        np.testing.assert_allclose(theirs.dof_frictionloss, [j.drive.coulomb for j in robot.joints], rtol=1e-12)
        theirs.dof_damping[:] = 0.0
        state = mujoco.MjData(theirs)
        for k in range(len(q)):
            state.qpos[:], state.qvel[:], state.qacc[:] = q[k], dq[k], ddq[k]
            mujoco.mj_inverse(theirs, state)
            np.testing.assert_allclose(state.qfrc_inverse, wanted[k], rtol=0, atol=AGREE * scale)


def rigid_actuators(robot: Robot) -> np.ndarray:
    return np.array([joint.drive.inertia for joint in robot.joints])


def test_the_exported_mjcf_resimulates_the_identified_model() -> None:
    """The file in MuJoCo's own loop, along a motion nobody fitted: its effort is what the fitted model predicts.

    Bar [issue 4]: 0.1 % while moving.
    """
    result = rx90()
    log = resimulated(text_of(result, "mjcf"), identified_robot(result), random_trajectory(result.robot, 9))
    figures = scored([log], [result.predict(log)], result.robot)
    assert figures["moving_relative_residual_percent"] < 0.1
    assert log.effort is not None
    assert np.abs(low_pass(log.effort, 10.0, log.rate_hz)).max() > 100.0
    half = Log(log.time, log.position, log.velocity, 0.5 * log.effort, log.joints)
    assert scored([half], [result.predict(log)], result.robot)["moving_relative_residual_percent"] > 50


def resimulated(mjcf: str, robot: Robot, trajectory: Trajectory) -> Log:
    """The 1 kHz log of the file's torque motors under position control with feed-forward, as it stands."""
    model = mujoco.MjModel.from_xml_string(mjcf)
    data = mujoco.MjData(model)
    step = model.opt.timestep
    time = np.arange(round(trajectory.duration / step)) * step
    q, dq, ddq = trajectory.sample(time)
    forward = reference_effort(robot, q, dq, ddq)
    stiffness = 400.0 * np.array([60.0, 60.0, 25.0, 4.0, 4.0, 1.0])
    damping = stiffness / 10
    positions, efforts = np.empty_like(q), np.empty_like(q)
    data.qpos[:] = q[0]
    for k in range(len(time)):
        data.ctrl[:] = forward[k] + stiffness * (q[k] - data.qpos) + damping * (dq[k] - data.qvel)
        positions[k], efforts[k] = data.qpos, data.ctrl
        mujoco.mj_step(model, data)
    return Log(time[::2], positions[::2], None, efforts[::2], robot.joint_names)


def test_coupled_motors_come_back_in_toml() -> None:
    robot = identified_robot(coupled())
    assert robot.transmission is not None
    motor = robot.transmission.motors[2]
    assert (motor.inertia, motor.viscous, motor.coulomb) == pytest.approx((0.2, 0.15, 0.8), rel=0.05)
    again = read_toml(text_of(coupled(), "toml"))
    assert again.transmission == robot.transmission
    assert dict(zip(Regressor(again).names, Regressor(again).parameters, strict=True))["Fvm3"] == motor.viscous


@pytest.mark.parametrize("seed", [1, 5])
def test_a_short_noisy_log_gets_possible_links_that_predict_better(seed: int) -> None:
    """Least squares on 4 s of noise makes an impossible robot; the nearest possible one is nearer to unseen motion."""
    robot = fitted().robot
    short = cut(exact_log(robot, seed=seed, noise=6.0), 4.0)
    result = workflow.fit(short, unknown(robot), test=[replace(exact_log(robot, 2), source="unseen.mcap")])
    physical = result.record["physical"]
    assert physical["consistent"] is True
    assert min(link["min_eigenvalue"] for link in physical["links"]) > 0
    assert physical["cost"]["chi_squared"] > 1
    assert physical["moved"]
    key = "moving_relative_residual_percent"
    assert physical["test"][0][key] < 0.7 * result.record["test"][0][key]
    assert physical["fit"][key] == pytest.approx(result.record["fit"][key], rel=0.02)


def cut(log: Log, seconds: float) -> Log:
    rows = log.time <= seconds
    assert log.effort is not None
    return replace(log, time=log.time[rows], position=log.position[rows], effort=log.effort[rows])


def test_a_robot_from_a_urdf_keeps_names_variables_and_tree() -> None:
    result = fitted()
    origin = read_urdf(to_urdf(unknown(result.robot)), source="arm.urdf")
    log = exact_log(result.robot, noise=0.02)
    again = workflow.fit(log, origin)
    back = read_urdf(text_of(again, "urdf"))
    assert back.joint_names == origin.joint_names
    assert [joint.parent for joint in back.joints] == [joint.parent for joint in origin.joints]
    for one, other in zip(back.joints, origin.joints, strict=True):
        for key in ("alpha", "d", "theta", "r", "gamma", "b"):
            assert getattr(one, key) == pytest.approx(getattr(other, key), abs=1e-9)
    motion = np.array([log.position[::100]] * 3)
    truth = oracle.inverse_dynamics(result.robot, *motion) + friction(result.robot, motion[1])
    regressor = Regressor(identified_robot(again))
    found = regressor.inverse_dynamics(*motion, regressor.parameters)
    np.testing.assert_allclose(found, truth, rtol=0, atol=0.01 * np.abs(truth).max())


def test_files_say_where_their_numbers_come_from_and_what_they_leave_out() -> None:
    result = fitted()
    digest = result.record["logs"][0]["sha256"]
    for form in FORMATS:
        text, lost = exported(result, form)
        assert digest in text
        assert "made.mcap" in text
        assert "not CAD values" in text
        for line in lost:
            assert line in text
        if form != "toml":
            ElementTree.fromstring(text)
    assert "actuator inertias" in exported(result, "urdf")[1][0]
    assert exported(result, "toml")[1] == ()


def test_names_that_no_comment_may_hold_do_not_break_the_file() -> None:
    result = deepcopy(fitted())
    result.record["logs"][0]["path"] = "a--b---.mcap\x07-"
    root = ElementTree.fromstring(text_of(result, "urdf"))
    assert root.tag == "robot"
    mujoco.MjModel.from_xml_string(text_of(result, "mjcf"))


def test_a_smooth_passage_through_rest_and_coupled_motors_are_told() -> None:
    plain = deepcopy(fitted())
    geared = Transmission(matrix=((30.0, 0.0, 0.0), (0.0, 40.0, 0.0), (0.0, 20.0, 25.0)))
    result = replace(plain, robot=replace(plain.robot, transmission=geared))
    result.record["settings"]["coulomb_velocity"] = 0.05
    result.record["physical"]["transmission"] = [{"name": "Iam3", "value": 0.0123}]
    told = " ".join(exported(result, "urdf")[1])
    assert "Iam3 = 0.0123" in told
    assert "up to 0.05 rad/s" in told


def test_a_result_without_possible_links_is_refused(tmp_path: Path) -> None:
    result = deepcopy(fitted())
    result.record["physical"], result.record["physical_reason"] = None, "the solver ended"
    with pytest.raises(InputError, match=r"the solver ended.*fit again"):
        exported(result, "toml")
    with pytest.raises(InputError, match="choose one of toml, urdf, mjcf"):
        exported(fitted(), "sdf")
    fitted().save(tmp_path / "result")
    workflow.export(tmp_path / "result", "toml", tmp_path / "arm.toml")
    with pytest.raises(OutputError, match="exists"):
        workflow.export(tmp_path / "result", "urdf", tmp_path / "arm.toml")
    workflow.export(tmp_path / "result", "urdf", tmp_path / "arm.toml", force=True)
    assert (tmp_path / "arm.toml").read_text(encoding="utf-8").startswith("<!--")
