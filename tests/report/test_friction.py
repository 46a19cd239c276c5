"""The friction that is drawn is the regressor's, and its data are what the arrays leave for it."""

from __future__ import annotations

import re

import numpy as np
import pytest
from example_results import example

from identify.regressor.columns import smooth_sign
from identify.regressor.friction import PLAIN
from identify.regressor.regressor import Regressor
from identify.report.friction import friction_curve
from identify.report.page import render
from identify.robot.robot import Joint, Robot

VALUES = {"viscous": 1.7, "coulomb": -0.4, "offset": 0.3, "cube_root": 2.1, "presliding": 0.9}


@pytest.mark.parametrize("forms", [(), ("cube_root",), ("cube_root", "presliding")])
@pytest.mark.parametrize("width", [None, 0.05])
def test_the_curve_is_the_regressors(width: float | None, forms: tuple[str, ...]) -> None:
    row = {key: {"estimate": value} for key, value in VALUES.items() if key in (*PLAIN, *forms)}
    form = "sign" if width is None else "smooth sign"
    curve = friction_curve(row, {"settings": {"coulomb_form": form, "coulomb_velocity": width}})
    velocity = np.concatenate([[-0.0, 0.0], np.linspace(-0.2, 0.2, 41)])[:, None]
    regressor = Regressor(Robot("one", (Joint("a"),)), forms)
    sign = np.sign if width is None else smooth_sign(width)
    still = np.zeros_like(velocity)
    matrix = regressor.torque(still, velocity, still, sign=sign, slip=np.sign(velocity))
    friction = matrix[:, 0, len(regressor.base.names) :] @ [VALUES[key] for key in row]
    np.testing.assert_allclose(curve(velocity[:, 0]), friction, rtol=1e-14)


def test_further_forms_are_told_and_tabled() -> None:
    record, curves = example(1)
    plain = render(record, curves)
    record["settings"] |= {"friction": ["cube_root", "presliding"], "presliding_distance": 2e-4}
    for row in record["friction"]:
        row |= {key: {**row["coulomb"], "estimate": 0.7} for key in ("cube_root", "presliding")}
    html = render(record, curves)
    assert "not surely better there" not in html
    record["settings"] |= {"friction": [], "candidates": [{"settings": {"friction": ["cube_root"]}}]}
    assert "not surely better there: cube root friction." in render(record, curves)
    for text in ("cube root of the velocity (Fc)", "0.2 mrad", "F<sub>c1</sub>", "F<sub>p1</sub>"):
        assert text in html
        assert text not in plain


def dots(html: str) -> np.ndarray:
    """Heights of the data points in the first friction figure [px]."""
    figure = html.partition('<section id="friction">')[2].partition("<figure>")[2].partition("</figure>")[0]
    places = re.findall(r'<use href="#f-0[^"]*" x="([^"]*)" y="([^"]*)"', figure)
    return np.array([float(y) for x, y in places if x != "0"])  # the band stands at x = 0, whole


def test_a_coupled_motors_share_is_taken_out_of_the_data() -> None:
    record, curves = example(1, coupled=True, noise=1e-6)
    before = dots(render(record, curves))
    assert len(before) > 20
    assert np.ptp(before) > 60  # the data follow the curve, not the residual alone
    shift = 500.0 * np.sin(7 * curves["train0/time"])[:, None]
    curves["train0/measured"] = curves["train0/measured"] + shift
    curves["train0/predicted"] = curves["train0/predicted"] + shift
    np.testing.assert_allclose(dots(render(record, curves)), before, atol=0.11)
    record["transmission"] = []
    assert np.abs(dots(render(record, curves)) - before).max() > 5


def test_without_training_arrays_the_curve_stands_alone_and_says_so() -> None:
    record, curves = example(1)
    html = render(record, {key: value for key, value in curves.items() if not key.startswith("train")})
    assert "No data behind the curves." in html
