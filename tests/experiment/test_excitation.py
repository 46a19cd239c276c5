"""Designed motions: exact gradients, limits and rest against independent oracles, and worth more than chance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from arms import STANFORD
from capsules import engine_gaps
from chains import random_chain, without
from oracle import inverse_dynamics

from identify import load_robot
from identify.errors import InputError
from identify.experiment.assessment import assess
from identify.experiment.clearance import Clearance
from identify.experiment.design import Design
from identify.experiment.excitation import energy_harmonics, excite
from identify.experiment.limits import working_limits
from identify.experiment.simulation import simulate
from identify.experiment.trajectory import Trajectory, random_trajectory
from identify.regressor.regressor import Regressor
from identify.robot.robot import Limits, Robot, Transmission
from identify.robot.transforms import from_roll_pitch_yaw, to_matrix


@pytest.fixture(scope="module")
def rx90() -> Robot:
    return load_robot("rx90")


@pytest.fixture(scope="module")
def designed(rx90: Robot) -> Trajectory:
    return excite(rx90, "torque", starts=1)


@pytest.fixture(scope="module")
def designed_for_energy(rx90: Robot) -> Trajectory:
    return excite(rx90, "energy", starts=1)


def coupled_chain() -> Robot:
    robot = random_chain(np.random.default_rng(21), 3)
    return replace(robot, transmission=Transmission(((40.0, 0.0, 0.0), (0.0, 50.0, 0.0), (0.0, 30.0, 45.0))))


def prismatic_tree_without_limits() -> Robot:
    robot = without(random_chain(np.random.default_rng(8), 4, tree=True), limits=Limits())
    types = ("revolute", "prismatic", "revolute", "prismatic")
    joints = (replace(joint, type=type) for joint, type in zip(robot.joints, types, strict=True))
    return replace(robot, joints=tuple(joints))


def known_arm() -> Robot:
    """An arm with a sliding joint that can reach itself and the floor."""
    joints = tuple(replace(joint, limits=Limits((-2.5, 2.5), 3.0, 10.0, 60.0)) for joint in STANFORD.joints[:5])
    return replace(STANFORD, joints=joints, floor=-0.3, tool=to_matrix(from_roll_pitch_yaw([0.1, 0.0, 0.3], [0.0] * 3)))


@pytest.mark.parametrize("criterion", ["torque", "energy", "both"])
@pytest.mark.parametrize("make", [coupled_chain, prismatic_tree_without_limits, known_arm])
def test_gradient_is_that_of_the_augmented_lagrangian(criterion: str, make) -> None:  # type: ignore[no-untyped-def]
    design = Design(make(), criterion, 6.0, 5)
    assert (design.clearance is None) == (make is prismatic_tree_without_limits)
    rng = np.random.default_rng(5)
    # beyond the limits at some samples, so that all kinds pull
    x = design.fourier.random_point(rng, fill=1.3)
    multipliers = rng.uniform(0.0, 3.0, (design.rows, design.samples))
    gradient = design.lagrangian(x, 50.0, multipliers)[1]
    assert np.count_nonzero(design.excess(x) > 0) > 10
    if make is known_arm:
        assert (design.excess(x)[4 * design.robot.n :] > 0).any(axis=1).all()

    def along(direction: np.ndarray, h: float) -> float:
        return (
            design.lagrangian(x + h * direction, 50.0, multipliers)[0]
            - design.lagrangian(x - h * direction, 50.0, multipliers)[0]
        ) / (2 * h)

    for direction in rng.standard_normal((3, len(x))) / np.sqrt(len(x)):
        numeric = (4 * along(direction, 2e-5) - along(direction, 4e-5)) / 3
        assert gradient @ direction == pytest.approx(numeric, rel=1e-6, abs=1e-6 * np.linalg.norm(gradient))


def dense(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return trajectory.sample(np.linspace(0.0, trajectory.duration, 6001))


@pytest.mark.parametrize("name", ["designed", "designed_for_energy"])
def test_all_limits_hold_between_samples_too(name: str, rx90: Robot, request: pytest.FixtureRequest) -> None:
    trajectory = request.getfixturevalue(name)
    q, dq, ddq = dense(trajectory)
    drives = [joint.drive for joint in rx90.joints]
    friction = dq * [d.viscous for d in drives] + np.sign(dq) * [d.coulomb for d in drives] + [d.offset for d in drives]
    effort = inverse_dynamics(rx90, q, dq, ddq) + friction
    shares = []
    for j, joint in enumerate(rx90.joints):
        low, high = joint.limits.position
        assert low < q[:, j].min() < q[:, j].max() < high
        for signal, limit in ((dq, "velocity"), (ddq, "acceleration"), (effort, "effort")):
            shares.append(np.abs(signal[:, j]).max() / getattr(joint.limits, limit))
    assert max(shares) < 0.995
    # and they are used: a design that stays far inside would tell less
    assert max(shares) > 0.95


@pytest.mark.parametrize("name", ["designed", "designed_for_energy"])
def test_the_arm_is_clear_of_itself_and_the_floor_by_mujocos_measure(
    name: str, rx90: Robot, request: pytest.FixtureRequest
) -> None:
    trajectory = request.getfixturevalue(name)
    clearance = Clearance.of(rx90)
    assert clearance is not None
    assert (len(clearance.pairs), len(clearance.over)) == (3, 3)
    q = trajectory.sample(np.linspace(0.5, 10.5, 150))[0]
    least = min(min(engine_gaps(clearance, pose)) for pose in q)
    assert 0.01 < least < 0.05
    assert "joint_" in trajectory.note.split(" mm between ")[1]
    # A motion inside all other limits may well run into the arm itself and through the floor.
    blind = random_trajectory(rx90, 0)
    assert clearance.gaps(blind.sample(np.linspace(0.5, 10.5, 1000))[0].T).min() < -0.05


def test_every_period_starts_and_ends_at_rest(designed: Trajectory) -> None:
    ends = designed.rest + designed.period * np.arange(designed.periods + 1)
    # just inside the motion, where `sample` doesn't set the rest by itself
    _, dq, ddq = designed.sample(ends[:-1] + 1e-9)
    assert np.abs(dq).max() < 1e-7
    assert np.abs(ddq).max() < 1e-6
    assert (designed.periods, designed.rest, designed.criterion, designed.period) == (3, 0.5, "torque", 10.0)


def test_the_simulated_robot_runs_it_without_breaking_a_limit(rx90: Robot, designed: Trajectory) -> None:
    log, _ = simulate(rx90, replace(designed, periods=1), noise="none")
    assert log.findings == ()
    share = np.abs(log.effort).max(axis=0) / [joint.limits.effort for joint in rx90.joints]
    assert 0.9 < share.max() < 1.0


def geometric_mean_std(robot: Robot, trajectory: Trajectory) -> float:
    """Mean size of the parameters' standard deviations that one period allows, effort noise ∝ the effort limits."""
    q, dq, ddq = trajectory.sample(trajectory.rest + np.arange(1000) / 1000 * trajectory.period)
    rows = Regressor(robot).torque(q, dq, ddq) / np.array([[j.limits.effort] for j in robot.joints])
    information = np.einsum("kip,kir->pr", rows, rows)
    size = np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information / np.outer(size, size))
    return float(np.exp(np.mean(np.log(np.sqrt(np.diag(inverse)) / size))))


