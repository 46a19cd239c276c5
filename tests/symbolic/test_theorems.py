"""Theorems 2.1 and 2.2, typed as the chapter prints them, against what base_parameters groups by itself."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
import sympy
from chains import random_chain
from symbolic_models import tilted

from identify.robot.library import load_robot
from identify.robot.robot import LINK_PARAMETERS, Joint, Robot
from identify.symbolic.base_parameters import base_parameters

XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = range(10)


def group_revolute(k: list[np.ndarray], j: int, joint: Joint) -> None:
    """Theorem 2.1 [2.104]: YY, MZ and M of link j go to link j − 1 and XX of link j; k[j] is (10, 11 n), in place."""
    s, c, d, r = math.sin(joint.alpha), math.cos(joint.alpha), joint.d, joint.r
    yy, mz, m = k[j][YY].copy(), k[j][MZ].copy(), k[j][M].copy()
    k[j][XX] -= yy
    p = k[j - 1]
    p[XX] += yy + 2 * r * mz + r**2 * m
    p[XY] += d * s * mz + d * r * s * m
    p[XZ] += -d * c * mz - d * r * c * m
    p[YY] += c * c * yy + 2 * r * c * c * mz + (d**2 + r**2 * c * c) * m
    p[YZ] += c * s * yy + 2 * r * c * s * mz + r**2 * c * s * m
    p[ZZ] += s * s * yy + 2 * r * s * s * mz + (d**2 + r**2 * s * s) * m
    p[MX] += d * m
    p[MY] += -s * mz - r * s * m
    p[MZ] += c * mz + r * c * m
    p[M] += m


def group_prismatic(k: list[np.ndarray], j: int, joint: Joint) -> None:
    """Theorem 2.2 [2.107]: the inertia tensor of link j goes to link j − 1."""
    sa, ca, st, ct = math.sin(joint.alpha), math.cos(joint.alpha), math.sin(joint.theta), math.cos(joint.theta)
    xx, xy, xz, yy, yz, zz = (k[j][i].copy() for i in range(6))
    p = k[j - 1]
    p[XX] += ct * ct * xx - 2 * ct * st * xy + st * st * yy
    p[XY] += ct * st * ca * xx + (ct * ct - st * st) * ca * xy - ct * sa * xz - ct * st * ca * yy + st * sa * yz
    p[XZ] += ct * st * sa * xx + (ct * ct - st * st) * sa * xy + ct * ca * xz - ct * st * sa * yy - st * ca * yz
    p[YY] += (
        st * st * ca * ca * xx + 2 * ct * st * ca * ca * xy - 2 * st * ca * sa * xz
        + ct * ct * ca * ca * yy - 2 * ct * ca * sa * yz + sa * sa * zz
    )  # fmt: skip
    p[YZ] += (
        st * st * ca * sa * xx + 2 * ct * st * ca * sa * xy + st * (ca * ca - sa * sa) * xz
        + ct * ct * ca * sa * yy + ct * (ca * ca - sa * sa) * yz - ca * sa * zz
    )  # fmt: skip
    p[ZZ] += (
        st * st * sa * sa * xx + 2 * ct * st * sa * sa * xy + 2 * st * ca * sa * xz
        + ct * ct * sa * sa * yy + 2 * ct * ca * sa * yz + ca * ca * zz
    )  # fmt: skip


def expected(robot: Robot) -> dict[str, np.ndarray]:
    """{leading parameter: (11 n,) combination} of a chain whose first two joints are revolute, in general position.

    Link 1 turns about a fixed axis that gravity is not along: ZZ, MX and MY are what its motion shows, and Ia1
    goes with ZZ1.
    """
    n = robot.n
    k = [np.eye(11 * n)[11 * j : 11 * j + 10] for j in range(n)]
    for j in reversed(range(1, n)):
        (group_revolute if robot.joints[j].revolute else group_prismatic)(k, j, robot.joints[j])
    result = {}
    for j, joint in enumerate(robot.joints):
        shown = (ZZ, MX, MY) if j == 0 else (XX, XY, XZ, YZ, ZZ, MX, MY) if joint.revolute else (MX, MY, MZ, M)
        for i in shown:
            result[f"{LINK_PARAMETERS[i]}{j + 1}"] = k[j][i]
        if j:
            result[f"Ia{j + 1}"] = np.eye(11 * n)[11 * j + 10]
    result["ZZ1"][10] += 1
    return result


@pytest.mark.parametrize("seed", range(16))
def test_general_chains_group_as_the_theorems_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = tilted(random_chain(rng, 3 + seed % 4))
    types = ["revolute"] * 2 + [("prismatic", "revolute")[int(x)] for x in rng.integers(0, 2, robot.n - 2)]
    if seed % 2:
        types[2] = "prismatic"
    robot = replace(robot, joints=tuple(replace(j, type=t) for j, t in zip(robot.joints, types, strict=True)))
    base = base_parameters(robot)
    found = {re.sub(r"R(?=\d)", "", name): row for name, row in zip(base.names, base.matrix, strict=True)}
    wanted = expected(robot)
    assert found.keys() == wanted.keys()
    for name, row in wanted.items():
        np.testing.assert_allclose(found[name], row, rtol=0, atol=1e-11, err_msg=name)


def test_names_tell_what_is_regrouped() -> None:
    robot = tilted(random_chain(np.random.default_rng(3), 5))
    base = base_parameters(robot)
    for name, row in zip(base.names, base.matrix, strict=True):
        assert (np.count_nonzero(row) > 1) == bool(re.search(r"R\d", name)), name
        assert row[base.kept[base.names.index(name)]] == 1, name
    reached = {robot.standard_names[i] for i in np.flatnonzero(np.abs(base.matrix).max(axis=0))}
    kept = {robot.standard_names[i] for i in base.kept}
    assert reached == kept | set(base.regrouped)
    assert set(robot.standard_names) == reached | set(base.no_effect)
    assert not reached & set(base.no_effect)
    assert not kept & set(base.regrouped)


def test_rounding_of_a_conversion_hides_no_special_geometry() -> None:
    """Readers that turn and subtract leave 1e-16 behind; the axes are meant parallel and vertical all the same."""
    rx90 = load_robot("rx90")
    assert base_parameters(replace(rx90, gravity=(6e-16, -4e-17, -9.81))).names == base_parameters(rx90).names
    joints = (
        Joint("a"),
        Joint("b", "prismatic", 0, alpha=0.7),
        Joint("c", parent=1, alpha=-0.7, d=0.25),
        Joint("d", parent=2, alpha=1.1, d=0.1, r=0.3),
    )
    exact = Robot("tilted", joints)

    def with_third(**geometry: float) -> Robot:
        return replace(exact, joints=(*joints[:2], replace(joints[2], **geometry), joints[3]))

    rounded = with_third(alpha=math.nextafter(-0.7, 0), d=math.nextafter(0.25, 1))
    askew = with_third(alpha=-0.7001)
    assert base_parameters(rounded).names == base_parameters(exact).names
    assert len(base_parameters(askew).names) > len(base_parameters(exact).names)


def test_a_named_length_of_zero_is_zero() -> None:
    """With D3 = 0 axes 2 and 3 of the RX-90 coincide: a letter that stood for any length would see more."""
    rx90 = load_robot("rx90")
    joints = list(rx90.joints)
    joints[2] = replace(joints[2], d=0.0)
    named = base_parameters(replace(rx90, joints=tuple(joints)))
    joints[2] = replace(joints[2], symbols=())
    bare = base_parameters(replace(rx90, joints=tuple(joints)))
    assert named.grouping == bare.grouping
    assert named.names == bare.names
    letters = set().union(*(formula.free_symbols for formula in named.grouping.values()))
    assert sympy.Symbol("RL4") in letters
    assert sympy.Symbol("D3") not in letters


def test_inertias_play_no_part() -> None:
    """Robots of one geometry share one result, computed once."""
    rng = np.random.default_rng(0)
    robot = tilted(random_chain(rng, 4))
    other = replace(
        robot,
        joints=tuple(replace(j, link=random_chain(rng, 1).joints[0].link, name=j.name + "x") for j in robot.joints),
    )
    assert base_parameters(other) is base_parameters(robot)
    assert base_parameters(replace(robot, gravity=(0.0, 0.0, -9.81))) is not base_parameters(robot)
