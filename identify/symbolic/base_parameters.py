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
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import pi, tan
from typing import Any

import numpy as np
import sympy
from sympy.polys.domains import QQ
from sympy.polys.matrices import DomainMatrix

from identify.robot.robot import LINK_PARAMETERS, LINK_UNITS, Joint, Robot
from identify.symbolic.chain import Mat, Vec, place, quarter_turns, transpose
from identify.symbolic.energy import inertia_transform

ELIMINATED_FIRST = {
    "revolute": ("Ia", "M", "MZ", "YY", "MY", "MX", "XX", "XY", "XZ", "YZ", "ZZ"),
    "prismatic": ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MZ", "MY", "MX", "M", "Ia"),
}
"""Which parameter of a relation is regrouped into the others, first choice first: the chapter's for revolute joints; for
prismatic ones, masses move inwards, so that every sum of masses has plus signs."""

ORDER = (*LINK_PARAMETERS, "Ia")
XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M, IA = range(11)

Rows = list[list[Any]]


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
    """Base parameters of `robot` with actuator inertia on every joint; exact, lengths as letters where it names them."""
    return _base_parameters(robot.joints, robot.gravity)


@dataclass(frozen=True)
class _Field:
    """The field all is computed in: rationals, surds of the angles, and the named lengths."""

    domain: Any
    letters: dict[str, Any]
    values: dict[str, float]

    def length(self, joint: Joint, key: str) -> Any:
        names = dict(joint.symbols)
        return self.letters[names[key]] if key in names else self.number(getattr(joint, key))

    def number(self, value: float) -> Any:
        return self.domain.convert(QQ(*Fraction(repr(float(value))).as_integer_ratio()))

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
        t = QQ(*Fraction(tan(angle / 2)).limit_denominator(10**12).as_integer_ratio())
        return self.domain.convert((1 - t * t) / (1 + t * t)), self.domain.convert(2 * t / (1 + t * t))


def _twelfths(angle: float) -> int | None:
    """The angle in units of π/12 where it is a whole number of them and no quarter turn, else None."""
    k = round(angle * 12 / pi)
    return k % 24 if abs(angle - k * pi / 12) < 1e-9 and k % 6 else None


def _field(joints: Sequence[Joint]) -> _Field:
    values = {name: float(getattr(joint, key)) for joint in joints for key, name in joint.symbols}
    twelfths = {k for j in joints for a in (j.alpha, j.gamma, j.theta * (not j.revolute)) if (k := _twelfths(a))}
    surds = [sympy.sqrt(2)] * any(k % 3 == 0 or k % 2 for k in twelfths)
    surds += [sympy.sqrt(3)] * any(k % 2 == 0 or k % 3 for k in twelfths)
    domain = QQ.algebraic_field(*surds) if surds else QQ
    if not values:
        return _Field(domain, {}, {})
    domain = domain.frac_field(*(sympy.Symbol(name) for name in values))
    return _Field(domain, dict(zip(values, domain.gens, strict=True)), values)


@lru_cache(maxsize=64)
def _base_parameters(joints: tuple[Joint, ...], gravity: Vec) -> BaseParameters:
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


def _relations(joints: Sequence[Joint], gravity: Vec, field: _Field) -> list[list[tuple[int, dict, dict]]]:
    """Per joint, for each parameter it eliminates: (its index, {kept parameter of the same link: coefficient in
    the relation}, {parameter of the parent: coefficient handed on})."""
    domain = field.domain
    zero, one, half = domain.zero, domain.one, domain.one / domain.convert(QQ(2))
    energy: list[Rows] = []
    velocity: list[Rows] = []
    relations = []
    base_energy = [[zero] * MX + [field.number(-x) for x in gravity] + [zero]]
    for joint in joints:
        fixed, fixed_velocity, powers, velocity_powers = _powers(joint, field)
        w = energy[joint.parent] if joint.parent >= 0 else base_energy
        t = velocity[joint.parent] if joint.parent >= 0 else []
        w, t = _product(w, fixed, domain), _product(t, transposed(fixed_velocity), domain)
        here = [row for p in velocity_powers for row in _product(t, transposed(p), domain)]
        constraints = [row + [zero] for p in powers[1:] for row in _product(w, p, domain)]
        constraints += [[*_velocity_row(joint.revolute, row, zero), zero] for row in here]
        half_squares = [zero] * 11
        half_squares[ZZ if joint.revolute else M] = half
        half_squares[IA] = half
        constraints.append(half_squares)
        order = [ORDER.index(name) for name in ELIMINATED_FIRST[joint.type]]
        relations.append(_reduced(constraints, order, _product(fixed, powers[0], domain), domain))
        # Velocity and energy functions of this link span what all powers of cos q, sin q or q make of the parent's.
        own = [zero] * 6
        own[2 if joint.revolute else 5] = one
        velocity.append(_row_space([*here, own], domain))
        spanned = [row for p in powers for row in _product(w, p, domain)]
        spanned += [_velocity_row(joint.revolute, row, zero) for row in here] + [half_squares[:IA]]
        energy.append(_row_space(spanned, domain))
    return relations


