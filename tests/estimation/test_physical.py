"""Links that physics allows: a possible robot's own model is kept, an impossible one gets its nearest neighbour."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
from chains import random_chain
from exact_logs import unknown
from scipy.optimize import least_squares

from identify.errors import InputError
from identify.estimation.physical import (
    LEAST,
    PULL,
    Consistent,
    information_of,
    nearest_consistent,
    pseudo_inertias,
    smallest_eigenvalues,
)
from identify.estimation.reference import DESCRIPTION, NEUTRAL, Reference, mean_length, reference
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.mjcf import to_mjcf
from identify.robot.robot import Drive, Joint, Link, Robot
from identify.validation.engines import pinocchio_torque

WIDTH = 11


def robots() -> list[Robot]:
    return [
        load_robot("rx90"),
        random_chain(np.random.default_rng(4), 4),
        random_chain(np.random.default_rng(11), 5, special=True),
        random_chain(np.random.default_rng(12), 4, tree=True),
    ]


def body(link: np.ndarray) -> np.ndarray:
    """(4, 4) ∫ [x; 1][x; 1]ᵀ dm of a link's ten parameters."""
    xx, xy, xz, yy, yz, zz, mx, my, mz, m = link[:10]
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    second = np.trace(tensor) / 2 * np.eye(3) - tensor
    first = np.array([mx, my, mz])
    return np.block([[second, first[:, None]], [first[None], np.array([[m]])]])


def precise(regressor: Regressor, estimate: np.ndarray, percent: float = 1.0, seed: int = 0) -> np.ndarray:
    """(p, p) the information of an estimate whose parameters have about `percent` σ and are correlated."""
    p = len(estimate)
    mix = np.eye(p) + 0.3 * np.random.default_rng(seed).normal(size=(p, p)) / np.sqrt(p)
    return information_of(
        mix @ np.diag((percent / 100 * np.maximum(np.abs(estimate), np.abs(estimate).mean() / 10)) ** 2) @ mix.T
    )


def solved(robot: Robot, estimate: np.ndarray, information: np.ndarray, **named: Any) -> Consistent:
    regressor = Regressor(robot)
    return nearest_consistent(regressor, estimate, information, reference(regressor, estimate, False), **named)


@pytest.mark.parametrize("number", range(4))
def test_a_possible_robot_keeps_its_model(number: int) -> None:
    """Not the robot's own links, which the base parameters don't tell, but links that no experiment could refute."""
    robot = robots()[number]
    regressor = Regressor(robot)
    # Without offsets, as that of a vertical slide can't be told from weight; what is left of it is added below.
    truth = regressor.theta(robot.standard, {f"Fv{j + 1}": x.drive.viscous for j, x in enumerate(robot.joints)})
    found = solved(unknown(robot), truth, precise(regressor, truth))
    assert found.possible
    assert found.cost < 1e-4  # what the pull takes
    np.testing.assert_allclose(found.parameters, truth, rtol=1e-4, atol=1e-4 * np.abs(truth).max())
    np.testing.assert_allclose(
        found.parameters, regressor.theta(found.standard, found.extra), rtol=1e-14, atol=1e-14 * np.abs(truth).max()
    )
    for link in found.standard.reshape(-1, WIDTH):
        assert np.linalg.eigvalsh(body(link))[0] > 0
        assert link[10] >= 0
    assert np.abs(found.standard - robot.standard).max() > 1e-3
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot, found.standard, friction=False, limits=False))
    assert model.nv == robot.n
    states = np.random.default_rng(number).uniform(-1, 1, (3, 20, robot.n))
    torque = pinocchio_torque(robot, robot.standard, *states)
    offsets = [found.extra[f"off{j + 1}"] for j in range(robot.n)]
    assert np.abs(offsets).max() < 1e-2 * np.abs(torque).max()
    np.testing.assert_allclose(
        pinocchio_torque(robot, found.standard, *states) + offsets, torque, rtol=0, atol=1e-4 * np.abs(torque).max()
    )


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("Ia6", -0.01),  # an actuator with a negative inertia
        ("ZZ6", -0.05),  # a body with a negative moment about its axis
        ("XY6", 5.0),  # a product far beyond the moments
        ("ZZR1", 0.0),  # less about axis 1 than the links beyond it have alone
        ("MX6", 4.0),  # first moments that need more inertia than there is
        ("Fv3", -1.0),  # a joint that friction drives
        ("Fs2", -3.0),
    ],
)
def test_an_impossible_estimate_gets_a_possible_neighbour(name: str, value: float) -> None:
    robot = load_robot("rx90")
    regressor = Regressor(robot)
    estimate = regressor.parameters.copy()
    estimate[regressor.names.index(name)] = value
    information = precise(regressor, estimate)
    found = solved(unknown(robot), estimate, information)
    assert found.possible
    assert found.cost > 1.0
    shift = found.parameters - estimate
    assert found.cost == pytest.approx(shift @ information @ shift, rel=1e-6)
    # The robot itself is possible, so that the nearest one can't be farther off.
    apart = regressor.parameters - estimate
    assert found.cost <= apart @ information @ apart
    assert max(found.primal_residual, found.dual_residual) < 1e-7
    assert found.gap < 1e-6 * max(found.cost, 1.0)
    mujoco.MjModel.from_xml_string(to_mjcf(robot, found.standard, friction=False))


