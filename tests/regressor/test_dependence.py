"""Transmission columns that say nothing new are left out, and everywhere alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import oracle
import pytest
from chains import random_chain, random_link
from symbolic_models import Motion, states, tilted

from identify.regressor.columns import JointColumns
from identify.regressor.dependence import dependent_columns
from identify.regressor.regressor import Regressor
from identify.robot.robot import Drive, Joint, Robot, Transmission
from identify.symbolic.expression import Graph, evaluate


def with_motors(robot: Robot, rows: list[list[float]]) -> Robot:
    return replace(robot, transmission=Transmission(tuple(map(tuple, rows))))


def planar_arm(gravity: tuple[float, float, float], tilt: float = 0.0) -> Robot:
    """Two links in a plane, both motors on the base: motor 2 drives link 2 by a belt over joint 1."""
    rng = np.random.default_rng(11)
    joints = (
        Joint("shoulder", link=random_link(rng), drive=Drive(0.3, 1.0, 0.5, 0.1)),
        Joint("elbow", parent=0, alpha=tilt, d=0.4, link=random_link(rng), drive=Drive(0.2, 0.7, 0.4, -0.2)),
    )
    return with_motors(Robot("planar", joints, gravity), [[50.0, 0.0], [40.0, 40.0]])


def full_column(robot: Robot, name: str, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(N, n) the column of that name as it is before anything is left out."""
    columns, graph = JointColumns.of(robot), Graph()
    out = np.zeros((len(dq), robot.n))
    for (i, at), entry in columns.entries(graph).items():
        if columns.names[at] == name:
            signals = {"dq": dq, "ddq": ddq, "sign": np.sign(columns.speeds(dq))}
            for k in range(len(dq)):
                values = {f"{p}{j + 1}": x for p, signal in signals.items() for j, x in enumerate(signal[k])}
                (out[k, i],) = evaluate([entry], values)
    return out


def rank(samples: np.ndarray) -> int:
    singular = np.linalg.svd(samples / np.linalg.norm(samples, axis=0), compute_uv=False)
    return int((singular > 1e-10 * singular[0]).sum())


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), (0.0, -9.81, 0.0)], ids=["level", "upright"])
def test_parallel_axes_hide_a_motors_inertia(gravity: tuple[float, float, float]) -> None:
    """½·Iam·(q̇1 + q̇2)² is what ZZ2 does, less the shares of Ia1 (in ZZR1) and Ia2: q̇1·q̇2 = ZZ2 − ZZ1 − Ia2."""
    robot = planar_arm(gravity)
    regressor = Regressor(robot)
    assert regressor.names == (*regressor.base.names, "Fv1", "Fs1", "off1", "Fv2", "Fs2", "off2", "Fvm2", "Fsm2")
    assert len(regressor.units) == regressor.p == len(regressor.names)
    assert regressor.units[-2:] == ("N·m·s/rad", "N·m")
    assert regressor.dropped.keys() == {"Iam2"}
    factors = regressor.dropped["Iam2"]
    assert factors.keys() == {"ZZR1", "ZZ2", "Ia2"}
    assert [factors[k] for k in ("ZZR1", "ZZ2", "Ia2")] == pytest.approx([-1, 1, -1], abs=1e-12)
    q, dq, ddq = states(np.random.default_rng(0), robot, 40)
    torque = regressor.torque(q, dq, ddq)
    assert rank(torque.reshape(-1, regressor.p)) == regressor.p
    at = {name: k for k, name in enumerate(regressor.names)}
    combined = sum(factor * torque[:, :, at[name]] for name, factor in factors.items())
    np.testing.assert_allclose(combined, full_column(robot, "Iam2", dq, ddq), rtol=0, atol=1e-12)
    np.testing.assert_allclose(combined, ddq[:, ::-1], rtol=0, atol=1e-12)


