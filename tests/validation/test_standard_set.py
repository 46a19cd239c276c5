"""From base parameters back to links: any that map to them, and possible ones where there are any."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from chains import random_chain
from exact_logs import unknown

from identify.robot.library import load_robot
from identify.robot.mjcf import to_mjcf
from identify.robot.robot import LINK_PARAMETERS, Robot
from identify.symbolic.base_parameters import base_parameters
from identify.validation.engines import pinocchio_torque
from identify.validation.standard_set import any_standard, consistent_standard, smallest_eigenvalues

WIDTH = len(LINK_PARAMETERS) + 1


def robots() -> list[Robot]:
    return [
        load_robot("rx90"),
        random_chain(np.random.default_rng(4), 4),
        random_chain(np.random.default_rng(11), 5, special=True),
        random_chain(np.random.default_rng(12), 4, tree=True),
    ]


def pseudo_inertia(link: np.ndarray) -> np.ndarray:
    """(4, 4) ∫ [x; 1][x; 1]ᵀ dm of a link's ten parameters."""
    xx, xy, xz, yy, yz, zz, mx, my, mz, m = link[:10]
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    second = np.trace(tensor) / 2 * np.eye(3) - tensor
    first = np.array([mx, my, mz])
    return np.block([[second, first[:, None]], [first[None], np.array([[m]])]])


@pytest.mark.parametrize("seed", range(4))
def test_any_base_vector_has_a_standard_one(seed: int) -> None:
    for robot in robots():
        matrix = base_parameters(robot).matrix
        base = np.random.default_rng(seed).normal(size=len(matrix)) * 5
        standard = any_standard(robot, base)
        np.testing.assert_allclose(matrix @ standard, base, rtol=0, atol=1e-11)


def test_the_standard_set_stays_near_unit_masses() -> None:
    """What the base parameters leave open is not blown up: the exact start comes back, masses elsewhere stay tame."""
    robot = load_robot("rx90")
    matrix = base_parameters(robot).matrix
    start = np.tile([0.0] * 9 + [1.0, 0.0], 6)
    np.testing.assert_allclose(any_standard(robot, matrix @ start), start, rtol=0, atol=1e-12)
    assert np.abs(any_standard(robot, matrix @ robot.standard)).max() < 2 * np.abs(robot.standard).max()


@pytest.mark.parametrize("number", range(4))
def test_possible_base_vectors_get_possible_links(number: int) -> None:
    """Not the robot's own links, which the base parameters don't tell, but links that no experiment could refute."""
    robot = robots()[number]
    matrix = base_parameters(robot).matrix
    base = matrix @ robot.standard
    standard = consistent_standard(unknown(robot), base)
    assert standard is not None
    np.testing.assert_allclose(matrix @ standard, base, rtol=0, atol=1e-12 * np.abs(base).max())
    for link in standard.reshape(-1, WIDTH):
        assert np.linalg.eigvalsh(pseudo_inertia(link))[0] > 0
        assert link[10] >= 0
    assert np.abs(standard - robot.standard).max() > 1e-3
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot, standard, friction=False, limits=False))
    assert model.nv == robot.n
    states = np.random.default_rng(number).uniform(-1, 1, (3, 20, robot.n))
    torque = pinocchio_torque(robot, robot.standard, *states)
    np.testing.assert_allclose(
        pinocchio_torque(robot, standard, *states), torque, rtol=0, atol=1e-9 * np.abs(torque).max()
    )


def test_smallest_eigenvalues_are_those_of_the_pseudo_inertia() -> None:
    standard = np.random.default_rng(5).normal(size=3 * WIDTH)
    expected = [np.linalg.eigvalsh(pseudo_inertia(link))[0] for link in standard.reshape(3, WIDTH)]
    np.testing.assert_allclose(smallest_eigenvalues(standard), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("Ia6", -0.01),  # an actuator with a negative inertia
        ("ZZ6", -0.05),  # a body with a negative moment about its axis
        ("XY6", 5.0),  # a product far beyond the moments
        ("ZZR1", 0.0),  # less about axis 1 than the links beyond it have alone
        ("MX6", 4.0),  # first moments that need more inertia than there is
    ],
)
def test_impossible_base_vectors_get_none(name: str, value: float) -> None:
    robot = load_robot("rx90")
    base = base_parameters(robot)
    vector = base.matrix @ robot.standard
    vector[base.names.index(name)] = value
    assert consistent_standard(robot, vector) is None


def test_a_vector_just_inside_is_found_and_just_outside_is_not() -> None:
    """One joint about a vertical axis has ZZ + Ia alone: anything positive is possible, nothing negative."""
    robot = random_chain(np.random.default_rng(0), 1)
    base = base_parameters(robot)
    vector = base.matrix @ robot.standard
    at = next(i for i, name in enumerate(base.names) if name.startswith("ZZ"))
    for value, possible in ((1e-2, True), (-1e-2, False)):
        inside = np.zeros_like(vector)
        inside[at] = value
        assert (consistent_standard(robot, inside) is not None) is possible
