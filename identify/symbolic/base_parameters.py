"""Base parameters of any chain or tree of revolute and prismatic joints, exactly.

The energy functions of link j follow from its parent's: h_j = h_p · λ_j(q_j) + q̇_j · η_j [2.94]. A combination
Σ h_k K_k + ½ q̇_k² Ia_k is constant, so that its parameters leave the model untouched [2.98], exactly when
for each link, from the tips inwards, h_j K_j + ½ q̇_j² Ia_j depends on neither q_j nor q̇_j; it then equals
h_p · λ_j(0) K_j and is handed to the parent. These K_j form a linear space S_j, which needs only two facts
about the parent: the span W of its energy functions and the span T of its velocities. Both follow by the same
recurrence from the base, where h_0 = −[0 … 0, 0g, 0]. All this is linear algebra over the field of rational
functions of the lengths, so that nothing is rounded and no rule has to be known for special geometries:
theorems 2.1 and 2.2 and the particular groupings (no effect, parallel axes, axes along gravity) are what comes out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from math import pi, tan
from typing import Any

import numpy as np
import sympy
from sympy.polys.domains import QQ
from sympy.polys.matrices import DomainMatrix
from sympy.polys.rings import PolyElement, ring

from identify.robot.robot import LINK_PARAMETERS, LINK_UNITS, Drive, Joint, Limits, Link, Robot, Vector
from identify.symbolic.chain import Mat, Vec, matmul, place, quarter_turns, transpose
from identify.symbolic.energy import inertia_transform

ELIMINATED_FIRST = {
    "revolute": ("Ia", "M", "MZ", "YY", "MY", "MX", "XX", "XY", "XZ", "YZ", "ZZ"),
    "prismatic": ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MZ", "MY", "MX", "M", "Ia"),
}
"""Which parameter of a relation is regrouped into the others, first choice first: the chapter's for revolute
joints; for prismatic ones, masses move inwards, so that every sum of masses has plus signs."""

ORDER = (*LINK_PARAMETERS, "Ia")
XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M, IA = range(11)

DIGITS = 12
"""Decimals of lengths [m], angles [rad] and gravity [m/s²] that count: what rounding adds in a conversion must not
make parallel axes skew, or tilt an axis out of the vertical."""

Rows = list[list[Any]]

Relation = tuple[int, dict[int, Any], dict[int, Any]]
"""One eliminated parameter of a link: its index, {other parameter of the link: coefficient in the relation},
{parameter of the parent: coefficient handed on}."""


@dataclass(frozen=True)
class BaseParameters:
    """The base parameters of a robot.

    names (p,) in the chapter's notation, R where something was regrouped (XXR3); grouping {name: formula in
    plain symbols, standard parameters and lengths}; units (p,); kept (p,) index of each one's leading standard
    parameter in Robot.standard_names, whose regressor column is the base parameter's; matrix (p, 11 n):
    base = matrix @ robot.standard; no_effect and regrouped: the standard parameters that are not kept.
    """

    names: tuple[str, ...]
    grouping: dict[str, sympy.Expr]
    units: tuple[str, ...]
    kept: tuple[int, ...]
    matrix: np.ndarray
    no_effect: tuple[str, ...]
    regrouped: tuple[str, ...]


def base_parameters(robot: Robot) -> BaseParameters:
    """Base parameters of `robot`, with actuator inertia on every joint.

    Exact: lengths the robot names stay letters, whatever their values, unless these are zero. They follow from
    the geometry and the direction of gravity alone; robots that differ in nothing else share one computation.
    """
    geometry = (replace(joint, name="", limits=Limits(), link=Link(), drive=Drive()) for joint in robot.joints)
    return _base_parameters(tuple(geometry), robot.gravity)


@dataclass(frozen=True)
class _Field:
    """The field all is computed in: rationals, surds of the angles, and the named lengths."""

    domain: Any
    letters: dict[str, Any]
    values: dict[str, float]

    def length(self, joint: Joint, key: str) -> Any:
        """A length of the joint: its letter where it has one, or else the number."""
        letter = dict(joint.symbols).get(key)
        return self.letters[letter] if letter in self.letters else self.number(getattr(joint, key))

    def number(self, value: float) -> Any:
        """The number as a fraction, as it is written in decimals."""
        return self.domain.convert(QQ(*Fraction(repr(round(float(value), DIGITS))).as_integer_ratio()))

    def cos_sin(self, angle: float) -> tuple[Any, Any]:
        """Exact (cos, sin): multiples of π/12 as surds, others through a rational half-angle tangent,
        so that cos² + sin² = 1 holds exactly."""
        k = quarter_turns(angle)
        if k is not None:
            return tuple(self.domain.convert(QQ(x)) for x in ((1, 0), (0, 1), (-1, 0), (0, -1))[k])  # type: ignore[return-value]
        twelfth = _twelfths(angle)
        if twelfth is not None:
            exact = sympy.pi * twelfth / 12
            return tuple(self.domain.from_sympy(f(exact)) for f in (sympy.cos, sympy.sin))  # type: ignore[return-value]
        t = QQ(*Fraction(tan(round(angle, DIGITS) / 2)).limit_denominator(10**12).as_integer_ratio())
        return self.domain.convert((1 - t * t) / (1 + t * t)), self.domain.convert(2 * t / (1 + t * t))

    def constant_part(self, joint: Joint) -> tuple[Mat, Vec]:
        """Rotation and translation from the parent's frame to R_j where the variable, θ or r as a whole, is zero."""
        gamma, alpha = self.cos_sin(joint.gamma), self.cos_sin(joint.alpha)
        b, d = self.length(joint, "b"), self.length(joint, "d")
        if joint.revolute:
            return place(gamma, b, alpha, d, (self.domain.one, self.domain.zero), self.length(joint, "r"))
        return place(gamma, b, alpha, d, self.cos_sin(joint.theta), self.domain.zero)