def test_every_method_leaves_out_the_same() -> None:
    robot = planar_arm((0.0, -9.81, 0.0))
    regressor = Regressor(robot)
    rng = np.random.default_rng(1)
    q, dq, ddq = states(rng, robot, 30)
    at = {name: k for k, name in enumerate(regressor.names)}
    torque = regressor.torque(q, dq, ddq)
    for name in ("Fvm2", "Fsm2"):
        np.testing.assert_array_equal(torque[:, :, at[name]], full_column(robot, name, dq, ddq))
    theta = rng.normal(size=regressor.p)
    np.testing.assert_allclose(regressor.inverse_dynamics(q, dq, ddq, theta), torque @ theta, rtol=0, atol=1e-11)
    np.testing.assert_allclose(regressor.slotine_li(q, dq, dq, ddq), torque, rtol=0, atol=1e-12)
    assert not regressor.energy(q, dq)[:, len(regressor.base.names) :].any()
    motion = Motion(rng, 2, monotonic=True)
    q, dq, ddq = motion.at(motion.nodes)
    work = motion.weights @ np.einsum("kn,knp->kp", dq, regressor.torque(q, dq, ddq))
    start, end = regressor.energy(*motion.at(np.array([0.0, 1.0]))[:2])
    np.testing.assert_allclose(work, end - start + motion.weights @ regressor.power(dq), rtol=1e-10, atol=1e-10)


def test_the_factors_carry_the_motors_inertia_into_the_kept_columns() -> None:
    """An arm with a motor of inertia Iam: θ of the kept columns is theirs plus factor × Iam."""
    robot, iam = planar_arm((0.0, -9.81, 0.0)), 0.37
    regressor = Regressor(robot)
    at = {name: k for k, name in enumerate(regressor.names)}
    theta = np.zeros(regressor.p)
    theta[: len(regressor.base.names)] = regressor.base.matrix @ robot.standard
    q, dq, ddq = states(np.random.default_rng(2), robot, 20)
    without = regressor.inverse_dynamics(q, dq, ddq, theta)
    for name, factor in regressor.dropped["Iam2"].items():
        theta[at[name]] += factor * iam
    found = regressor.inverse_dynamics(q, dq, ddq, theta)
    np.testing.assert_allclose(found - without, iam * ddq[:, ::-1], rtol=0, atol=1e-12)


def test_a_small_tilt_keeps_the_column() -> None:
    """On a turning base, axes 2 and 3 at 1e-4 rad make a new column of it, if a weak one; 1e-12 rad is parallel."""
    arm = planar_arm((0.0, 0.0, -9.81))
    shoulder = replace(arm.joints[0], parent=0, alpha=np.pi / 2)
    for tilt, dropped in ((1e-4, set()), (1e-12, {"Iam3"})):
        joints = (Joint("base"), shoulder, replace(arm.joints[1], parent=1, alpha=tilt))
        robot = with_motors(replace(arm, joints=joints), [[30, 0, 0], [0, 50, 0], [0, 40, 40]])
        assert Regressor(robot).dropped.keys() == dropped


@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_gravity_on_a_vertical_slide_hides_its_offset(tilt: float) -> None:
    """A mass on a vertical slide weighs the same everywhere: M·(q̈ + g) less Ia·q̈, and less what M at the distance d
    adds to ZZ of the column that carries it, is a constant force, an offset. On a leaning slide M does more."""
    rng = np.random.default_rng(6)
    joints = (
        Joint("column", link=random_link(rng), drive=Drive(0.3, 1.0, 0.5, 0.1)),
        Joint("slide", "prismatic", 0, alpha=tilt, d=0.3, link=random_link(rng), drive=Drive(2.0, 7.0, 4.0, -3.0)),
        Joint("hand", parent=1, alpha=0.9, link=random_link(rng), drive=Drive(0.1, 0.5, 0.2, 0.3)),
    )
    robot = Robot("column and slide", joints)
    regressor = Regressor(robot)
    q, dq, ddq = states(rng, robot, 40)
    torque = regressor.torque(q, dq, ddq)
    assert rank(torque.reshape(-1, regressor.p)) == regressor.p
    if tilt:
        assert regressor.dropped == {}
    else:
        factors = {"MR2": 1 / 9.81, "Ia2": -1 / 9.81, "ZZR1": -(0.3**2) / 9.81}
        assert regressor.dropped == {"off2": pytest.approx(factors, rel=1e-9)}
        assert "off2" not in regressor.names
    effort = oracle.inverse_dynamics(robot, q, dq, ddq)
    for j, joint in enumerate(joints):
        effort[:, j] += joint.drive.viscous * dq[:, j] + joint.drive.coulomb * np.sign(dq[:, j]) + joint.drive.offset
    found = regressor.inverse_dynamics(q, dq, ddq, regressor.parameters)
    np.testing.assert_allclose(found, effort, rtol=0, atol=1e-11 * np.abs(effort).max())


