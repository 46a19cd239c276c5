"""What only the dynamics tell of a log is found, named, and not seen where it is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from beside import tx40_recording
from script_modules import script

from identify.errors import UnsupportedLogError
from identify.experiment.simulation import simulate
from identify.experiment.trajectory import random_trajectory
from identify.logs.finding import ERROR, WARNING
from identify.logs.log import Log
from identify.logs.triage import refusals
from identify.regressor.regressor import Regressor
from identify.robot.robot import Drive, Joint, Limits, Link, Robot
from identify.validation.log_checks import check_log, look_over
from identify.workflow import fit

ROOT = Path(__file__).resolve().parents[2]

ARM = Robot(
    "three-joint arm",
    (
        Joint(
            "turn",
            r=0.3,
            limits=Limits((-2.0, 2.2), 3.0, 12.0, 150.0),
            link=Link(7.0, (0.05, -0.02, 0.11), (0.12, 0.011, -0.007, 0.15, 0.006, 0.09)),
            drive=Drive(0.4, 3.1, 4.2, 0.5),
        ),
        Joint(
            "lift",
            alpha=1.5707963267948966,
            d=0.1,
            limits=Limits((-1.8, 1.6), 3.0, 12.0, 120.0),
            link=Link(5.0, (0.2, 0.03, -0.04), (0.03, -0.003, 0.002, 0.09, 0.004, 0.08)),
            drive=Drive(0.3, 2.2, 3.1, -0.4),
        ),
        Joint(
            "bend",
            d=0.35,
            r=0.05,
            limits=Limits((-1.9, 2.1), 4.0, 18.0, 60.0),
            link=Link(2.5, (0.13, -0.02, 0.05), (0.01, 0.001, -0.002, 0.03, 0.002, 0.025)),
            drive=Drive(0.1, 1.1, 1.3, 0.2),
        ),
    ),
)


@pytest.fixture(scope="module")
def regressor() -> Regressor:
    return Regressor(ARM)


@pytest.fixture(scope="module")
def log() -> Log:
    return moved(0)


def moved(seed: int, noise: str = "standard") -> Log:
    """10 s at rest, in motion, at rest."""
    return simulate(ARM, random_trajectory(ARM, seed, fundamental_hz=0.1, periods=1), noise, seed)[0]


@pytest.mark.parametrize(("seed", "noise"), [(1, "none"), (2, "standard"), (3, "high")])
def test_a_good_log_is_quiet(seed: int, noise: str, regressor: Regressor) -> None:
    assert look_over(moved(seed, noise), ARM, regressor).findings == ()


def turned(log: Log, what: str, joint: int) -> Log:
    values = getattr(log, what).copy()
    values[:, joint] *= -1
    return replace(log, **{what: values})


@pytest.mark.parametrize("joint", range(3))
def test_an_effort_with_the_wrong_sign_is_refused_by_name(joint: int, log: Log, regressor: Regressor) -> None:
    (found,) = check_log(turned(log, "effort", joint), regressor)
    assert (found.kind, found.severity) == ("sign", ERROR)
    assert f"the effort of {ARM.joint_names[joint]} has the wrong sign" in found.text


def test_a_joint_counted_the_wrong_way_round_is_found(log: Log, regressor: Regressor) -> None:
    (found,) = check_log(turned(log, "position", 2), regressor)
    assert "the position of bend has the wrong sign" in found.text


def test_two_faults_are_both_named(log: Log, regressor: Regressor) -> None:
    found = check_log(turned(turned(log, "effort", 0), "effort", 2), regressor)
    assert {name for finding in found for name in finding.joints} >= {"turn", "bend"}
    assert {finding.kind for finding in found} == {"sign"}


@pytest.mark.parametrize(
    ("channels", "words"),
    [
        (("position", "effort"), "lift and bend are swapped"),
        (("effort",), "the efforts of lift and bend are swapped"),
        (("position",), "the positions of lift and bend are swapped"),
    ],
)
def test_swapped_joints_are_found(channels: tuple[str, ...], words: str, log: Log, regressor: Regressor) -> None:
    other = replace(log, **{name: getattr(log, name)[:, [0, 2, 1]] for name in channels})
    found = check_log(other, regressor)
    assert words in found[0].text
    assert found[0].severity == ERROR


@pytest.mark.parametrize("delay", [0.012, -0.008])
def test_a_delay_is_measured(delay: float, log: Log, regressor: Regressor) -> None:
    late = np.column_stack([np.interp(log.time - delay, log.time, x) for x in log.effort.T])
    (found,) = check_log(replace(log, effort=late), regressor)
    assert (found.kind, found.severity) == ("delay", WARNING)
    told = float(found.text.split("the effort is ")[1].split(" ms")[0])
    assert told == pytest.approx(1e3 * abs(delay), abs=0.5)
    assert ("behind" if delay > 0 else "ahead of") in found.text


def test_a_delay_of_one_joint_is_that_joints(log: Log, regressor: Regressor) -> None:
    effort = log.effort.copy()
    effort[:, 1] = np.interp(log.time - 0.02, log.time, effort[:, 1])
    (found,) = check_log(replace(log, effort=effort), regressor)
    assert (found.kind, found.joints) == ("delay", ("lift",))


def test_an_effort_in_another_unit_is_told_by_its_ratio(log: Log, regressor: Regressor) -> None:
    (found,) = check_log(replace(log, effort=log.effort / 20), regressor)
    assert found.kind == "effort unit"
    assert "0.05" in found.text
    bare = replace(ARM, joints=tuple(replace(joint, link=Link()) for joint in ARM.joints))
    assert check_log(replace(log, effort=log.effort / 20), Regressor(bare)) == []


def test_inertia_that_no_acceleration_shows_is_named(regressor: Regressor) -> None:
    slow = simulate(ARM, random_trajectory(ARM, 5, fundamental_hz=0.01, periods=1), "high", 0)[0]
    found = check_log(slow, regressor)
    assert {finding.kind for finding in found} == {"under-excited"}
    assert any("can't be told from zero" in finding.text for finding in found)


def test_fit_refuses_what_triage_calls_an_error(log: Log) -> None:
    with pytest.raises(UnsupportedLogError, match="the effort of lift has the wrong sign"):
        fit(turned(log, "effort", 1), ARM)


def test_without_effort_or_motion_nothing_is_held_against_the_dynamics(log: Log, regressor: Regressor) -> None:
    assert check_log(replace(log, effort=None), regressor) == []
    rest = slice(0, 400)
    part = replace(log, time=log.time[rest], position=log.position[rest], velocity=None, effort=log.effort[rest])
    assert check_log(part, regressor) == []


@pytest.fixture(scope="module")
def study() -> ModuleType:
    return script("check_triage")


@pytest.mark.parametrize(
    "words",
    [
        "jitter",
        "quarter of the rate",
        "clipped",
        "bit of joint 1",
        "0.05 rad midway",
        "joint 6 with the wrong",
        "10 ms",
    ],
)
def test_a_part_of_the_study_of_planted_faults(words: str, study: ModuleType) -> None:
    seed, fault = next((k, fault) for k, fault in enumerate(study.FAULTS) if words in fault.what)
    assert any(study.names(fault, finding) for finding in study.planted(seed, fault))


def test_the_studys_clean_logs_are_quiet(study: ModuleType) -> None:
    assert len(study.FAULTS) >= 20
    assert [found for _, found in study.clean_logs(2)] == [(), ()]


def test_the_measured_tx40_has_no_false_finding() -> None:
    from identify.logs.reading import read_log
    from identify.robot.library import load_robot

    robot = load_robot("tx40")
    found = look_over(read_log(tx40_recording(), ROOT / "datasets" / "tx40.toml", robot.joint_names), robot)
    assert found.findings == ()
    assert refusals(found) == []
