"""The compact SVG draws what was asked for, in the page's colours, and nothing twice under one name."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest

from identify.report import curve_figures, drawing, parameter_figures


def points(path: str) -> np.ndarray:
    """Absolute corners of a path made of M, l, h, v and z."""
    at, found = np.zeros(2), []
    for letter, rest in re.findall(r"([A-Za-z])([^A-Za-z]*)", path):
        numbers = [float(x) for x in re.findall(r"-?(?:\d+\.?\d*|\.\d+)", rest)]
        if letter == "M":
            steps = [np.array(numbers) - at]
        elif letter in "hv":
            steps = [np.array([x, 0.0] if letter == "h" else [0.0, x]) for x in numbers]
        else:
            assert letter in "lz"
            steps = list(np.array(numbers).reshape(-1, 2))
        for step in steps:
            at = at + step
            found.append(at)
    return np.array(found)


def test_a_line_lands_on_its_pixels_whatever_its_length() -> None:
    rng = np.random.default_rng(1)
    x, y = np.arange(100.0), rng.uniform(-1, 1, 100)
    with drawing.drawing():
        figure = drawing.new(200)
        axes = drawing.add_axes(figure, 46, 18, 400, 120)
        drawing.scale(figure, axes, "x", 0.0, 99.0, rules=False)
        drawing.scale(figure, axes, "y", -1.0, 1.0, rules=False)
        axes.plot(x, y, color=drawing.colour("measured"), linewidth=1)
        drawn = drawing.svg(figure, "k", "a line")
    data = next(d for d, style in re.findall(r'<path d="([^"]*)"[^>]* style="([^"]*)"', drawn) if "--measured" in style)
    expected = np.column_stack([46 + 400 * x / 99, 18 + 120 * (1 - y) / 2])
    np.testing.assert_allclose(points(data), expected, atol=0.0501)


def test_text_is_text_and_may_be_anything() -> None:
    text = "関節 $x^2$ <b>&\"' \\frac{1}{2} {"
    with drawing.drawing():
        figure = drawing.new(50)
        drawing.write(figure, 10, 20, text, "right")
        drawn = ElementTree.fromstring(drawing.svg(figure, "k", text))
    element = drawn.find("text")
    assert element is not None
    assert element.text == text
    assert (float(element.get("x", "0")), float(element.get("y", "0"))) == (10.0, 20.0)
    assert element.get("style") == "fill:var(--muted);text-anchor:end"
    assert drawn.get("aria-label") == text


def test_drawing_leaves_the_users_settings_alone_and_ignores_them() -> None:
    def drawn() -> str:
        with drawing.drawing():
            figure = drawing.new(90)
            axes = drawing.add_axes(figure, 40, 10, 200, 40)
            drawing.scale(figure, axes, "x", 0.0, 1.0)
            axes.plot([0, 1], [0, 1], color=drawing.colour("error"))
            return drawing.svg(figure, "k", "x")

    before = drawn()
    with matplotlib.rc_context({"font.size": 33, "axes.grid": True, "svg.fonttype": "path", "lines.linewidth": 9}):
        assert drawn() == before
        assert matplotlib.rcParams["font.size"] == 33


def test_intervals_reach_two_sigma_and_an_unknown_one_squeezes_no_other() -> None:
    dots = [
        parameter_figures.Dot("XX2", "kg·m²", 1.0, 0.1, truth=1.1, prior=0.9),
        parameter_figures.Dot("YY2", "kg·m²", -0.5, 0.05, other=(-0.4, 0.1)),
        parameter_figures.Dot("ZZ2", "kg·m²", 0.1, 1e4, open=True),
    ]
    low, high = parameter_figures._limits(dots)
    assert low < -0.7
    assert high > 1.2
    assert high - low < 20
    with drawing.drawing():
        drawn = parameter_figures.figure(dots, "p", "label")
    assert drawn.count("<text") >= 5
    line = points(re.findall(r'<path d="(M[^"]*)" style="[^"]*--measured[^"]*stroke-width:1.4', drawn)[0])
    ends = np.array([0.8, 1.2, -0.6, -0.4, low, high])
    width = drawing.WIDTH - parameter_figures.LEFT - parameter_figures.WORDS
    pixels = parameter_figures.LEFT + (ends - low) / (high - low) * width
    np.testing.assert_allclose(line[:, 0], pixels, atol=0.06)


def test_the_error_strip_shows_measured_minus_predicted_on_the_same_time_axis() -> None:
    time = np.linspace(0.0, 10.0, 200)
    predicted = 3 * np.sin(time)[:, None]
    arrays = {"time": time, "measured": predicted + time[:, None], "predicted": predicted}
    joint = {"name": "a", "effort_unit": "N", "position_unit": "m"}
    with drawing.drawing():
        drawn = curve_figures.panel(arrays, 0, joint, {}, "c", 300)
    lines = {
        tone: points(re.findall(rf'<path d="([^"]*)"[^>]* style="fill:none[^"]*--{tone}\)', drawn)[0])
        for tone in ("measured", "error")
    }
    error = lines["error"]
    assert (np.diff(error[:, 1]) <= 0).all()  # pixels count downwards, the error grows
    assert error[0, 1] - error[-1, 1] > 15
    assert (error[0, 0], error[-1, 0]) == pytest.approx((lines["measured"][0, 0], lines["measured"][-1, 0]))
    assert "force [N]" in drawn
    assert "error [N]" in drawn


@pytest.mark.parametrize("limits", [([3.0, 3.0], False), ([0.0], False), ([], True), ([np.nan, 1.0, -4.0], True)])
def test_limits_always_have_a_width(limits: tuple[list[float], bool]) -> None:
    values, symmetric = limits
    low, high = drawing.span_of([np.array(values)], symmetric=symmetric)
    assert low < high
    assert all(low <= v <= high for v in values if np.isfinite(v))
    if symmetric:
        assert low == pytest.approx(-high)
