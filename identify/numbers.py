"""How reports write numbers: never more digits than are known, never a zero that isn't one.

A value with a standard deviation σ shows σ with two significant digits and the value to the same place
(the convention of the Guide to the Expression of Uncertainty in Measurement, JCGM 100:2008, 7.2.6).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_HALF_EVEN, Decimal

DASH = "—"
MINUS = "−"
PLACES = 7  # decimals beyond which a pair is written with a power of ten
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Estimate:
    """One estimate as text: `value` and `sigma` of one place, or `determined` False and `bound` alone."""

    value: str
    sigma: str
    determined: bool
    bound: str

    @property
    def text(self) -> str:
        """The whole in one line: "0.152 ± 0.048" or "not determined (|x| < 0.21)"."""
        if not self.determined:
            return f"not determined (|x| < {self.bound})"
        return f"{self.value} ± {self.sigma}" if self.sigma else self.value


def finite(x: object) -> float | None:
    """`x` as a finite float, None for anything else."""
    if isinstance(x, bool) or not isinstance(x, (int, float)):
        return None
    return float(x) if math.isfinite(x) else None


def power(exponent: int) -> str:
    """10 to the exponent, as text with superscripts."""
    return "10" + str(exponent).translate(_SUPERSCRIPTS)


def _plain(number: Decimal) -> str:
    text = f"{number:,f}" if abs(number) >= 10000 else f"{number:f}"
    return text.replace("-", MINUS) if number else text.lstrip("-")


def _quantum(place: int) -> Decimal:
    return Decimal(1).scaleb(place)


def _round(x: float, place: int) -> Decimal:
    return Decimal(repr(float(x))).quantize(_quantum(place), ROUND_HALF_EVEN)


def _place(x: float, digits: int, rounding: str = ROUND_HALF_EVEN) -> int:
    """Power of ten of the last of `digits` significant digits of x, rounding up into a new digit included."""
    number = abs(Decimal(repr(float(x))))
    place = number.adjusted() - digits + 1
    rounded = number.quantize(_quantum(place), rounding)
    return place + (rounded.adjusted() - number.adjusted())


def significant(x: object, digits: int = 3) -> str:
    """`x` with `digits` significant digits; whole digits are never dropped, a small value never becomes 0.000."""
    number = finite(x)
    if number is None:
        return DASH
    if number == 0:
        return "0"
    place = _place(number, digits)
    exponent = place + digits - 1
    if exponent < -4 or exponent >= 9:
        return f"{_plain(_round(number, place).scaleb(-exponent))}·{power(exponent)}"
    return _plain(_round(number, min(place, 0)))


def given(x: object, digits: int = 6) -> str:
    """A number somebody chose, without the zeros that would only fill it up: 10, 0.01, 1000."""
    text = significant(x, digits)
    mantissa, times, exponent = text.partition("·")
    return (mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa) + times + exponent


def percent(x: object, digits: int = 2) -> str:
    """`x` (already in percent) with its sign, "3.2 %"."""
    text = significant(x, digits)
    return text if text == DASH else f"{text}\u00a0%"


def interval(low: object, high: object) -> str:
    """ "−0.87 to 1.57": both ends to one place, at which their distance has three significant digits."""
    a, b = finite(low), finite(high)
    if a is None or b is None:
        return DASH
    place = min(0, max(-5, _place(b - a, 3))) if a != b else -3
    return f"{_plain(_round(a, place))} to {_plain(_round(b, place))}" if max(abs(a), abs(b)) < 1e9 else DASH


def count(x: object) -> str:
    """A whole number with separators."""
    number = finite(x)
    return DASH if number is None else _plain(_round(number, 0))


def column(values: Sequence[object], digits: int = 2, most: int = 5) -> list[str]:
    """Values of one column to one place, at which the smallest that isn't zero keeps `digits` digits.

    Where that would take more than `most` decimals, the smallest are written on their own.
    """
    numbers = [finite(x) for x in values]
    places = [_place(x, digits) for x in numbers if x]
    place = min(0, max(min(places, default=0), -most))

    def cell(x: float | None) -> str:
        if x is None:
            return DASH
        if x and (_place(x, digits) < place or abs(x) >= 1e9):
            return significant(x, digits)
        return _plain(_round(x, place)) if x else "0"

    return [cell(x) for x in numbers]


def estimate(value: object, sigma: object) -> Estimate:
    """Value and σ by the rule above; where σ ≥ |value|, a bound at |value| + 2σ instead.

    A missing or zero σ leaves the value with four significant digits and an empty `sigma`.
    """
    x, s = finite(value), finite(sigma)
    if x is None:
        return Estimate(DASH, "", True, "")
    if s is None or s <= 0:
        return Estimate(significant(x, 4), "", True, "")
    if s >= abs(x):
        return Estimate("", "", False, upper_bound(abs(x) + 2 * s))
    place = _place(s, 2)
    exponent = Decimal(repr(x)).adjusted()
    if exponent - place > 15:  # more digits than a double holds
        return Estimate(significant(x, 15), significant(s, 2), True, "")
    if (-place > PLACES and exponent < -3) or place > 3:
        pair = [_plain(_round(v, place).scaleb(-exponent)) for v in (x, s)]
        return Estimate(f"({pair[0]}", f"{pair[1]})·{power(exponent)}", True, "")
    # Digits of a whole number left of the place of σ would be noise: they are rounded, and zeros stand for them.
    pair = [_plain(_round(v, place).quantize(_quantum(min(place, 0)))) for v in (x, s)]
    return Estimate(pair[0], pair[1], True, "")


def entry(value: object, sigma: object) -> tuple[str, str]:
    """Value and σ of an entry of a vector or matrix, to the place of σ's second digit: near zero too, where the entry
    is as well known as its neighbours."""
    x, s = finite(value), finite(sigma)
    if x is None:
        return DASH, ""
    if s is None or s <= 0:
        return significant(x, 4), ""
    if s < abs(x) or _place(s, 2) < -PLACES:
        shown = estimate(x, s)
        return shown.value or significant(x, 2), shown.sigma or significant(s, 2)
    place = min(_place(s, 2), 0)
    return _plain(_round(x, place)), _plain(_round(s, place))


def upper_bound(x: float) -> str:
    """A positive bound with two significant digits, rounded up."""
    place = _place(x, 2, ROUND_CEILING)
    bound = Decimal(repr(float(x))).quantize(_quantum(place), ROUND_CEILING)
    exponent = bound.adjusted()
    if exponent < -4 or exponent >= 7:
        return f"{_plain(bound.scaleb(-exponent))}·{power(exponent)}"
    return _plain(bound.quantize(_quantum(min(place, 0))))


def ticks(values: Sequence[float]) -> list[str]:
    """Labels of evenly spaced axis ticks, all to the place of their step."""
    if len(values) < 2:
        return [significant(v, 3) for v in values]
    step = abs(values[1] - values[0])
    place = Decimal(repr(float(f"{step:.3g}"))).normalize().as_tuple().exponent
    place = place if isinstance(place, int) else 0
    largest = max(abs(v) for v in values)
    if place < -4 or largest >= 1e6:
        exponent = math.floor(math.log10(largest))
        rounded = [_round(v, place).scaleb(-exponent) for v in values]
        return [f"{_plain(r.normalize())}·{power(exponent)}" if r else "0" for r in rounded]
    return [_plain(_round(v, min(place, 0))) for v in values]
