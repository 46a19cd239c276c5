"""Types of equations in Paul's method, recognised in polynomials of cosines, sines and lengths.

The numbers are those of Khalil & Dombre's catalogue, with θi, θj angles (or sums of angles of parallel axes), r a
length and the rest known:

1   X r = Y                                5   X1 Sθi = Y1 + Z1 r, X2 Cθi = Y2 + Z2 r
2   X Sθi + Y Cθi = Z                      6   W Sθj = X Cθi + Y Sθi + Z1, W Cθj = X Sθi − Y Cθi + Z2
3   two equations of type 2 in one θi      7   the same with W1 Cθj + W2 Sθj and W1 Sθj − W2 Cθj on the left
4   X1 r Sθi = Y1, X2 r Cθi = Y2           8   X Cθi + Y C(θi+θj) = Z1, X Sθi + Y S(θi+θj) = Z2

Types 4 to 8 are brought to an equation in one unknown by eliminating the other; where that is of the second
degree in Cθi and Sθi it is of type 9, and of type 10 where it is of the second degree in r.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from identify.symbolic.geometry import Angle, canonical
from identify.symbolic.trigonometry import Algebra, Polynomial, evaluate

Unknown = Angle | int
"""What an equation is solved for: an angle, or the variable of a prismatic joint (its index)."""

ALWAYS_ZERO = 1e-9
"""Share of its terms' magnitude below which a polynomial counts as zero at a probe."""


@dataclass(frozen=True)
class Equation:
    """polynomial = 0; `origin` says which entry of which matrix it is."""

    polynomial: Polynomial
    origin: str


@dataclass(frozen=True)
class Step:
    """One unknown found.

    type: as the module lists; coefficients, as polynomials in what is known by then: (X, Y) of every equation of
    type 1; (X, Y, Z) of type 2; (X1, Y1, Z1, X2, Y2, Z2) of type 3; of type 9 those of C², C S, C, S, 1; of type 10
    those of r², r, 1. `via`: the type that was recognised before elimination, and what was eliminated; `parts`:
    known sums that the coefficients are made of and that are worth a name.
    """

    type: int
    unknown: Unknown
    coefficients: tuple[Polynomial, ...]
    origin: str
    via: int | None = None
    eliminated: Unknown | None = None
    parts: tuple[Polynomial, ...] = ()


@dataclass(frozen=True)
class Knowledge:
    """What has been found so far: angles and prismatic joints."""

    angles: tuple[Angle, ...] = ()
    lengths: tuple[int, ...] = ()

    def combination(self, angle: Angle, more: Sequence[Angle] = ()) -> tuple[int, ...] | None:
        """Integer factors of the known angles (and `more`) that sum up to the angle, None if there are none."""
        own = [*self.angles, *more]
        joints = sorted({j for a in (*own, angle) for j, _ in a})
        if not own:
            return None
        matrix = np.zeros((len(joints), len(own)))
        for k, a in enumerate(own):
            for j, s in a:
                matrix[joints.index(j), k] = s
        right = np.zeros(len(joints))
        for j, s in angle:
            right[joints.index(j)] = s
        factors = np.round(np.linalg.lstsq(matrix, right, rcond=None)[0])
        return tuple(int(f) for f in factors) if np.array_equal(matrix @ factors, right) else None

    def knows(self, unknown: Unknown) -> bool:
        """Whether its value follows from what is known."""
        return unknown in self.lengths if isinstance(unknown, int) else self.combination(unknown) is not None

    def adding(self, unknown: Unknown) -> Knowledge:
        """What is known once this unknown is, too."""
        if isinstance(unknown, int):
            return Knowledge(self.angles, (*self.lengths, unknown))
        return Knowledge((*self.angles, unknown), self.lengths)


