"""Which bodies stand for the base parameters, and in which form each link is written: fewest operations win.

Many sets of standard parameters give the same base parameters, and so the same torque. A representative keeps as many
second-moment parameters as there are base parameters and puts the others to zero: a basis of the columns of
base = B·σ. Forms follow from the arm's structure: parallel axes, and a last link about the origin of the link before.
One model with every parameter then tells what each set costs, by leaving out what vanishes with the parameters outside;
the search starts from the greedy basis and exchanges one parameter at a time while that saves operations, as a mass
left at a wrist does that makes a first moment vanish. Last, single changes of forms and the unit of length are tried.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from identify.robot.robot import Drive, Limits, Link, Robot
from identify.symbolic.base_parameters import base_parameters
from identify.symbolic.chain import exact_cos_sin
from identify.symbolic.customised import customised_torque, scale_of
from identify.symbolic.expression import Expression, Graph, Scalar, arguments, reachable
from identify.symbolic.form import Form, Forms, can_merge, turn_symbol, with_unequal_lengths
from identify.symbolic.motion import Motion
from identify.symbolic.operations import count, lifted, varying
from identify.symbolic.second_moments import (
    MX,
    MY,
    SECOND_MOMENTS,
    XX,
    XY,
    XZ,
    YY,
    YZ,
    parameter_name,
    standard_from_second_moments,
)
from identify.symbolic.simplification import simplified

PRICE = {"Ia": 2, "SXX": 3, "SYY": 3, "SXZ": 5, "SYZ": 5, "SXY": 6, "MX": 8, "MY": 8, "SZZ": 9, "M": 20, "MZ": 30}
"""Roughly what a parameter of a link on a general axis costs in operations; decides where the search starts."""

SMALL = 1e-9
"""Entries and independent parts below this, of columns of size one, are rounding."""

WORST_CONDITION = 1e6

CHANGES = ("shared_squares", "doubled_rate", "turned_row", "unturned", "unturned_first")
"""Options of a link's form that are tried one at a time."""

WEIGHTY = ("merged", "level", "levered", "stepped")
"""Options whose price shows after simplification alone."""

PARALLEL = ("level", "levered", "stepped")
"""Options of links behind a parallel axis."""


@dataclass(frozen=True)
class CustomisedModel:
    """Inverse dynamics as it is counted.

    torque (n,) expressions of q1 …, dq1 …, ddq1 …, the wrench F1 F2 F3, N1 N2 N3 if asked for, and the symbols
    `parameters`, whose values `values` gives.
    """

    torque: list[Expression]
    parameters: tuple[str, ...]
    chosen: Representative

    def values(self, base: np.ndarray) -> dict[str, float]:
        """The model's parameters by name, for base parameters (p,), in the unit of length of the forms."""
        return self.chosen.values(base)


@dataclass(frozen=True)
class Representative:
    """Second-moment parameters kept (indices into 11 n), their values matrix (k, p) @ base parameters, and forms."""

    kept: tuple[int, ...]
    matrix: np.ndarray
    forms: Forms

    def symbols(self, graph: Graph, n: int) -> list[Scalar]:
        """(11 n,) a symbol for each parameter kept, zero for the others."""
        values: list[Scalar] = [graph.constant(0)] * (11 * n)
        for k in self.kept:
            values[k] = graph.symbol(representative_name(k))
        return values

    def values(self, base: np.ndarray) -> dict[str, float]:
        """Parameters by name for base parameters (p,), as `customised_torque` reads them: in the forms' unit of length;
        those of a frame in `forms.turned` are the turned frame's, and the angle that it is turned by is one more."""
        unit = self.forms.unit
        found = {
            representative_name(k): float(x) * scale_of(k % 11, unit)
            for k, x in zip(self.kept, self.matrix @ base, strict=True)
        }
        for j in self.forms.turned:
            found |= _turned(j, found)
        return found


def representative_name(k: int) -> str:
    """Name of parameter k of a representative, rMX2, which is not the robot's MX2."""
    return f"r{parameter_name(k)}"


def _turned(j: int, values: Mapping[str, float]) -> dict[str, float]:
    """Parameters of link j in its frame turned about z so that MY is zero, those that are there, and the angle."""
    at = {name: values.get(f"r{name}{j + 1}", 0.0) for name in SECOND_MOMENTS}
    angle = float(np.arctan2(at["MY"], at["MX"]))
    c, s = np.cos(angle), np.sin(angle)
    axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    second = np.array([[at[f"S{min(a, b)}{max(a, b)}"] for b in "XYZ"] for a in "XYZ"])
    second, first = axes @ second @ axes.T, axes @ [at["MX"], at["MY"], at["MZ"]]
    found = {f"rS{'XYZ'[a]}{'XYZ'[b]}{j + 1}": float(second[a, b]) for a in range(3) for b in range(a, 3)}
    found |= {f"rMX{j + 1}": float(first[0]), f"rMY{j + 1}": 0.0}
    return {name: x for name, x in found.items() if name in values} | {turn_symbol(j): angle}


