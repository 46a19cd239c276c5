"""Cosine and sine as additions and multiplications: the same bits from NumPy, C and Python, on every machine.

Library functions differ in their last bit, and from one build of NumPy to the next; IEEE sums and products don't. The
angle is taken to within π/4 of the nearest quarter turn, π/2 in three parts (Cody & Waite 1980), and the Taylor series
summed there, to the last bit or the one before. Beyond 10⁶ rad the error is that of an angle wrong in its last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial

from identify.symbolic.expression import ARITHMETIC, Expression, reachable

QUARTER = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
"""π/2 as a sum: the first two have 33 bits, so that 20-bit multiples of them are exact."""

QUARTERS_PER_RADIAN = 0.6366197723675814

ROUNDING = 1.5 * 2.0**52
"""Added and taken away again, it rounds to the nearest integer."""


def as_arithmetic(outputs: Sequence[Expression]) -> list[Expression]:
    """The same values with every cosine and sine written out, in the same graph."""
    if not outputs:
        return []
    graph = outputs[0].graph
    made: dict[int, Expression] = {}
    circles: dict[int, tuple[Expression, Expression]] = {}
    for i in reachable(graph, outputs):
        kind, *rest = graph.nodes[i]
        match kind:
            case "constant" | "symbol":
                made[i] = Expression(graph, i)
            case "cos" | "sin":
                x = made[rest[0]]
                if x.index not in circles:
                    circles[x.index] = cosine_and_sine(x)
                made[i] = circles[x.index][kind == "sin"]
            case _:
                made[i] = ARITHMETIC[kind](*(made[k] for k in rest))
    return [made[e.index] for e in outputs]


def cosine_and_sine(x: Expression) -> tuple[Expression, Expression]:
    """Both functions of x [rad], in sums and products alone."""
    turns = _rounded(x * QUARTERS_PER_RADIAN)
    r = x
    for part in QUARTER:
        r = r - turns * part
    square = r * r
    cosine = 1 - square * 0.5 + square * square * _series(square, range(4, 18, 2))
    sine = r + r * square * _series(square, range(3, 19, 2))
    # turns = 4·a + 2·b + c with b and c in {0, 1}: an odd turn swaps the two, two turns change both signs.
    half = _rounded(turns * 0.5 - 0.25)
    odd = turns - half * 2
    even = 1 - odd
    sign = 1 - (half - _rounded(half * 0.5 - 0.25) * 2) * 2
    return sign * (even * cosine - odd * sine), sign * (even * sine + odd * cosine)


def _rounded(x: Expression) -> Expression:
    return (x + ROUNDING) - ROUNDING


def taylor(powers: range) -> list[float]:
    """Coefficients ±1 / power! of these powers, even ones of cosine and odd ones of sine."""
    return [(-1) ** (power // 2) / factorial(power) for power in powers]


def _series(square: Expression, powers: range) -> Expression:
    """Σ of the Taylor terms of these powers, divided by the least of them, by Horner's rule in the angle's square."""
    terms = taylor(powers)
    total: Expression = square.graph.constant(terms[-1])
    for term in reversed(terms[:-1]):
        total = total * square + term
    return total
