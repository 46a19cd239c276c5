"""The example of identified parameters in a loop: the laws that its controllers obey, and the files it writes."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import mujoco
import numpy as np
import pytest
from script_modules import SCRIPTS, script

import identify
from identify.errors import InputError
from identify.robot.mjcf import to_mjcf

sys.path.insert(0, str(SCRIPTS))

import control_laws
import control_report
import control_runs


@pytest.fixture(scope="module")
def example() -> ModuleType:
    return script("example_control")


@pytest.fixture(scope="module")
def comparison(example: ModuleType):
    """Every law along one pass of 5 s, with a fit on 10 s of another motion."""
    return control_runs.compare(example.learnt(quick=True), example.unseen(quick=True))


class Arm:
    """MuJoCo's own arithmetic of a frictionless arm: the oracle of the laws' algebra."""

    def __init__(self, robot: identify.Robot) -> None:
        self.model = mujoco.MjModel.from_xml_string(to_mjcf(robot, friction=False, limits=False))
        self.data = mujoco.MjData(self.model)

    def acceleration(self, q: np.ndarray, dq: np.ndarray, torque: np.ndarray) -> np.ndarray:
        self.data.qpos[:], self.data.qvel[:], self.data.qfrc_applied[:] = q, dq, torque
        mujoco.mj_forward(self.model, self.data)
        return self.data.qacc.copy()

    def inertia(self, q: np.ndarray) -> np.ndarray:
        matrix = np.empty((len(q), len(q)))
        self.data.qpos[:] = q
        mujoco.mj_forward(self.model, self.data)
        mujoco.mj_fullM(self.model, self.data, matrix)
        return matrix


def test_computed_torque_with_true_parameters_gives_the_acceleration_asked_for(example: ModuleType) -> None:
    robot = identify.load_robot("rx90")
    regressor, arm = identify.Regressor(robot), Arm(robot)
    law, random = control_laws.computed_torque(regressor), np.random.default_rng(0)
    theta = regressor.theta(robot.standard, {})  # no friction
    omega = control_laws.OMEGA
    for _ in range(5):
        q, dq, e, de, ddq_ref = random.standard_normal((5, robot.n))
        torque, after = law(theta, q, dq, q + e, dq + de, ddq_ref)
        wanted = ddq_ref + 2 * omega * de + omega**2 * e
        np.testing.assert_allclose(arm.acceleration(q, dq, torque), wanted, rtol=1e-9, atol=1e-7)
        assert after is theta


def test_adaptive_law_takes_its_lyapunov_function_down_by_s_k_s(example: ModuleType) -> None:
    """V = ½·sᵀ·A·s + ½·θ̃ᵀ·P⁻¹·θ̃ along MuJoCo's motion: V̇ = −sᵀ·K·s, whatever the parameters are (Slotine & Li 1987)."""
    robot = identify.load_robot("rx90")
    regressor, arm = identify.Regressor(robot), Arm(robot)
    truth = regressor.theta(robot.standard, {})
    random = np.random.default_rng(1)
    root = random.standard_normal((regressor.p, regressor.p))
    gain = root @ root.T + np.eye(regressor.p)
    inertia = 1 + random.standard_normal(robot.n) ** 2
    law, omega, step = control_laws.adaptive(regressor, inertia, gain), control_laws.OMEGA, 1e-6
    for _ in range(5):
        q, dq, e, de, ddq_ref = random.standard_normal((5, robot.n))
        theta = truth + random.standard_normal(regressor.p)
        torque, after = law(theta, q, dq, q - e, dq - de, ddq_ref)
        s = de + omega * e
        ds = arm.acceleration(q, dq, torque) - ddq_ref + omega * de
        turning = (arm.inertia(q + step * dq) - arm.inertia(q - step * dq)) / (2 * step)
        adaptation = (theta - truth) @ np.linalg.solve(gain, (after - theta) / control_laws.PERIOD)
        rate = s @ arm.inertia(q) @ ds + s @ turning @ s / 2 + adaptation
        assert rate == pytest.approx(-omega * s @ (inertia * s), rel=1e-6)


def test_truth_is_the_arm_with_its_payload(example: ModuleType, comparison) -> None:
    loaded = control_runs.carrying(identify.load_robot("rx90"), control_runs.PAYLOAD)
    model = mujoco.MjModel.from_xml_string(to_mjcf(loaded, friction=False, limits=False))
    data = mujoco.MjData(model)
    random = np.random.default_rng(2)
    drives = [joint.drive for joint in loaded.joints]
    for _ in range(5):
        q, dq, ddq = data.qpos[:], data.qvel[:], data.qacc[:] = random.standard_normal((3, loaded.n))
        mujoco.mj_inverse(model, data)
        friction = np.array(
            [d.viscous * v + d.coulomb * np.sign(v) + d.offset for d, v in zip(drives, dq, strict=True)]
        )
        torque = comparison.regressor.inverse_dynamics(q, dq, ddq, comparison.truth)
        np.testing.assert_allclose(torque, data.qfrc_inverse + friction, rtol=1e-9, atol=1e-9)