def by_descent(regressor: Regressor, estimate: np.ndarray, information: np.ndarray, bodies: Reference) -> float:
    """Smallest cost and pull found by Levenberg-Marquardt over P = LEAST·P₀ + A·Aᵀ, Ia and friction as squares."""
    n, names = regressor.robot.n, regressor.names[len(regressor.base.names) :]
    root = np.linalg.cholesky(information).T
    lower = np.tril_indices(4)
    halves = [np.linalg.inv(np.linalg.cholesky(p)) for p in bodies.bodies]
    units = np.eye(WIDTH * n + len(names))
    theta_of = (
        root
        @ np.array([regressor.theta(u[: WIDTH * n], dict(zip(names, u[WIDTH * n :], strict=True))) for u in units]).T
    )
    wanted = root @ estimate
    free = np.array([name.startswith("off") for name in names])

    def residuals(x: np.ndarray) -> np.ndarray:
        standard, pulled = [], []
        for j in range(n):
            a = np.zeros((4, 4))
            a[lower] = x[10 * j : 10 * j + 10]
            p = LEAST * bodies.bodies[j] + a @ a.T
            pulled += (halves[j] @ (p - bodies.bodies[j]) @ halves[j].T).ravel().tolist()
            inertia = np.trace(p[:3, :3]) * np.eye(3) - p[:3, :3]
            actuator = x[10 * n + j] ** 2
            pulled.append(actuator / bodies.actuators[j] - 1)
            standard += [*inertia[np.triu_indices(3)], *p[:3, 3], p[3, 3], actuator]
        rest = x[WIDTH * n :]
        theta = theta_of @ np.concatenate([standard, np.where(free, rest, rest**2)])
        return np.concatenate([theta - wanted, np.sqrt(PULL) * np.array(pulled)])

    starts = np.random.default_rng(0).normal(size=(2, WIDTH * n + len(names)))
    return min(2 * least_squares(residuals, start, x_scale="jac", max_nfev=200).cost for start in starts)


@pytest.mark.parametrize("seed", [1, 2])
def test_nothing_possible_is_nearer(seed: int) -> None:
    """Against descent in a parametrisation in which everything is possible, from estimates that are not."""
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, 2)
    regressor = Regressor(robot)
    estimate = regressor.parameters * (1 + 1.5 * rng.normal(size=regressor.p))
    information = precise(regressor, estimate, percent=20.0, seed=seed)
    bodies = reference(regressor, estimate, description=False)
    found = nearest_consistent(regressor, estimate, information, bodies)
    theirs = by_descent(regressor, estimate, information, bodies)
    assert found.cost > 0.1
    ours = found.cost + PULL * found.pull
    assert found.eigenvalues.min() > 0
    assert ours <= theirs * (1 + 1e-6)
    assert ours == pytest.approx(theirs, rel=0.01)  # descent creeps where a body grows thin


def test_one_joint_about_a_vertical_axis_is_known_in_closed_form() -> None:
    """ZZ + Ia alone: anything positive is possible; a negative one costs its square over the variance."""
    robot = random_chain(np.random.default_rng(0), 1)
    robot = replace(robot, joints=(replace(robot.joints[0], type="revolute", alpha=0.0),))
    regressor = Regressor(robot)
    estimate = regressor.parameters.copy()
    at = 0
    assert regressor.names == ("ZZR1", "Fv1", "Fs1", "off1")
    information = np.diag(1 / np.full(regressor.p, 0.1) ** 2)
    estimate[:] = np.abs(estimate)
    estimate[at] = 0.5
    assert solved(robot, estimate, information).cost < 1e-4
    estimate[at] = -0.5
    found = solved(robot, estimate, information)
    least = 2 * LEAST * reference(regressor, estimate, False).bodies[0][0, 0]
    assert found.possible
    assert found.parameters[at] == pytest.approx(least, rel=1e-3)
    assert found.cost == pytest.approx(((0.5 + least) / 0.1) ** 2, rel=1e-4)


