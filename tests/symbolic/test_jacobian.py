"""Jacobians: examples 2.4 and 2.5 of the chapter, stored values, Pinocchio, and singular configurations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import oracle
import pinocchio as pin
import pytest
import sympy
from arms import OFFSET_SHOULDER, PUMA, SCARA, STANFORD, THREE_PARALLEL, arm, placed, rx90
from beside import stored_values
from chains import random_chain

from identify.symbolic.geometry import direct_geometry, letters
from identify.symbolic.jacobian import determinant, jacobian, rank, symbolic_jacobian, three_matrices, tool_jacobian


def chapter_jacobian() -> sympy.Matrix:
    """³J6 of the RX-90, typed from example 2.5."""
    q = sympy.symbols("q1:7")
    d3, rl4 = sympy.symbols("D3 RL4")
    s2, c2, s3, c3, s4, c4, s5, c5 = (f(q[j]) for j in (1, 2, 3, 4) for f in (sympy.sin, sympy.cos))
    s23, c23 = sympy.sin(q[1] + q[2]), sympy.cos(q[1] + q[2])
    assert c2 == sympy.cos(q[1])
    assert s2 == sympy.sin(q[1])
    return sympy.Matrix(
        [
            [0, -rl4 + s3 * d3, -rl4, 0, 0, 0],
            [0, c3 * d3, 0, 0, 0, 0],
            [s23 * rl4 - c2 * d3, 0, 0, 0, 0, 0],
            [s23, 0, 0, 0, s4, -s5 * c4],
            [c23, 0, 0, 1, 0, c5],
            [0, 1, 1, 0, c4, s5 * s4],
        ]
    )


def test_example_2_5() -> None:
    entries = symbolic_jacobian(rx90(), 3).expressions
    chapter = chapter_jacobian()
    for i in range(6):
        for k in range(6):
            assert sympy.expand(entries[f"J{i + 1}{k + 1}"] - chapter[i, k]) == 0, (i, k)


def test_example_2_4() -> None:
    """Planar 3R: velocity of the end of the third segment, by differentiation in the chapter."""
    segments = (0.4, 0.3, 0.2)
    planar = arm("planar 3R", [("revolute", 0, d, 0, 0) for d in (0.0, *segments[:2])])
    tip = np.eye(4)
    tip[0, 3] = segments[2]
    planar = type(planar)(planar.name, planar.joints, tool=tuple(tuple(map(float, row)) for row in tip))
    q = np.array([0.3, -0.8, 1.4])
    s, c = np.sin(np.cumsum(q)) * segments, np.cos(np.cumsum(q)) * segments
    expected = [
        [-s[0] - s[1] - s[2], -s[1] - s[2], -s[2]],
        [c[0] + c[1] + c[2], c[1] + c[2], c[2]],
        [1, 1, 1],
    ]
    np.testing.assert_allclose(tool_jacobian(planar, q)[0][[0, 1, 5]], expected, rtol=0, atol=1e-15)


def test_example_2_4_in_symbols() -> None:
    """The same with letters for the segments: the end is the origin of a fourth frame, whose own column is left out."""
    lengths = {"L1": 0.4, "L2": 0.3, "L3": 0.2}
    rows = [("revolute", 0, d, 0, 0) for d in (0.0, *lengths.values())]
    planar = arm("planar 3R", rows)
    joints = [replace(j, symbols=(("d", name),)) for j, name in zip(planar.joints[1:], lengths, strict=True)]
    entries = symbolic_jacobian(replace(planar, joints=(planar.joints[0], *joints)), 0).expressions
    q1, q2, q3, l1, l2, l3 = sympy.symbols("q1 q2 q3 L1 L2 L3")
    turns = ((l1, q1), (l2, q1 + q2), (l3, q1 + q2 + q3))
    for k in range(3):
        assert sympy.expand(entries[f"J1{k + 1}"] + sum(d * sympy.sin(q) for d, q in turns[k:])) == 0
        assert sympy.expand(entries[f"J2{k + 1}"] - sum(d * sympy.cos(q) for d, q in turns[k:])) == 0
        assert [entries[f"J{i}{k + 1}"] for i in (3, 4, 5, 6)] == [0, 0, 0, 1]


def test_determinant_of_example_2_5() -> None:
    found = determinant(rx90())
    q2, q3, q5 = sympy.symbols("q2 q3 q5")
    d3, rl4 = sympy.symbols("D3 RL4")
    wall = sympy.sin(q2 + q3) * rl4 - sympy.cos(q2) * d3
    assert sympy.expand(found.value + sympy.cos(q3) * d3 * rl4 * sympy.sin(q5) * wall) == 0
    assert found.full_rank == 6
    solved = {s.factor: s for s in found.singularities}
    assert set(solved[sympy.cos(q3)].values) == {-sympy.pi / 2, sympy.pi / 2}
    assert set(solved[sympy.sin(q5)].values) == {0, sympy.pi}
    assert sum(sympy.expand(f**2 - wall**2) == 0 for f in solved) == 1
    assert len(solved) == 3
    assert all(s.generic_rank == 5 for s in solved.values())


@pytest.mark.parametrize("forearm", [0.45, 0.52])
def test_stored_jacobians(forearm: float) -> None:
    known = stored_values(f"rx90-geometry-0.45-{forearm}.json")
    robot, q = rx90(known["RL4"]), np.array(known["q"])
    for i in (0, 3, 6):
        np.testing.assert_allclose(jacobian(robot, q, i)[0], known[f"J_{i}_6"], rtol=0, atol=1e-12)
    values = {sympy.Symbol(f"q{j + 1}"): x for j, x in enumerate(q)} | {
        sympy.Symbol(name): x for name, x in letters(robot)
    }
    found = determinant(robot)
    assert float(found.value.xreplace(values)) == pytest.approx(known["det_3J6"], rel=0, abs=1e-12)
    for point in (3, 4):
        core = three_matrices(robot, 3, 3, point).core.xreplace(values)
        stored = np.array(known[f"J_3_6_intermediate{point}"])
        # Stored is the product of the three matrices or the third one alone; the former equals ³J6.
        whole = np.array(three_matrices(robot, 3, 3, point).shift.xreplace(values) * core, dtype=float)
        assert min(np.abs(np.array(core, dtype=float) - stored).max(), np.abs(whole - stored).max()) < 1e-12
        np.testing.assert_allclose(whole, known["J_3_6"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_against_pinocchio(seed: int) -> None:
    robot, model, order, positions = oracle.random_arm(seed)
    data = model.createData()
    for q in positions:
        pin.computeJointJacobians(model, data, q[order])
        for number, j in enumerate(order, start=1):
            expected = np.empty((6, robot.n))
            expected[:, order] = pin.getJointJacobian(model, data, number, pin.LOCAL_WORLD_ALIGNED)
            np.testing.assert_allclose(jacobian(robot, q, 0, j)[0], expected, rtol=0, atol=1e-12)
            expected[:, order] = pin.getJointJacobian(model, data, number, pin.LOCAL)
            np.testing.assert_allclose(jacobian(robot, q, j + 1, j)[0], expected, rtol=0, atol=1e-12)


def test_tool_jacobian_is_the_derivative_of_the_pose() -> None:
    robot = placed(PUMA)
    q = np.random.default_rng(2).uniform(-2, 2, 6)
    h = 1e-6
    here = direct_geometry(robot, q)[0]
    for k, move in enumerate(h * np.eye(6)):
        change = (direct_geometry(robot, q + move)[0] - direct_geometry(robot, q - move)[0]) / (2 * h)
        turn = change[:3, :3] @ here[:3, :3].T
        expected = [*change[:3, 3], turn[2, 1], turn[0, 2], turn[1, 0]]
        np.testing.assert_allclose(tool_jacobian(robot, q)[0, :, k], expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("seed", range(5))
def test_symbols_three_matrices_and_numbers_agree(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, 4, special=True)
    q = rng.uniform(-2, 2, 4)
    values = {sympy.Symbol(f"q{j + 1}"): x for j, x in enumerate(q)}
    for frame in (0, 2, 4):
        entries = symbolic_jacobian(robot, frame).expressions.values()
        found = np.array([float(e.xreplace(values).evalf()) for e in entries]).reshape(6, 4)
        np.testing.assert_allclose(found, jacobian(robot, q, frame)[0], rtol=0, atol=1e-12)
    parts = three_matrices(robot, 1, 2, 3)
    product = (parts.turn * parts.shift * parts.core).xreplace(values).evalf()
    np.testing.assert_allclose(np.array(product, dtype=float), jacobian(robot, q, 1)[0], rtol=0, atol=1e-12)


@pytest.mark.parametrize("robot", [STANFORD, PUMA, OFFSET_SHOULDER, THREE_PARALLEL], ids=lambda r: r.name)
def test_determinant_is_the_determinant_and_its_zeros_are_singular(robot) -> None:
    found = determinant(robot)
    rng = np.random.default_rng(8)
    variables = [sympy.Symbol(f"q{j + 1}") for j in range(6)]
    value = sympy.lambdify(variables, found.value)
    for q in rng.uniform(-2, 2, (5, 6)):
        assert value(*q) == pytest.approx(np.linalg.det(jacobian(robot, q)[0]), rel=1e-11, abs=1e-14)
    assert len(found.singularities) >= 2
    for singular in found.singularities:
        assert singular.generic_rank == 5, singular.factor


def test_an_arm_without_listed_singularities_says_why() -> None:
    """Seven joints lose rank where seven minors vanish together; one joint never does."""
    seven = random_chain(np.random.default_rng(3), 7)
    square = tuple(
        replace(j, type="revolute", alpha=(-1) ** k * np.pi / 2, gamma=0.0, theta=0.0, d=0.0, b=0.0)
        for k, j in enumerate(seven.joints)
    )
    assert (
        "no singular configuration listed: the rank falls where"
        in symbolic_jacobian(replace(seven, joints=square)).notes[-1]
    )
    (single,) = random_chain(np.random.default_rng(3), 1).joints
    one = replace(seven, joints=(single,), transmission=None)
    assert "no singular configuration: the rank is the same everywhere" in symbolic_jacobian(one).notes[-1]


def test_scara_has_four_degrees_of_freedom_and_a_stretched_elbow() -> None:
    found = determinant(SCARA)
    assert found.value is None
    assert found.full_rank == 4
    (elbow,) = found.singularities
    assert elbow.factor == sympy.sin(sympy.Symbol("q2"))
    assert elbow.generic_rank == 3
    np.testing.assert_array_equal(rank(jacobian(SCARA, np.array([[0.3, 0.8, 0.1, 1.0], [0.3, 0.0, 0.1, 1.0]]))), [4, 3])
