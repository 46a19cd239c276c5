"""Typeset formulas still say what they said: read back, they have the same value at random points."""

from __future__ import annotations

import random
import re

import pytest
from example_results import RX90_GROUPING
from hypothesis import given, settings
from hypothesis import strategies as st

from identify.report.symbols import LONGEST, formula_html, symbol_html, symbol_text

FORMULAS = [
    *RX90_GROUPING.values(),
    "-XX3 + 0.2025*M4 - 1.50e-05*MZ2/(2*D3**3)",
    "XX12 + YY12*cos(alpha) - Ia12",
    "-(MX2 - RL4**2*M4)*sin(0.5)",
]


def read_back(html: str) -> str:
    """A typeset formula in Python's notation again."""
    text = re.sub(r"<sup>(.*?)</sup>", r"**\1", re.sub(r"</?sub>", "", html))
    return (
        text.replace("\u202f", "*")
        .replace("\u2009/\u2009", "/")
        .replace("−", "-")
        .replace("·", "*")
        .replace("α", "alpha")
    )


def value(formula: str, seed: int) -> float:
    draw = random.Random(seed)
    names = {name: draw.uniform(0.5, 2.0) for name in sorted(set(re.findall(r"[A-Za-z]+\d*", formula)))}
    functions = {"cos": lambda x: x**3 + x, "sin": lambda x: x**2 + 1}
    return float(eval(formula, {"__builtins__": {}}, {**names, **functions}))


@pytest.mark.parametrize("formula", FORMULAS)
def test_a_typeset_formula_keeps_its_value(formula: str) -> None:
    for seed in range(3):
        assert value(read_back(formula_html(formula)), seed) == pytest.approx(value(formula, seed), rel=1e-12)


def test_symbols_and_formulas_look_as_the_specification_shows() -> None:
    assert symbol_html("XX3") == "XX<sub>3</sub>"
    assert symbol_html("ZZR12") == "ZZR<sub>12</sub>"
    assert symbol_html("Ia6") == "I<sub>a6</sub>"
    assert symbol_html("Fsm6") == "F<sub>sm6</sub>"
    assert symbol_html("<b>") == "&lt;b&gt;"
    assert symbol_text("MYR10") == "MYR₁₀"
    assert formula_html("RL4**2*M4") == "RL4<sup>2</sup>\u202fM<sub>4</sub>"
    assert formula_html("XX2 - YY2") == "XX<sub>2</sub> − YY<sub>2</sub>"


def test_a_long_formula_is_cut_at_a_term_and_says_so() -> None:
    terms = [f"XX{k}" for k in range(1, 200)]
    shown = formula_html(" + ".join(terms))
    assert shown.endswith("… (whole in parameters.json)")
    kept = read_back(shown).partition(" + …")[0].split(" + ")
    assert kept == terms[: len(kept)]
    assert LONGEST // 2 < len(" + ".join(kept)) <= LONGEST


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=40))
def test_no_text_gets_out_of_a_formula_or_symbol(text: str) -> None:
    for shown in (formula_html(text), symbol_html(text)):
        bare = re.sub(r"</?su[bp]>", "", shown)
        assert not set("<>\"'") & set(bare)
