"""Friction beside viscous and Coulomb: found where it is, left out where it is not, and carried through a result."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import oracle
import pytest
from exact_logs import arm, exact_log, fitted, friction, motion

import identify.estimation.observation as observation_module
from identify.codegen.generate import generate
from identify.errors import InputError, UnsupportedLogError
from identify.estimation.fitting import fit_torque
from identify.estimation.identification import Identification
from identify.estimation.identified_robot import exported, identified_robot
from identify.estimation.observation import signal_pieces, signals, stacked, torque_blocks
from identify.estimation.prediction import predicted_effort
from identify.estimation.selection import choose_settings, validated
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.regressor.columns import smooth_sign
from identify.regressor.friction import presliding_state
from identify.regressor.regressor import Regressor
from identify.workflow import fit

ARM = arm(1)
WIDTH, DISTANCE = 0.1, 1e-4
ROOT, STATE = np.array([4.0, 6.0, 3.0]), np.array([2.0, 3.0, 1.5])
"""Fc and Fp of the arm's joints [N·m·(s/rad)^⅓, N·m]."""

NOISE = 0.05
REST_S = 3.0
BOTH = ("cube_root", "presliding")


def made(root: bool, state: bool, seed: int = 1) -> Log:
    """A motion that stops for a while half-way; smooth Coulomb friction and, if wanted, the further forms of it."""
    log = exact_log(ARM, seed)
    trajectory, half = motion(ARM, seed), log.duration / 2
    # Time runs slower and slower up to the stop, and faster and faster after it.
    u = np.arange(0.0, log.duration, 1 / 250)
    warp, rate, bend = _stopping(u, half)
    q, dq, ddq = trajectory.sample(warp)
    ddq = ddq * rate[:, None] ** 2 + dq * bend[:, None]
    dq = dq * rate[:, None]
    stopped = trajectory.sample(np.array([half]))[0][0]
    still = np.zeros_like(stopped)
    q, dq, ddq = (_held(x, value) for x, value in ((q, stopped), (dq, still), (ddq, still)))
    coulomb = np.array([joint.drive.coulomb for joint in ARM.joints])
    effort = oracle.inverse_dynamics(ARM, q, dq, ddq) + friction(ARM, dq)
    effort += coulomb * (np.clip(dq / WIDTH, -1, 1) - np.sign(dq))
    effort += root * ROOT * np.cbrt(dq) + state * STATE * presliding_state(q, DISTANCE)
    effort += NOISE * np.random.default_rng(seed).standard_normal(q.shape)
    return replace(log, time=np.arange(len(q)) / 250, position=q, effort=effort)


def _held(x: np.ndarray, value: np.ndarray) -> np.ndarray:
    middle = len(x) // 2
    return np.concatenate([x[:middle], np.tile(value, (round(REST_S * 250), 1)), x[middle:]])


