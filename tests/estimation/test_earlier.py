"""What earlier results tell the next design: information, parameters as limits of effort, noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import identify
from identify.errors import InputError
from identify.estimation.earlier import density, earlier, information, next_excitation
from identify.estimation.identification import Identification
from identify.experiment.simulation import simulate
from identify.experiment.trajectory import random_trajectory
from identify.regressor.regressor import Regressor
from identify.robot.robot import Drive, Limits, Link, Robot

SIGMA = np.array([0.15, 0.09])


@pytest.fixture(scope="module")
def arm() -> Robot:
    """Two axes with offsets; noise at `standard` has the deviations SIGMA."""
    first = Link(7.0, (0.05, -0.02, 0.11), (0.12, 0.011, -0.007, 0.15, 0.006, 0.09))
    second = Link(3.5, (0.17, 0.03, -0.04), (0.02, -0.003, 0.002, 0.06, 0.004, 0.05))
    joint = type(identify.load_robot("rx90").joints[0])
    shoulder = joint(
        "shoulder", r=0.3, limits=Limits((-2.0, 2.2), 3.0, 12.0, 150.0), link=first, drive=Drive(0.4, 3.1, 4.2, 0.5)
    )
    elbow = joint(
        "elbow",
        parent=0,
        alpha=np.pi / 2,
        d=0.35,
        limits=Limits((-1.8, 1.6), 4.0, 15.0, 90.0),
        link=second,
        drive=Drive(0.2, 1.9, 2.3, -0.3),
    )
    return Robot("two-joint arm", (shoulder, elbow))


@pytest.fixture(scope="module")
def result(arm: Robot) -> Identification:
    log, _ = simulate(arm, random_trajectory(arm, 1, fundamental_hz=0.2, periods=2), "standard", 0)
    return identify.fit(log, arm)


def test_information_is_the_inverse_covariance_in_the_regressors_order(arm: Robot, result: Identification) -> None:
    regressor = Regressor(arm)
    found = information(regressor, result)
    assert_allclose(found @ result.covariance, np.eye(regressor.p), atol=1e-8)
    # A result with more parameters: what they leave open stays open.
    backwards = np.arange(len(result.names))[::-1]
    wider = np.zeros((len(backwards) + 1,) * 2)
    wider[:-1, :-1] = result.covariance[np.ix_(backwards, backwards)]
    wider[-1, -1], wider[-1, 0], wider[0, -1] = 4.0, 1e-5, 1e-5
    names = (*(result.names[i] for i in backwards), "Fc1")
    assert_allclose(information(regressor, replace(result, names=names, covariance=wider)), found, rtol=1e-9)


def test_noise_is_that_of_the_simulated_sensors(arm: Robot, result: Identification) -> None:
    found = np.sqrt(density(Regressor(arm), result) * 1000)
    # position noise adds to the effort's own
    assert (found > 0.8 * SIGMA).all()
    assert (found < 2.0 * SIGMA).all()
    without = density(Regressor(arm), replace(result, curves={}))
    rows = result.record["fit"]["per_joint"]
    assert_allclose(without, [row["moving_rmse"] ** 2 / 20 for row in rows])


def test_the_guess_is_the_identified_robot_inside_the_limits_that_are_given(arm: Robot, result: Identification) -> None:
    slower = tuple(replace(joint, limits=replace(joint.limits, velocity=1.0)) for joint in arm.joints)
    unknown = tuple(replace(joint, link=Link(), drive=Drive()) for joint in slower)
    guess, known = earlier(replace(arm, joints=unknown), [result, result])
    assert [joint.limits.velocity for joint in guess.joints] == [1.0, 1.0]
    true = Regressor(arm).parameters
    # within what the fit says of itself: the robot given had no inertia at all
    assert (np.abs(Regressor(guess).parameters - true) < 6 * result.std + 1e-9).all()
    assert known.information is not None
    assert_allclose(known.information, 2 * information(Regressor(arm), result))


def test_effort_limits_hold_for_the_identified_parameters(arm: Robot, result: Identification) -> None:
    """An arm described without inertia would be driven beyond its efforts, were it not for the earlier result."""
    weak = tuple(
        replace(joint, link=Link(), drive=Drive(), limits=replace(joint.limits, effort=limit))
        for joint, limit in zip(arm.joints, (19.0, 13.0), strict=True)
    )
    unknown = replace(arm, joints=weak)

    def worst(trajectory: identify.Trajectory) -> float:
        q, dq, ddq = trajectory.sample(np.linspace(0.5, 5.5, 2001))
        effort = Regressor(arm).inverse_dynamics(q, dq, ddq, Regressor(arm).parameters)
        return float((np.abs(effort).max(axis=0) / [19.0, 13.0]).max())

    blind = identify.excite(unknown, duration=5.0, starts=1)
    assert worst(blind) > 1.2
    assert worst(identify.excite(unknown, duration=5.0, starts=1, earlier=[result])) < 1.0


def test_results_of_another_robot_are_refused_in_one_line(arm: Robot, result: Identification) -> None:
    longer = (arm.joints[0], replace(arm.joints[1], d=0.4))
    for other in (replace(arm, joints=longer), identify.load_robot("rx90"), replace(arm, gravity=(0.0, 9.81, 0.0))):
        with pytest.raises(InputError, match="the earlier result is of another robot") as caught:
            next_excitation(other, [result])
        assert "\n" not in str(caught.value)
