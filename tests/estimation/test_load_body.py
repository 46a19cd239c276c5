"""A load as a body: the same numbers as a Link's, exact derivatives, and the nearest body that can be."""

from __future__ import annotations

import numpy as np
import pytest
from chains import random_link

from identify.estimation.load_body import body_values, nearest_body, seen_from, smallest_eigenvalue
from identify.robot.robot import Link
from identify.robot.transforms import from_roll_pitch_yaw, move_link


def values(link: Link) -> np.ndarray:
    return np.array([link.mass, *link.com, *link.inertia])


def random_covariance(rng: np.random.Generator, size: float) -> np.ndarray:
    mixed = rng.normal(size=(10, 10)) * np.array([*(0.01,) * 6, *(0.05,) * 3, 0.3])[:, None]
    return size**2 * (mixed @ mixed.T + np.diag(np.diag(mixed @ mixed.T)) * 0.1)


def test_values_are_those_of_the_link() -> None:
    link = random_link(np.random.default_rng(0))
    np.testing.assert_allclose(body_values(link.standard)[0], values(link), rtol=0, atol=1e-13)


def test_derivatives_are_those_of_differences() -> None:
    load = random_link(np.random.default_rng(1)).standard
    differences = [(body_values(load + h)[0] - body_values(load - h)[0]) / 2e-6 for h in 1e-6 * np.eye(10)]
    np.testing.assert_allclose(body_values(load)[1], np.transpose(differences), rtol=0, atol=1e-7)


def test_another_frame_sees_the_same_body() -> None:
    link = random_link(np.random.default_rng(2))
    transform = from_roll_pitch_yaw((0.1, -0.2, 0.3), (0.4, -1.1, 2.0))
    slopes, seen = seen_from(transform, values(link))
    np.testing.assert_allclose(seen, values(move_link(link, transform)), rtol=0, atol=1e-13)
    np.testing.assert_allclose(
        slopes @ np.eye(10)[4], seen_from(transform, values(link) + np.eye(10)[4])[1] - seen, rtol=0, atol=1e-13
    )


def test_a_possible_body_stays_as_it_is() -> None:
    rng = np.random.default_rng(3)
    load = random_link(rng).standard
    found = nearest_body(load, random_covariance(rng, 1.0), np.eye(10))
    np.testing.assert_array_equal(found.parameters, load)
    assert not found.moved
    assert found.cost == 0.0
    assert found.eigenvalue == found.least == smallest_eigenvalue(load) > 0


@pytest.mark.parametrize("seed", range(6))
def test_no_possible_body_is_nearer(seed: int) -> None:
    """The problem is convex: on the way to any possible body, and beside it, the cost only grows."""
    rng = np.random.default_rng(seed)
    covariance = random_covariance(rng, 0.3)
    load = random_link(rng).standard
    load[:6] -= 3 * np.abs(load[:6]).max() * np.array([1, 0.1, -0.2, 0.5, 0.1, 0])
    assert smallest_eigenvalue(load) < 0
    found = nearest_body(load, covariance, np.eye(10))
    assert found.moved
    assert found.least > 0
    information = np.linalg.inv(covariance)

    def cost(body: np.ndarray) -> float:
        return float((body - load) @ information @ (body - load))

    assert found.cost == pytest.approx(cost(found.parameters), rel=1e-6)
    assert found.eigenvalue == pytest.approx(smallest_eigenvalue(load))
    for _ in range(200):
        other = random_link(rng).standard * rng.uniform(0.1, 2.0)
        for share in (1e-4, 1e-2, 1.0):
            assert cost(found.parameters + share * (other - found.parameters)) >= found.cost * (1 - 1e-5)


def test_a_negative_mass_becomes_a_small_one() -> None:
    load = np.array([1e-3, 0, 0, 1e-3, 0, 1e-3, 0.01, -0.02, 0.01, -0.05])
    found = nearest_body(load, np.diag(np.full(10, 0.01)), np.eye(10))
    assert found.parameters[9] > 0
    assert smallest_eigenvalue(found.parameters) > 0


def test_what_is_not_told_is_filled_in_and_costs_nothing() -> None:
    """Of a body whose first moment along z and mass are known, and nothing else, any will do."""
    load = np.zeros(10)
    load[8:] = 0.3, 2.0
    covariance = np.zeros((10, 10))
    covariance[8:, 8:] = np.diag([1e-4, 1e-2])
    found = nearest_body(load, covariance, np.eye(10)[8:])
    assert found.least > 0
    assert found.cost < 1e-4
    np.testing.assert_allclose(body_values(found.parameters)[0][:4], [2.0, 0.0, 0.0, 0.15], rtol=0, atol=1e-3)