def _stopping(u: np.ndarray, half: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time of the trajectory at u, its rate and the change of that: at rest at `half` and running one second away."""
    s = np.clip(np.abs(u - half), 0, 1)
    rate = s**2 * (3 - 2 * s)
    inside = s**3 - s**4 / 2
    warp = half + np.sign(u - half) * np.where(np.abs(u - half) < 1, inside, np.abs(u - half) - 0.5)
    return warp, rate, np.sign(u - half) * np.where(s < 1, 6 * s * (1 - s), 0.0)


@pytest.mark.parametrize(("root", "state"), [(False, False), (True, False), (True, True)])
def test_the_forms_that_are_there_are_chosen(root: bool, state: bool) -> None:
    chosen, tried = choose_settings(Regressor(ARM), [made(root, state)])
    assert chosen.friction == tuple(form for form, there in zip(BOTH, (root, state), strict=True) if there)
    assert chosen.rest_counted
    assert state or chosen.coulomb_velocity == WIDTH  # with a presliding part the slope is not all Coulomb's
    assert chosen.presliding_distance == (pytest.approx(DISTANCE, rel=0.3) if state else None)
    assert any(t["settings"]["friction"] for t in tried) == root


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_plain_friction_stays_plain(noise: float) -> None:
    chosen, tried = choose_settings(Regressor(ARM), [exact_log(ARM, rate=400.0, noise=noise)])
    assert chosen.friction == ()
    assert chosen.presliding_distance is None
    assert not any(t["settings"]["friction"] for t in tried)  # no form promised enough to be worth the trial


def test_forms_that_a_log_is_too_short_for_are_passed_over() -> None:
    log = made(False, False)
    short = replace(log, time=log.time[:700], position=log.position[:700], effort=log.effort[:700])
    settings = replace(SETTINGS, decimated_rate_hz=5.5)
    with pytest.raises(UnsupportedLogError, match="equations are left"):
        validated(Regressor(ARM, BOTH), [short], settings)
    chosen, tried = choose_settings(Regressor(ARM), [short], Settings(decimated_rate_hz=5.5))
    assert chosen.friction == ()
    assert not any(t["settings"]["friction"] for t in tried)


def test_forms_asked_for_are_not_left_out() -> None:
    chosen, _ = choose_settings(Regressor(ARM), [exact_log(ARM, noise=0.02)], friction=("presliding",))
    assert (chosen.friction, chosen.rest_counted) == (("presliding",), True)
    assert choose_settings(Regressor(ARM), [made(True, False)], friction=())[0].friction == ()


SETTINGS = Settings(40.0, coulomb_velocity=WIDTH, rest_counted=True, friction=BOTH, presliding_distance=DISTANCE)


def test_states_of_pieces_are_those_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Through the rest half-way as well, where the state never changes and so is never forgotten."""
    regressor, log = Regressor(ARM, BOTH), made(True, True)
    dense = replace(
        log,
        time=np.arange(4 * log.samples) / 1000,
        position=np.column_stack(
            [np.interp(np.arange(4 * log.samples) / 4, range(log.samples), x) for x in log.position.T]
        ),
        effort=np.repeat(log.effort, 4, axis=0),
    )
    for each, rate in ((log, 250.0), (dense, 500.0)):
        whole = signals(each, SETTINGS, regressor)
        assert whole.rate == rate
        assert whole.slip is not None
        assert np.ptp(whole.slip, axis=0).min() > 1.9
        for s in signal_pieces(each, SETTINGS, regressor, length=1.3):
            assert s.slip is not None
            inside = slice(s.inside.start, s.inside.stop)
            np.testing.assert_allclose(
                s.slip[inside], whole.slip[s.first + s.inside.start : s.first + s.inside.stop], rtol=0, atol=1e-6
            )
    rows = stacked(torque_blocks(regressor, [log], SETTINGS))
    monkeypatch.setattr(observation_module, "PIECE_S", 2.0)
    for ours, theirs in zip(stacked(torque_blocks(regressor, [log], SETTINGS)).matrix, rows.matrix, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-6 * np.abs(theirs).max())


def test_parameters_of_further_forms_are_found_and_predict() -> None:
    regressor = Regressor(ARM, BOTH)
    estimate = fit_torque(regressor, [made(True, True), made(True, True, 2)], SETTINGS, "wls").estimate
    at = [[regressor.names.index(f"{kind}{j}") for j in (1, 2, 3)] for kind in ("Fc", "Fp")]
    truth = regressor.theta(ARM.standard, {f"Fc{j + 1}": x for j, x in enumerate(ROOT)})
    assert (truth[at[0]] == ROOT).all()
    np.testing.assert_allclose(estimate.parameters[at[0]], ROOT, rtol=0.1)
    np.testing.assert_allclose(estimate.parameters[at[1]], STATE, rtol=0.1)
    unseen = made(True, True, 3)
    resting = slice(round(0.45 * unseen.samples), round(0.55 * unseen.samples))
    for log, rows in ((unseen, slice(50, -50)), (unseen, resting)):
        left = predicted_effort(regressor, log, estimate.parameters, SETTINGS)[rows] - log.effort[rows]
        assert np.sqrt(np.mean(left**2)) < 3 * NOISE


@lru_cache(maxsize=1)
def rich() -> Identification:
    """A fit with both further forms of friction."""
    return fit(made(True, True), ARM, test=[made(True, True, 2)])


def test_a_result_carries_its_forms(tmp_path: Path) -> None:
    result = rich()
    assert result.settings.friction == BOTH
    assert result.names == Regressor(ARM, BOTH).names
    assert result.record["models"]["energy"] is None or len(result.record["models"]["energy"]["parameters"]) == (
        Regressor(ARM).p
    )
    result.save(tmp_path / "result")
    loaded = Identification.load(tmp_path / "result")
    log = made(True, True, 3)
    np.testing.assert_array_equal(loaded.predict(log), result.predict(log))
    assert loaded.names == result.names
    for j, row in enumerate(result.record["friction"], 1):
        for key, letters in (("cube_root", "Fc"), ("presliding", "Fp")):
            k = result.names.index(f"{letters}{j}")
            assert (row[key]["estimate"], row[key]["std"]) == (result.parameters[k], result.std[k])
    assert "Fc1" in result.summary()
    assert not {"cube_root", "presliding"} & set(fitted().record["friction"][0])


def test_a_robot_file_holds_the_plain_friction_nearest_to_it() -> None:
    """Up to the speeds of the log; against a straight line through the curve by numpy.polyfit."""
    result = rich()
    assert result.record["physical"]["consistent"]
    theta = dict(zip(result.names, result.record["physical"]["parameters"], strict=True))
    tops = [row["velocity_max"] for row in result.record["coverage"]["per_joint"]]
    sign = smooth_sign(result.settings.coulomb_velocity)
    for j, (joint, top) in enumerate(zip(identified_robot(result).joints, tops, strict=True), 1):
        v = np.linspace(0, top, 201)[1:]
        curve = theta[f"Fs{j}"] * sign(v) + theta[f"Fv{j}"] * v + theta[f"Fc{j}"] * np.cbrt(v) + theta[f"Fp{j}"]
        assert curve.min() >= 0
        slope, start = np.polyfit(v, curve, 1)
        np.testing.assert_allclose([joint.drive.viscous, joint.drive.coulomb], [slope, start], rtol=1e-6)
    lost = exported(result, "toml")[1]
    assert any("cube root and presliding friction" in line for line in lost)


def test_generated_code_has_the_friction_of_steady_sliding() -> None:
    result = rich()
    (text,) = generate(
        result.robot, "python", result.parameters, result.covariance, BOTH, result.settings.coulomb_velocity
    ).values()
    space: dict[str, object] = {"__name__": "generated"}
    exec(compile(text, "generated", "exec"), space)
    q, dq, ddq = np.random.default_rng(3).uniform(-1, 1, (3, 3))
    dq[1] *= 0.03
    sign = smooth_sign(result.settings.coulomb_velocity)
    expected = result.regressor.inverse_dynamics(q, dq, ddq, result.parameters, sign)
    np.testing.assert_allclose(space["inverse_dynamics"](q, dq, ddq), expected, rtol=1e-9)  # type: ignore[operator]
    assert re.search(r"Presliding friction \(Fp\) is that of steady sliding", " ".join(text.split()))


def test_a_form_that_there_is_not_is_refused() -> None:
    with pytest.raises(InputError, match="friction 'squeak' is not known"):
        fit(exact_log(ARM), ARM, friction="squeak")
    with pytest.raises(ValueError, match="presliding_distance"):
        Settings(friction=BOTH)
