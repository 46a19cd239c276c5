"""Base parameters: the chapter's RX-90, the SVD rank of another derivation, and special geometries."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy
from beside import stored_values
from chains import random_chain

from identify.robot.library import load_robot
from identify.robot.robot import Joint, Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.expression import Expression, Graph
from identify.symbolic.newton_euler import direct_torque
from identify.symbolic.printing import compiled


def standard_regressor(robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(N, n, 11 n) by the backward Newton-Euler recurrence, one unit parameter at a time."""
    n, m = robot.n, 11 * robot.n
    graph = Graph()
    torque = direct_torque(graph, robot, [graph.symbol(f"k{i}") for i in range(m)])
    names = [f"{p}{j + 1}" for p in ("q", "dq", "ddq") for j in range(n)] + [f"k{i}" for i in range(m)]
    outputs = [e if isinstance(e, Expression) else graph.constant(e) for e in torque]
    function, rows = compiled("torque", {name: i for i, name in enumerate(names)}, outputs)
    result = np.empty((len(q), n, m))
    for i in range(m):
        unit = np.zeros((m, len(q)))
        unit[i] = 1
        out = np.empty((n, len(q)))
        function(np.vstack([q.T, dq.T, ddq.T, unit]), out, np.empty((rows, len(q))))
        result[:, :, i] = out.T
    return result


def states(rng: np.random.Generator, n: int, count: int = 60) -> np.ndarray:
    return rng.uniform(-2, 2, (3, count, n))


def test_rx90_is_table_2_2() -> None:
    oracle = stored_values("rx90-base-parameters.json")
    base = base_parameters(load_robot("rx90"))
    assert base.names == tuple(name.replace("IA", "Ia") for name in oracle["order"])
    assert set(base.no_effect) == set(oracle["no_effect"])
    assert set(base.regrouped) == {name.replace("IA", "Ia") for name in oracle["eliminated_by_grouping"]}
    for name in base.names:
        formula = oracle["grouping"].get(name.replace("Ia", "IA"), name).replace("IA", "Ia")
        assert sympy.expand(base.grouping[name] - sympy.sympify(formula)) == 0, name
        assert all(type(s) is sympy.Symbol for s in base.grouping[name].free_symbols)


@pytest.mark.parametrize("seed", range(200))
def test_count_is_the_rank_and_nothing_is_lost(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, 2 + seed % 6, special=seed % 4 != 0, tree=seed % 5 == 4)
    base = base_parameters(robot)
    full = standard_regressor(robot, *states(rng, robot.n))
    flat = full.reshape(-1, full.shape[2])
    scale = np.linalg.norm(flat, axis=0)
    scale[scale < 1e-9] = 1.0
    singular = np.linalg.svd(flat / scale, compute_uv=False)
    assert len(base.names) == int((singular > 1e-10 * singular[0]).sum())
    reduced = full[:, :, list(base.kept)] @ base.matrix
    assert np.abs(reduced - full).max() <= 1e-10 * np.abs(full).max()


def test_matrix_is_the_grouping_at_unequal_lengths() -> None:
    robot = load_robot("rx90")
    joints = list(robot.joints)
    joints[3] = replace(joints[3], r=0.52)
    robot = replace(robot, joints=tuple(joints))
    base = base_parameters(robot)
    values = dict(zip(robot.standard_names, robot.standard, strict=True)) | {"D3": 0.45, "RL4": 0.52}
    by_formula = [float(base.grouping[name].subs(values)) for name in base.names]
    np.testing.assert_allclose(base.matrix @ robot.standard, by_formula, rtol=1e-13)


def arm(*rows: tuple, gravity: tuple = (0.0, 0.0, -9.81)) -> Robot:
    """A serial arm from (type, alpha in quarter turns, d, r, theta in quarter turns) rows."""
    joints = [
        Joint(
            f"j{k}",
            "revolute" if kind == "R" else "prismatic",
            k - 1,
            alpha=turns * math.pi / 2,
            d=d,
            r=r,
            theta=(*theta, 0)[0] * math.pi / 2,
        )
        for k, (kind, turns, d, r, *theta) in enumerate(rows)
    ]
    return Robot("arm", tuple(joints), gravity)


@pytest.mark.parametrize(
    ("robot", "count"),
    [
        (arm(("P", 0, 0, 0), ("P", 1, 0, 0, 1), ("P", 1, 0, 0)), 4),
        (arm(("R", 0, 0, 0), ("R", 0, 0.4, 0), ("P", 0, 0.3, 0), ("R", 0, 0, 0)), 11),
        (arm(("R", 0, 0, 0), ("R", -1, 0, 0.2), ("P", 1, 0, 0), ("R", 0, 0, 0), ("R", -1, 0, 0), ("R", 1, 0, 0)), 37),
        (arm(("R", 0, 0, 0), ("R", 0, 0.5, 0), ("R", 0, 0.4, 0)), 9),
        (arm(("R", 0, 0, 0), ("R", 0, 0.5, 0), ("R", 0, 0.4, 0), gravity=(0.0, -9.81, 0.0)), 11),
        (arm(*(("R", (0, 1, -1, 1, -1, 1, -1)[k], 0, (0, 0, 0.4, 0, 0.4, 0, 0)[k]) for k in range(7))), 48),
    ],
    ids=["PPP", "SCARA RRPR", "Stanford", "planar 3R in a horizontal plane", "planar 3R in a vertical plane", "7R"],
)
def test_known_counts(robot: Robot, count: int) -> None:
    assert len(base_parameters(robot).names) == count


def test_gravity_and_length_of_the_rx90() -> None:
    robot = load_robot("rx90")
    assert len(base_parameters(replace(robot, gravity=(0.0, -9.81, 0.0))).names) == 42
    assert len(base_parameters(replace(robot, joints=robot.joints[:3])).names) == 16


def test_angles_that_add_up_to_a_right_angle_are_exact() -> None:
    """Two turns of π/4 in one plane make an axis along gravity: only surds, no rational angle, show it."""
    eighth = math.pi / 4
    joints = (
        Joint("a", "revolute", -1),
        Joint("b", "prismatic", 0, alpha=eighth),
        Joint("c", "revolute", 1, alpha=-eighth, d=0.3),
        Joint("d", "prismatic", 2, alpha=math.pi / 3),
        Joint("e", "revolute", 3, alpha=-math.pi / 3, d=0.2),
    )
    robot = Robot("folded", joints)
    rng = np.random.default_rng(5)
    full = standard_regressor(robot, *states(rng, 5)).reshape(-1, 55)
    singular = np.linalg.svd(full, compute_uv=False)
    base = base_parameters(robot)
    assert len(base.names) == int((singular > 1e-10 * singular[0]).sum())
    generic = replace(robot, joints=(*joints[:2], replace(joints[2], alpha=-0.7), *joints[3:]))
    assert len(base_parameters(generic).names) > len(base.names)
