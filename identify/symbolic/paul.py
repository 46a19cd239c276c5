"""Paul's method (Paul 1981, [2.14]–[2.16]): the unknowns of ⁰T_n(q) = U0 found one after the other, by the program.

Both sides are multiplied by ʲT_{j−1} from the left, and where that is not enough by the inverses of the last
transforms from the right; entries are compared, and equations of a known type are solved.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from operator import itemgetter
from typing import Any

import numpy as np

from identify.robot.robot import Robot
from identify.robot.transforms import inverse, screw_z
from identify.robot.transforms import placement as placement_of
from identify.symbolic.equations import (
    LAST_RESORT,
    MOVING,
    ROBUST,
    Equation,
    Knowledge,
    Reader,
    Step,
    Unknown,
    pairs,
    reader,
    single,
)
from identify.symbolic.geometry import POSE, Angle, segments, serial
from identify.symbolic.trigonometry import Algebra, algebra, evaluate, probes

ENTRIES = ("s", "n", "a", "P")

TERMS = 120
"""Longest entry of ⁰T_n that is worth the method: chains without special angles have none that is short."""

LONGEST = 80
"""Terms of an equation that is looked at; those of arms with right angles have up to about thirty."""


@dataclass(frozen=True)
class Core:
    """The robot without its constant screws: `robot` from the first joint's axis to the last joint's frame.

    U0 = before · (tool in the world) · after, for (4, 4) constants of [2.11], is the pose that `robot` must reach.
    """

    robot: Robot
    before: np.ndarray
    after: np.ndarray


def core(robot: Robot) -> Core:
    """Base, tool, the screw to the first axis, r of a first and of a last revolute joint taken out of the chain."""
    joints = list(serial(robot).joints)
    first = joints[0]
    r = first.r if first.revolute else 0.0
    before = np.array(robot.base) @ placement_of(first.gamma, first.b, first.alpha, first.d, 0.0, r)
    joints[0] = replace(first, gamma=0.0, b=0.0, alpha=0.0, d=0.0, r=first.r - r)
    last = joints[-1]
    r = last.r if last.revolute else 0.0
    joints[-1] = replace(last, r=last.r - r)
    after = screw_z(0.0, r) @ np.array(robot.tool)
    identity = tuple(tuple(float(i == j) for j in range(4)) for i in range(4))
    inner = replace(robot, joints=tuple(joints), base=identity, tool=identity)
    return Core(inner, inverse(before), inverse(after))


@dataclass(frozen=True)
class Derived:
    """A sum of joint variables as an integer combination of angles found earlier."""

    angle: Angle
    terms: tuple[tuple[Angle, int], ...]


@dataclass(frozen=True)
class Stage:
    """A step, the sums of angles that it settles, and the usual size of its coefficients [m or 1, as they come]."""

    step: Step
    derived: tuple[Derived, ...]
    sizes: tuple[float, ...]


@dataclass(frozen=True)
class Plan:
    """The stages that find every joint, in order.

    `missing`: joints (indices) that no known type of equation gives; empty where Paul's method finds them all.
    `conditions`: polynomials that vanish for poses the robot can reach (n < 6), free of joint variables.
    """

    core: Core
    space: Algebra
    stages: tuple[Stage, ...]
    missing: tuple[int, ...]
    conditions: tuple[Equation, ...]


Transforms = dict[tuple[int, int], list[list[Any]]]


def _transforms(space: Algebra) -> Transforms:
    """ⁱT_k for 0 ≤ i ≤ k ≤ n as matrices of the ring."""
    n, ring = space.robot.n, space.ring
    found: Transforms = {}
    for i in range(n + 1):
        for k in range(i, n + 1):
            result = [[ring.one if a == b else ring.zero for b in range(4)] for a in range(4)]
            for segment, _ in segments(space.robot, i, k - 1):
                whole = segment.rotation.row_join(segment.position).tolist()
                rows = [[space.polynomial(x) for x in row] for row in whole]
                result = space.product(result, [*rows, [ring.zero] * 3 + [ring.one]])
            found[i, k] = result
    return found


def _inverse(space: Algebra, matrix: list[list[Any]]) -> list[list[Any]]:
    """Inverse of a rigid transform of the ring."""
    turned = [[matrix[j][i] for j in range(3)] for i in range(3)]
    shifted = space.product(turned, [[-matrix[i][3]] for i in range(3)])
    ring = space.ring
    return [[*row, p[0]] for row, p in zip(turned, shifted, strict=True)] + [[ring.zero] * 3 + [ring.one]]


def _equations(space: Algebra, transforms: Transforms, extended: bool) -> Iterator[Equation]:
    """ⁱT_0 U0 ⁿT_k = ⁱT_k entry by entry: with k = n as Paul has it, or with all other k."""
    n, ring = space.robot.n, space.ring
    pose = dict(zip(POSE, ring.gens[:12], strict=True))
    u0 = [[pose[f"{c}{x}"] for c in ENTRIES] for x in "xyz"] + [[ring.zero] * 3 + [ring.one]]
    for i in range(n):
        left = space.product(_inverse(space, transforms[0, i]), u0)
        for k in range(i, n) if extended else (n,):
            both = left if k == n else space.product(left, _inverse(space, transforms[k, n]))
            sides = f"{i}T0·U0" + (f"·{n}T{k}" if k < n else "") + f" = {i}T{k}"
            for column, name in enumerate(ENTRIES):
                for row, axis in enumerate("xyz"):
                    difference = space.reduce(both[row][column] - transforms[i, k][row][column])
                    if difference and len(difference) <= LONGEST:
                        yield Equation(difference, f"{sides}, entry {name}{axis}")


def _distinct(equations: Iterator[Equation]) -> list[Equation]:
    found: dict[Any, Equation] = {}
    for equation in equations:
        if -equation.polynomial not in found:
            found.setdefault(equation.polynomial, equation)
    return list(found.values())


@lru_cache(maxsize=16)
def plan(robot: Robot) -> Plan:
    """Paul's method on a serial robot of n ≤ 6 joints."""
    inner = core(robot)
    space = algebra(inner.robot)
    look = reader(space, probes(inner.robot, space))
    transforms = _transforms(space)
    if max(len(entry) for row in transforms[0, inner.robot.n] for entry in row) > TERMS:
        return Plan(inner, space, (), tuple(range(inner.robot.n)), ())
    classic = _distinct(_equations(space, transforms, extended=False))
    further: list[Equation] | None = None
    known = Knowledge()
    stages: list[Stage] = []
    wanted: list[Unknown] = [((j, 1),) if joint.revolute else j for j, joint in enumerate(inner.robot.joints)]
    while not all(known.knows(u) for u in wanted):
        step = _next(look, classic, known, ROBUST)
        if step is None:
            if further is None:
                further = _distinct(_equations(space, transforms, extended=True))
            step = _next(look, classic + further, known, LAST_RESORT)
        if step is None:
            break
        before, known = known, known.adding(step.unknown)
        sizes = tuple(float(evaluate(c, look.values)[1].max()) for c in step.coefficients)
        stages.append(Stage(step, _derived(space, before, known), sizes))
    missing = tuple(j for j, u in enumerate(wanted) if not known.knows(u))
    conditions = tuple(_conditions(look, classic)) if inner.robot.n < 6 else ()
    return Plan(inner, space, tuple(stages), missing, conditions)


def _next(look: Reader, equations: list[Equation], known: Knowledge, limit: int) -> Step | None:
    """The safest step from one equation, or from two where no single one is safe enough."""
    alone = sorted(single(look, equations, known), key=itemgetter(0))
    if alone and alone[0][0][0] <= limit:
        return alone[0][1]
    together = sorted(pairs(look, equations, known), key=itemgetter(0))
    if together and (limit < LAST_RESORT or not alone):
        return together[0][1] if together[0][0][0] < MOVING or limit >= LAST_RESORT else None
    return None


def _derived(space: Algebra, before: Knowledge, known: Knowledge) -> tuple[Derived, ...]:
    """Sums of angles that have become known."""
    found = []
    for angle in space.angles:
        if before.combination(angle) is None:
            factors = known.combination(angle)
            if factors is not None:
                terms = tuple((a, f) for a, f in zip(known.angles, factors, strict=True) if f)
                found.append(Derived(angle, terms))
    return tuple(found)


def _conditions(look: Reader, equations: list[Equation]) -> Iterator[Equation]:
    """Equations without any joint variable."""
    for equation in equations:
        if not look.unknowns(equation.polynomial, Knowledge()):
            yield equation