def clear(robot: Robot, trajectory: Trajectory) -> Trajectory:
    """The motion made smaller about its mean pose until it is clear of itself and of the floor."""
    clearance = Clearance.of(robot)
    assert clearance is not None
    t = np.linspace(0.0, trajectory.duration, 3001)
    while clearance.gaps(trajectory.sample(t)[0].T).min() < 0:
        trajectory = replace(trajectory, a=0.98 * trajectory.a, b=0.98 * trajectory.b)
    return trajectory


def test_a_design_tells_far_more_than_random_motions(
    rx90: Robot, designed: Trajectory, designed_for_energy: Trajectory
) -> None:
    chance = [clear(rx90, random_trajectory(rx90, seed, fill=0.95)) for seed in range(3)]
    assert geometric_mean_std(rx90, designed) < 0.5 * min(geometric_mean_std(rx90, motion) for motion in chance)
    looked_at = [assess(rx90, motion, "energy") for motion in chance]
    energy = assess(rx90, designed_for_energy, "energy")
    assert energy.energy_condition < 0.02 * min(one.energy_condition for one in looked_at)
    assert energy.value < min(one.value for one in looked_at) - 8
    torque = assess(rx90, designed, "torque")
    # the bar of the design: 35 for the torque model, 3,000 for the energy model; random motions have 11–15 and 3e4–5e5
    assert torque.torque_condition < 12
    assert energy.energy_condition < 300
    assert torque.within_limits
    assert energy.within_limits


def test_assessment_agrees_with_plain_numpy(rx90: Robot, designed: Trajectory) -> None:
    found = assess(rx90, designed, "torque")
    regressor = Regressor(rx90)
    t = designed.rest + np.linspace(0.0, designed.period, 2001)
    q, dq, ddq = designed.sample(t)
    rows = regressor.torque(q[:-1], dq[:-1], ddq[:-1]).reshape(-1, regressor.p)
    assert found.torque_condition == pytest.approx(np.linalg.cond(rows / np.linalg.norm(rows, axis=0)), rel=0.02)
    edges = np.arange(0, 2001, 10)
    power = regressor.power(dq)
    work = np.array([np.trapezoid(power[a : a + 11], t[a : a + 11], axis=0) for a in edges[:-1]])
    windows = np.diff(regressor.energy(q, dq)[edges], axis=0) + work
    assert found.window == pytest.approx(0.05)
    assert found.energy_condition == pytest.approx(np.linalg.cond(windows / np.linalg.norm(windows, axis=0)), rel=1e-3)
    velocity = np.abs(dq) / [joint.limits.velocity for joint in rx90.joints]
    assert found.margins.use["velocity"] == pytest.approx(velocity.max(), rel=1e-3)
    assert found.unexcited == ()
    assert designed.note == found.summary()
    assert f"torque cond {found.torque_condition:.3g}" in designed.note


