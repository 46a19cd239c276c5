"""The printed recurrence of Newton and Euler: stored values, Pinocchio with a wrench, and what its names stand for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import oracle
import pinocchio as pin
import pytest
import sympy
from arms import rx90
from chains import random_chain
from printed_models import printed, stored_rx90
from symbolic_models import tilted

from identify.robot.library import load_robot
from identify.robot.robot import Drive, Robot, Transmission
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.expression import Expression, Graph, evaluate
from identify.symbolic.geometry import letters
from identify.symbolic.inverse_dynamics import carried_parameters, symbolic_newton_euler
from identify.symbolic.lagrange import symbolic_lagrange
from identify.symbolic.link_motion import recurrence
from identify.symbolic.representative import representative, written_with_letters


def test_stored_torque_of_the_rx90() -> None:
    known, constants = stored_rx90()
    found = printed(symbolic_newton_euler(rx90(known["RL4"])))(
        constants, q=known["q"], dq=known["qd"], ddq=known["qdd"], F=known["fe6"][:3], N=known["fe6"][3:]
    )
    np.testing.assert_allclose(found, known["tau_total"], rtol=0, atol=1e-12 * np.abs(known["tau_total"]).max())


@pytest.mark.parametrize("seed", range(6))
def test_against_pinocchio_with_a_wrench(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = tilted(random_chain(rng, 3 + seed % 2, special=seed % 3 == 2, tree=seed % 2 == 1))
    q, dq, ddq = rng.uniform(-1.5, 1.5, (3, robot.n))
    wrench = rng.normal(size=6) * 20
    order = oracle.branch_order(robot)
    arm = oracle.pinocchio_model(robot)
    forces = [pin.Force(np.zeros(6)) for _ in range(robot.n + 1)]
    forces[1 + order.index(robot.n - 1)] = pin.Force(-wrench)
    expected = np.empty(robot.n)
    expected[order] = pin.rnea(arm, arm.createData(), q[order], dq[order], ddq[order], pin.StdVec_Force(forces))
    drives = [joint.drive for joint in robot.joints]
    expected += [d.viscous * v + d.coulomb * np.sign(v) + d.offset for d, v in zip(drives, dq, strict=True)]
    for model in (symbolic_newton_euler(robot), symbolic_lagrange(robot)):
        found = printed(model)(q=q, dq=dq, ddq=ddq, F=wrench[:3], N=wrench[3:])
        torque = found["tau"] if isinstance(found, dict) else found
        np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_names_stand_for_what_they_say() -> None:
    """Every w, wp, Vp and U of the printed model against its definition, elsewhere than where it was found."""
    robot, model = rx90(), symbolic_newton_euler(rx90())
    graph, signals = Graph(), np.random.default_rng(2).normal(size=(3, 6))
    kept = representative(robot).symbols(graph, 6)
    links = recurrence(graph, robot, [graph.constant(0)] * 66)
    values = dict(model.constants) | {
        f"{p}{j + 1}": x for p, row in zip(("q", "dq", "ddq"), signals, strict=True) for j, x in enumerate(row)
    }
    values |= {f"{p}{i}": 0.0 for p in "FN" for i in (1, 2, 3)} | dict(letters(robot))
    assert kept
    known = dict(values)
    for name, expression in model.expressions.items():
        known[name] = float(expression.xreplace({s: sympy.Float(known[s.name]) for s in expression.free_symbols}))
    named = [name for name in model.expressions if name in links and name[0] in "wVU"]
    assert len(named) > 15
    assert {name.rstrip("0123456789_") for name in named} >= {"w", "U"}
    for name in named:
        quantity = links[name]
        assert isinstance(quantity, Expression)
        assert known[name] == pytest.approx(evaluate([quantity], values)[0], rel=1e-9, abs=1e-9), name


@pytest.mark.parametrize("robot", [rx90(), load_robot("tx40")], ids=lambda r: r.name)
def test_carried_parameters_have_the_values_of_the_representative(robot: Robot) -> None:
    """Letters for the lengths, and for a robot without letters numbers; at the RX-90's unequal lengths, so that one
    letter in place of the other shows."""
    (_, chosen), names = written_with_letters(robot), base_parameters(robot).names
    lengths = {sympy.Symbol(name): value for name, value in letters(robot)}
    found = carried_parameters(robot)
    assert len(found) == len(chosen.kept)
    for formula, row in zip(found.values(), chosen.matrix, strict=True):
        expanded = sympy.expand(formula.xreplace(lengths))
        numbers = [float(expanded.coeff(sympy.Symbol(name))) for name in names]
        np.testing.assert_allclose(numbers, row, rtol=1e-12, atol=1e-12)
    if lengths:
        assert set(lengths) <= set().union(*(formula.free_symbols for formula in found.values()))


def test_shared_motors_add_their_inertia_and_friction() -> None:
    """½·Iam·ṁ² and Fvm·ṁ² of a motor at ṁ = ratios·q̇, less what falls on single joints, and Fsm·sign(ṁ) whole."""
    arm = random_chain(np.random.default_rng(2), 3)
    matrix = ((20.0, 0.0, 0.0), (0.0, 30.0, 0.0), (0.0, 45.0, 30.0))
    motors = (Drive(), Drive(), Drive(inertia=0.7, viscous=1.3, coulomb=2.9))
    robot = replace(arm, transmission=Transmission(matrix, motors))
    ratios = np.array([0.0, 1.5, 1.0])
    rng = np.random.default_rng(6)
    q, dq, ddq = rng.normal(size=(3, 3))
    model = symbolic_newton_euler(robot)
    constants = {"Iam3": 0.7, "Fvm3": 1.3, "Fsm3": 2.9}
    assert constants.items() <= dict(model.parameters).items()
    unknown = symbolic_newton_euler(replace(arm, transmission=Transmission(matrix)))
    assert dict.fromkeys(constants, 0.0).items() <= dict(unknown.parameters).items()
    cross = np.outer(ratios, ratios) - np.diag(ratios**2)
    expected = cross @ (0.7 * ddq + 1.3 * dq) + 2.9 * ratios * np.sign(ratios @ dq)
    for printed_model in (printed(model), printed(symbolic_lagrange(robot))):
        with_motor, without = (
            printed_model(None if there else dict.fromkeys(constants, 0.0), q=q, dq=dq, ddq=ddq)
            for there in (True, False)
        )
        if isinstance(with_motor, dict):
            with_motor, without = with_motor["tau"], without["tau"]
        np.testing.assert_allclose(with_motor - without, expected, rtol=0, atol=1e-12 * np.abs(with_motor).max())
