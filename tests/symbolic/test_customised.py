"""Customised inverse dynamics: Pinocchio's effort from fewer operations than the chapter's."""

from __future__ import annotations

import itertools

import numpy as np
import oracle
import pinocchio as pin
import pytest
from chains import random_chain
from symbolic_models import function_of, states, tilted

from identify.robot.library import load_robot
from identify.robot.robot import Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.customised import Form, Motion, customised_torque
from identify.symbolic.expression import Expression, Graph, evaluate
from identify.symbolic.operation_table import is_chapters_robot, operations, symmetric_absent, table
from identify.symbolic.operations import Operations
from identify.symbolic.representative import customised_model, representative, standard_from_second_moments

FORMS = [Form(*flags) for flags in itertools.product((True, False), repeat=4)]


def values(torque: list[Expression], robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, more: dict) -> list:
    signals = {f"{p}{j + 1}": x[j] for p, x in (("q", q), ("dq", dq), ("ddq", ddq)) for j in range(robot.n)}
    lengths = {name: getattr(joint, key) for joint in robot.joints for key, name in joint.symbols}
    return evaluate(torque, signals | lengths | more)


@pytest.mark.parametrize("seed", range(10))
def test_every_form_is_the_same_torque(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = tilted(random_chain(rng, 5, special=seed % 2 == 0, tree=seed % 3 == 0))
    q, dq, ddq = states(rng, robot, 5)
    expected = oracle.inverse_dynamics(robot, q, dq, ddq)
    sigma = np.linalg.solve(standard_from_second_moments(robot.n), robot.standard)
    for form in FORMS:
        graph = Graph()
        motion = Motion.of(graph, robot)
        torque = customised_torque(graph, robot, list(sigma), motion, forms=[form] * robot.n)
        found = function_of(graph, robot.n, torque)(q, dq, ddq)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize(
    "robot", [load_robot("rx90"), tilted(random_chain(np.random.default_rng(3), 4))], ids=["rx90", "random"]
)
def test_base_parameters_and_wrench_against_pinocchio(robot: Robot) -> None:
    model = customised_model(robot, wrench=True, letters=True)
    parameters = dict(zip(model.parameters, model.matrix @ base_parameters(robot).matrix @ robot.standard, strict=True))
    rng = np.random.default_rng(5)
    arm = oracle.pinocchio_model(robot)
    for q, dq, ddq in states(rng, robot, 4).transpose(1, 0, 2):
        wrench = rng.normal(size=6) * 20
        on_the_arm = pin.StdVec_Force([pin.Force(np.zeros(6))] * robot.n + [pin.Force(-wrench)])
        expected = pin.rnea(arm, arm.createData(), q, dq, ddq, on_the_arm)
        symbols = {f"{p}{k + 1}": wrench[3 * i + k] for i, p in enumerate("FN") for k in range(3)}
        found = values(model.torque, robot, q, dq, ddq, parameters | symbols)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_operations_of_the_rx90() -> None:
    """Below the chapter's 253 × and 238 +, and 160 × and 113 + with symmetric links; a change for the worse fails."""
    rows = {row.model: row for row in operations(load_robot("rx90"))}
    general, symmetric = rows["inverse dynamics, wrench"], rows["inverse dynamics, wrench, symmetric links"]
    assert general.chapter == Operations(253, 238, 0)
    assert symmetric.chapter == Operations(160, 113, 0)
    assert general.operations.multiplications <= 224
    assert general.operations.additions <= 207
    assert symmetric.operations.multiplications <= 137
    assert symmetric.operations.additions <= 111
    printed = table(tuple(rows.values())).splitlines()
    assert len(printed) == 1 + len(rows)
    assert printed[1].split()[-4:] == [
        str(general.operations.multiplications),
        str(general.operations.additions),
        "253",
        "238",
    ]


def test_the_chapters_figures_stand_beside_its_robot_alone() -> None:
    assert is_chapters_robot(load_robot("rx90"))
    other = random_chain(np.random.default_rng(0), 3)
    assert not is_chapters_robot(other)
    assert not is_chapters_robot(load_robot("tx40"))
    assert all(row.chapter is None for row in operations(other))


def test_symmetric_links_are_the_general_model_with_zeros() -> None:
    robot = load_robot("rx90")
    base, absent = base_parameters(robot), symmetric_absent(robot)
    assert len(base.names) - len(absent) == 19
    rng = np.random.default_rng(8)
    present = rng.normal(size=len(base.names)) * [name not in absent for name in base.names]
    q, dq, ddq = states(rng, robot, 1)[:, 0]
    found = []
    for model in (customised_model(robot), customised_model(robot, absent=absent)):
        parameters = dict(zip(model.parameters, model.matrix @ present, strict=True))
        found.append(values(model.torque, robot, q, dq, ddq, parameters))
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-12 * np.abs(found[0]).max())


@pytest.mark.parametrize("seed", [None, 1, 4])
def test_a_representative_has_the_base_parameters_it_stands_for(seed: int | None) -> None:
    robot = load_robot("rx90") if seed is None else random_chain(np.random.default_rng(seed), 3, special=True)
    base, chosen = base_parameters(robot), representative(robot)
    sigma = np.zeros((11 * robot.n, len(base.names)))
    sigma[list(chosen.kept)] = chosen.matrix
    np.testing.assert_allclose(
        base.matrix @ standard_from_second_moments(robot.n) @ sigma, np.eye(len(base.names)), rtol=0, atol=1e-13
    )
