"""Placement and decomposition undo each other; carried and merged links keep their point masses' inertia."""

from __future__ import annotations

import math

import numpy as np
import pytest
from chains import random_chain
from hypothesis import example, given, settings
from hypothesis import strategies as st

from identify.robot.robot import Link
from identify.robot.transforms import (
    decompose,
    from_roll_pitch_yaw,
    inverse,
    link_frames,
    merge_links,
    move_link,
    placement,
    to_roll_pitch_yaw,
)

angles = st.one_of(st.floats(-3.1, 3.1), st.sampled_from([k * math.pi / 4 for k in range(-4, 5)]))
lengths = st.one_of(st.just(0.0), st.floats(-2.0, 2.0))


def rotation(axis: str, angle: float) -> np.ndarray:
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    result = np.eye(4)
    result[i, i] = result[j, j] = np.cos(angle)
    result[i, j], result[j, i] = -np.sin(angle), np.sin(angle)
    return result


def translation(x: float, y: float, z: float) -> np.ndarray:
    result = np.eye(4)
    result[:3, 3] = x, y, z
    return result


@given(angles, lengths, angles, lengths, angles, lengths)
def test_placement_is_the_product_of_six_motions(gamma, b, alpha, d, theta, r) -> None:
    product = (
        rotation("z", gamma)
        @ translation(0, 0, b)
        @ rotation("x", alpha)
        @ translation(d, 0, 0)
        @ rotation("z", theta)
        @ translation(0, 0, r)
    )
    np.testing.assert_allclose(placement(gamma, b, alpha, d, theta, r), product, rtol=0, atol=1e-15 * 8)


@given(lengths, lengths, lengths, angles, angles, angles)
@example(0.3, -0.2, 0.1, math.pi, 0.0, 0.7)
@example(0.0, 0.4, 0.1, 0.0, 0.0, 0.7)
@example(0.3, -0.2, 0.1, 1e-8, 0.0, 0.7)
@example(0.3, -0.2, 0.1, 0.5, math.pi / 2, 0.7)
def test_decompose_gives_back_any_rigid_transform(x, y, z, roll, pitch, yaw) -> None:
    transform = from_roll_pitch_yaw((x, y, z), (roll, pitch, yaw))
    # A snap moves an angle by up to 1e-9 rad, hence a frame 3.5 m away by up to 4e-9 m.
    np.testing.assert_allclose(placement(*decompose(transform)), transform, rtol=0, atol=1e-8)
    assert -math.pi / 2 < decompose(transform)[0] <= math.pi / 2


@pytest.mark.parametrize("seed", range(5))
def test_decompose_without_snapping_is_exact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    transform = from_roll_pitch_yaw(rng.normal(size=3), rng.uniform(-3, 3, 3))
    np.testing.assert_allclose(placement(*decompose(transform)), transform, rtol=0, atol=1e-14)


@given(st.floats(-3, 3), st.floats(-1, 1), st.floats(-3, 3), st.floats(-1, 1))
@example(math.pi / 2, 0.45, 0.3, 0.1)
@example(math.pi, -0.45, 0.3, 0.1)
@example(0.0, 0.45, 0.3, 0.1)
@example(0.0, -0.45, 0.3, 0.0)
@example(-math.pi / 2, 0.0, math.pi, 0.35)
def test_four_parameters_suffice_where_they_can(alpha, d, theta, r) -> None:
    gamma, b, *_ = decompose(placement(0, 0, alpha, d, theta, r))
    assert (gamma, b) == (0.0, 0.0)


def test_parameters_of_a_decimal_description_come_back_exact() -> None:
    for given_parameters in [
        (0.0, 0.0, -math.pi / 2, 0.0, math.pi / 2, 0.45),
        (0.0, 0.0, 0.0, 0.45, 0.0, 0.0),
        (0.0, 0.0, math.pi / 2, 0.15, 0.0, -0.2),
    ]:
        assert decompose(placement(*given_parameters)) == pytest.approx(given_parameters, rel=0, abs=0)


def test_nearly_right_angles_and_nearly_zero_lengths_snap() -> None:
    noisy = from_roll_pitch_yaw((0.225, 3e-11, 0.0), (-1.57079632679, 0.0, 3.14159265359))
    gamma, b, alpha, d, theta, r = decompose(noisy)
    assert alpha in (-math.pi / 2, math.pi / 2)
    assert theta in (math.pi, -math.pi)
    assert (gamma, b, r) == (0.0, 0.0, 0.0)
    assert d == pytest.approx(0.225, abs=1e-12)


@given(lengths, angles, st.floats(-1.5, 1.5), angles)
@example(0.2, 0.4, math.pi / 2, 1.1)
def test_roll_pitch_yaw_round_trip(x, roll, pitch, yaw) -> None:
    transform = from_roll_pitch_yaw((x, 0.2, -0.3), (roll, pitch, yaw))
    expected = translation(x, 0.2, -0.3) @ rotation("z", yaw) @ rotation("y", pitch) @ rotation("x", roll)
    np.testing.assert_allclose(transform, expected, rtol=0, atol=1e-15 * 4)
    np.testing.assert_allclose(from_roll_pitch_yaw(*to_roll_pitch_yaw(transform)), transform, rtol=0, atol=1e-14)


def test_link_frames_follow_the_tree() -> None:
    rng = np.random.default_rng(4)
    robot = random_chain(rng, 6, tree=True)
    q = rng.uniform(-2, 2, 6)
    frames = link_frames(robot, q)
    for j, joint in enumerate(robot.joints):
        parent = frames[joint.parent] if joint.parent >= 0 else np.eye(4)
        variable = rotation("z", q[j]) if joint.revolute else translation(0, 0, q[j])
        fixed = placement(joint.gamma, joint.b, joint.alpha, joint.d, joint.theta, joint.r)
        np.testing.assert_allclose(frames[j], parent @ fixed @ variable, rtol=0, atol=1e-14)
        np.testing.assert_allclose(inverse(frames[j]) @ frames[j], np.eye(4), rtol=0, atol=1e-14)


def cloud(masses: np.ndarray, points: np.ndarray) -> Link:
    """Link of point masses (k,) at points (k, 3): inertia from its definition."""
    com = masses @ points / masses.sum()
    arms = points - com
    inertia = sum(m * (a @ a * np.eye(3) - np.outer(a, a)) for m, a in zip(masses, arms, strict=True))
    return Link(float(masses.sum()), tuple(com), tuple(inertia[np.triu_indices(3)]))


def assert_same_body(first: Link, second: Link) -> None:
    np.testing.assert_allclose(first.standard, second.standard, rtol=0, atol=1e-13)


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_a_moved_link_is_its_moved_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    masses, points = rng.uniform(0.1, 1, 5), rng.normal(size=(5, 3)) * 0.3
    transform = from_roll_pitch_yaw(rng.normal(size=3), rng.uniform(-3, 3, 3))
    moved = points @ transform[:3, :3].T + transform[:3, 3]
    assert_same_body(move_link(cloud(masses, points), transform), cloud(masses, moved))


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_merged_links_are_all_their_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    masses, points = rng.uniform(0.1, 1, 9), rng.normal(size=(9, 3)) * 0.3
    merged = merge_links(cloud(masses[:4], points[:4]), cloud(masses[4:], points[4:]))
    assert_same_body(merged, cloud(masses, points))
    assert merge_links(merged, Link()) == merged
    assert_same_body(merge_links(Link(), merged), merged)
