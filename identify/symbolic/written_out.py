"""Lagrange's terms of a small arm as a textbook has them: written out in cosines and sines, each coefficient short."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

from identify.symbolic.expression import Expression
from identify.symbolic.geometry import canonical, trigonometric
from identify.symbolic.model import CORIOLIS, entry_name
from identify.symbolic.naming import harmonic, named

if TYPE_CHECKING:
    import sympy

Wave = tuple[tuple[int, int], ...]
"""A sum of multiples of joint variables: (joint index, factor) by index."""

ROUNDING = 1e-14
"""Share of the largest coefficient below which a decimal one is rounding."""


@dataclass(frozen=True)
class Angles:
    """Symbols C2 S2 C23 … with the functions they stand for and the angles these are of."""

    functions: dict[sympy.Symbol, sympy.Expr]
    waves: dict[sympy.Symbol, Wave]

    def short(self, expression: sympy.Expr) -> sympy.Expr:
        """The expression with the coefficient of every product of parameters, lengths and rates as short as it gets."""
        import sympy

        own = sorted(self.functions, key=lambda s: s.name)
        others = sorted(expression.free_symbols - set(own), key=lambda s: s.name)
        if not others:
            return self._shortest(expression)
        parts = sympy.Poly(expression, *others).terms()
        return sympy.Add(
            *(self._shortest(c) * sympy.Mul(*(x**k for x, k in zip(others, m, strict=True))) for m, c in parts)
        )

    def _shortest(self, coefficient: sympy.Expr) -> sympy.Expr:
        import sympy

        best = sympy.expand(coefficient)
        for c in self.functions:
            s = sympy.Symbol("S" + c.name[1:])
            if c.name.startswith("C"):
                both = (sympy.expand(best.xreplace({x**2: 1 - y**2})) for x, y in ((s, c), (c, s)))
                best = min(best, *both, key=_length)
        sums = self._as_sums(best) if self.functions else None
        return best if sums is None or _length(sums) >= _length(best) else sums

    def _as_sums(self, coefficient: sympy.Expr) -> sympy.Expr | None:
        """Products of cosines and sines as sums, which are unique; None if they are of angles that have no symbol."""
        import sympy

        own = sorted(self.functions, key=lambda s: s.name)
        total: dict[Wave, sympy.Expr] = {}
        for powers, factor in sympy.Poly(coefficient, *own).terms():
            part: dict[Wave, sympy.Expr] = {(): factor}
            for symbol, power in zip(own, powers, strict=True):
                for _ in range(power):
                    part = self._times(part, symbol)
            for wave, value in part.items():
                total[wave] = total.get(wave, 0) + value
        largest = max((abs(complex(x)) for x in total.values()), default=0.0)
        written: sympy.Expr = sympy.Integer(0)
        known = {wave: symbol for symbol, wave in self.waves.items() if symbol.name.startswith("C")}
        for wave, value in total.items():
            if abs(complex(value)) <= ROUNDING * largest:
                continue
            if not wave:
                written += sympy.re(value)
            elif wave[0][1] > 0:
                if wave not in known:
                    return None
                c = known[wave]
                written += 2 * sympy.re(value) * c - 2 * sympy.im(value) * sympy.Symbol("S" + c.name[1:])
        return written

    def _times(self, part: Mapping[Wave, sympy.Expr], symbol: sympy.Symbol) -> dict[Wave, sympy.Expr]:
        """A sum of exponentials e^{i·wave} times the cosine or sine that the symbol stands for."""
        import sympy

        even = symbol.name.startswith("C")
        result: dict[Wave, sympy.Expr] = {}
        for wave, value in part.items():
            for sign in (1, -1):
                shifted = dict(wave)
                for j, k in self.waves[symbol]:
                    shifted[j] = shifted.get(j, 0) + sign * k
                key = tuple(sorted((j, k) for j, k in shifted.items() if k))
                result[key] = result.get(key, 0) + value * (sympy.Rational(1, 2) if even else -sign * sympy.I / 2)
        return result


def _length(expression: sympy.Expr) -> tuple[int, int]:
    import sympy

    return len(sympy.Add.make_args(expression)), int(expression.count_ops())


def written_out(
    n: int, inertia: Mapping[tuple[int, int], Expression], potential: Expression, others: Mapping[str, Expression]
) -> dict[str, sympy.Expr]:
    """A11 … from the upper triangle, U, the others, then C11 … by [2.49] and Q1 … by [2.50], without intermediate
    variables but cosines and sines."""
    import sympy

    names = {entry_name("A", n, i, k): e for (i, k), e in inertia.items()}
    outputs = names | {"U": potential} | dict(others)
    whole: dict[str, sympy.Expr] = {}
    calls: set[sympy.Expr] = set()
    for name, expression in named(outputs).items():
        if expression.atoms(sympy.cos, sympy.sin) and name not in outputs:
            calls |= expression.atoms(sympy.cos, sympy.sin)
        whole[name] = expression.xreplace({sympy.Symbol(k): e for k, e in whole.items()})
    functions: dict[sympy.Symbol, sympy.Expr] = {}
    waves: dict[sympy.Symbol, Wave] = {}
    read_angles = sorted({call.args[0] for call in calls}, key=lambda a: sorted(harmonic(a).items()))
    # Products of cosines and sines may be those of a sum or difference: C2 C4 - S2 S4 is C24.
    sums = [
        angle + s * other
        for angle, other in combinations(read_angles, 2)
        for s in (1, -1)
        if not angle.free_symbols & other.free_symbols
    ]
    for angle in (*read_angles, *sums):
        wave, sign = canonical(harmonic(angle))
        for symbol, function in zip(trigonometric(wave), (sympy.cos, sympy.sin), strict=True):
            functions.setdefault(symbol, function(sign * angle))
            waves[symbol] = wave
    angles = Angles(functions, waves)
    back = {e: symbol for symbol, e in functions.items()}
    found = {name: angles.short(whole[name].xreplace(back)) for name in outputs}

    def derivative(expression: sympy.Expr, j: int) -> sympy.Expr:
        return sympy.diff(expression.xreplace(functions), sympy.Symbol(f"q{j + 1}")).xreplace(back)

    every = [(i, k) for i in range(n) for k in range(n)]
    entry = {(i, k): found[entry_name("A", n, min(i, k), max(i, k))] for i, k in every}
    slope = {(i, k, m): derivative(entry[i, k], m) for i, k in every for m in range(n)}
    rates = sympy.symbols([f"dq{m + 1}" for m in range(n)])
    for i, k in every:
        symbols = ((slope[i, k, m] + slope[i, m, k] - slope[k, m, i]) / 2 for m in range(n))
        found[entry_name(CORIOLIS, n, i, k)] = sympy.Add(
            *(angles.short(x) * r for x, r in zip(symbols, rates, strict=True))
        )
    found |= {f"Q{j + 1}": angles.short(derivative(found["U"], j)) for j in range(n)}
    read = set().union(*(e.free_symbols for e in found.values()))
    return {symbol.name: e for symbol, e in functions.items() if symbol in read} | found
