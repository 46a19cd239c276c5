"""Forms of friction beside the plain ones, against an integrator of differential equations and laws written out."""

from __future__ import annotations

import numpy as np
import pytest
from chains import random_chain
from scipy.integrate import solve_ivp
from symbolic_models import states

from identify.errors import InputError
from identify.regressor.columns import smooth_sign
from identify.regressor.friction import FURTHER, FrictionConstants, chosen_forms, further_forms, presliding_state
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.validation.engines import pinocchio_torque

BOTH = ("cube_root", "presliding")
DISTANCE = 2e-3


@pytest.fixture(scope="module")
def plain() -> Regressor:
    return Regressor(load_robot("tx40"), compiler=False)


@pytest.fixture(scope="module")
def whole() -> Regressor:
    return Regressor(load_robot("tx40"), BOTH, compiler=False)


def path(time: np.ndarray) -> np.ndarray:
    """(N, 2) a joint that creeps to and fro by little more than DISTANCE, and one that stops for half the time."""
    creeping = 3e-3 * np.sin(7 * time) + 1e-3 * np.sin(31 * time + 0.4)
    stopping = 0.3 * np.where(time < 1, np.sin(time), np.sin(1))
    return np.column_stack([creeping, stopping])


def test_the_state_obeys_its_differential_equation() -> None:
    """dz/dt = (q̇ − |q̇|·z)/x0, integrated by Runge and Kutta's method of order 8 between the reversals."""
    time = np.linspace(0.0, 2.0, 200_001)
    found = presliding_state(path(time), DISTANCE, np.array([0.3, -0.8]))
    assert found[0].tolist() == [0.3, -0.8]

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        speed = 21e-3 * np.cos(7 * t) + 31e-3 * np.cos(31 * t + 0.4)
        return (speed - abs(speed) * z) / DISTANCE

    kept = slice(None, None, 10_000)
    truth = solve_ivp(rate, (0, 2), [0.3], "DOP853", time[kept], rtol=1e-10, atol=1e-12, max_step=1e-3)
    assert np.ptp(truth.y[0]) > 1
    np.testing.assert_allclose(found[kept, 0], truth.y[0], rtol=0, atol=1e-6)
    exact = 1 - 1.8 * np.exp(-path(time)[:, 1] / DISTANCE)  # on the way from −0.8 up to its end
    np.testing.assert_allclose(found[:, 1], exact, rtol=0, atol=1e-12)
    assert np.abs(found).max() <= 1