def customised_model(
    robot: Robot,
    wrench: bool = False,
    absent: Collection[str] = (),
    *,
    dq: bool = True,
    ddq: bool = True,
    gravity: bool = True,
) -> CustomisedModel:
    """Inverse dynamics with the base parameters, less those called `absent`, which are zero.

    `wrench`: with what the last link exerts on its surroundings. Velocities, accelerations or gravity that are switched
    off are zero.
    """
    chosen = representative(robot, absent)
    graph = Graph()
    motion = Motion.of(graph, robot, dq=dq, ddq=ddq, gravity=gravity, wrench=wrench)
    values = chosen.symbols(graph, robot.n)
    torque = customised_torque(graph, robot, values, motion, forms=chosen.forms)
    names = tuple(representative_name(k) for k in chosen.kept)
    names += tuple(turn_symbol(j) for j in chosen.forms.turned)
    return CustomisedModel(simplified(lifted(graph, torque)), names, chosen)


def representative(robot: Robot, absent: Collection[str] = ()) -> Representative:
    """The cheapest representative found for the robot's geometry; robots that differ in nothing else share a search."""
    bare = tuple(replace(joint, name="", limits=Limits(), link=Link(), drive=Drive()) for joint in robot.joints)
    return _representative(Robot("", bare, robot.gravity), frozenset(absent))


def written_with_letters(robot: Robot) -> tuple[Robot, Representative]:
    """The robot with unequal lengths to write models of with letters, and its representative with the values matrix at
    the robot's own lengths.

    Without its letters where one of them is like a name that models make of another, or where its own lengths are so
    special that they group other parameters.
    """
    letters = {name for joint in robot.joints for _, name in joint.symbols}
    if not any(name[:-1] in letters and name[-1] in "ui" for name in letters):
        arm = with_unequal_lengths(robot)
        chosen, own, other = representative(arm), base_parameters(robot), base_parameters(arm)
        if arm == robot:
            return robot, chosen
        b = (own.matrix @ standard_from_second_moments(robot.n))[:, list(chosen.kept)]
        if own.names == other.names and b.shape[0] == b.shape[1] and np.linalg.cond(b) <= WORST_CONDITION:
            return arm, replace(chosen, matrix=np.linalg.inv(b))
    arm = replace(robot, joints=tuple(replace(joint, symbols=()) for joint in robot.joints))
    return arm, representative(arm)


@lru_cache(maxsize=64)
def _representative(robot: Robot, absent: frozenset[str]) -> Representative:
    base = base_parameters(robot)
    b = base.matrix @ standard_from_second_moments(robot.n)
    present = np.array([name not in absent for name in base.names])
    forms = Forms(_structural(robot))
    kept = _exchanged(b, _cheapest_basis(b), present, _Program.of(robot, b, forms))
    live, matrix = _live(b, kept, present)
    forms = _best_forms(robot, live, forms)
    matrix.setflags(write=False)
    return Representative(tuple(live), matrix, forms)


def _structural(robot: Robot) -> tuple[Form, ...]:
    """Forms that the arm's structure suggests: links on parallel axes in axes that these do not turn, a last link that
    turns about its parent's origin as part of the parent's body."""
    forms = [Form()] * robot.n
    for j, joint in enumerate(robot.joints):
        if can_merge(robot, j):
            forms[j] = Form(merged=True)
            forms[joint.parent] = replace(forms[joint.parent], doubled_rate=True)
        before = robot.joints[joint.parent] if joint.parent >= 0 else None
        parallel = exact_cos_sin(joint.alpha)[1] == 0 and exact_cos_sin(joint.gamma)[0] == 1
        if before and before.revolute and joint.revolute and parallel:
            closed = Form(shared_squares=False, doubled_rate=True, unturned=True)
            if not forms[joint.parent].level:
                forms[joint.parent] = closed
            forms[j] = replace(closed, turned_row=True, level=True, levered=True, stepped=True)
    return tuple(forms)


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


