"""Direct geometric model and orientations: the chapter's example 2.2, Pinocchio, stored values, and back again."""

from __future__ import annotations

import numpy as np
import oracle
import pinocchio as pin
import pytest
import sympy
from arms import PUMA, SCARA, placed, rx90
from beside import stored_values
from chains import random_chain

from identify.errors import InputError
from identify.robot.robot import Robot
from identify.symbolic import orientation
from identify.symbolic.geometry import direct_geometry, frames, path, symbolic_direct_geometry
from identify.symbolic.model import SymbolicModel


def numbers(model: SymbolicModel, q: np.ndarray) -> np.ndarray:
    """The model's entries at q, in their order."""
    lengths = {sympy.Symbol(name): value for name, value in model.lengths}
    entries = [expression.xreplace(lengths) for expression in model.expressions.values()]
    return np.array(sympy.lambdify([sympy.Symbol(name) for name in model.inputs], entries)(*q), dtype=float)


def test_example_2_2() -> None:
    """⁰T6 of the RX-90, typed from the chapter."""
    q = sympy.symbols("q1:7")
    d3, rl4 = sympy.symbols("D3 RL4")
    (s1, s2, _, s4, s5, s6), (c1, c2, _, c4, c5, c6) = (tuple(map(f, q)) for f in (sympy.sin, sympy.cos))
    s23, c23 = sympy.sin(q[1] + q[2]), sympy.cos(q[1] + q[2])
    chapter = {
        "sx": c1 * (c23 * (c4 * c5 * c6 - s4 * s6) - s23 * s5 * c6) - s1 * (s4 * c5 * c6 + c4 * s6),
        "sy": s1 * (c23 * (c4 * c5 * c6 - s4 * s6) - s23 * s5 * c6) + c1 * (s4 * c5 * c6 + c4 * s6),
        "sz": s23 * (c4 * c5 * c6 - s4 * s6) + c23 * s5 * c6,
        "nx": c1 * (-c23 * (c4 * c5 * s6 + s4 * c6) + s23 * s5 * s6) + s1 * (s4 * c5 * s6 - c4 * c6),
        "ny": s1 * (-c23 * (c4 * c5 * s6 + s4 * c6) + s23 * s5 * s6) - c1 * (s4 * c5 * s6 - c4 * c6),
        "nz": -s23 * (c4 * c5 * s6 + s4 * c6) - c23 * s5 * s6,
        "ax": -c1 * (c23 * c4 * s5 + s23 * c5) + s1 * s4 * s5,
        "ay": -s1 * (c23 * c4 * s5 + s23 * c5) - c1 * s4 * s5,
        "az": -s23 * c4 * s5 + c23 * c5,
        "Px": -c1 * (s23 * rl4 - c2 * d3),
        "Py": -s1 * (s23 * rl4 - c2 * d3),
        "Pz": c23 * rl4 + s2 * d3,
    }
    model = symbolic_direct_geometry(rx90())
    assert list(model.expressions) == list(chapter)
    for name, expression in chapter.items():
        assert sympy.expand(model.expressions[name] - expression) == 0, name


@pytest.mark.parametrize("forearm", [0.45, 0.52])
def test_stored_frames(forearm: float) -> None:
    known = stored_values(f"rx90-geometry-0.45-{forearm}.json")
    robot = rx90(known["RL4"])
    q = np.array(known["q"])
    np.testing.assert_allclose(direct_geometry(robot, q)[0], known["T06"], rtol=0, atol=1e-12)
    for j, frame in enumerate(frames(robot, q)[0], start=1):
        np.testing.assert_allclose(frame, known["T_partial"][f"0T{j}"], rtol=0, atol=1e-12)
        np.testing.assert_array_equal(frame, direct_geometry(robot, q, j - 1)[0])


