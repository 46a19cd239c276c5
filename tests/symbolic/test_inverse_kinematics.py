"""Inverse kinematics: example 2.6 of the chapter, block inverses, singular and redundant arms."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from arms import OFFSET_SHOULDER, PUMA, SCARA, STANFORD, THREE_PARALLEL, arm, rx90
from beside import stored_values
from chains import random_chain

from identify.errors import InputError
from identify.symbolic.inverse_kinematics import (
    away_from_limits,
    damped_inverse,
    joint_velocity,
    limit_distance,
    manipulability,
    null_space_part,
    pseudo_inverse,
    symbolic_inverse_kinematics,
    toward_manipulability,
)
from identify.symbolic.jacobian import jacobian


def test_example_2_6() -> None:
    """³J6⁻¹ of the RX-90, typed from the chapter with the entries (4,1) and (5,1) put right."""
    q = sympy.symbols("q1:7")
    d3, rl4 = sympy.symbols("D3 RL4")
    c2, s3, c3, s4, c4, s5, c5 = (
        sympy.cos(q[1]), sympy.sin(q[2]), sympy.cos(q[2]), sympy.sin(q[3]), sympy.cos(q[3]), sympy.sin(q[4]),
        sympy.cos(q[4]),
    )  # fmt: skip
    s23, c23 = sympy.sin(q[1] + q[2]), sympy.cos(q[1] + q[2])
    v1, v2, v3 = 1 / (s23 * rl4 - c2 * d3), -rl4 + s3 * d3, 1 / (c3 * d3)
    v4, v5 = c4 * c5 / s5, s4 * c5 / s5
    v6, v7 = s3 / (c3 * rl4), 1 / (s5 * rl4)
    v8 = (-s23 * v4 - c23) * v1
    chapter = sympy.Matrix(
        [
            [0, 0, v1, 0, 0, 0],
            [0, v3, 0, 0, 0, 0],
            [-1 / rl4, v2 * v3 / rl4, 0, 0, 0, 0],
            [-s4 * c5 * v7, v5 * v6, v8, v4, 1, -v5],
            [c4 / rl4, -c4 * v6, -s23 * s4 * v1, s4, 0, c4],
            [s4 * v7, -s4 * v6 / s5, s23 * c4 * v1 / s5, -c4 / s5, 0, s4 / s5],
        ]
    )
    entries = symbolic_inverse_kinematics(rx90(), 3).expressions
    for i in range(6):
        for k in range(6):
            assert sympy.simplify(entries[f"K{i + 1}{k + 1}"] - chapter[i, k]) == 0, (i, k)


@pytest.mark.parametrize("forearm", [0.45, 0.52])
def test_stored_inverse(forearm: float) -> None:
    known = stored_values(f"rx90-geometry-0.45-{forearm}.json")
    model = symbolic_inverse_kinematics(rx90(known["RL4"]), 3)
    values = dict(zip(model.inputs, known["q"], strict=True)) | dict(model.lengths)
    point = {sympy.Symbol(name): sympy.Float(value) for name, value in values.items()}
    found = np.array([float(e.xreplace(point)) for e in model.expressions.values()]).reshape(6, 6)
    np.testing.assert_allclose(found, known["inv_3J6"], rtol=0, atol=1e-12 * np.abs(known["inv_3J6"]).max())


@pytest.mark.parametrize("robot", [rx90(), STANFORD, PUMA, OFFSET_SHOULDER], ids=lambda r: r.name)
def test_block_inverse_is_the_inverse(robot) -> None:
    model = symbolic_inverse_kinematics(robot)
    lengths = {sympy.Symbol(name): value for name, value in model.lengths}
    entries = [e.xreplace(lengths) for e in model.expressions.values()]
    function = sympy.lambdify([sympy.Symbol(name) for name in model.inputs], entries)
    for q in np.random.default_rng(1).uniform(0.3, 1.2, (3, 6)):
        inverse = np.array(function(*q), dtype=float).reshape(6, 6)
        np.testing.assert_allclose(inverse @ jacobian(robot, q, 3)[0], np.eye(6), rtol=0, atol=1e-11)


def test_no_spherical_wrist_no_block_inverse() -> None:
    with pytest.raises(InputError, match="no spherical wrist"):
        symbolic_inverse_kinematics(THREE_PARALLEL)
    with pytest.raises(InputError, match="no inverse"):
        symbolic_inverse_kinematics(SCARA)


def test_regular_velocities_are_exact_and_singular_ones_bounded() -> None:
    robot = rx90()
    rng = np.random.default_rng(2)
    q = np.array([0.3, -0.5, 0.4, 0.7, 0.9, -0.2])
    wanted = rng.normal(size=6)
    speed = joint_velocity(robot, q, wanted, frame=3)
    np.testing.assert_allclose(jacobian(robot, q, 3)[0] @ speed[0], wanted, rtol=0, atol=1e-12)
    for angle in (0.0, 1e-9, 1e-6, 1e-4, 1e-3):
        near = q.copy()
        near[4] = angle
        speed = joint_velocity(robot, near, wanted)[0]
        assert np.all(np.isfinite(speed))
        # σ/(σ² + λ²) is at most 1/(2λ) with λ close to a hundredth of the largest singular value.
        assert np.linalg.norm(speed) < 80 * np.linalg.norm(wanted)
    singular = q.copy()
    singular[4] = 0.0
    matrix = jacobian(robot, singular)[0]
    possible = matrix @ rng.normal(size=6)
    np.testing.assert_allclose(matrix @ pseudo_inverse(matrix) @ possible, possible, rtol=0, atol=1e-12)
    impossible = np.linalg.svd(matrix)[0][:, 5]
    np.testing.assert_allclose(pseudo_inverse(matrix) @ impossible, 0, atol=1e-12)
    np.testing.assert_allclose(damped_inverse(matrix) @ impossible, 0, atol=1e-12)


def test_an_arm_of_fewer_joints_is_not_singular_for_that() -> None:
    q = np.array([0.4, 0.9, 0.1, -0.3])
    speed = np.array([0.2, -0.5, 0.3, 0.8])
    matrix = jacobian(SCARA, q)[0]
    np.testing.assert_allclose(joint_velocity(SCARA, q, matrix @ speed)[0], speed, rtol=0, atol=1e-12)
    planar = arm("planar 4R", [("revolute", 0, d, 0, 0) for d in (0.0, 0.4, 0.3, 0.2)])
    matrix = jacobian(planar, q)[0]
    found = joint_velocity(planar, q, matrix @ speed)[0]
    np.testing.assert_allclose(matrix @ found, matrix @ speed, rtol=0, atol=1e-12)


def test_redundant_arm_follows_its_criterion_without_moving_its_end() -> None:
    robot = random_chain(np.random.default_rng(4), 7)
    rng = np.random.default_rng(5)
    q = rng.uniform(-1, 1, (6, 7))
    wanted = rng.normal(size=6)
    plain = joint_velocity(robot, q, wanted)
    matrix = jacobian(robot, q)
    for gradient, value, gain in (
        (away_from_limits(robot), lambda x: -limit_distance(robot, x), 0.7),
        (toward_manipulability(robot), lambda x: manipulability(robot, x), 30.0),
    ):
        speed = joint_velocity(robot, q, wanted, criterion=gradient, gain=gain)
        np.testing.assert_allclose((matrix @ speed[:, :, None])[:, :, 0], np.tile(wanted, (6, 1)), rtol=0, atol=1e-10)
        extra = speed - plain
        rate = (value(q + 1e-6 * extra) - value(q - 1e-6 * extra)) / 2e-6
        assert np.all(rate > 0)
        # Along the projected gradient the criterion grows by |projection|² times the gain.
        projection = null_space_part(matrix, gradient(q))
        np.testing.assert_allclose(rate, gain * (projection**2).sum(axis=1), rtol=1e-4, atol=1e-9)


def test_manipulability_of_a_square_jacobian_is_its_determinant() -> None:
    q = np.random.default_rng(6).uniform(-2, 2, (5, 6))
    expected = np.abs(np.linalg.det(jacobian(PUMA, q)))
    np.testing.assert_allclose(manipulability(PUMA, q), expected, rtol=1e-10)
