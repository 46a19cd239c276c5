"""Inverse geometry: example 2.3 of the chapter, stored solutions, every solution of random poses, singular poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy
from arms import OFFSET_SHOULDER, PUMA, SCARA, STANFORD, THREE_PARALLEL, placed, rx90
from beside import stored_values
from chains import random_chain, without

from identify.errors import InputError
from identify.robot.library import load_robot
from identify.robot.robot import Limits, Robot
from identify.symbolic.geometry import POSE, direct_geometry, letters
from identify.symbolic.inverse_geometry import differences, inverse_geometries, inverse_geometry
from identify.symbolic.inverse_model import conditions, symbolic_inverse_geometry
from identify.symbolic.paul import plan

CLOSED = [rx90(), load_robot("tx40"), STANFORD, SCARA, PUMA, OFFSET_SHOULDER, THREE_PARALLEL]


def random_positions(robot: Robot, count: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-3, 3, (count, robot.n))


def nearest(robot: Robot, q: np.ndarray, target: np.ndarray) -> float:
    return float(np.abs(differences(robot, q, np.broadcast_to(target, q.shape))).max(axis=1).min())


@pytest.mark.parametrize("forearm", [0.45, 0.52])
def test_stored_solutions(forearm: float) -> None:
    """All eight solutions of example 2.3 at one pose, and no other."""
    known = stored_values(f"rx90-geometry-0.45-{forearm}.json")
    robot = rx90(known["RL4"])
    found = inverse_geometry(robot, np.array(known["T06"]))
    q = np.array([solution.q for solution in found])
    assert len(found) == len(known["igm_all8"]) == 8
    for stored in known["igm_all8"]:
        assert nearest(robot, q, np.array(stored["q"])) < 1e-12


def test_example_2_3() -> None:
    """The formulas that the program finds are the chapter's: each is compared at poses and branches."""
    model = symbolic_inverse_geometry(rx90())
    e = model.expressions
    px, py, pz, c1, s1, d3, rl4 = sympy.symbols("Px Py Pz C1 S1 D3 RL4")
    b1 = px * c1 + py * s1
    written = {name: sympy.expand(value.subs("B2", e["B2"])) for name, value in e.items()}
    assert sympy.expand(e["B2"] - b1) == 0
    assert sympy.expand(written["X2"] + 2 * pz * d3) == 0
    assert sympy.expand(written["Y2"] + 2 * b1 * d3) == 0
    assert sympy.expand(written["Z2"] - (rl4**2 - d3**2 - pz**2 - b1**2)) == 0
    reached_by_formulas(rx90(), 5)