@pytest.mark.parametrize("seed", range(8))
def test_against_pinocchio(seed: int) -> None:
    robot, model, order, positions = oracle.random_arm(seed)
    data = model.createData()
    for q in positions:
        pin.forwardKinematics(model, data, q[order])
        found = frames(robot, q)[0]
        for number, j in enumerate(order, start=1):
            np.testing.assert_allclose(found[j], data.oMi[number].homogeneous, rtol=0, atol=1e-12)
            np.testing.assert_allclose(direct_geometry(robot, q, j)[0], found[j], rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_symbols_and_numbers_agree(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = placed(random_chain(rng, 3 - seed % 2, special=seed % 2 == 0))
    bare = Robot(robot.name, robot.joints)
    between, own = symbolic_direct_geometry(robot, placed=True), symbolic_direct_geometry(robot)
    for q in rng.uniform(-2, 2, (3, robot.n)):
        for model, pose in ((between, direct_geometry(robot, q)[0]), (own, direct_geometry(bare, q)[0])):
            np.testing.assert_allclose(numbers(model, q), pose[:3].T.ravel(), rtol=0, atol=1e-12)


def test_parallel_axes_are_sums_and_right_angles_exact() -> None:
    entries = symbolic_direct_geometry(SCARA).expressions
    q1, q2, q3, q4 = sympy.symbols("q1:5")
    assert entries["Px"] == sympy.Rational(2, 5) * sympy.cos(q1) + sympy.Rational(7, 20) * sympy.cos(q1 + q2)
    assert entries["Pz"] == sympy.Rational(31, 100) - q3 - sympy.Rational(1, 20)
    assert entries["sx"] == sympy.cos(q1 + q2 - q4)
    assert not any(e.has(sympy.Float) for e in symbolic_direct_geometry(PUMA).expressions.values())


def rotations() -> np.ndarray:
    """Random rotations, and those where an orientation by three angles is singular or a quaternion part vanishes."""
    rng = np.random.default_rng(3)
    made = [orientation.from_euler(rng.uniform(-3, 3, (40, 3)))]
    quarters = np.array(np.meshgrid(*[np.arange(4)] * 3)).reshape(3, -1).T * np.pi / 2
    for tiny in (0.0, 1e-13, 1e-9, 1e-6):
        made.append(orientation.from_euler(quarters + np.array([0.3, tiny, -0.8])))
        made.append(orientation.from_roll_pitch_yaw(quarters + np.array([0.3, tiny, 0.0])))
        made.append(orientation.from_roll_pitch_yaw(quarters))
    return np.concatenate(made)


@pytest.mark.parametrize(
    ("there", "back", "tolerance"),
    [
        (orientation.euler, orientation.from_euler, 1e-12),
        (orientation.roll_pitch_yaw, orientation.from_roll_pitch_yaw, 1e-12),
        (orientation.quaternion, orientation.from_quaternion, 1e-14),
    ],
)
def test_orientations_come_back(there, back, tolerance: float) -> None:
    turns = rotations()
    coordinates = there(turns)
    assert np.all(np.isfinite(coordinates))
    np.testing.assert_allclose(back(coordinates), turns, rtol=0, atol=tolerance)


def test_orientations_mean_what_they_say() -> None:
    """Against Pinocchio's rotations about axes and its quaternions."""
    z, y, x = pin.utils.rotate("z", 0.3), pin.utils.rotate("y", -0.7), pin.utils.rotate("x", 1.9)
    np.testing.assert_allclose(orientation.roll_pitch_yaw(z @ y @ x), [0.3, -0.7, 1.9], rtol=0, atol=1e-14)
    np.testing.assert_allclose(orientation.euler(z @ x @ pin.utils.rotate("z", 2.2)), [0.3, 1.9, 2.2], atol=1e-14)
    turns = rotations()
    for turn, found in zip(turns, orientation.quaternion(turns), strict=True):
        x4 = pin.Quaternion(turn).coeffs()
        expected = np.array([x4[3], *x4[:3]])
        assert min(np.abs(found - expected).max(), np.abs(found + expected).max()) < 1e-12


def test_direction_cosines() -> None:
    pose = direct_geometry(PUMA, np.random.default_rng(0).uniform(-2, 2, (5, 6)))
    cosines = orientation.direction_cosines(pose)
    np.testing.assert_array_equal(cosines[:, 3:6], pose[:, :3, 0])
    np.testing.assert_array_equal(orientation.from_direction_cosines(cosines), pose)
    short = np.delete(cosines, [3, 4, 5], axis=1)
    np.testing.assert_allclose(orientation.from_direction_cosines(short), pose, rtol=0, atol=1e-14)


def test_bad_input_is_named() -> None:
    with pytest.raises(InputError, match=r"q has shape \(1, 5\)"):
        direct_geometry(PUMA, np.zeros(5))
    with pytest.raises(InputError, match="no link 6"):
        path(PUMA, 6)
    tree = random_chain(np.random.default_rng(1), 5, tree=True)
    with pytest.raises(InputError, match="branch"):
        symbolic_direct_geometry(tree)