def _twelfths(angle: float) -> int | None:
    """The angle in units of π/12 where it is a whole number of them and no quarter turn, else None."""
    k = round(angle * 12 / pi)
    return k % 24 if abs(angle - k * pi / 12) < 1e-9 and k % 6 else None


def _field(joints: Sequence[Joint]) -> _Field:
    values = {name: x for joint in joints for key, name in joint.symbols if (x := float(getattr(joint, key)))}
    twelfths = {k for j in joints for a in (j.alpha, j.gamma, j.theta * (not j.revolute)) if (k := _twelfths(a))}
    surds = [sympy.sqrt(2)] * any(k % 3 == 0 or k % 2 for k in twelfths)
    surds += [sympy.sqrt(3)] * any(k % 2 == 0 or k % 3 for k in twelfths)
    domain = QQ.algebraic_field(*surds) if surds else QQ
    if not values:
        return _Field(domain, {}, {})
    domain = domain.frac_field(*(sympy.Symbol(name) for name in values))
    return _Field(domain, dict(zip(values, domain.gens, strict=True)), values)


@lru_cache(maxsize=64)
def _base_parameters(joints: tuple[Joint, ...], gravity: Vector) -> BaseParameters:
    field = _field(joints)
    relations = _relations(joints, gravity, field)
    n, zero = len(joints), field.domain.zero
    # current[j][k]: what stands for parameter k of link j by now, {standard parameter: coefficient}.
    current: list[list[dict[int, Any]]] = [[{11 * j + k: field.domain.one} for k in range(11)] for j in range(n)]
    eliminated: set[int] = set()
    for j in reversed(range(n)):
        for pivot, relation, handed in relations[j]:
            moved = current[j][pivot]
            for k, coefficient in relation.items():
                _accumulate(current[j][k], moved, -coefficient)
            if joints[j].parent >= 0:
                for k, coefficient in handed.items():
                    _accumulate(current[joints[j].parent][k], moved, coefficient)
            eliminated.add(11 * j + pivot)
    kept = [i for i in range(11 * n) if i not in eliminated]
    symbols = [sympy.Symbol(f"{p}{j + 1}") for j in range(n) for p in ORDER]
    names, grouping, matrix, units = [], {}, np.zeros((len(kept), 11 * n)), []
    for row, i in enumerate(kept):
        j, k = divmod(i, 11)
        combination = {c: x for c, x in current[j][k].items() if x != zero}
        name = f"{ORDER[k]}{'R' if len(combination) > 1 else ''}{j + 1}"
        names.append(name)
        units.append((*LINK_UNITS, "kg·m²" if joints[j].revolute else "kg")[k])
        grouping[name] = sympy.Add(*(field.domain.to_sympy(x) * symbols[c] for c, x in combination.items()))
        for c, x in combination.items():
            matrix[row, c] = _number(field, x)
    matrix.setflags(write=False)
    used = {c for row in matrix for c in np.flatnonzero(row)}
    lost = [i for i in sorted(eliminated) if i not in used]
    return BaseParameters(
        names=tuple(names),
        grouping=grouping,
        units=tuple(units),
        kept=tuple(kept),
        matrix=matrix,
        no_effect=tuple(str(symbols[i]) for i in lost),
        regrouped=tuple(str(symbols[i]) for i in sorted(eliminated) if i in used),
    )