@dataclass(frozen=True)
class _Program:
    """The model with every parameter that has an effect: nodes in order (kind, arguments) of an operation, and what
    tells how many operations are left when parameters are zero."""

    steps: list[tuple[int, str, tuple[int, ...], bool]]
    parameters: dict[int, int]
    roots: list[int]

    @staticmethod
    def of(robot: Robot, b: np.ndarray, forms: Forms) -> _Program:
        graph = Graph()
        felt = tuple(int(k) for k in np.flatnonzero(np.linalg.norm(b, axis=0) > SMALL))
        every = Representative(felt, np.zeros(0), forms)
        motion = Motion.of(graph, robot, wrench=True)
        torque = lifted(graph, customised_torque(graph, robot, every.symbols(graph, robot.n), motion, forms=forms))
        order = reachable(graph, torque)
        variable = varying(graph, order)
        steps = [(i, graph.nodes[i][0], arguments(graph.nodes[i]), i in variable) for i in order]
        at = {graph.nodes[i][1]: i for i in order if graph.nodes[i][0] == "symbol"}
        return _Program(
            steps, {k: at[name] for k in felt if (name := representative_name(k)) in at}, [e.index for e in torque]
        )

    def price(self, live: Collection[int]) -> int:
        """Operations left when the parameters outside `live` are zero."""
        zero = {i for k, i in self.parameters.items() if k not in live}
        same: dict[int, int] = {}
        for i, kind, x, _ in self.steps:
            if kind == "mul":
                if x[0] in zero or x[1] in zero:
                    zero.add(i)
            elif kind in ("add", "sub"):
                if x[0] in zero:
                    if x[1] in zero:
                        zero.add(i)
                    else:
                        same[i] = x[1]
                elif x[1] in zero:
                    same[i] = x[0]
            elif kind == "neg" and x[0] in zero:
                zero.add(i)
        needed = {i for i in self.roots if i not in zero}
        total = 0
        for i, kind, x, variable in reversed(self.steps):
            if i in needed:
                if i in same:
                    needed.add(same[i])
                    continue
                needed.update(x)
                total += variable and kind in ("add", "sub", "mul")
        return total


def _exchanged(b: np.ndarray, kept: list[int], present: np.ndarray, program: _Program) -> list[int]:
    """The basis after single exchanges that save operations, every column outside tried until none does."""
    best = program.price(_live(b, kept, present)[0])
    changed = True
    while changed:
        changed = False
        for entering in range(b.shape[1]):
            if entering in kept or np.linalg.norm(b[:, entering]) < SMALL:
                continue
            coefficients = np.linalg.solve(b[:, kept], b[:, entering])
            for leaving in [k for k, x in zip(kept, coefficients, strict=True) if abs(x) > 1e-7]:
                trial = sorted([k for k in kept if k != leaving] + [entering])
                price = program.price(_live(b, trial, present)[0])
                if price < best and np.linalg.cond(b[:, trial]) <= WORST_CONDITION:
                    best, kept, changed = price, trial, True
                    break
    return kept


def _price(robot: Robot, live: Sequence[int], forms: Forms, shared: bool = False) -> tuple[int, int]:
    """Operations altogether, and multiplications, with a wrench, before simplification or `shared`: after it."""
    graph = Graph()
    chosen = Representative(tuple(live), np.zeros(0), forms)
    motion = Motion.of(graph, robot, wrench=True)
    torque = lifted(graph, customised_torque(graph, robot, chosen.symbols(graph, robot.n), motion, forms=forms))
    counted = count(simplified(torque) if shared else torque)
    return counted.multiplications + counted.additions, counted.multiplications


def _best_forms(robot: Robot, live: Sequence[int], forms: Forms) -> Forms:
    """Forms, unit of length and turned frames after changes that save operations, each tried once."""
    lengths = {abs(x) for joint in robot.joints for x in (joint.d, joint.r, joint.b)} - {0.0}
    units = sorted(lengths) if all(joint.revolute for joint in robot.joints) else []
    best = _price(robot, live, forms)
    for trial in [replace(forms, unit=unit) for unit in units]:
        price = _price(robot, live, trial)
        if price < best:
            best, forms = price, trial
    for shared, options in ((False, CHANGES), (True, WEIGHTY)):
        best = _price(robot, live, forms, shared)
        for j in range(robot.n):
            for option in options:
                form = forms.links[j]
                vain = form.merged if option in CHANGES else option in PARALLEL and not form.level
                if vain or (option == "merged" and not can_merge(robot, j)):
                    continue
                changed = replace(form, **{option: not getattr(form, option)})
                trial = replace(forms, links=(*forms.links[:j], changed, *forms.links[j + 1 :]))
                price = _price(robot, live, trial, shared)
                if price < best:
                    best, forms = price, trial
    turned = [j for j in range(robot.n) if forms.links[j].merged and _can_turn({k - 11 * j for k in live})]
    return replace(forms, turned=tuple(turned))


def _can_turn(live: Collection[int]) -> bool:
    """Whether both first moments across the axis are there, and what a turn mixes is there as a whole or not at all."""
    mixed = ({XX, XY, YY}, {XZ, YZ})
    return {MX, MY} <= set(live) and all(len(group & set(live)) in (0, len(group)) for group in mixed)