def test_a_change_of_the_unit_of_mass_changes_nothing_else() -> None:
    robot = load_robot("rx90")
    regressor = Regressor(robot)
    estimate = regressor.parameters * (1 + 0.3 * np.random.default_rng(3).normal(size=regressor.p))
    information = precise(regressor, estimate, 10.0)
    one = solved(robot, estimate, information)
    thousand = solved(robot, 1000 * estimate, information / 1e6)
    np.testing.assert_allclose(thousand.standard / 1000, one.standard, rtol=0, atol=1e-5 * np.abs(one.standard).max())
    assert thousand.cost == pytest.approx(one.cost, rel=1e-5)


def test_masses_keep_to_their_bounds() -> None:
    robot = load_robot("rx90")
    regressor = Regressor(robot)
    truth = regressor.parameters
    information = precise(regressor, truth)
    free = solved(unknown(robot), truth, information).standard[9::WIDTH]
    bounds = np.array([[0.0, np.inf]] * 6)
    bounds[2] = [0.0, 0.8 * free[2]]
    bounds[4] = [1.5 * free[4], np.inf]
    found = solved(unknown(robot), truth, information, mass_bounds=bounds)
    masses = found.standard[9::WIDTH]
    assert masses[2] == pytest.approx(bounds[2, 1], rel=1e-4)
    assert masses[4] == pytest.approx(bounds[4, 0], rel=1e-4)
    assert found.possible
    assert found.cost < 1e-3  # other splits of the masses move alike
    with pytest.raises(InputError, match="expected a lowest and a highest mass"):
        solved(robot, truth, information, mass_bounds=np.array([[2.0, 1.0]] * 6))


def test_a_coupled_motor_is_part_of_what_its_joints_have() -> None:
    """The TX40's motor 6 turns with joints 5 and 6: their Ia and Fv hold its own."""
    robot = load_robot("tx40")
    regressor = Regressor(robot)
    estimate = np.full(regressor.p, 0.5)
    for name, value in (("Ia6", 0.2), ("Iam6", 0.6), ("Fv5", 0.1), ("Fvm6", 0.9), ("Fsm6", -0.4)):
        estimate[regressor.names.index(name)] = value
    found = solved(robot, estimate, precise(regressor, estimate, 10.0))
    ia5, ia6 = found.standard[10::WIDTH][4:]
    extra = found.extra
    slack = 1e-6
    assert extra["Iam6"] <= min(ia5, ia6) + slack
    assert extra["Fvm6"] <= min(extra["Fv5"], extra["Fv6"]) + slack
    assert extra["Fsm6"] >= 0
    assert extra["Iam6"] == pytest.approx(ia6, abs=1e-4)
    assert extra["Fvm6"] == pytest.approx(extra["Fv5"], abs=1e-4)


def test_the_counterweight_of_a_vertical_slide_is_no_negative_mass() -> None:
    """Its constant force can't be told from weight: what looks like a mass below zero is an offset."""
    drive = Drive(inertia=1.0, viscous=2.0, coulomb=3.0, offset=-400.0)
    arm = random_chain(np.random.default_rng(2), 2)
    slide = Joint("slide", "prismatic", link=Link(5.0, (0.1, 0.0, 0.0), (0.1, 0.0, 0.0, 0.1, 0.0, 0.1)), drive=drive)
    joints = (slide, *(replace(joint, parent=joint.parent + 1, type="revolute") for joint in arm.joints))
    robot = Robot("lift", joints)
    regressor = Regressor(robot)
    assert "off1" in regressor.dropped
    truth = regressor.parameters
    assert truth[0] < 0
    assert regressor.names[0].startswith("M")
    found = solved(unknown(robot), truth, precise(regressor, truth))
    assert found.possible
    assert found.cost < 1e-2
    assert found.extra["off1"] < -100
    exact = regressor.theta(found.standard, found.extra)
    np.testing.assert_allclose(found.parameters, exact, rtol=0, atol=1e-12 * np.abs(truth).max())


@pytest.mark.parametrize("seed", range(10))
def test_whatever_comes_the_answer_is_possible_and_near(seed: int) -> None:
    """Any chain or tree, any precision and correlation: never dearer than the robot that the estimate was made from."""
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, int(rng.integers(1, 7)), special=seed % 3 == 0, tree=seed % 3 == 1)
    regressor = Regressor(robot)
    truth = regressor.parameters
    size = 10 ** rng.uniform(-5, 0.5)
    estimate = truth + size * np.maximum(np.abs(truth), np.abs(truth).mean()) * rng.normal(size=regressor.p)
    deviation = size * 10 ** rng.uniform(-3, 1.5, regressor.p) * np.maximum(np.abs(truth), 1e-3)
    axes = np.linalg.qr(rng.normal(size=(regressor.p, regressor.p)))[0]
    spread = 10 ** rng.uniform(-rng.uniform(0, 9), 0, regressor.p)
    information = information_of((axes * spread) @ axes.T * np.outer(deviation, deviation))
    found = solved(unknown(robot), estimate, information)
    assert found.possible
    shift = truth - estimate
    assert found.cost <= 1.001 * (shift @ information @ shift)


