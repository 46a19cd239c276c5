"""Newton-Euler torque and its regressor: the chapter's formulas, its worked arm, and Pinocchio."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import oracle
import pytest
from chains import random_chain
from symbolic_models import function_of, states, tilted

from identify.robot.library import load_robot
from identify.robot.robot import Robot
from identify.symbolic.expression import Graph, Scalar
from identify.symbolic.newton_euler import direct_torque, torque_regressor, wrench_columns


def torque_of(robot: Robot, standard: np.ndarray, *signals: np.ndarray) -> np.ndarray:
    graph = Graph()
    return function_of(graph, robot.n, direct_torque(graph, robot, list(standard)))(*signals)


def regressor_of(robot: Robot, columns: list[int], *signals: np.ndarray) -> np.ndarray:
    """(N, n, len(columns)), zeros where torque_regressor has no entry."""
    graph = Graph()
    entries = torque_regressor(graph, robot, columns)
    dense: list[Scalar] = [entries.get((i, c), 0) for i in range(robot.n) for c in columns]
    return function_of(graph, robot.n, dense)(*signals).reshape(-1, robot.n, len(columns))


def random_robot(seed: int) -> tuple[np.random.Generator, Robot]:
    rng = np.random.default_rng(seed)
    return rng, tilted(random_chain(rng, 3 + seed % 4, special=seed % 4 == 3, tree=seed % 2 == 1))


def test_wrench_columns_are_newton_and_euler() -> None:
    """F = M·V̇ + ω̇×MS + ω×(ω×MS) and moment J·ω̇ + ω×J·ω + MS×V̇ about O_j [2.69], [2.70]."""
    rng = np.random.default_rng(0)
    w, a, v = rng.normal(size=(3, 3))
    xx, xy, xz, yy, yz, zz, *first, mass = standard = rng.normal(size=10)
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments = np.array(first)
    columns = wrench_columns(SimpleNamespace(omega=tuple(w), alpha=tuple(a), acceleration=tuple(v)))  # type: ignore[arg-type]
    force, moment = np.einsum("k,kcx->cx", standard, np.array(columns, dtype=float))
    np.testing.assert_allclose(
        force, mass * v + np.cross(a, moments) + np.cross(w, np.cross(w, moments)), rtol=1e-13, atol=1e-13
    )
    np.testing.assert_allclose(
        moment, inertia @ a + np.cross(w, inertia @ w) + np.cross(moments, v), rtol=1e-13, atol=1e-13
    )


@pytest.mark.parametrize("seed", range(12))
def test_torque_against_pinocchio(seed: int) -> None:
    rng, robot = random_robot(seed)
    q, dq, ddq = states(rng, robot, 20)
    expected = oracle.inverse_dynamics(robot, q, dq, ddq)
    found = torque_of(robot, robot.standard, q, dq, ddq)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("seed", range(12))
def test_regressor_times_parameters_is_the_torque(seed: int) -> None:
    """For any parameters, possible bodies or not: every column is right, not only their sum."""
    rng, robot = random_robot(seed)
    signals = states(rng, robot, 10)
    columns = list(range(11 * robot.n))
    regressor = regressor_of(robot, columns, *signals)
    for _ in range(3):
        standard = rng.normal(size=11 * robot.n)
        expected = torque_of(robot, standard, *signals)
        np.testing.assert_allclose(regressor @ standard, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    some = [c for c in columns if c % 3 == 1]
    np.testing.assert_array_equal(regressor_of(robot, some, *signals), regressor[:, :, some])


@pytest.mark.parametrize("seed", range(4))
def test_a_link_loads_the_joints_that_carry_it_and_no_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = tilted(random_chain(rng, 6, tree=True))
    carriers = []
    for j in range(robot.n):
        way, i = set(), j
        while i >= 0:
            way.add(i)
            i = robot.joints[i].parent
        carriers.append(way)
    assert any(len(way) < j + 1 for j, way in enumerate(carriers)), "a branch, or the test shows nothing"
    entries = torque_regressor(Graph(), robot, range(11 * robot.n))
    for i, column in entries:
        j, k = divmod(column, 11)
        assert i == j if k == 10 else i in carriers[j]
    loaded = np.abs(regressor_of(robot, list(range(11 * robot.n)), *states(rng, robot, 10))).max(axis=0) > 1e-12
    for j, way in enumerate(carriers):
        assert set(np.flatnonzero(loaded[:, 11 * j : 11 * j + 10].any(axis=1))) <= way


def test_the_three_axis_arm_of_example_2_7() -> None:
    """A and Q of the chapter's example 2.7, typed from it; 0g = [0, 0, G3], D3 a length of its own."""
    arm = load_robot("rx90")
    arm = replace(arm, joints=arm.joints[:3])
    rng = np.random.default_rng(7)
    standard = rng.normal(size=33)
    k = dict(zip(arm.standard_names, standard, strict=True))
    d3, g3 = arm.joints[2].d, arm.gravity[2]
    q = rng.uniform(-3, 3, 3)
    s2, c2, s3, c3 = np.sin(q[1]), np.cos(q[1]), np.sin(q[2]), np.cos(q[2])
    s23, c23 = np.sin(q[1] + q[2]), np.cos(q[1] + q[2])
    a11 = (
        k["Ia1"] + k["ZZ1"] + s2 * s2 * k["XX2"] + 2 * c2 * s2 * k["XY2"] + c2 * c2 * k["YY2"]
        + s23 * s23 * k["XX3"] + 2 * c23 * s23 * k["XY3"] + c23 * c23 * k["YY3"]
        + 2 * c2 * c23 * d3 * k["MX3"] - 2 * c2 * s23 * d3 * k["MY3"] + c2 * c2 * d3**2 * k["M3"]
    )  # fmt: skip
    a12 = s2 * k["XZ2"] + c2 * k["YZ2"] + s23 * k["XZ3"] + c23 * k["YZ3"] - s2 * d3 * k["MZ3"]
    a13 = s23 * k["XZ3"] + c23 * k["YZ3"]
    a22 = k["Ia2"] + k["ZZ2"] + k["ZZ3"] + 2 * c3 * d3 * k["MX3"] - 2 * s3 * d3 * k["MY3"] + d3**2 * k["M3"]
    a23 = k["ZZ3"] + c3 * d3 * k["MX3"] - s3 * d3 * k["MY3"]
    a33 = k["Ia3"] + k["ZZ3"]
    q2 = -g3 * (c2 * k["MX2"] - s2 * k["MY2"] + c23 * k["MX3"] - s23 * k["MY3"] + d3 * c2 * k["M3"])
    q3 = -g3 * (c23 * k["MX3"] - s23 * k["MY3"])
    still = np.zeros((1, 3))
    gravity = torque_of(arm, standard, q[None], still, still)[0]
    rows = np.repeat(q[None], 3, axis=0)
    inertia = torque_of(arm, standard, rows, np.zeros((3, 3)), np.eye(3)) - gravity
    np.testing.assert_allclose(gravity, [0, q2, q3], rtol=0, atol=1e-13 * np.abs(gravity).max())
    np.testing.assert_allclose(
        inertia, [[a11, a12, a13], [a12, a22, a23], [a13, a23, a33]], rtol=0, atol=1e-13 * np.abs(inertia).max()
    )
