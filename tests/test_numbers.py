"""Laws of how numbers are written: two digits of σ, one place for both, nothing small shown as zero."""

from __future__ import annotations

import math
import re
from decimal import Decimal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identify import numbers

magnitudes = st.floats(-9, 9).map(lambda e: 10.0**e)
values = st.builds(lambda m, sign: sign * m, magnitudes, st.sampled_from([-1.0, 1.0]))
quick = settings(max_examples=300, deadline=None)


def parsed(text: str) -> Decimal:
    """The number that a written number stands for."""
    plain = text.replace(numbers.MINUS, "-").replace(",", "").strip("()")
    mantissa, _, exponent = plain.partition("·10")
    return Decimal(mantissa) * Decimal(10) ** int(exponent.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)


def pair(shown: numbers.Estimate) -> tuple[str, str]:
    """Value and σ with a common power of ten handed to both."""
    tail = shown.sigma.partition(")")[2]
    return shown.value.strip("(") + tail, shown.sigma.replace(")", "")


@quick
@given(values, magnitudes)
def test_sigma_has_two_digits_and_the_value_the_same_place(value: float, sigma: float) -> None:
    shown = numbers.estimate(value, sigma)
    if sigma >= abs(value):
        assert not shown.determined
        limit = abs(value) + 2 * sigma
        assert limit <= float(parsed(shown.bound)) * (1 + 1e-12)
        assert float(parsed(shown.bound)) <= 1.1 * limit * (1 + 1e-12)
        return
    if abs(value) / sigma > 1e14:
        return
    written, deviation = pair(shown)
    place = 10.0 ** (math.floor(math.log10(float(parsed(deviation)))) - 1)
    digits = re.sub(r"[^0-9]", "", deviation.partition("·")[0]).lstrip("0")
    assert len(digits) == 2 or (float(parsed(deviation)) >= 100 and not digits[2:].strip("0"))
    assert abs(float(parsed(deviation)) - sigma) <= 0.5001 * place
    assert abs(float(parsed(written)) - value) <= 0.5001 * place + 1e-15 * abs(value)
    decimals = [len(text.partition("·")[0].partition(".")[2]) for text in (written, deviation)]
    assert decimals[0] == decimals[1]


@quick
@given(values, st.integers(1, 6))
def test_significant_digits_bound_the_relative_error(value: float, digits: int) -> None:
    shown = float(parsed(numbers.significant(value, digits)))
    assert abs(shown - value) <= 0.5001 * 10.0 ** (math.floor(math.log10(abs(value))) - digits + 1)
    assert shown != 0


@quick
@given(st.lists(values, min_size=1, max_size=8))
def test_a_column_shows_no_value_as_zero_and_keeps_one_place(column: list[float]) -> None:
    shown = numbers.column(column)
    assert all(parsed(text) != 0 for text in shown)
    places = {len(text.partition(".")[2]) for text, x in zip(shown, column, strict=True) if 1e-3 < abs(x) < 1e9}
    assert len(places) <= 1


@quick
@given(st.floats(-1e5, 1e5), st.sampled_from([1, 2, 2.5, 5]), st.integers(-8, 4), st.integers(2, 7))
def test_tick_labels_tell_the_ticks_apart(start: float, mantissa: float, exponent: int, count: int) -> None:
    step = mantissa * 10.0**exponent
    first = round(start / step)
    if abs(first) > 1e6:
        return
    ticks = [(first + k) * step for k in range(count)]
    shown = [float(parsed(text)) for text in numbers.ticks(ticks)]
    assert all(abs(a - b) <= 1e-3 * step for a, b in zip(shown, ticks, strict=True))


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (0.152049, 0.04791, "0.152 ± 0.048"),
        (-0.00628135, 0.144894, "not determined (|x| < 0.30)"),
        (1523.4, 132.0, "1520 ± 130"),
        (3.14159, 0.0996, "3.14 ± 0.10"),
        (1.5234e-8, 1.31e-9, "(1.52 ± 0.13)·10⁻⁸"),
        (-2.5, 0.0, "−2.500"),
        (float("nan"), 1.0, "—"),
        (None, 1.0, "—"),
    ],
)
def test_estimates_as_the_specification_writes_them(value: float | None, sigma: float, text: str) -> None:
    assert numbers.estimate(value, sigma).text == text


@pytest.mark.parametrize(
    ("shown", "text"),
    [
        (numbers.significant(0.006496), "0.00650"),
        (numbers.significant(1363.2, 2), "1363"),
        (numbers.significant(3.1e-14, 2), "3.1·10⁻¹⁴"),
        (numbers.significant(0.0), "0"),
        (numbers.significant(True), "—"),
        (numbers.significant(float("inf")), "—"),
        (numbers.given(0.01), "0.01"),
        (numbers.given(1000.0), "1000"),
        (numbers.given(12.5), "12.5"),
        (numbers.percent(0.043), "0.043\u00a0%"),
        (numbers.count(1234567), "1,234,567"),
        (numbers.upper_bound(0.2901), "0.30"),
        (numbers.interval(-0.000188, 1.8902), "0.00 to 1.89"),
        (numbers.interval(-2.5, 0.0625), "−2.50 to 0.06"),
        (numbers.interval(0.1, 0.104), "0.10000 to 0.10400"),
        (numbers.interval(None, 1.0), "—"),
    ],
)
def test_numbers_as_they_are_written(shown: str, text: str) -> None:
    assert shown == text
