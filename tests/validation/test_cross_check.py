"""Three engines agree on any robot, and a regressor that is wrong does not pass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from chains import random_chain
from exact_logs import unknown

from identify.estimation.physical import smallest_eigenvalues
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.robot import Robot
from identify.symbolic.base_parameters import base_parameters
from identify.validation import cross_check as module
from identify.validation.cross_check import (
    any_standard,
    check_robot,
    consistent_links,
    cross_check_identified,
    cross_check_regressor,
    random_states,
)

AGREE = 1e-10


def chain(seed: int) -> Robot:
    """2 to 5 joints; odd seeds branch, even ones are full of right angles, zero lengths and parallel axes."""
    rng = np.random.default_rng(seed)
    return random_chain(rng, int(rng.integers(2, 6)), special=seed % 2 == 0, tree=seed % 2 == 1)


@pytest.mark.parametrize("seed", range(8))
def test_random_robots(seed: int) -> None:
    found = check_robot(chain(seed), samples=150)
    assert found["pinocchio"]["max_abs_error"] <= AGREE
    assert found["mujoco"]["max_abs_error"] <= AGREE
    assert found["rank"] == found["base_parameters"]
    assert found["agree"] is True


@pytest.mark.parametrize("name", ["rx90", "tx40"])
def test_built_in_robots_on_a_thousand_samples(name: str) -> None:
    found = check_robot(load_robot(name))
    assert found["pinocchio"]["samples"] == found["mujoco"]["samples"] == 1000
    assert found["pinocchio"]["max_abs_error"] <= AGREE
    assert found["mujoco"]["max_abs_error"] <= AGREE
    assert (found["base_parameters"], found["rank"], found["agree"]) == (40, 40, True)


@pytest.mark.parametrize("change", [{"d": 1e-5}, {"alpha": 1e-5}, {"theta": 1e-5}])
def test_a_regressor_of_a_slightly_different_arm_is_caught(
    change: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ten micrometres or microradians, on the second joint."""
    robot = load_robot("rx90")
    second = robot.joints[1]
    wrong = replace(second, **{key: getattr(second, key) + by for key, by in change.items()})
    other = replace(robot, joints=(robot.joints[0], wrong, *robot.joints[2:]))
    monkeypatch.setattr(module, "Regressor", lambda _, friction=True: Regressor(other, friction))
    found = check_robot(robot, samples=100)
    assert found["pinocchio"]["max_abs_error"] > 1e-7
    assert found["mujoco"]["max_abs_error"] > 1e-7
    assert found["agree"] is False


def test_one_wrong_entry_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    class OneWrong(Regressor):
        def torque(self, *states: np.ndarray, **named: object) -> np.ndarray:
            y = super().torque(*states, **named)  # type: ignore[arg-type]
            _, i, c = np.unravel_index(np.abs(y).argmax(), y.shape)
            y[:, i, c] *= 1 + 1e-6
            return y

    monkeypatch.setattr(module, "Regressor", OneWrong)
    found = cross_check_regressor(chain(3), samples=50)
    assert found["pinocchio"]["max_abs_error"] > 1e-9
    assert found["mujoco"]["max_abs_error"] <= AGREE  # takes inverse dynamics, which is another program


def test_a_count_of_base_parameters_that_is_not_the_rank_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = chain(3)
    monkeypatch.setattr(module, "_rank", lambda robot: 1 + len(Regressor(robot, friction=False).names))
    assert check_robot(robot, samples=20)["agree"] is False


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_identified_model_runs_in_both_engines(seed: int) -> None:
    robot = chain(seed)
    base = Regressor(robot, friction=False).parameters
    found = cross_check_identified(unknown(robot), base, robot.standard, samples=100)
    assert found["pinocchio"]["max_abs_error"] <= AGREE
    assert found["mujoco"]["max_abs_error"] <= AGREE
    assert "mujoco_reason" not in found


def test_an_impossible_model_runs_in_pinocchio_alone_and_says_why() -> None:
    robot = load_robot("rx90")
    regressor = Regressor(robot, friction=False)
    base = regressor.parameters.copy()
    base[regressor.names.index("Ia6")] = -0.1
    found = cross_check_identified(robot, base, None, samples=100)
    assert found["pinocchio"]["max_abs_error"] <= AGREE
    assert found["mujoco"] is None
    assert "no links that physics allows" in found["mujoco_reason"]


@pytest.mark.parametrize("seed", range(4))
def test_any_base_vector_has_a_standard_one(seed: int) -> None:
    for robot in (load_robot("rx90"), chain(seed)):
        matrix = base_parameters(robot).matrix
        base = np.random.default_rng(seed).normal(size=len(matrix)) * 5
        np.testing.assert_allclose(matrix @ any_standard(robot, base), base, rtol=0, atol=1e-11)


def test_the_standard_set_stays_near_unit_masses() -> None:
    """What the base parameters leave open is not blown up: the exact start comes back, masses elsewhere stay tame."""
    robot = load_robot("rx90")
    matrix = base_parameters(robot).matrix
    start = np.tile([0.0] * 9 + [1.0, 0.0], 6)
    np.testing.assert_allclose(any_standard(robot, matrix @ start), start, rtol=0, atol=1e-12)
    assert np.abs(any_standard(robot, matrix @ robot.standard)).max() < 2 * np.abs(robot.standard).max()


def test_states_fill_the_limits_of_the_joints() -> None:
    robot = load_robot("rx90")
    q, dq, ddq = random_states(robot, 4000, seed=1)
    low, high = np.array([joint.limits.position for joint in robot.joints]).T
    assert (q >= low).all()
    assert (q <= high).all()
    np.testing.assert_allclose(np.ptp(q, axis=0), high - low, rtol=0.01)
    assert np.abs(dq).max() == pytest.approx(2, rel=0.01)
    assert np.abs(ddq).max() == pytest.approx(5, rel=0.01)
    np.testing.assert_array_equal(random_states(robot, 4000, seed=1)[0], q)


def test_limits_that_no_cosine_bears_are_none() -> None:
    robot = load_robot("rx90")
    wide = replace(robot.joints[0], limits=replace(robot.joints[0].limits, position=(-1e16, 1e16)))
    robot = replace(robot, joints=(wide, *robot.joints[1:]))
    q = random_states(robot, 100, seed=0)[0]
    assert np.abs(q[:, 0]).max() <= np.pi
    assert check_robot(robot, samples=50)["agree"] is True


def test_invented_links_are_possible_ones() -> None:
    standard = consistent_links(load_robot("rx90"), seed=3)
    assert smallest_eigenvalues(standard).min() > 0
    assert standard[10::11].min() > 0
    assert (np.abs(standard.reshape(6, 11)[:, [1, 2, 4]]) > 1e-4).all()