def _relations(joints: Sequence[Joint], gravity: Vector, field: _Field) -> list[list[Relation]]:
    """What each joint eliminates, by the recurrence of the spans W (rows of `energy`) and T (rows of `velocity`)."""
    domain = field.domain
    half = domain.one / domain.convert(2)
    base_energy = _matrix([[0] * MX + [field.number(-x) for x in gravity] + [0]], domain)
    base_velocity = DomainMatrix.zeros((0, 6), domain)
    energy: list[DomainMatrix] = []
    velocity: list[DomainMatrix] = []
    relations = []
    for joint in joints:
        energy_powers, velocity_powers = _variable_part(joint.revolute)
        fixed = field.constant_part(joint)
        carried = _matrix(inertia_transform(*fixed), domain)
        w = (energy[joint.parent] if joint.parent >= 0 else base_energy) * carried
        t = velocity[joint.parent] if joint.parent >= 0 else base_velocity
        t = t * _matrix(_velocity_transform(*fixed), domain).transpose()
        # Coefficients of each power of the variable in h_p · λ_j, and in the velocity that q̇_j does not make.
        static = [w * power.convert_to(domain) for power in energy_powers]
        passed = DomainMatrix.vstack(*(t * power.convert_to(domain) for power in velocity_powers))
        linear = passed * ETA[joint.type].convert_to(domain)
        square = DomainMatrix({0: {ZZ if joint.revolute else M: half}}, (1, 10), domain)
        moving = DomainMatrix.vstack(*static[1:], linear)
        without_drive = DomainMatrix.zeros((moving.shape[0], 1), domain)
        constraints = DomainMatrix.vstack(
            DomainMatrix.hstack(moving, without_drive),
            DomainMatrix.hstack(square, DomainMatrix({0: {0: half}}, (1, 1), domain)),
        )
        still = carried * energy_powers[0].convert_to(domain)
        relations.append(_eliminated(constraints, [ORDER.index(name) for name in ELIMINATED_FIRST[joint.type]], still))
        own = DomainMatrix({0: {2 if joint.revolute else 5: domain.one}}, (1, 6), domain)
        velocity.append(_row_space(DomainMatrix.vstack(passed, own)))
        energy.append(_row_space(DomainMatrix.vstack(*static, linear, square)))
    return relations


ETA = {
    "revolute": DomainMatrix({0: {2: QQ(1)}, 1: {4: QQ(1)}, 2: {5: QQ(1)}, 3: {7: QQ(-1)}, 4: {6: QQ(1)}}, (6, 10), QQ),
    "prismatic": DomainMatrix({0: {7: QQ(1)}, 1: {6: QQ(-1)}, 5: {9: QQ(1)}}, (6, 10), QQ),
}
"""η_j [2.96] as a matrix: (ω, V) of link j, less what q̇_j makes of it, times it is the part of η_j free of q̇_j."""


