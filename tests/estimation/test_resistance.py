"""Friction whose forms resist together, each of them free: against the law written out at many speeds."""

from __future__ import annotations

import numpy as np
import pytest

from identify.estimation.physical import Consistent, information_of, nearest_consistent
from identify.estimation.reference import reference
from identify.regressor.friction import FrictionConstants
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot

WIDTH, FADING = 0.05, 0.2
FORMS = ("cube_root", "presliding", "stribeck", "asymmetric", "load")


def estimate_with(robot: str, changes: dict[str, float]) -> tuple[Regressor, np.ndarray]:
    """The robot's own links with friction of every form, and single parameters changed."""
    load = {"load_parameters": (1.0,), "mean_load": (1.0,)}
    regressor = Regressor(load_robot(robot), FORMS, constants=FrictionConstants(FADING, **load))  # type: ignore[arg-type]
    usual = {"Fv": 4.0, "Fs": 6.0, "Fc": 3.0, "Fp": 2.0, "Fb": 1.0, "Fa": 0.3, "Fl": 1.0, "Fvm": 1.0, "Fsm": 2.0}
    usual |= {"Iam": 0.01, "Fcm": 1.0, "Fpm": 1.0, "Fbm": 0.5, "Fam": 0.1}
    theta = regressor.parameters.copy()
    for at, name in enumerate(regressor.names):
        theta[at] = changes.get(name, usual.get(name.rstrip("0123456789"), theta[at]))
    return regressor, theta


def nearest(regressor: Regressor, theta: np.ndarray) -> Consistent:
    information = information_of(np.diag((0.01 * np.maximum(np.abs(theta), 0.1)) ** 2))
    bodies = reference(regressor, theta, description=True)
    return nearest_consistent(regressor, theta, information, bodies, coulomb_velocity=WIDTH)


def friction(values: dict[str, float], j: int, v: np.ndarray, load: float) -> np.ndarray:
    """What joint j takes at velocity v, by the formulas."""
    smooth = np.clip(v / WIDTH, -1, 1)
    terms = {
        "Fv": v,
        "Fs": smooth,
        "Fc": np.sign(v) * np.abs(v) ** (1 / 3),
        "Fp": np.sign(v),
        "Fb": smooth * np.exp(-np.abs(v) / FADING),
        "Fa": np.abs(v),
        "Fl": load * smooth,
    }
    return sum((values.get(f"{kind}{j}", 0.0) * term for kind, term in terms.items()), np.zeros_like(v))


@pytest.mark.parametrize("changes", [{}, {"Fs3": -2.0}, {"Fb2": -6.0, "Fv2": 9.0}, {"Fc1": -1.0, "Fa1": -2.0}])
def test_forms_that_resist_together_stay_as_they_are(changes: dict[str, float]) -> None:
    regressor, theta = estimate_with("rx90", changes)
    found = nearest(regressor, theta)
    assert found.possible
    assert found.cost < 1e-2
    np.testing.assert_allclose(found.parameters, theta, rtol=1e-2, atol=1e-2)


@pytest.mark.parametrize(
    "changes",
    [{"Fs3": -12.0}, {"Fp4": -3.0}, {"Fb5": -20.0}, {"Fa2": 9.0}, {"Fv1": -8.0}, {"Fl6": -7.0}, {"Fc2": -14.0}],
)
def test_friction_that_drives_is_mended_at_every_speed_and_load(changes: dict[str, float]) -> None:
    regressor, theta = estimate_with("rx90", changes)
    j = int(next(iter(changes))[2])
    limit = regressor.robot.joints[j - 1].limits.velocity
    speeds = np.geomspace(1e-5, 1.0, 500) * limit
    v = np.concatenate([speeds, -speeds])
    before = dict(zip(regressor.names, theta, strict=True))
    least = min((np.sign(v) * friction(before, j, v, load)).min() for load in (0.0, 1.0, 3.0))
    assert least < -0.1
    found = nearest(regressor, theta)
    assert found.possible
    assert found.cost > 1.0
    for load in (0.0, 1.0, 3.0):
        taken = np.sign(v) * friction(found.extra, j, v, load)
        assert taken.min() > -2e-3 * np.abs(taken).max()


def test_a_coupled_motor_resists_on_its_own() -> None:
    """The TX40's motor 6, whose viscous friction its two joints hold: neither it nor what is left of them drives."""
    regressor, theta = estimate_with("tx40", {"Fsm6": -9.0, "Fvm6": 5.0, "Fv5": 4.0, "Fs5": -1.0, "Fv6": 1.0})
    found = nearest(regressor, theta)
    assert found.possible
    assert found.cost > 1.0
    v = np.geomspace(1e-4, 10.0, 400)
    motor = {name.replace("m6", "9"): value for name, value in found.extra.items() if name.endswith("m6")}
    for values, j in ((motor, 9), (found.extra | {"Fv5": found.extra["Fv5"] - found.extra["Fvm6"]}, 5)):
        for direction in (v, -v):
            taken = np.sign(direction) * friction(values, j, direction, 0.0)
            assert taken.min() > -2e-3 * np.abs(taken).max()
