"""Which bodies stand for the base parameters, and in which form each link is written: fewest operations win.

Many sets of standard parameters give the same base parameters, and so the same torque. A representative keeps as many
second-moment parameters as there are base parameters and puts the others to zero: a basis of the columns of
base = B·σ. The search starts from the cheapest columns, then exchanges one at a time while that saves operations, as
a mass left at a wrist does that makes a first moment vanish.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from identify.robot.robot import Drive, Limits, Link, Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.customised import SECOND_MOMENTS, Form, Motion, customised_torque
from identify.symbolic.expression import Expression, Graph, Scalar
from identify.symbolic.operations import count, lifted
from identify.symbolic.simplification import simplified

PRICE = {"Ia": 2, "SXX": 3, "SYY": 3, "SXZ": 5, "SYZ": 5, "SXY": 6, "MX": 8, "MY": 8, "SZZ": 9, "M": 20, "MZ": 30}
"""Roughly what a parameter of a link on a general axis costs in operations; decides where the search starts."""

SMALL = 1e-9
"""Entries and independent parts below this, of columns of size one, are rounding."""

WORST_CONDITION = 1e6

CHANGES = (("unturned",), ("unturned_first",), ("unturned", "unturned_first"), ("shared_squares",), ("doubled_rate",))
"""Options of a link's form that are tried together; the two unturned ones pay most in company."""


@dataclass(frozen=True)
class CustomisedModel:
    """Inverse dynamics ready to print.

    torque (n,) expressions of q1 …, dq1 …, ddq1 …, the wrench F1 F2 F3, N1 N2 N3 if asked for, and the symbols
    `parameters` (k,); these have the values matrix (k, p) @ base parameters.
    """

    torque: list[Expression]
    parameters: tuple[str, ...]
    matrix: np.ndarray


@dataclass(frozen=True)
class Representative:
    """Second-moment parameters kept (indices into 11 n), values matrix (k, p) @ base parameters, and forms (n,)."""

    kept: tuple[int, ...]
    matrix: np.ndarray
    forms: tuple[Form, ...]

    def symbols(self, graph: Graph, n: int) -> list[Scalar]:
        """(11 n,) a symbol for each parameter kept, zero for the others."""
        values: list[Scalar] = [graph.constant(0)] * (11 * n)
        for k in self.kept:
            values[k] = graph.symbol(parameter_name(k))
        return values


def parameter_name(k: int) -> str:
    """Name of the second-moment parameter of index k: "SXX1" …"""
    return f"{SECOND_MOMENTS[k % 11]}{k // 11 + 1}"


def customised_model(
    robot: Robot,
    wrench: bool = False,
    letters: bool = False,
    absent: Collection[str] = (),
    *,
    dq: bool = True,
    ddq: bool = True,
    gravity: bool = True,
) -> CustomisedModel:
    """Inverse dynamics with the base parameters, less those called `absent`, which are zero.

    `wrench`: with what the last link exerts on its surroundings. `letters`: lengths the robot names stay symbols.
    Velocities, accelerations or gravity that are switched off are zero.
    """
    chosen = representative(robot, absent)
    graph = Graph()
    motion = Motion.of(graph, robot, dq=dq, ddq=ddq, gravity=gravity, wrench=wrench)
    values = chosen.symbols(graph, robot.n)
    torque = customised_torque(graph, robot, values, motion, letters, chosen.forms)
    names = tuple(parameter_name(k) for k in chosen.kept)
    return CustomisedModel(simplified(lifted(graph, torque)), names, chosen.matrix)


def representative(robot: Robot, absent: Collection[str] = ()) -> Representative:
    """The cheapest representative found for the robot's geometry; robots that differ in nothing else share a search."""
    bare = tuple(replace(joint, name="", limits=Limits(), link=Link(), drive=Drive()) for joint in robot.joints)
    return _representative(Robot("", bare, robot.gravity), frozenset(absent))


