"""Priors and bounds that a user gives, and what consistency costs, through a whole fit."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exact_logs import arm, exact_log, fitted, unknown

from identify.errors import InputError, RobotError
from identify.estimation.identified_robot import identified_robot
from identify.robot.robot import Limits, Robot
from identify.robot.toml import read_toml
from identify.robot.toml_writing import write_toml
from identify.workflow import fit

ARM = arm(1)
NOISE = 0.02


def drawn(share: float) -> Robot:
    """The arm with links that its drawing makes heavier by a share, shapes and centres alike."""
    joints = []
    for joint in ARM.joints:
        link = joint.link
        heavier = replace(link, mass=link.mass * (1 + share), inertia=tuple(x * (1 + share) for x in link.inertia))
        joints.append(replace(joint, link=heavier))
    return replace(ARM, joints=tuple(joints))


def masses(robot: Robot) -> np.ndarray:
    return np.array([joint.link.mass for joint in robot.joints])


def test_a_tight_prior_holds_links_to_the_drawing_and_a_loose_one_to_the_data() -> None:
    log, robot = exact_log(ARM, noise=NOISE), drawn(0.2)
    loose, tight = (fit(log, robot, friction="plain", prior=prior) for prior in (10.0, 1e-6))
    np.testing.assert_allclose(masses(identified_robot(tight)), masses(robot), rtol=5e-3)
    kept = loose.record["physical"]
    assert tight.record["physical"]["cost"]["chi_squared"] > 1e3 * max(kept["cost"]["chi_squared"], 1e-3)
    np.testing.assert_allclose(kept["parameters"], loose.parameters, rtol=0.02, atol=0.02)
    np.testing.assert_array_equal(tight.parameters, loose.parameters)
    assert kept["pull"]["prior_percent"] == 1000.0
    without = fitted().record["physical"]["pull"]
    assert without["prior_percent"] is None
    assert without["prior_percent_reason"]


def test_what_it_costs_is_told_in_points_and_in_shares_of_the_residual() -> None:
    log, robot = exact_log(ARM, noise=NOISE), drawn(0.2)
    record = fit(log, robot, friction="plain", prior=0.01).record
    cost = record["physical"]["cost"]
    before, after = (x["relative_residual_percent"] for x in (record["fit"], record["physical"]["fit"]))
    assert after > before
    assert cost["residual_points"] == pytest.approx(after - before, rel=1e-9)
    assert cost["residual_growth_percent"] == pytest.approx(100 * (after - before) / before, rel=1e-9)
    free = record["settings"]["effective_samples"] - len(record["names"])
    assert cost["residual_uncertainty_percent"] == pytest.approx(100 / math.sqrt(2 * free), rel=1e-9)


def test_bounds_of_the_robot_file_are_kept(tmp_path: Path) -> None:
    """Other splits of the masses move alike, so that bounds cost nothing where they leave one of them."""
    log = exact_log(ARM, noise=NOISE)
    free = masses(identified_robot(fit(log, unknown(ARM), friction="plain")))
    low, high = 1.2 * free[1], 0.9 * free[2]
    joints = list(unknown(ARM).joints)
    joints[1] = replace(joints[1], limits=replace(joints[1].limits, mass=(low, math.inf)))
    joints[2] = replace(joints[2], limits=replace(joints[2].limits, mass=(0.0, high)))
    (tmp_path / "bounded.toml").write_text(write_toml(replace(ARM, joints=tuple(joints))))
    bounded = read_toml(tmp_path / "bounded.toml")
    assert bounded.joints[1].limits.mass == (low, math.inf)
    result = fit(log, bounded, friction="plain")
    found = masses(identified_robot(result))
    assert found[1] >= low * (1 - 1e-6)
    assert found[2] <= high * (1 + 1e-6)
    assert result.record["physical"]["consistent"]


@pytest.mark.parametrize("bounds", ["[2.0, 1.0]", "[-1.0, 2.0]", "[0.0, 0.0]", "[inf, inf]", "[1.0]"])
def test_bounds_that_no_mass_meets_are_refused(bounds: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(f'name = "arm"\n[[joint]]\nname = "one"\nlimits = {{ mass = {bounds} }}\n')
    with pytest.raises(RobotError, match=r"joint 'one': limits.mass: expected"):
        read_toml(path)


def test_a_prior_without_links_is_refused() -> None:
    with pytest.raises(InputError, match="gives no link a mass"):
        fit(exact_log(ARM), unknown(ARM), prior=0.3)
    with pytest.raises(InputError, match="standard deviation above 0"):
        fit(exact_log(ARM), ARM, prior=-0.3)
    assert Limits().mass == (0.0, math.inf)