@dataclass(frozen=True)
class Reader:
    """Reads equations of one algebra; `values` (generators, k) are the probes that tell zero from not zero."""

    space: Algebra
    values: np.ndarray
    owner: dict[int, Unknown]

    def is_zero(self, polynomial: Polynomial) -> bool:
        """Zero at one probe at least: not safe to divide by."""
        if not polynomial:
            return True
        value, size = evaluate(polynomial, self.values)
        return bool(np.any(np.abs(value) <= ALWAYS_ZERO * size))

    def vanishes(self, polynomial: Polynomial) -> bool:
        """Zero at every probe: zero for every pose that the robot reaches."""
        if not polynomial:
            return True
        value, size = evaluate(polynomial, self.values)
        return bool(np.all(np.abs(value) <= ALWAYS_ZERO * size))

    def clean(self, polynomial: Polynomial) -> Polynomial:
        """The polynomial, or zero where it vanishes at every probe."""
        return self.space.ring.zero if self.vanishes(polynomial) else polynomial

    def is_constant(self, polynomial: Polynomial) -> bool:
        """Free of joint variables and of the pose."""
        moving = set(self.owner) | set(range(12))
        return not self.space.generators(polynomial) & moving

    def indices(self, unknown: Unknown) -> tuple[int, ...]:
        """Generators that stand for the unknown: of an angle, its cosine and sine."""
        return (self.space.prismatic[unknown],) if isinstance(unknown, int) else self.space.angles[unknown]

    def unknowns(self, polynomial: Polynomial, known: Knowledge) -> list[Unknown]:
        """What the polynomial holds and is not known, shortest sums of angles first."""
        found = {self.owner[k] for k in self.space.generators(polynomial) if k in self.owner}
        left = [u for u in found if not known.knows(u)]
        return sorted(left, key=lambda u: (0, ((u, 1),)) if isinstance(u, int) else (len(u), u))

    def rewritten(self, polynomial: Polynomial, known: Knowledge) -> tuple[Polynomial, list[Unknown]] | None:
        """The polynomial in independent unknowns, None where sums of angles can't be separated."""
        unknowns = self.unknowns(polynomial, known)
        kept: list[Unknown] = []
        rules = []
        for u in unknowns:
            angles = [k for k in kept if not isinstance(k, int)]
            if isinstance(u, int) or known.combination(u, angles) is None:
                kept.append(u)
                continue
            rule = self._by_difference(u, angles, known)
            if rule is None:
                return None
            rules += rule
        if rules:
            polynomial = self.space.reduce(polynomial.compose(rules))
        return polynomial, kept

    def _by_difference(self, angle: Angle, kept: Sequence[Angle], known: Knowledge) -> list[tuple] | None:
        """Cosine and sine of the angle by those of a kept angle and of a known one."""
        gens = self.space.ring.gens
        for other in kept:
            for sign in (1, -1):
                rest = dict(angle)
                for j, s in other:
                    rest[j] = rest.get(j, 0) - sign * s
                key, sense = canonical(rest)
                if key in self.space.angles and known.knows(key):
                    (c, s), (co, so), (ck, sk) = (
                        tuple(gens[k] for k in self.space.angles[a]) for a in (angle, other, key)
                    )
                    return [(c, co * ck - sign * sense * so * sk), (s, sign * so * ck + sense * co * sk)]
        return None


def reader(space: Algebra, values: np.ndarray) -> Reader:
    """The reader of an algebra, with values (generators, k) of its generators at k probes."""
    owner: dict[int, Unknown] = {k: angle for angle, pair in space.angles.items() for k in pair}
    owner.update({k: j for j, k in space.prismatic.items()})
    return Reader(space, values, owner)


Rank = tuple[int, int, int]
"""Preference of a step: how safe it is (0 best), lowest joint first, fewest terms."""

ROBUST, LAST_RESORT = 4, 6
EXACT, FIXED, MOVING = 0, 1, 2
"""What an elimination divides by: nothing that moves and it keeps lengths; a constant; something that may vanish."""

SECOND_DEGREE = 5
LONG = 60
"""Terms before squaring beyond which an elimination gives formulas that nobody wants to compute."""