@lru_cache(maxsize=64)
def _representative(robot: Robot, absent: frozenset[str]) -> Representative:
    base = base_parameters(robot)
    b = base.matrix @ standard_from_second_moments(robot.n)
    present = np.array([name not in absent for name in base.names])
    kept = _cheapest_basis(b)
    forms = [Form()] * robot.n
    for _ in range(2):
        forms = _best_forms(robot, _live(b, kept, present)[0], forms, shared=False)
        kept = _exchanged(robot, b, kept, present, forms)
    live, matrix = _live(b, kept, present)
    forms = _best_forms(robot, live, forms, shared=True)
    matrix.setflags(write=False)
    return Representative(tuple(live), matrix, tuple(forms))


def standard_from_second_moments(n: int) -> np.ndarray:
    """(11 n, 11 n): standard parameters = matrix @ second-moment ones; XX = SYY + SZZ, XY = −SXY …"""
    link = np.eye(11)
    for i, (a, c) in {0: (3, 5), 3: (0, 5), 5: (0, 3)}.items():
        link[i, i] = 0
        link[i, a] = link[i, c] = 1
    for i in (1, 2, 4):
        link[i, i] = -1
    return np.kron(np.eye(n), link)


def _cheapest_basis(b: np.ndarray) -> list[int]:
    """Columns that span all, cheap ones first and outer links before inner ones, where moments have less far to go."""
    order = sorted(range(b.shape[1]), key=lambda k: (PRICE[SECOND_MOMENTS[k % 11]], -k))
    kept: list[int] = []
    span = np.zeros((0, b.shape[0]))
    for k in order:
        size = np.linalg.norm(b[:, k])
        if size < SMALL:
            continue
        v = b[:, k] / size
        for _ in range(2):
            v = v - span.T @ (span @ v)
        rest = np.linalg.norm(v)
        if rest > 1e-7:
            span = np.vstack([span, v / rest])
            kept.append(k)
    return sorted(kept)


def _live(b: np.ndarray, kept: Sequence[int], present: np.ndarray) -> tuple[list[int], np.ndarray]:
    """Those kept that are not zero when only the present base parameters are, and their values' matrix."""
    inverse = np.linalg.inv(b[:, kept])
    inverse[np.abs(inverse) < 1e-13] = 0.0
    rows = np.abs(inverse[:, present]).max(axis=1, initial=0.0) > SMALL
    return [k for k, row in zip(kept, rows, strict=True) if row], inverse[rows]


def _price(robot: Robot, live: Sequence[int], forms: Sequence[Form], shared: bool) -> tuple[int, int]:
    """Operations altogether, and multiplications, with a wrench and lengths as letters; `shared`: simplified."""
    graph = Graph()
    chosen = Representative(tuple(live), np.zeros(0), tuple(forms))
    motion = Motion.of(graph, robot, wrench=True)
    torque = lifted(graph, customised_torque(graph, robot, chosen.symbols(graph, robot.n), motion, True, forms))
    counted = count(simplified(torque) if shared else torque)
    return counted.multiplications + counted.additions, counted.multiplications


def _best_forms(robot: Robot, live: Sequence[int], forms: list[Form], shared: bool) -> list[Form]:
    """Forms after changes of one link that save operations: until none does, or in one round where simplifying the
    whole model for every trial makes them dear."""
    best = _price(robot, live, forms, shared)
    changed = True
    while changed:
        changed = False
        for j in range(robot.n):
            for options in CHANGES:
                trial = list(forms)
                trial[j] = replace(trial[j], **{option: not getattr(trial[j], option) for option in options})
                price = _price(robot, live, trial, shared)
                if price < best:
                    best, forms, changed = price, trial, not shared
    return forms


def _exchanged(robot: Robot, b: np.ndarray, kept: list[int], present: np.ndarray, forms: Sequence[Form]) -> list[int]:
    """The basis after single exchanges that save operations, every column outside tried once."""
    best = _price(robot, _live(b, kept, present)[0], forms, False)
    for entering in range(b.shape[1]):
        if entering in kept or np.linalg.norm(b[:, entering]) < SMALL:
            continue
        coefficients = np.linalg.solve(b[:, kept], b[:, entering])
        for leaving in [k for k, x in zip(kept, coefficients, strict=True) if abs(x) > 1e-7]:
            trial = sorted([k for k in kept if k != leaving] + [entering])
            if np.linalg.cond(b[:, trial]) > WORST_CONDITION:
                continue
            price = _price(robot, _live(b, trial, present)[0], forms, False)
            if price < best:
                best, kept = price, trial
                break
    return kept