def test_identified_parameters_track_better_than_wrong_ones_and_better_than_pd(example: ModuleType, comparison) -> None:
    """Measured on this motion: the tool is 14 and 48 times nearer, the joints 34 and 36 times."""
    joints = {name: control_report.rms(run.q - comparison.motion.q) for name, run in comparison.runs.items()}
    tool = {name: control_report.rms(comparison.tool_error(name)) for name in comparison.runs}
    assert tool[control_runs.IDENTIFIED] < tool[control_runs.GUESSED] / 8
    assert tool[control_runs.IDENTIFIED] < tool[control_runs.PD] / 30
    assert joints[control_runs.IDENTIFIED] < min(joints[control_runs.GUESSED], joints[control_runs.PD]) / 20
    assert all(run.clipped == 0 for run in comparison.runs.values())
    # The guess is worth something: gravity is in it, by and large.
    assert tool[control_runs.GUESSED] < tool[control_runs.PD] / 2


def test_adaptive_law_learns_the_payload(example: ModuleType, comparison) -> None:
    """Under the payload it starts like computed torque without it and ends near computed torque that knows it."""
    third = len(comparison.tool_error(control_runs.PD)) // 3
    first = {name: control_report.rms(comparison.tool_error(name)[:third]) for name in comparison.runs}
    last = {name: control_report.rms(comparison.tool_error(name)[-third:]) for name in comparison.runs}
    assert first[control_runs.ADAPTIVE] > 0.4 * first[control_runs.LOADED]
    assert last[control_runs.ADAPTIVE] < last[control_runs.LOADED] / 4
    assert last[control_runs.ADAPTIVE] < first[control_runs.ADAPTIVE] / 2
    assert last[control_runs.ADAPTIVE] < 2.5 * last[control_runs.FLOOR]


def test_lyapunov_function_does_not_grow_and_torque_of_the_parameters_comes_near(
    example: ModuleType, comparison
) -> None:
    """With noise, delay and stiction, of which the proof knows nothing, V rises by less than 0.5 % of itself."""
    v = comparison.lyapunov()
    assert np.max(v / np.minimum.accumulate(v)) < 1.005
    assert v[-1] < 0.6 * v[0]
    theta = comparison.runs[control_runs.ADAPTIVE].theta
    start, middle, end = comparison.torque_error(theta[[0, len(theta) // 2, -1]])
    assert start > 0.1
    assert end < middle < start
    assert end < start / 8


def test_first_moments_settle_where_the_payload_has_them(example: ModuleType, comparison) -> None:
    """Gravity weighs them, so that this motion tells them; inertias that it hardly needs are free to stay."""
    names, theta = comparison.regressor.names, comparison.runs[control_runs.ADAPTIVE].theta
    added = comparison.truth - comparison.regressor.parameters
    moments = [k for k, name in enumerate(names) if name.startswith("M") and abs(added[k]) > 0.1]
    assert {names[k] for k in moments} == {"MXR2", "MYR3", "MYR5", "MX6", "MY6"}
    for k in moments:
        assert theta[-1, k] == pytest.approx(comparison.truth[k], abs=0.15 * abs(added[k])), names[k]


def test_other_laws_leave_their_parameters_alone(example: ModuleType, comparison) -> None:
    for name, run in comparison.runs.items():
        assert (np.ptp(run.theta, axis=0) > 0).any() == (name == control_runs.ADAPTIVE), name


def test_result_folder_in_figure_and_table_out(
    example: ModuleType, comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """All of main but the runs, which the fixture has made already."""
    given = []
    monkeypatch.setattr(control_runs, "compare", lambda result, *_: given.append(result) or comparison)
    comparison.result.save(tmp_path / "result")
    words = [str(tmp_path / "result"), "--quick", "-o", str(tmp_path / "control.png")]
    monkeypatch.setattr(sys, "argv", ["example_control", *words])
    assert example.main() == 0
    np.testing.assert_array_equal(given[0].parameters, comparison.result.parameters)
    assert (tmp_path / "control.png").read_bytes().startswith(b"\x89PNG")
    text = (tmp_path / "control.md").read_text(encoding="utf-8")
    assert "`scripts/example_control RESULT --quick`" in text
    assert str(tmp_path) not in text
    assert all(f"| {name} | " in text for name in comparison.runs)
    assert capsys.readouterr().err == ""


def test_unusable_results_and_names_are_told_in_one_line(
    example: ModuleType, comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["example_control", str(tmp_path), "-o", str(tmp_path / "control.png")])
    assert example.main() == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())
    monkeypatch.setattr(sys, "argv", ["example_control", "-o", str(tmp_path / "missing" / "control.png")])
    with pytest.raises(SystemExit, match="2"):
        example.main()
    other = replace(comparison.result, robot=identify.load_robot("tx40"))
    with pytest.raises(InputError, match="wants a fit of the built-in rx90"):
        control_runs.compare(other, example.unseen(quick=True))