def test_the_same_arguments_give_the_same_bits_and_another_seed_another_motion() -> None:
    robot = replace(STANFORD, joints=STANFORD.joints[:3], floor=0.0)
    first, again, other = (excite(robot, "torque", 4.0, seed, starts=1, harmonics=3) for seed in (3, 3, 4))
    assert first.to_toml() == again.to_toml()
    assert not np.array_equal(first.a, other.a)


def test_robots_without_limits_and_with_sliding_joints_get_the_working_limits() -> None:
    robot = prismatic_tree_without_limits()
    trajectory = excite(robot, "both", 6.0, starts=1)
    q, dq, ddq = dense(trajectory)
    limits = working_limits(robot)
    assert (np.abs(q - limits.middle).max(axis=0) < limits.half).all()
    assert (np.abs(dq).max(axis=0) < limits.velocity).all()
    assert (np.abs(ddq).max(axis=0) < limits.acceleration).all()
    assert (np.abs(ddq).max(axis=0) > 0.5 * limits.acceleration).any()
    found, chance = (
        assess(robot, motion, "both") for motion in (trajectory, random_trajectory(robot, 1, fundamental_hz=1 / 6))
    )
    assert found.value < chance.value - 3
    assert set(found.margins.use.values()) == {0.0}
    assert found.margins.tightest == ""


def test_an_arm_with_unknown_links_and_a_coupled_wrist() -> None:
    robot = load_robot("tx40")
    trajectory = excite(robot, "torque", starts=1)
    q, dq, _ = dense(trajectory)
    for j, joint in enumerate(robot.joints):
        assert joint.limits.position[0] < q[:, j].min() < q[:, j].max() < joint.limits.position[1]
    assert (np.abs(dq).max(axis=0) < [joint.limits.velocity for joint in robot.joints]).all()
    found, chance = (assess(robot, motion, "torque") for motion in (trajectory, random_trajectory(robot, 0)))
    assert found.unexcited == ()
    assert found.torque_condition < 0.5 * chance.torque_condition
    assert found.value < chance.value - 3
    assert found.margins.use["effort"] == 0.0


def test_too_few_harmonics_leave_the_energy_model_singular_and_it_says_so() -> None:
    """Drives' kinetic energies, their viscous work and their offsets' work are trigonometric polynomials of degree
    2 L at rest at both ends: at most 4 L − 1 are independent, and a TX40 has 6 + 6 + 6 and the wrist's two, and
    those of its parallel axes."""
    robot = load_robot("tx40")
    few = assess(robot, random_trajectory(robot, 0, harmonics=5), "energy")
    assert few.energy_condition == float("inf")
    assert {"Ia6", "Fv1", "Iam6", "Fvm6"} <= set(few.unexcited)
    assert "can't tell apart" in few.summary()
    enough = assess(robot, random_trajectory(robot, 0, harmonics=energy_harmonics(robot)), "energy")
    assert enough.unexcited == ()
    assert energy_harmonics(robot) == 7
    assert energy_harmonics(random_chain(np.random.default_rng(0), 2)) == 5


def test_progress_is_told_in_order_and_in_words() -> None:
    told: list[tuple[float, str]] = []
    excite(
        coupled_chain(), "torque", 6.0, starts=2, harmonics=3, progress=lambda share, text: told.append((share, text))
    )
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert any(text.startswith("start 1 of 2: torque cond ") for _, text in told)


def test_limits_that_no_motion_can_hold_are_told_in_one_line() -> None:
    robot = random_chain(np.random.default_rng(2), 2)
    joints = tuple(
        replace(joint, type="revolute", limits=replace(joint.limits, effort=0.5), alpha=1.2) for joint in robot.joints
    )
    with pytest.raises(InputError, match=r"no motion of 4 s within the limits.*% of joint_[12]'s effort") as caught:
        excite(replace(robot, joints=joints), duration=4.0, starts=1)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"criterion": "power"}, "choose one of torque, energy, both"),
        ({"duration": 0.0}, "positive time"),
        ({"duration": float("nan")}, "positive time"),
        ({"harmonics": 1}, "harmonics is 1"),
        ({"starts": 0}, "starts is 0"),
        ({"seed": -1}, "seed is -1"),
    ],
)
def test_arguments_out_of_range_are_refused(change: dict, words: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(InputError, match=words):
        excite(random_chain(np.random.default_rng(0), 1), **change)
