"""Direct dynamics as printed: Pinocchio's articulated bodies, MuJoCo, stored values, and branches without fill-in."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import oracle
import pinocchio as pin
import pytest
import sympy
from arms import SCARA, rx90
from chains import random_chain
from printed_models import printed, stored_rx90
from symbolic_models import tilted

from identify.robot.mjcf import depth_first, to_mjcf
from identify.robot.robot import Robot
from identify.symbolic.direct_dynamics import solution, symbolic_direct_dynamics
from identify.symbolic.inverse_dynamics import symbolic_newton_euler
from identify.symbolic.models import symbolic_model


def some(seed: int) -> Robot:
    return tilted(random_chain(np.random.default_rng(seed), 3 + seed % 3, tree=seed % 2 == 1))


@pytest.mark.parametrize("robot", [rx90(), *(some(seed) for seed in range(4))], ids=lambda r: r.name)
def test_against_pinocchio(robot: Robot) -> None:
    rng = np.random.default_rng(1)
    q, dq, tau = rng.uniform(-1.5, 1.5, (3, robot.n)) * np.array([[1.0], [1.0], [30.0]])
    drives = [joint.drive for joint in robot.joints]
    friction = [d.viscous * v + d.coulomb * np.sign(v) + d.offset for d, v in zip(drives, dq, strict=True)]
    order = oracle.branch_order(robot)
    arm = oracle.pinocchio_model(robot)
    expected = np.empty(robot.n)
    expected[order] = pin.aba(arm, arm.createData(), q[order], dq[order], (tau - friction)[order])
    found = printed(symbolic_direct_dynamics(robot))(q=q, dq=dq, tau=tau)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    # There and back: this effort is what the inverse model asks for these accelerations.
    again = printed(symbolic_newton_euler(robot))(q=q, dq=dq, ddq=found)
    np.testing.assert_allclose(again, tau, rtol=0, atol=1e-11 * np.abs(tau).max())


@pytest.mark.parametrize("robot", [rx90(), some(0), some(3)], ids=lambda r: r.name)
def test_against_mujoco(robot: Robot) -> None:
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot, robot.standard, friction=False, limits=False))
    flags = mujoco.mjtDisableBit
    model.opt.disableflags |= flags.mjDSBL_LIMIT | flags.mjDSBL_CONTACT | flags.mjDSBL_FRICTIONLOSS
    data, order = mujoco.MjData(model), list(depth_first(robot))
    rng = np.random.default_rng(4)
    q, dq, tau = rng.uniform(-1.5, 1.5, (3, robot.n)) * np.array([[1.0], [1.0], [30.0]])
    data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q[order], dq[order], tau[order]
    mujoco.mj_forward(model, data)
    frictionless = {f"{p}{j + 1}": 0.0 for p in ("Fv", "Fs", "off") for j in range(robot.n)}
    found = printed(symbolic_direct_dynamics(robot))(frictionless, q=q, dq=dq, tau=tau)
    np.testing.assert_allclose(found[order], data.qacc, rtol=0, atol=1e-10 * np.abs(data.qacc).max())


def test_stored_accelerations_of_the_rx90() -> None:
    known, constants = stored_rx90()
    tau = np.array(known["tau_total"]) - known["tau_external"]
    found = printed(symbolic_direct_dynamics(rx90(known["RL4"])))(constants, q=known["q"], dq=known["qd"], tau=tau)
    np.testing.assert_allclose(found, known["qdd_from_tau_total"], rtol=0, atol=1e-12 * 2.1)


def test_a_length_may_be_called_like_an_inner_variable() -> None:
    """H1, say, or D2: the printed model keeps the length's name and takes another for its own."""
    robot = some(0)
    joints = tuple(
        replace(joint, symbols=(("d", name), ("r", other)))
        for joint, name, other in zip(robot.joints, ("H1", "A12", "W21"), ("b1", "d2", "t1"), strict=True)
    )
    rng = np.random.default_rng(1)
    q, dq, tau = rng.uniform(-1.5, 1.5, (3, 3))
    expected = printed(symbolic_direct_dynamics(robot))(q=q, dq=dq, tau=tau)
    model = symbolic_model(replace(robot, joints=joints), "direct-dynamics")
    assert {"H1", "A12", "t1"} <= dict(model.lengths).keys()
    np.testing.assert_allclose(printed(model)(q=q, dq=dq, tau=tau), expected, rtol=1e-10)


def test_nothing_is_computed_that_nobody_reads() -> None:
    """A SCARA's A has zeros: a C compiler would complain of variables without a reader."""
    model = symbolic_direct_dynamics(SCARA)
    read = {s.name for e in model.expressions.values() for s in e.free_symbols} | set(model.results[0].entries)
    assert set(model.expressions) <= read


def test_branches_leave_no_fill_in() -> None:
    """Two arms of three joints on one turning base: what one arm's joints do is no part of the other's rows."""
    a = [[sympy.Symbol(f"A{min(i, k)}{max(i, k)}") for k in range(7)] for i in range(7)]
    for i in (1, 2, 3):
        for k in (4, 5, 6):
            a[i][k] = a[k][i] = sympy.Integer(0)
    effort = list(sympy.symbols("e0:7"))
    found = solution(a, effort)
    assert not any(name in found for name in ("L52", "L53", "L54", "L62", "L63", "L64", "L72", "L73", "L74"))
    rng = np.random.default_rng(3)
    pattern = np.array([[float(x != 0) for x in row] for row in a])
    numbers = rng.uniform(0.1, 0.4, (7, 7))
    numbers = (numbers + numbers.T) * pattern + 3 * np.eye(7)
    known = {a[i][k]: numbers[i, k] for i in range(7) for k in range(i, 7) if a[i][k] != 0}
    known |= dict(zip(effort, rng.normal(size=7), strict=True))
    for name, expression in found.items():
        known[sympy.Symbol(name)] = float(
            expression.xreplace({s: sympy.Float(known[s]) for s in expression.free_symbols})
        )
    accelerations = [known[sympy.Symbol(f"ddq{j + 1}")] for j in range(7)]
    np.testing.assert_allclose(accelerations, np.linalg.solve(numbers, [known[e] for e in effort]), rtol=1e-12)