def test_what_the_data_leave_open_goes_to_the_reference() -> None:
    """The description's links come back from their base parameters; without it, other links that move alike."""
    robot = load_robot("rx90")
    regressor = Regressor(robot)
    truth = regressor.parameters
    information = precise(regressor, truth)
    bodies = reference(regressor, truth, description=True)
    assert set(bodies.kinds) == {DESCRIPTION}
    known = nearest_consistent(regressor, truth, information, bodies)
    np.testing.assert_allclose(known.standard, robot.standard, rtol=0, atol=1e-2)
    assert reference(Regressor(unknown(robot)), truth, description=True).kinds == (NEUTRAL,) * 6
    assert np.abs(solved(robot, truth, information).standard - robot.standard).max() > 1.0


def test_a_strong_pull_is_a_prior() -> None:
    robot = load_robot("rx90")
    regressor = Regressor(robot)
    estimate = regressor.parameters * (1 + 0.5 * np.random.default_rng(8).normal(size=regressor.p))
    information = precise(regressor, estimate, 50.0)
    bodies = reference(regressor, estimate, description=True)
    weak, strong = (nearest_consistent(regressor, estimate, information, bodies, pull=w) for w in (PULL, 1e4))
    assert strong.pull < 1e-3 * weak.pull
    assert strong.cost > weak.cost
    rigid = len(regressor.base.names)
    np.testing.assert_allclose(
        strong.parameters[:rigid], regressor.parameters[:rigid], rtol=0, atol=0.02 * np.abs(estimate).max()
    )


def test_references_are_possible_whatever_the_description_says() -> None:
    """Points, rods and inertias that no body has are thickened; links without mass become balls."""
    robot = load_robot("rx90")
    odd = [
        Link(2.0, (0.1, 0.2, 0.3)),
        Link(2.0, (0.0, 0.0, 0.1), (0.5, 0.0, 0.0, 0.5, 0.0, 0.0)),
        Link(2.0, (0.0, 0.0, 0.1), (0.9, 0.0, 0.0, 0.1, 0.0, 0.1)),
        Link(),
    ]
    joints = [replace(joint, link=link) for joint, link in zip(robot.joints, odd, strict=False)]
    changed = replace(robot, joints=(*joints, *robot.joints[4:]))
    regressor = Regressor(changed)
    bodies = reference(regressor, regressor.parameters, description=True)
    assert bodies.kinds == (DESCRIPTION, DESCRIPTION, DESCRIPTION, NEUTRAL, DESCRIPTION, DESCRIPTION)
    for entry in bodies.bodies:
        assert np.linalg.eigvalsh(entry)[0] > 1e-6
    np.testing.assert_allclose(bodies.bodies[0][:, 3], [0.2, 0.4, 0.6, 2.0])
    np.testing.assert_allclose(bodies.bodies[5], body(robot.joints[5].link.standard), rtol=1e-12, atol=1e-15)
    assert (bodies.actuators > 0).all()
    assert mean_length(robot) == pytest.approx(0.45)


def test_smallest_eigenvalues_are_those_of_the_pseudo_inertia() -> None:
    standard = np.random.default_rng(5).normal(size=3 * WIDTH)
    expected = [np.linalg.eigvalsh(body(link))[0] for link in standard.reshape(3, WIDTH)]
    np.testing.assert_allclose(smallest_eigenvalues(standard), expected, rtol=1e-12)
    np.testing.assert_allclose(pseudo_inertias(standard)[1], body(standard[WIDTH : 2 * WIDTH]), rtol=1e-15)


def test_the_solver_takes_less_than_its_bar() -> None:
    """50 ms on the RX-90 [issue 4]; the best of five, as other work may share the processor."""
    robot = load_robot("rx90")
    regressor = Regressor(robot)
    estimate = regressor.parameters * (1 + 0.3 * np.random.default_rng(3).normal(size=regressor.p))
    information = precise(regressor, estimate, 10.0)
    assert min(solved(robot, estimate, information).seconds for _ in range(5)) < 0.05


def test_information_is_the_inverse_of_a_covariance_of_any_units() -> None:
    rng = np.random.default_rng(1)
    a = rng.normal(size=(6, 6))
    scale = 10.0 ** np.arange(-6, 6, 2)
    covariance = (a @ a.T + np.eye(6)) * np.outer(scale, scale)
    np.testing.assert_allclose(information_of(covariance) @ covariance, np.eye(6), rtol=0, atol=1e-4)