def test_a_differential_has_one_inertia_and_one_viscous_column() -> None:
    """Motors at q̇2 + q̇3 and q̇3 − q̇2: their cross terms differ in sign alone, their Coulomb frictions do not."""
    chain = tilted(random_chain(np.random.default_rng(4), 3))
    chain = replace(chain, joints=tuple(replace(joint, type="revolute") for joint in chain.joints))
    regressor = Regressor(with_motors(chain, [[30, 0, 0], [0, 20, 20], [0, -20, 20]]))
    assert regressor.names[-4:] == ("Iam2", "Fvm2", "Fsm2", "Fsm3")
    assert regressor.dropped.keys() == {"Iam3", "Fvm3"}
    for name, partner in (("Iam3", "Iam2"), ("Fvm3", "Fvm2")):
        assert regressor.dropped[name] == pytest.approx({partner: -1.0}, abs=1e-12)


def test_without_friction_nothing_is_there_to_leave_out() -> None:
    regressor = Regressor(planar_arm((0.0, -9.81, 0.0)), friction=False)
    assert regressor.dropped == {}
    assert regressor.names == regressor.base.names


def random_transmission(seed: int) -> tuple[np.random.Generator, Robot]:
    """A random chain, parallel axes and vertical slides among them, whose last motor is coupled to the first joint."""
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, 2 + seed % 4, special=seed % 3 != 0, tree=seed % 5 == 4)
    matrix = np.diag(rng.uniform(10, 50, robot.n)) + np.tril(rng.choice([0, 20.0], (robot.n, robot.n)), -1)
    matrix[-1, 0] = 15.0
    return rng, with_motors(robot, matrix.tolist())


@pytest.mark.parametrize("seed", range(20))
def test_no_column_is_a_combination_of_others(seed: int) -> None:
    """Full rank, and what is missing is spanned by what is there."""
    rng, robot = random_transmission(seed)
    regressor = Regressor(robot)
    everything = JointColumns.of(robot)
    assert {*regressor.names} | {*regressor.dropped} == {*regressor.base.names, *everything.names}
    assert not {*regressor.names} & {*regressor.dropped}
    q, dq, ddq = states(rng, robot, 80)
    torque = regressor.torque(q, dq, ddq)
    assert rank(torque.reshape(-1, regressor.p)) == regressor.p
    at = {name: k for k, name in enumerate(regressor.names)}
    for name, factors in regressor.dropped.items():
        combined = sum((f * torque[:, :, at[kept]] for kept, f in factors.items()), np.zeros(()))
        np.testing.assert_allclose(combined, full_column(robot, name, dq, ddq), rtol=0, atol=1e-9)


def test_the_random_transmissions_lose_columns_of_every_kind_that_can_be_lost() -> None:
    lost = [Regressor(random_transmission(seed)[1]).dropped for seed in range(20)]
    assert {name[:3] for dropped in lost for name in dropped} >= {"Iam", "off"}
    assert [] in [list(dropped) for dropped in lost]


def test_dependence_is_of_all_columns_before_and_blind_to_units() -> None:
    rng = np.random.default_rng(3)
    a, b, c = rng.normal(size=(3, 50))
    samples = np.array([a, 1e6 * b, 1e-3 * c, 2 * a + 3e-7 * b, a + 1e-7 * c, 5e-3 * c - a]).T
    names = ["a", "b", "c?", "ab?", "ac?", "ca?"]
    found = dependent_columns(samples, names, [name for name in names if name.endswith("?")])
    assert found.keys() == {"ab?", "ac?", "ca?"}
    assert found["ab?"] == pytest.approx({"a": 2.0, "b": 3e-13}, rel=1e-6)
    assert found["ca?"] == pytest.approx({"a": -1.0, "c?": 5.0})
    noisy = samples.copy()
    noisy[:, 3] += 1e-7 * rng.normal(size=50)
    assert dependent_columns(noisy, names, ["ab?"]) == {}
