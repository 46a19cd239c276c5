"""The load from two logs: a constructed truth is found, with an uncertainty that counts what the fit leaves open."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import carried
import numpy as np
import pytest
from carried import one_joint_moving
from chains import random_chain, random_link
from exact_logs import arm, exact_log, motion
from oracle import inverse_dynamics

from identify.errors import UnsupportedLogError
from identify.estimation.least_squares import weighted_least_squares
from identify.estimation.observation import torque_blocks, torque_residual
from identify.estimation.payload import Unloaded, estimate_load, load_matrix, root_of_information
from identify.estimation.reduction import reduced
from identify.estimation.settings import Settings
from identify.logs.log import Log
from identify.regressor.regressor import Regressor
from identify.robot.payload import carrying
from identify.robot.robot import Drive, Joint, Link, Robot

SETTINGS = Settings(guard_s=0.05)
LOAD = Link(3.0, (0.06, -0.04, 0.11), (0.03, 0.004, -0.003, 0.025, 0.002, 0.02))


@lru_cache(maxsize=1)
def regressor() -> Regressor:
    return Regressor(arm(1))


def unloaded(log: Log, of: Regressor | None = None, settings: Settings = SETTINGS) -> Unloaded:
    """What weighted least squares makes of a log without a load, with fixed settings."""
    used = of or regressor()
    reduction = reduced(torque_blocks(used, [log], settings))
    found = weighted_least_squares(reduction, lambda theta: torque_residual(used, [log], settings, theta))
    return Unloaded(used, settings, found.parameters, found.covariance)


def with_friction(robot: Robot, share: float) -> Robot:
    """The robot with Coulomb and viscous friction so many times as large."""
    joints = []
    for joint in robot.joints:
        d = joint.drive
        joints.append(replace(joint, drive=Drive(d.inertia, share * d.viscous, share * d.coulomb, d.offset)))
    return replace(robot, joints=tuple(joints))


@pytest.mark.parametrize(("seed", "tree"), [(0, False), (1, True), (3, True), (9, False)])
def test_a_load_adds_its_ten_parameters_to_those_of_the_arm(seed: int, tree: bool) -> None:
    """Against Pinocchio, on random chains and trees of revolute and prismatic joints."""
    rng = np.random.default_rng(seed)
    robot, load = random_chain(rng, 4, tree=tree), random_link(rng)
    of = Regressor(robot)
    q, dq, ddq = rng.uniform(-2, 2, (3, 20, 4))
    expected = inverse_dynamics(carrying(robot, load), q, dq, ddq) - inverse_dynamics(robot, q, dq, ddq)
    found = of.torque(q, dq, ddq) @ load_matrix(of) @ load.standard
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()


def test_the_low_cut_off_of_the_unloaded_log_is_not_put_on_the_load() -> None:
    """It was low enough for the motion without the load; with it the arm swings otherwise."""
    known = unloaded(exact_log(arm(1)))
    quiet = replace(known, settings=replace(known.settings, quiet_cutoff_hz=1.0))
    loaded = [exact_log(carrying(arm(1), LOAD), 2)]
    found, other = estimate_load(known, loaded), estimate_load(quiet, loaded)
    np.testing.assert_array_equal(other.parameters, found.parameters)
    assert other.settings.quiet_cutoff_hz is None


def test_a_load_is_found_in_exact_logs() -> None:
    """What is left is what the filters cost; the same load by the wrong centre of mass is 50 times further off."""
    found = estimate_load(unloaded(exact_log(arm(1))), [exact_log(carrying(arm(1), LOAD), 2)])
    assert found.untold.shape == (10, 0)
    assert found.parameters[9] == pytest.approx(3.0, rel=2e-3)
    np.testing.assert_allclose(found.parameters[6:9] / found.parameters[9], LOAD.com, rtol=0, atol=1e-3)
    np.testing.assert_allclose(found.parameters[:6], LOAD.standard[:6], rtol=0, atol=2e-3)
    everything = Regressor(carrying(arm(1), LOAD)).parameters
    torque = np.abs(found.loaded - everything)[: len(regressor().base.names)]
    assert torque.max() < 0.02 * np.abs(everything).max()


def test_standard_deviations_hold_the_truth_over_seeds_and_count_the_fits_own() -> None:
    """Errors over σ have an rms of about one; with the arm taken for perfectly known it is several."""
    scores, naive = [], []
    for seed in range(16):
        bare = unloaded(noisy(arm(1), 1, seed))
        loaded = noisy(carrying(arm(1), LOAD), 2, 100 + seed)
        for known, kept in ((bare, scores), (replace(bare, covariance=1e-6 * bare.covariance), naive)):
            found = estimate_load(known, [loaded])
            kept.append((found.parameters - LOAD.standard) / np.sqrt(np.diag(found.covariance)))
    rms = float(np.sqrt(np.mean(np.square(scores))))
    assert 0.75 < rms < 1.25
    assert np.abs(scores).max() < 4.5
    assert np.sqrt(np.mean(np.square(naive))) > 1.4 * rms


def noisy(robot: Robot, motion: int, seed: int) -> Log:
    """An exact log of one motion with white noise on the effort, of its own seed."""
    log = exact_log(robot, motion)
    assert log.effort is not None
    return replace(log, effort=log.effort + 0.5 * np.random.default_rng(seed).standard_normal(log.effort.shape))


def test_friction_that_changes_with_the_load_is_not_taken_for_load() -> None:
    bare = unloaded(noisy(arm(1), 1, 0))
    log = noisy(with_friction(carrying(arm(1), LOAD), 1.5), 2, 1)
    free, same = estimate_load(bare, [log]), estimate_load(bare, [log], friction=False)
    score = [np.abs(found.parameters - LOAD.standard) / np.sqrt(np.diag(free.covariance)) for found in (free, same)]
    assert score[0].max() < 4.0
    assert score[1].max() > 10.0
    for j, joint in enumerate(arm(1).joints, 1):
        for letters, value in (("Fv", joint.drive.viscous), ("Fs", joint.drive.coulomb)):
            name = f"{letters}{j}"
            assert free.change[name] == pytest.approx(0.5 * value, abs=4 * free.change_std[name])
            assert free.change_std[name] < 0.2 * value
    assert same.change == {}
    # The log is explained as well as by parameters of its own only where friction is free.
    assert free.chi_squared < 3 * free.degrees < same.chi_squared / 3


def test_friction_that_grows_with_the_joints_load_grows_with_what_the_arm_carries() -> None:
    """Fl·|Γ_r|/Γ_m·sign(q̇): what the fit knows of it holds for the loaded arm, whose Γ_r is another."""
    q, dq, ddq = motion(arm(1), 1).sample(np.linspace(0.0, 10.0, 500))
    mean = np.abs(inverse_dynamics(arm(1), q, dq, ddq)).mean(axis=0)
    base = regressor().base.matrix @ arm(1).standard
    settings = replace(
        SETTINGS, friction=("load",), load_parameters=tuple(base.tolist()), mean_load=tuple(mean.tolist())
    )
    growing = np.array([3.0, 2.0, 1.0])

    def log(robot: Robot, of: int, seed: int) -> Log:
        plain = noisy(robot, of, seed)
        q, dq, ddq = motion(robot, of).sample(plain.time)
        share = np.abs(inverse_dynamics(robot, q, dq, ddq)) / mean
        assert plain.effort is not None
        return replace(plain, effort=plain.effort + growing * share * np.sign(dq))

    of = settings.suited(regressor())
    bare = unloaded(log(arm(1), 1, 0), of, settings)
    found = estimate_load(bare, [log(carrying(arm(1), LOAD), 2, 1)], friction=False)
    deviations = np.sqrt(np.diag(found.covariance))
    assert (np.abs(found.parameters - LOAD.standard) / deviations).max() < 4.0
    assert found.settings.load_parameters is not None
    np.testing.assert_allclose(found.settings.load_parameters[-7:], found.loaded[: len(base)][-7:], rtol=0.1, atol=0.05)
    assert np.linalg.norm(np.array(found.settings.load_parameters) - base) > 0.1


def test_no_load_is_found_where_there_is_none() -> None:
    found = estimate_load(unloaded(noisy(arm(1), 1, 0)), [noisy(arm(1), 2, 1)])
    assert np.abs(found.parameters / np.sqrt(np.diag(found.covariance))).max() < 4.0


def test_what_a_motion_of_the_last_joint_alone_tells_is_not_the_mass() -> None:
    """About one axis: the inertia about it, and first moments across it; the rest stays unknown."""
    found = estimate_load(unloaded(noisy(arm(1), 1, 0)), [one_joint_moving(2)])
    told = [found.tells(axis) for axis in np.eye(10)]
    assert told == [False, False, False, False, False, True, True, True, False, False]
    for k in (5, 6, 7):
        assert found.parameters[k] == pytest.approx(carried.LOAD.standard[k], abs=4 * np.sqrt(found.covariance[k, k]))
    # A torque about one axis says nothing of a mass, whatever the arm's own covariance.
    assert found.told.shape == (3, 10)


def test_an_arm_that_can_not_feel_a_mass_is_known_by_its_matrix() -> None:
    """Two joints, the first one upright: a mass only adds to the inertia about it. A third joint tells them apart."""
    first, second, third = arm(1).joints
    upright = replace(first, alpha=0.0, d=0.0)
    across = replace(second, alpha=np.pi / 2, d=0.35)
    beside = replace(third, alpha=0.0, d=0.4)

    def felt(*joints: Joint) -> bool:
        matrix = load_matrix(Regressor(replace(arm(1), joints=joints)))
        return bool(np.linalg.matrix_rank(matrix) > np.linalg.matrix_rank(matrix[:, :9]))

    assert not felt(upright, across)
    assert felt(upright, across, beside)


def test_a_log_without_a_moving_joint_gives_nothing() -> None:
    log = exact_log(arm(1))
    rest = replace(log, position=np.tile(log.position[:1], (log.samples, 1)))
    with pytest.raises(UnsupportedLogError, match="no joint moves"):
        estimate_load(unloaded(log), [rest])


def test_root_of_information_whatever_the_units() -> None:
    rng = np.random.default_rng(0)
    scale = np.diag(10.0 ** rng.uniform(-6, 4, 8))
    mixed = rng.normal(size=(8, 8))
    covariance = scale @ (mixed @ mixed.T + 0.1 * np.eye(8)) @ scale
    root = root_of_information(covariance)
    np.testing.assert_allclose(root @ covariance @ root.T, np.eye(8), rtol=0, atol=1e-8)