@pytest.mark.parametrize("cuts", [[1], [500, 501, 502], [0, 17, 999]])
def test_piece_by_piece_is_the_whole(whole: Regressor, cuts: list[int]) -> None:
    q = np.cumsum(np.random.default_rng(0).normal(0, 1e-3, (1000, 6)), axis=0)
    q[300:400] = q[300]
    at_once = whole.presliding(DISTANCE)(q)
    kept = whole.presliding(DISTANCE)
    pieces = np.concatenate([kept(part) for part in np.split(q, cuts)])
    np.testing.assert_allclose(pieces, at_once, rtol=0, atol=1e-11)
    tick = whole.presliding(DISTANCE)
    np.testing.assert_allclose([tick(row) for row in q], at_once, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(at_once[300:400], np.tile(at_once[300], (100, 1)))  # at rest it keeps its value
    motor = presliding_state((q[:, 4] + q[:, 5])[:, None], DISTANCE)
    np.testing.assert_allclose(at_once[:, 6:], motor, rtol=0, atol=1e-12)


def test_names_stand_behind_the_plain_ones(plain: Regressor, whole: Regressor) -> None:
    further = [f"{kind}{j}" for j in range(1, 7) for kind in ("Fc", "Fp")] + ["Fcm6", "Fpm6"]
    assert whole.names == (*plain.names, *further)
    assert plain.forms == ()
    assert whole.forms == BOTH
    assert len(whole.units) == whole.p
    assert Regressor(load_robot("tx40"), ("viscous", "coulomb", "offset")).names == plain.names
    assert plain.with_forms(BOTH).names == whole.names


def test_columns_and_their_power(plain: Regressor, whole: Regressor) -> None:
    rng = np.random.default_rng(1)
    q, dq, ddq = states(rng, whole.robot, 40)
    dq[3] = 0.0
    slip = rng.uniform(-1, 1, (40, 7))
    sign = smooth_sign(0.4)
    y = whole.torque(q, dq, ddq, sign=sign, slip=slip)
    np.testing.assert_array_equal(y[:, :, : plain.p], plain.torque(q, dq, ddq, sign=sign))
    expected = np.zeros((40, 6, 14))
    for j in range(6):
        expected[:, j, 2 * j] = np.sign(dq[:, j]) * np.abs(dq[:, j]) ** (1 / 3)
        expected[:, j, 2 * j + 1] = slip[:, j]
    motor = dq[:, 4] + dq[:, 5]
    expected[:, 4:, 12] = (np.sign(motor) * np.abs(motor) ** (1 / 3))[:, None]
    expected[:, 4:, 13] = slip[:, 6:]
    np.testing.assert_allclose(y[:, :, plain.p :], expected, rtol=0, atol=1e-14)
    theta = rng.normal(size=whole.p)
    np.testing.assert_allclose(whole.inverse_dynamics(q, dq, ddq, theta, sign, slip), y @ theta, rtol=0, atol=1e-10)
    np.testing.assert_allclose(whole.slotine_li(q, dq, dq, ddq, sign, slip), y, rtol=0, atol=1e-10)
    one = whole.torque(q[5], dq[5], ddq[5], sign=sign, slip=slip[5])
    np.testing.assert_allclose(one, y[5], rtol=0, atol=1e-13)
    power = whole.power(dq, sign, slip)
    friction = np.arange(whole.p) >= len(whole.base.names)
    taken = np.einsum("nj,njk->nk", dq, y)
    inertia = whole.names.index("Iam6")
    friction[inertia] = False
    np.testing.assert_allclose(power[:, friction], taken[:, friction], rtol=0, atol=1e-12)
    np.testing.assert_allclose(whole.power(dq[5], sign, slip[5]), power[5], rtol=0, atol=1e-13)
    assert not power[:, ~friction].any()
    assert not whole.energy(q, dq)[:, plain.p :].any()


def test_without_a_state_it_is_that_of_steady_sliding(whole: Regressor) -> None:
    q, dq, ddq = states(np.random.default_rng(2), whole.robot, 10)
    sliding = np.sign(np.column_stack([dq, dq[:, 4] + dq[:, 5]]))
    np.testing.assert_array_equal(whole.torque(q, dq, ddq), whole.torque(q, dq, ddq, slip=sliding))


def test_choices() -> None:
    assert chosen_forms(None) is None
    assert chosen_forms("auto") is None
    assert chosen_forms("plain") == chosen_forms("viscous, coulomb") == further_forms(True) == ()
    assert chosen_forms("presliding,cube_root") == chosen_forms(["presliding", "cube_root"]) == BOTH
    with pytest.raises(InputError, match=r"friction 'squeak' is not known; choose from viscous.*presliding"):
        chosen_forms("cube_root,squeak")


def test_units() -> None:
    arm = random_chain(np.random.default_rng(2), 3)
    regressor = Regressor(arm, BOTH)
    units = dict(zip(regressor.names, regressor.units, strict=True))
    for j, joint in enumerate(arm.joints, 1):
        force, speed = (joint.effort_unit, f"s/{joint.position_unit}")
        assert [units[f"{kind}{j}"] for kind in ("Fs", "Fp", "Fc")] == [force, force, f"{force}·∛({speed})"]
    assert {joint.type for joint in arm.joints} == {"revolute", "prismatic"}


def test_columns_of_forms_with_constants() -> None:
    """Stribeck, asymmetric and load-dependent friction by their formulas; the load by Pinocchio."""
    robot = load_robot("rx90")
    base = Regressor(robot, False)
    mean = (40.0, 60.0, 30.0, 2.0, 3.0, 1.0)
    load = base.theta(robot.standard, {})
    constants = FrictionConstants(0.3, tuple(load), mean)
    regressor = Regressor(robot, ("load", "asymmetric", "stribeck"), compiler=False, constants=constants)
    assert regressor.forms == ("stribeck", "asymmetric", "load")
    p = Regressor(robot).p
    assert regressor.names[p:] == tuple(f"{kind}{j}" for j in range(1, 7) for kind in ("Fb", "Fa", "Fl"))
    q, dq, ddq = states(np.random.default_rng(5), robot, 30)
    dq *= 0.2
    sign = smooth_sign(0.1)
    smooth = np.clip(dq / 0.1, -1, 1)
    rigid = pinocchio_torque(robot, robot.standard, q, dq, ddq)
    expected = np.zeros((30, 6, 18))
    for j in range(6):
        expected[:, j, 3 * j] = smooth[:, j] * np.exp(-np.abs(dq[:, j]) / 0.3)
        expected[:, j, 3 * j + 1] = np.abs(dq[:, j])
        expected[:, j, 3 * j + 2] = smooth[:, j] * np.abs(rigid[:, j]) / mean[j]
    y = regressor.torque(q, dq, ddq, sign=sign)
    np.testing.assert_allclose(y[:, :, p:], expected, rtol=0, atol=1e-12)
    theta = np.random.default_rng(6).normal(size=regressor.p)
    np.testing.assert_allclose(regressor.inverse_dynamics(q, dq, ddq, theta, sign), y @ theta, rtol=0, atol=1e-10)
    np.testing.assert_allclose(regressor.slotine_li(q, dq, dq, ddq, sign), y, rtol=0, atol=1e-9)
    np.testing.assert_allclose(regressor.torque(q[3], dq[3], ddq[3], sign=sign), y[3], rtol=0, atol=1e-12)
    taken = np.einsum("nj,njk->nk", dq, y)[:, p:]
    power = regressor.power(dq, sign, load=regressor.load(q, dq, ddq))
    np.testing.assert_allclose(power[:, p:], taken, rtol=0, atol=1e-12)
    rows = [
        np.concatenate(parts, axis=1)
        for parts in zip(*map(_copied, regressor.rows(q, dq, ddq, rigid, sign)), strict=True)
    ]
    for j, support in enumerate(regressor.supports):
        np.testing.assert_allclose(rows[j][:-1], y[:, j, support].T, rtol=0, atol=1e-12)
    unloaded = regressor.with_forms(regressor.forms, FrictionConstants(0.3))
    mean_load = unloaded.torque(q, dq, ddq, sign=sign)[:, :, p:]
    np.testing.assert_allclose(mean_load[:, range(6), range(2, 18, 3)], smooth, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(regressor.torque(q, dq, ddq, sign=sign), y)  # the copy left its model alone


def _copied(block: list[np.ndarray]) -> list[np.ndarray]:
    return [rows.copy() for rows in block]


def test_a_coupled_motor_has_every_form_but_the_load() -> None:
    whole = Regressor(load_robot("tx40"), FURTHER, compiler=False)
    assert [name for name in whole.names if name.endswith("m6")] == [
        "Iam6",
        "Fvm6",
        "Fsm6",
        "Fcm6",
        "Fpm6",
        "Fbm6",
        "Fam6",
    ]
    assert len(whole.units) == whole.p == 61 + 6 * 5 + 4
    q, dq, ddq = states(np.random.default_rng(7), whole.robot, 5)
    y = whole.torque(q, dq, ddq)
    speed = dq[:, 4] + dq[:, 5]
    for name, law in (("Fbm6", np.sign(speed) * np.exp(-np.abs(speed) / 0.1)), ("Fam6", np.abs(speed))):
        np.testing.assert_allclose(y[:, 4:, whole.names.index(name)], np.stack([law, law], axis=1), rtol=0, atol=1e-14)