def single(look: Reader, equations: Sequence[Equation], known: Knowledge) -> Iterator[tuple[Rank, Step]]:
    """Steps from equations in one unknown: types 1, 2, 3."""
    linear: dict[Unknown, list[tuple[Equation, tuple[Any, ...]]]] = {}
    for equation in equations:
        form = look.rewritten(equation.polynomial, known)
        if form is None or len(form[1]) != 1:
            continue
        unknown = form[1][0]
        parts = _linear(look, form[0], unknown)
        if parts is not None:
            linear.setdefault(unknown, []).append((equation, parts))
    for unknown, found in linear.items():
        yield from _type_1(look, unknown, found) if isinstance(unknown, int) else _types_2_3(look, unknown, found)


def _linear(look: Reader, polynomial: Polynomial, unknown: Unknown) -> tuple[Any, ...] | None:
    """(X, Y) of X r = Y, or (X, Y, Z) of X S + Y C = Z, cleaned; None for other forms."""
    indices = look.indices(unknown)
    parts = {key: look.clean(part) for key, part in look.space.split(polynomial, indices).items()}
    parts = {key: part for key, part in parts.items() if part}
    none = look.space.ring.zero
    if isinstance(unknown, int):
        return (parts[(1,)], -parts.get((0,), none)) if set(parts) <= {(1,), (0,)} and (1,) in parts else None
    if not set(parts) <= {(1, 0), (0, 1), (0, 0)} or not set(parts) & {(1, 0), (0, 1)}:
        return None
    return parts.get((0, 1), none), parts.get((1, 0), none), -parts.get((0, 0), none)


def _terms(polynomials: Sequence[Any]) -> int:
    return sum(len(p) for p in polynomials)


def _type_1(look: Reader, joint: int, found: Sequence[tuple[Equation, tuple[Any, ...]]]) -> Iterator[tuple[Rank, Step]]:
    for equation, parts in found:
        if look.is_constant(parts[0]):
            yield (0, joint, _terms(parts)), Step(1, joint, parts, equation.origin)
    # Several equations together stay regular where one factor passes through zero.
    flat = tuple(p for _, parts in found for p in parts)
    origin = "; ".join(equation.origin for equation, _ in found)
    yield (3 if len(found) > 1 else 5, joint, _terms(flat)), Step(1, joint, flat, origin)


def _types_2_3(
    look: Reader, angle: Angle, found: Sequence[tuple[Equation, tuple[Any, ...]]]
) -> Iterator[tuple[Rank, Step]]:
    first = angle[0][0]
    for equation, (x, y, z) in found:
        if look.is_zero(x) and look.is_zero(y):
            continue
        safety = 2 if not z else 4 if x and y else 6
        yield (safety, first, _terms((x, y, z))), Step(2, angle, (x, y, z), equation.origin)
    for (one, a), (two, b) in combinations(found, 2):
        det = look.space.reduce(a[0] * b[1] - a[1] * b[0])
        if look.is_zero(det):
            continue
        safety = 1 if look.is_constant(det) else 3
        yield (safety, first, _terms((*a, *b))), Step(3, angle, (*a, *b), f"{one.origin}; {two.origin}")


def pairs(look: Reader, equations: Sequence[Equation], known: Knowledge) -> Iterator[tuple[Rank, Step]]:
    """Steps from two equations in the same two unknowns: types 4 to 8, and what their elimination leaves."""
    groups: dict[tuple, list[tuple[Equation, Any]]] = {}
    for equation in equations:
        form = look.rewritten(equation.polynomial, known)
        if form is not None and len(form[1]) == 2:
            groups.setdefault(tuple(form[1]), []).append((equation, form[0]))
    for (u, v), found in groups.items():
        for (one, p), (two, q) in combinations(found, 2):
            for keep, drop in ((u, v), (v, u)):
                eliminate: Callable = _without_length if isinstance(drop, int) else _without_angle
                for number, quality, left in eliminate(look, p, q, keep, drop):
                    step = _after_elimination(look, left, keep, drop, number, f"{one.origin}; {two.origin}")
                    if step is not None:
                        step = replace(step, parts=_known_parts(look, (p, q), u, v))
                        first = keep if isinstance(keep, int) else keep[0][0]
                        yield (quality + (SECOND_DEGREE if step.type > 2 else 0), first, len(left)), step