def _powers(joint: Joint, field: _Field) -> tuple[Rows, Rows, list[Rows], list[Rows]]:
    """The constant part of the joint's transform, of energies (10, 10) and velocities (6, 6), and the coefficients of
    the variable part: of 1, cos q, sin q, cos q·sin q, cos² q (revolute) or 1, q, q² (prismatic)."""
    domain = field.domain
    zero, one = domain.zero, domain.one
    gamma, alpha = field.cos_sin(joint.gamma), field.cos_sin(joint.alpha)
    b, d = field.length(joint, "b"), field.length(joint, "d")
    still = (one, zero)
    if joint.revolute:
        fixed = place(gamma, b, alpha, d, still, field.length(joint, "r"))
        samples = [place(still, zero, still, zero, cs, zero) for cs in _points(domain)]
        weights = _CIRCLE
    else:
        fixed = place(gamma, b, alpha, d, field.cos_sin(joint.theta), zero)
        samples = [place(still, zero, still, zero, still, domain.convert(QQ(k))) for k in (0, 1, -1)]
        weights = _LINE
    energies = [inertia_transform(*s) for s in samples]
    velocities = [_velocity_transform(*s) for s in samples]
    combine = lambda matrices: [_combination(row, matrices, domain) for row in weights]  # noqa: E731
    return (
        _converted(inertia_transform(*fixed), domain),
        _converted(_velocity_transform(*fixed), domain),
        combine(energies),
        combine(velocities),
    )


# Five points of the circle that tell 1, c, s, cs, c² apart, and the weights that read the coefficients off.
_ANGLES = ((1, 0), (-1, 0), (0, 1), (0, -1), (Fraction(3, 5), Fraction(4, 5)))
_CIRCLE = sympy.Matrix([[1, c, s, c * s, c * c] for c, s in _ANGLES]).inv().tolist()
_LINE = sympy.Matrix([[1, r, r * r] for r in (0, 1, -1)]).inv().tolist()


def _points(domain: Any) -> list[tuple[Any, Any]]:
    return [tuple(domain.convert(QQ(*Fraction(x).as_integer_ratio())) for x in cs) for cs in _ANGLES]  # type: ignore[misc]


def _combination(weights: Sequence, matrices: Sequence[Rows], domain: Any) -> Rows:
    total = None
    for weight, matrix in zip(weights, matrices, strict=True):
        factor = domain.convert(QQ(weight.p, weight.q))
        scaled = [[factor * domain.convert(x) for x in row] for row in matrix]
        total = (
            scaled
            if total is None
            else [[a + b for a, b in zip(r, s, strict=True)] for r, s in zip(total, scaled, strict=True)]
        )
    assert total is not None
    return total


def _velocity_transform(rotation: Mat, position: Vec) -> Rows:
    """(6, 6) matrix that takes (ω, V) of the parent to (Aᵀω, Aᵀ(V + ω×P)) of the child."""
    back = transpose(rotation)
    x, y, z = position
    minus_hat = ((0, z, -y), (-z, 0, x), (y, -x, 0))
    rows: Rows = [[*row, 0, 0, 0] for row in back]
    for row in back:
        rows.append([sum(row[k] * minus_hat[k][c] for k in range(3)) for c in range(3)] + list(row))
    return rows


def _velocity_row(revolute: bool, t: Sequence, zero: Any) -> list[Any]:
    """(10,) η_j [2.96] as a row, from the part (6,) of link j's velocity that q̇_j does not make."""
    if revolute:
        return [zero, zero, t[0], zero, t[1], t[2], t[4], -t[3], zero, zero]
    return [zero] * MX + [-t[1], t[0], zero, t[5]]


def _converted(rows: Sequence[Sequence], domain: Any) -> Rows:
    return [[domain.convert(x) for x in row] for row in rows]


def transposed(rows: Rows) -> Rows:
    return [list(column) for column in zip(*rows, strict=True)]


def _product(a: Rows, b: Rows, domain: Any) -> Rows:
    if not a:
        return []
    shape_a, shape_b = (len(a), len(a[0])), (len(b), len(b[0]))
    return (DomainMatrix(a, shape_a, domain) * DomainMatrix(b, shape_b, domain)).to_list()


def _row_space(rows: Rows, domain: Any) -> Rows:
    """A basis, in reduced echelon form, of the span of the rows."""
    reduced, pivots = DomainMatrix(rows, (len(rows), len(rows[0])), domain).rref()
    return reduced.to_list()[: len(pivots)]


def _reduced(constraints: Rows, order: list[int], constant: Rows, domain: Any) -> list[tuple[int, dict, dict]]:
    """The null space of the constraints, each basis vector with one eliminated parameter of coefficient 1."""
    permuted = [[row[k] for k in order] for row in constraints]
    null = DomainMatrix(permuted, (len(permuted), 11), domain).nullspace()
    if not null.shape[0]:
        return []
    reduced, pivots = null.rref()
    found = []
    for row, pivot in zip(reduced.to_list(), pivots, strict=False):
        relation = {order[c]: x for c, x in enumerate(row) if x and c != pivot}
        whole = [[domain.zero] for _ in range(10)]
        for c, x in enumerate(row):
            if order[c] != IA:
                whole[order[c]] = [x]
        handed = {k: x[0] for k, x in enumerate(_product(constant, whole, domain)) if x[0]}
        found.append((order[pivot], relation, handed))
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