def reached_by_formulas(robot: Robot, count: int) -> None:
    """The named expressions alone, in their order, bring every branch of random poses to the pose."""
    model = symbolic_inverse_geometry(robot)
    functions = {}
    for name, expression in model.expressions.items():
        read = sorted(symbol.name for symbol in expression.free_symbols)
        functions[name] = (read, sympy.lambdify([sympy.Symbol(symbol) for symbol in read], expression))
    branches = [name for name in model.inputs if name not in POSE]
    assert branches
    for q in random_positions(robot, count):
        pose = direct_geometry(robot, q)[0]
        for signs in np.ndindex((2,) * len(branches)):
            values = {name: pose[k % 3, k // 3] for k, name in enumerate(POSE)} | dict(letters(robot))
            values |= {name: 2 * sign - 1 for name, sign in zip(branches, signs, strict=True)}
            for name, (read, function) in functions.items():
                values[name] = function(*(values[symbol] for symbol in read))
            found = np.array([values[f"q{j + 1}"] for j in range(robot.n)])
            np.testing.assert_allclose(direct_geometry(robot, found)[0], pose, rtol=0, atol=1e-9)


@pytest.mark.parametrize("robot", [STANFORD, SCARA, PUMA], ids=lambda r: r.name)
def test_formulas_reach_the_pose(robot: Robot) -> None:
    """With r of the first and last revolute joint zero, U0 is the pose itself."""
    ends = {0, robot.n - 1}
    joints = tuple(replace(joint, r=0.0) if k in ends else joint for k, joint in enumerate(robot.joints))
    reached_by_formulas(replace(robot, joints=joints), 2)


@pytest.mark.parametrize("robot", CLOSED, ids=lambda r: r.name)
def test_every_solution_reaches_the_pose_and_the_position_is_among_them(robot: Robot) -> None:
    for arm_ in (robot, placed(robot)):
        q = random_positions(arm_, 300)
        poses = direct_geometry(arm_, q)
        found = inverse_geometries(arm_, poses)
        assert found.method == "Paul"
        reached = direct_geometry(arm_, found.q)
        assert np.abs(reached - poses[found.pose]).max() < 1e-9
        closest = np.full(len(q), np.inf)
        np.minimum.at(closest, found.pose, np.abs(differences(arm_, found.q, q[found.pose])).max(axis=1))
        assert closest.max() < 1e-7
        counts = np.bincount(found.pose, minlength=len(q))
        assert counts.max() == (2 if robot.n == 4 else 8)


def test_types_of_equations_that_are_recognised() -> None:
    def types(robot: Robot) -> list[int]:
        return [stage.step.via or stage.step.type for stage in plan(robot).stages]

    assert types(rx90()) == [2, 8, 3, 2, 3, 3]
    assert types(STANFORD) == [2, 2, 1, 2, 3, 3]
    assert sorted(types(SCARA)) == [1, 3, 3, 8]
    assert not plan(THREE_PARALLEL).missing


def test_coefficients_of_the_fourth_degree_are_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    """No formula reads them: they stand for the joint's own, which becomes an input."""
    found = plan(rx90())
    first, *others = found.stages
    x, y, z = first.step.coefficients
    quartic = replace(first, step=replace(first.step, type=9, via=None, coefficients=(x, y, z, x, y)))
    changed = replace(found, stages=(quartic, *others))
    monkeypatch.setattr("identify.symbolic.inverse_model.plan", lambda robot: changed)
    model = symbolic_inverse_geometry(rx90())
    assert {"QCC1", "QCS1", "QC1", "QS1", "Q1"} <= model.expressions.keys()
    assert "q1" in model.inputs


def test_singular_poses_keep_the_current_value() -> None:
    robot = rx90()
    d3, rl4 = robot.joints[2].d, robot.joints[3].r
    # S23 RL4 = C2 D3: the wrist on the first axis; S5 = 0: axes 4 and 6 in one line; C3 = 0: the elbow straight.
    shoulder = np.array([0.4, 0.9, 0.0, 0.5, 0.7, -0.3])
    shoulder[2] = np.arcsin(np.cos(0.9) * d3 / rl4) - 0.9
    wrist = np.array([0.4, -0.6, 1.3, 0.5, 0.0, -0.3])
    elbow = np.array([0.4, -0.6, np.pi / 2, 0.5, 0.7, -0.3])
    both = shoulder.copy()
    both[4] = 0.0
    for q, kept in ((shoulder, [0]), (wrist, [3]), (elbow, []), (both, [0]), (np.zeros(6), [3])):
        pose = direct_geometry(robot, q)[0]
        current = q + 0.0
        found = inverse_geometry(robot, pose, current)
        assert found
        assert all(np.all(np.isfinite(s.q)) and s.residual < 1e-9 for s in found)
        assert nearest(robot, np.array([s.q for s in found]), q) < 1e-6
        for other in (0.2, -1.1):
            moved = q.copy()
            moved[kept] = other
            again = inverse_geometry(robot, pose, moved)
            assert again
            assert all(s.residual < 1e-9 for s in again)
            if kept:
                assert min(np.abs(s.q[kept] - other).max() for s in again) < 1e-12


@pytest.mark.parametrize("robot", CLOSED, ids=lambda r: r.name)
def test_poses_of_round_angles_give_numbers(robot: Robot) -> None:
    """Joint positions of multiples of a right angle are full of singular cases."""
    rng = np.random.default_rng(3)
    q = rng.integers(-2, 3, (200, robot.n)) * np.pi / 2
    sliding = np.array([not joint.revolute for joint in robot.joints])
    q[:, sliding] = rng.choice([0.0, 0.3], (200, int(sliding.sum())))
    poses = direct_geometry(robot, q)
    found = inverse_geometries(robot, poses, q)
    assert np.all(np.isfinite(found.q))
    assert found.residual.max() < 1e-9
    assert len(np.unique(found.pose)) == len(q)


def test_limits() -> None:
    """A full turn is added where it helps, and what lies outside is said."""
    robot = rx90()
    q = np.array([0.1, -0.7, 1.2, 4.2, -0.9, 0.3])
    found = inverse_geometry(robot, direct_geometry(robot, q)[0], current=q)
    assert len(found) == 8
    match = min(found, key=lambda s: np.abs(s.q - q).max())
    np.testing.assert_allclose(match.q, q, rtol=0, atol=1e-9)
    assert match.inside_limits
    for solution in found:
        inside = all(
            joint.limits.position[0] <= x <= joint.limits.position[1]
            for joint, x in zip(robot.joints, solution.q, strict=True)
        )
        assert solution.inside_limits == inside
    assert 0 < sum(s.inside_limits for s in found) < 8


def test_out_of_reach_is_no_solution() -> None:
    robot = rx90()
    pose = direct_geometry(robot, np.array([0.3, 0.2, -np.pi / 2, 0.1, 0.8, 0.2]))[0]
    pose[:3, 3] *= 1.01
    assert inverse_geometry(robot, pose) == []


def test_fewer_joints_need_a_pose_that_suits_them() -> None:
    q = np.array([0.4, 0.9, 0.1, -0.3])
    pose = direct_geometry(SCARA, q)[0]
    assert len(inverse_geometry(SCARA, pose)) == 2
    tilted = pose.copy()
    tilted[:3, :3] = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]) @ pose[:3, :3]
    assert inverse_geometry(SCARA, tilted) == []
    assert {str(e) for e in conditions(SCARA)} == {"sz", "nz", "ax", "ay", "az + 1"}
    assert "the pose must meet 2 conditions" in symbolic_inverse_geometry(SCARA).notes[-1]