def _known_parts(look: Reader, polynomials: Sequence[Any], u: Unknown, v: Unknown) -> tuple[Polynomial, ...]:
    """Sums of several terms that hold neither unknown."""
    unknown = (*look.indices(u), *look.indices(v))
    none = look.space.ring.zero
    rests = (look.space.split(p, unknown).get((0,) * len(unknown), none) for p in polynomials)
    return tuple(rest for rest in rests if len(rest) > 1)


def _without_length(look: Reader, p: Any, q: Any, keep: Unknown, drop: Unknown) -> Iterator[tuple[int, int, Any]]:
    """Types 4 and 5: both equations linear in r, which is eliminated."""
    index = look.indices(drop)
    one, two = look.space.split(p, index), look.space.split(q, index)
    none = look.space.ring.zero
    if max(one)[0] == 1 == max(two)[0]:
        left = one[(1,)] * two.get((0,), none) - two[(1,)] * one.get((0,), none)
        constant = look.is_constant(one[(1,)]) and look.is_constant(two[(1,)])
        yield (5, EXACT, look.space.reduce(left)) if constant else (4, FIXED, look.space.reduce(left))


def _without_angle(look: Reader, p: Any, q: Any, keep: Unknown, drop: Unknown) -> Iterator[tuple[int, int, Any]]:
    """Types 6, 7, 8 (5 where r is kept): C and S of the angle by the other unknown, then C² + S² = 1."""
    space = look.space
    one, two = _linear(look, p, drop), _linear(look, q, drop)
    own = set(look.indices(keep))
    if one is None or two is None:
        return
    (b1, a1, f1), (b2, a2, f2) = one, two
    if any(space.generators(x) & own for x in (a1, b1, a2, b2)):
        return
    det = space.reduce(a1 * b2 - a2 * b1)
    if look.is_zero(det):
        return
    number = 7 if (a1 and b1) or (a2 and b2) else 6
    if isinstance(keep, int):
        number = 5
    elif not isinstance(drop, int) and {j for j, _ in keep} & {j for j, _ in drop}:
        number = 8
    norm = space.reduce(a1**2 + b1**2)
    if not space.reduce(norm - a2**2 - b2**2) and not space.reduce(a1 * a2 + b1 * b2):
        # Known cosines and sines stay as they are: (C1 Px + S1 Py)² is easier to read than its reduced form.
        own_pair = () if isinstance(keep, int) else (space.angles[keep],)
        squares = space.reduce(f1**2 + f2**2 - norm, own_pair)
        yield number, EXACT if look.is_constant(norm) else MOVING, squares
    elif max(len(b2) * len(f1) + len(b1) * len(f2), len(a1) * len(f2) + len(a2) * len(f1)) <= LONG:
        quality = FIXED if look.is_constant(det) else MOVING
        yield number, quality, space.reduce((b2 * f1 - b1 * f2) ** 2 + (a1 * f2 - a2 * f1) ** 2 - det**2)


def _after_elimination(look: Reader, left: Any, keep: Unknown, drop: Unknown, number: int, origin: str) -> Step | None:
    """The equation left = 0 in one unknown as a step."""
    parts = {k: look.clean(p) for k, p in look.space.split(left, look.indices(keep)).items()}
    parts = {k: p for k, p in parts.items() if p}
    none = look.space.ring.zero
    if not any(any(key) for key in parts):
        return None
    if isinstance(keep, int):
        if set(parts) <= {(1,), (0,)}:
            return Step(1, keep, (parts[(1,)], -parts.get((0,), none)), origin, number, drop)
        if set(parts) <= {(2,), (1,), (0,)}:
            return Step(10, keep, tuple(parts.get((e,), none) for e in (2, 1, 0)), origin, number, drop)
        return None
    if set(parts) <= {(1, 0), (0, 1), (0, 0)}:
        x, y, z = parts.get((0, 1), none), parts.get((1, 0), none), -parts.get((0, 0), none)
        return Step(2, keep, (x, y, z), origin, number, drop)
    keys = ((2, 0), (1, 1), (1, 0), (0, 1), (0, 0))
    if set(parts) <= set(keys):
        return Step(9, keep, tuple(parts.get(key, none) for key in keys), origin, number, drop)
    return None