@lru_cache(maxsize=2)
def _variable_part(revolute: bool) -> tuple[tuple[DomainMatrix, ...], tuple[DomainMatrix, ...]]:
    """Coefficients of λ (10, 10), and of the row-wise velocity transform (6, 6), of a turn or shift by the variable q:
    of 1, cos q, sin q, cos q·sin q, cos² q (revolute) or of 1, q, q² (prismatic)."""
    powers: tuple[tuple[int, ...], ...]
    if revolute:
        _, c, s = ring("c,s", QQ)
        moved = place((1, 0), 0, (1, 0), 0, (c, s), 0)
        powers = ((0, 0), (1, 0), (0, 1), (1, 1), (2, 0))
    else:
        _, r = ring("r", QQ)
        moved = place((1, 0), 0, (1, 0), 0, (1, 0), r)
        powers = ((0,), (1,), (2,))

    def coefficients(rows: Rows) -> tuple[DomainMatrix, ...]:
        found: dict[tuple[int, ...], dict[int, dict[int, Any]]] = {power: {} for power in powers}
        for i, row in enumerate(rows):
            for k, entry in enumerate(row):
                terms = dict(entry) if isinstance(entry, PolyElement) else {powers[0]: QQ(entry)}
                if (0, 2) in terms:  # sin² = 1 − cos²
                    square = terms.pop((0, 2))
                    terms[0, 0] = terms.get((0, 0), 0) + square
                    terms[2, 0] = terms.get((2, 0), 0) - square
                for power, x in terms.items():
                    if x:
                        found[power].setdefault(i, {})[k] = x
        return tuple(DomainMatrix(entries, (len(rows), len(rows)), QQ) for entries in found.values())

    return coefficients(inertia_transform(*moved)), tuple(
        m.transpose() for m in coefficients(_velocity_transform(*moved))
    )


def _velocity_transform(rotation: Mat, position: Vec) -> Rows:
    """(6, 6) matrix that takes (ω, V) of the parent to (Aᵀω, Aᵀ(V + ω×P)) of the child."""
    back = transpose(rotation)
    x, y, z = position
    minus_hat: Mat = ((0, z, -y), (-z, 0, x), (y, -x, 0))
    lower = matmul(back, minus_hat)
    return [[*row, 0, 0, 0] for row in back] + [[*left, *right] for left, right in zip(lower, back, strict=True)]


def _matrix(rows: Rows, domain: Any) -> DomainMatrix:
    """Sparse matrix over the domain: most entries of robots as they are built are zero."""
    entries = {i: {k: domain.convert(x) for k, x in enumerate(row) if x} for i, row in enumerate(rows)}
    return DomainMatrix({i: row for i, row in entries.items() if row}, (len(rows), len(rows[0])), domain)


def _row_space(rows: DomainMatrix) -> DomainMatrix:
    """A basis, in reduced echelon form, of the span of the rows."""
    reduced, pivots = rows.rref()
    return reduced.extract(range(len(pivots)), range(rows.shape[1]))


def _eliminated(constraints: DomainMatrix, order: list[int], still: DomainMatrix) -> list[Relation]:
    """The null space of the constraints, each basis vector with one eliminated parameter of coefficient 1."""
    null = constraints.extract(range(constraints.shape[0]), order).nullspace()
    reduced, pivots = null.rref()
    found = []
    for at, pivot in enumerate(pivots):
        vector = {order[c]: x for c, x in enumerate(reduced.extract([at], range(11)).to_list()[0]) if x}
        body = DomainMatrix({k: {0: x} for k, x in vector.items() if k != IA}, (10, 1), constraints.domain)
        handed = {k: row[0] for k, row in enumerate((still * body).to_list()) if row[0]}
        del vector[order[pivot]]
        found.append((order[pivot], vector, handed))
    return found


def _accumulate(target: dict[int, Any], source: dict[int, Any], factor: Any) -> None:
    for k, x in source.items():
        target[k] = target[k] + factor * x if k in target else factor * x


def _number(field: _Field, x: Any) -> float:
    """A field element as a number, at the lengths' values."""
    if not field.letters:
        return float(field.domain.to_sympy(x))
    parts = []
    for polynomial in (x.numer, x.denom):
        total = 0.0
        for powers, coefficient in polynomial.terms():
            term = float(polynomial.ring.domain.to_sympy(coefficient))
            for value, power in zip(field.values.values(), powers, strict=True):
                term *= value**power
            total += term
        parts.append(total)
    return parts[0] / parts[1]
