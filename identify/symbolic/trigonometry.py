"""Polynomials in the cosines and sines of a robot's angles, with c² + s² = 1: exact, fast, and easy to take apart.

One generator for every cosine and sine of a sum of neighbouring parallel axes, every prismatic variable, every
entry of a pose, every length kept as a letter, and every irrational number among the constants.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, Any

import numpy as np

from identify.robot.robot import Robot
from identify.symbolic.geometry import (
    POSE,
    Angle,
    angle_sum,
    differences,
    direct_geometry,
    letters,
    segments,
    trigonometric,
)

if TYPE_CHECKING:
    import sympy

Polynomial = Any
"""An element of sympy's sparse polynomial ring; sympy ships no types for it."""

PROBES = 3
"""Configurations at which a polynomial that may be zero is looked at."""


@dataclass(frozen=True)
class Algebra:
    """The ring of one robot.

    symbols: generators in order; angles: angle -> (index of its cosine, index of its sine); pairs: the same for
    every reducible pair, constants included; prismatic: joint -> index of its variable; numbers: irrational
    number behind a generator; irrational: the reverse.
    """

    robot: Robot
    ring: Any
    symbols: tuple[sympy.Symbol, ...]
    angles: dict[Angle, tuple[int, int]]
    pairs: tuple[tuple[int, int], ...]
    prismatic: dict[int, int]
    numbers: dict[sympy.Symbol, sympy.Expr]
    irrational: dict[sympy.Expr, sympy.Symbol]

    def polynomial(self, expression: sympy.Expr) -> Polynomial:
        """The expression as a reduced element of the ring."""
        return self.reduce(self.ring.from_expr(expression.xreplace(self.irrational)))

    def expression(self, polynomial: Polynomial) -> sympy.Expr:
        """The polynomial as an expression in the symbols of `trigonometric`."""
        return polynomial.as_expr().xreplace(self.numbers)

    def reduce(self, polynomial: Polynomial, pairs: Iterable[tuple[int, int]] | None = None) -> Polynomial:
        """The polynomial with s² replaced by 1 − c² for every pair, or for the given ones (indices)."""
        for c, s in self.pairs if pairs is None else pairs:
            if any(m[s] > 1 for m in polynomial):
                gens = self.ring.gens
                swap = 1 - gens[c] ** 2
                result = self.ring.zero
                by_power: dict[int, Any] = {}
                for monomial, coefficient in polynomial.terms():
                    power, odd = divmod(monomial[s], 2)
                    rest = (*monomial[:s], odd, *monomial[s + 1 :])
                    by_power.setdefault(power, self.ring.zero.copy())
                    by_power[power][rest] = by_power[power].get(rest, 0) + coefficient
                for power, part in by_power.items():
                    part.strip_zero()
                    result += part * swap**power
                polynomial = result
        return polynomial

    def generators(self, polynomial: Polynomial) -> set[int]:
        """Indices of the generators that occur."""
        return {k for monomial in polynomial for k, e in enumerate(monomial) if e}

    def split(self, polynomial: Polynomial, unknown: Sequence[int]) -> dict[tuple[int, ...], Polynomial]:
        """Coefficients by monomial of the given generators: exponents (len(unknown),) -> polynomial without them."""
        parts: dict[tuple[int, ...], Any] = {}
        for monomial, coefficient in polynomial.terms():
            key = tuple(monomial[k] for k in unknown)
            rest = list(monomial)
            for k in unknown:
                rest[k] = 0
            part = parts.setdefault(key, self.ring.zero.copy())
            part[tuple(rest)] = part.get(tuple(rest), 0) + coefficient
        for part in parts.values():
            part.strip_zero()
        return {key: part for key, part in parts.items() if part}

    def sample(self, q: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """(generators, N) values at joint positions q (N, n) and poses ⁰T_n (N, 4, 4)."""
        values = np.empty((len(self.symbols), len(q)))
        place = {symbol.name: k for k, symbol in enumerate(self.symbols)}
        for k, name in enumerate(POSE):
            values[place[name]] = pose[:, k % 3, k // 3]
        for name, value in letters(self.robot):
            if name in place:
                values[place[name]] = value
        for symbol, number in self.numbers.items():
            values[place[symbol.name]] = float(number)
        for joint, k in self.prismatic.items():
            values[k] = q[:, joint]
        for angle, (c, s) in self.angles.items():
            total = sum(sign * q[:, j] for j, sign in angle)
            values[c], values[s] = np.cos(total), np.sin(total)
        return values

    def to_joint_variables(self, expression: sympy.Expr) -> sympy.Expr:
        """Symbols C23, S23 … replaced by cos(q2 + q3), sin(q2 + q3) …."""
        return expression.xreplace(self.replacements())

    def replacements(self) -> Mapping[sympy.Symbol, sympy.Expr]:
        """C23 -> cos(q2 + q3) and the like."""
        import sympy

        found: dict[sympy.Symbol, sympy.Expr] = {}
        for angle, (c, s) in self.angles.items():
            total = angle_sum(angle)
            found[self.symbols[c]], found[self.symbols[s]] = sympy.cos(total), sympy.sin(total)
        return found

    def product(self, a: Sequence[Sequence[Any]], b: Sequence[Sequence[Any]]) -> list[list[Any]]:
        """Product of two matrices of the ring, reduced."""
        return [
            [self.reduce(sum((x * y for x, y in zip(row, column, strict=True) if x and y), self.ring.zero))
             for column in zip(*b, strict=True)]
            for row in a
        ]  # fmt: skip


@lru_cache(maxsize=16)
def algebra(robot: Robot) -> Algebra:
    """The ring for a serial robot."""
    import sympy
    from sympy.polys.domains import QQ
    from sympy.polys.rings import PolyRing

    angles: list[Angle] = []
    irrational: set[sympy.Expr] = set()
    for start, last in combinations_with_replacement(range(robot.n), 2):
        for segment, used in segments(robot, start, last):
            irrational |= _irrational([*segment.rotation, *segment.position])
            for i, key in enumerate(used):
                angles += [key, *differences(used, i)]
    symbols = [sympy.Symbol(name) for name in POSE]
    places: dict[Angle, tuple[int, int]] = {}
    for key in dict.fromkeys(sorted(angles)):
        places[key] = (len(symbols), len(symbols) + 1)
        symbols += trigonometric(key)
    prismatic = {}
    for j, joint in enumerate(robot.joints):
        if not joint.revolute:
            prismatic[j] = len(symbols)
            symbols.append(sympy.Symbol(f"q{j + 1}"))
    symbols += [sympy.Symbol(name) for name, value in letters(robot) if value]
    pairs = list(places.values())
    named: dict[sympy.Expr, sympy.Symbol] = {}
    for number in sorted(irrational, key=sympy.default_sort_key):
        named[number] = sympy.Symbol(f"_number{len(named)}")
        symbols.append(named[number])
    for number in named:
        sine = sympy.sin(*number.args) if isinstance(number, sympy.cos) else None
        if sine in named:
            pairs.append((symbols.index(named[number]), symbols.index(named[sine])))
    return Algebra(
        robot, PolyRing(symbols, QQ, sympy.lex), tuple(symbols), places, tuple(pairs), prismatic,
        {symbol: number for number, symbol in named.items()}, named,
    )  # fmt: skip


def _irrational(expressions: Iterable[sympy.Expr]) -> set[sympy.Expr]:
    """Roots, cosines and sines of numbers among the expressions."""
    import sympy

    found: set[sympy.Expr] = set()
    for expression in expressions:
        atoms = expression.atoms(sympy.Pow, sympy.cos, sympy.sin)
        found |= {atom for atom in atoms if atom.is_number and not atom.is_rational}
    return found


def probes(robot: Robot, space: Algebra) -> np.ndarray:
    """(generators, PROBES) values at fixed arbitrary configurations and the poses there: tell what is always zero."""
    rng = np.random.default_rng(20)
    q = rng.uniform(-2.5, 2.5, (PROBES, robot.n))
    return space.sample(q, direct_geometry(robot, q, robot.n - 1))


def evaluate(polynomial: Polynomial, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Value and sum of the terms' magnitudes, (N,) each, at `values` (generators, N)."""
    total, size = np.zeros(values.shape[1]), np.zeros(values.shape[1])
    for monomial, coefficient in polynomial.terms():
        term = np.full(values.shape[1], float(coefficient))
        for k, exponent in enumerate(monomial):
            if exponent:
                term = term * (values[k] if exponent == 1 else values[k] ** exponent)
        total, size = total + term, size + np.abs(term)
    return total, size