def test_more_joints_say_what_is_missing() -> None:
    robot = random_chain(np.random.default_rng(4), 7, special=True)
    robot = without(robot, type="revolute", limits=Limits())
    q = np.random.default_rng(5).uniform(-2, 2, 7)
    pose = direct_geometry(robot, q)[0]
    with pytest.raises(InputError, match="leave 1 relation missing"):
        inverse_geometry(robot, pose)
    with pytest.raises(InputError, match="relation"):
        symbolic_inverse_geometry(robot)
    found = inverse_geometry(robot, pose, current=q, fixed={2: q[2]})
    assert nearest(robot, np.array([s.q for s in found]), q) < 1e-6
    assert all(np.abs(direct_geometry(robot, s.q)[0] - pose).max() < 1e-8 for s in found)


def test_numerical_search_says_so() -> None:
    robot = without(random_chain(np.random.default_rng(2), 6), type="revolute")
    q = np.random.default_rng(1).uniform(-2, 2, 6)
    found = inverse_geometry(robot, direct_geometry(robot, q)[0])
    assert {s.method for s in found} == {"numerical"}
    assert nearest(robot, np.array([s.q for s in found]), q) < 1e-6
    with pytest.raises(InputError, match="searches solutions numerically"):
        symbolic_inverse_geometry(robot)


@pytest.mark.parametrize("seed", range(12))
def test_chains_of_any_kind(seed: int) -> None:
    """One to five joints with special angles: by formula or by search, the position is found again."""
    robot = random_chain(np.random.default_rng(seed), 1 + seed % 5, special=True)
    q = random_positions(robot, 3, seed) * 0.6
    poses = direct_geometry(robot, q)
    found = inverse_geometries(robot, poses, q)
    assert found.residual.max() < 1e-9
    for k in range(3):
        assert nearest(robot, found.q[found.pose == k], q[k]) < 1e-6


def test_bad_input_is_named() -> None:
    with pytest.raises(InputError, match="no rotation"):
        inverse_geometry(PUMA, 2 * np.eye(4))
    with pytest.raises(InputError, match="not finite"):
        inverse_geometry(PUMA, np.full((4, 4), np.nan))
    with pytest.raises(InputError, match="current"):
        inverse_geometry(PUMA, np.eye(4), current=np.zeros(5))
    with pytest.raises(InputError, match="outside 0 to 5"):
        inverse_geometry(PUMA, np.eye(4), fixed={6: 0.0})
