"""The regressor at run time: shapes, blocks, memory, and that Y·θ is the torque of other derivations and engines."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import oracle
import pinocchio as pin
import pytest
from beside import stored_values
from chains import random_chain
from symbolic_models import Motion, function_of, states, tilted

from identify.regressor.columns import smooth_sign
from identify.regressor.kernel import BLOCK
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.robot import Robot, Transmission
from identify.symbolic.expression import Graph
from identify.symbolic.newton_euler import direct_torque


def coupled(robot: Robot) -> Robot:
    """The robot with its last motor driven through the joint before it."""
    matrix = np.diag(np.linspace(20.0, 50.0, robot.n))
    matrix[-1, -2] = 0.7 * matrix[-1, -1]
    return replace(robot, transmission=Transmission(tuple(map(tuple, matrix.tolist()))))


def unequal_rx90() -> Robot:
    """The RX-90 with D3 ≠ RL4: equal lengths would hide a swap."""
    robot = load_robot("rx90")
    joints = list(robot.joints)
    joints[2], joints[3] = replace(joints[2], d=0.45), replace(joints[3], r=0.52)
    return replace(robot, joints=tuple(joints))


@pytest.fixture(scope="module")
def robot() -> Robot:
    """Three joints, one of them sliding, the last two coupled."""
    chain = tilted(random_chain(np.random.default_rng(5), 3))
    joints = (chain.joints[0], replace(chain.joints[1], type="prismatic"), replace(chain.joints[2], type="revolute"))
    return coupled(replace(chain, joints=joints))


@pytest.fixture(scope="module")
def regressor(robot: Robot) -> Regressor:
    return Regressor(robot)


def test_names_units_and_shapes(robot: Robot, regressor: Regressor) -> None:
    own = [f"{c}{j}" for j in (1, 2, 3) for c in ("Fv", "Fs", "off")]
    assert regressor.names == (*regressor.base.names, *own, "Iam3", "Fvm3", "Fsm3")
    assert len(regressor.units) == len(regressor.names) == regressor.p
    units = dict(zip(regressor.names, regressor.units, strict=True))
    assert (units["Fv1"], units["Fs1"], units["off1"]) == ("N·m·s/rad", "N·m", "N·m")
    assert (units["Fv2"], units["Fs2"], units["off2"]) == ("N·s/m", "N", "N")
    assert (units["Iam3"], units["Fvm3"], units["Fsm3"]) == ("kg·m²", "N·m·s/rad", "N·m")
    assert not regressor.dropped
    rng = np.random.default_rng(0)
    q, dq, ddq = states(rng, robot, 7)
    n, p = robot.n, regressor.p
    assert regressor.torque(q, dq, ddq).shape == (7, n, p)
    assert regressor.torque(q[0], dq[0], ddq[0]).shape == (n, p)
    assert regressor.torque(q[:1], dq[:1], ddq[:1]).shape == (1, n, p)
    assert regressor.torque(q[:0], dq[:0], ddq[:0]).shape == (0, n, p)
    assert regressor.energy(q, dq).shape == (7, p)
    assert regressor.energy(q[0], dq[0]).shape == (p,)
    assert regressor.power(dq).shape == (7, p)
    assert regressor.power(dq[0]).shape == (p,)
    assert regressor.slotine_li(q, dq, ddq, q).shape == (7, n, p)
    assert regressor.slotine_li(q[0], dq[0], ddq[0], q[0]).shape == (n, p)
    theta = rng.normal(size=p)
    assert regressor.inverse_dynamics(q, dq, ddq, theta).shape == (7, n)
    assert regressor.inverse_dynamics(q[0], dq[0], ddq[0], theta).shape == (n,)
    assert regressor.inverse_dynamics(q[:0], dq[:0], ddq[:0], theta).shape == (0, n)


def test_without_friction_it_is_the_base_parameters_alone(robot: Robot, regressor: Regressor) -> None:
    bare = Regressor(robot, friction=False)
    assert bare.names == regressor.base.names
    assert bare.units == regressor.units[: bare.p]
    signals = states(np.random.default_rng(1), robot, 5)
    np.testing.assert_array_equal(bare.torque(*signals), regressor.torque(*signals)[:, :, : bare.p])
    np.testing.assert_array_equal(bare.energy(*signals[:2]), regressor.energy(*signals[:2])[:, : bare.p])
    np.testing.assert_array_equal(bare.power(signals[1]), np.zeros((5, bare.p)))
    theta = np.arange(1.0, bare.p + 1)
    np.testing.assert_allclose(bare.inverse_dynamics(*signals, theta), bare.torque(*signals) @ theta, rtol=1e-12)


@pytest.mark.parametrize("count", [1, 511, 512, 513, 1025, BLOCK - 1, BLOCK, BLOCK + 1, 2 * BLOCK + 1])
def test_blocks_do_not_show(robot: Robot, regressor: Regressor, count: int) -> None:
    """Every row is what the sample alone gives, at the edges of blocks above all."""
    rng = np.random.default_rng(count)
    q, dq, ddq = states(rng, robot, count)
    theta = rng.normal(size=regressor.p)
    torque, energy = regressor.torque(q, dq, ddq), regressor.energy(q, dq)
    power, effort = regressor.power(dq), regressor.inverse_dynamics(q, dq, ddq, theta)
    reference = regressor.slotine_li(q, dq, ddq, q)
    scale = np.abs(torque).max()
    for k in {0, 1, 510, 511, 512, 513, BLOCK - 1, BLOCK, BLOCK + 1, 2 * BLOCK, count - 1} & set(range(count)):
        np.testing.assert_allclose(torque[k], regressor.torque(q[k], dq[k], ddq[k]), rtol=0, atol=1e-13 * scale)
        np.testing.assert_allclose(energy[k], regressor.energy(q[k], dq[k]), rtol=0, atol=1e-13 * scale)
        np.testing.assert_allclose(power[k], regressor.power(dq[k]), rtol=0, atol=1e-13 * scale)
        np.testing.assert_allclose(effort[k], torque[k] @ theta, rtol=0, atol=1e-12 * scale)
        np.testing.assert_allclose(
            reference[k], regressor.slotine_li(q[k], dq[k], ddq[k], q[k]), rtol=0, atol=1e-12 * scale
        )


def test_out_takes_the_result(robot: Robot, regressor: Regressor) -> None:
    q, dq, ddq = states(np.random.default_rng(2), robot, BLOCK + 3)
    expected = regressor.torque(q, dq, ddq)
    shape = expected.shape
    for out in (
        np.full(shape, np.nan),
        np.full((2 * shape[0], *shape[1:]), np.nan)[::2],
        np.full(shape[::-1], np.nan).T,
        np.full((shape[0], shape[1], shape[2] + 4), np.nan)[:, :, 1:-3],
    ):
        assert regressor.torque(q, dq, ddq, out=out) is out
        np.testing.assert_array_equal(out, expected)
    single = np.full(shape[1:], np.nan)
    assert regressor.torque(q[4], dq[4], ddq[4], out=single) is single
    np.testing.assert_array_equal(single, regressor.torque(q[4], dq[4], ddq[4]))
    for wrong in (np.empty(shape[1:]), np.empty((shape[0], shape[1] * shape[2])), np.empty(shape, dtype=np.float32)):
        with pytest.raises(ValueError, match=r"out is float\d\d of shape .* expected float64 of shape \(1027, 3, "):
            regressor.torque(q, dq, ddq, out=wrong)
    with pytest.raises(ValueError, match="out is"):
        regressor.torque(q[0], dq[0], ddq[0], out=np.empty((1, *shape[1:])))


def test_what_does_not_fit_is_refused(robot: Robot, regressor: Regressor) -> None:
    q = np.zeros((4, 3))
    with pytest.raises(ValueError, match=r"\(4, 3\), \(5, 3\), \(4, 3\); expected"):
        regressor.torque(q, np.zeros((5, 3)), q)
    with pytest.raises(ValueError, match=r"\(4, 2\).*expected \(3,\) or \(N, 3\)"):
        regressor.energy(q[:, :2], q[:, :2])
    with pytest.raises(ValueError, match=r"theta has shape \(5,\); expected \(\d+,\)"):
        regressor.inverse_dynamics(q, q, q, np.zeros(5))


def test_lists_and_integers_serve(robot: Robot, regressor: Regressor) -> None:
    q, dq, ddq = [1, 0, -1], [2, 1, -1], [0, 1, 3]
    expected = regressor.torque(*(np.array(x, dtype=float) for x in (q, dq, ddq)))
    np.testing.assert_array_equal(regressor.torque(q, dq, ddq), expected)  # type: ignore[arg-type]


def test_memory_is_the_result_and_a_block(robot: Robot, regressor: Regressor) -> None:
    samples = 200_000
    q, dq, ddq = states(np.random.default_rng(3), robot, samples)
    out = np.empty((samples, robot.n, regressor.p))
    few = np.empty((BLOCK, robot.n, regressor.p))
    theta = np.ones(regressor.p)
    regressor.torque(q[:BLOCK], dq[:BLOCK], ddq[:BLOCK], out=few)

    def peak(work: object) -> int:
        tracemalloc.start()
        work()  # type: ignore[operator]
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found

    million = 1_000_000
    assert peak(lambda: regressor.torque(q, dq, ddq, out=out)) < 2 * million
    q, dq, ddq = q[:100_000], dq[:100_000], ddq[:100_000]
    column = 8 * len(q)  # bytes of one signal of one joint
    assert peak(lambda: regressor.inverse_dynamics(q, dq, ddq, theta)) < robot.n * column + 2 * million
    assert peak(lambda: regressor.energy(q, dq)) < regressor.p * column + 2 * million
    assert peak(lambda: regressor.power(dq)) < regressor.p * column + 2 * million
    # Without out, the result itself and nothing else that grows.
    few_samples = 20_000
    signals = (q[:few_samples], dq[:few_samples], ddq[:few_samples])
    size = out[:few_samples].nbytes
    assert size <= peak(lambda: regressor.torque(*signals)) < size + 2 * million
    assert size <= peak(lambda: regressor.slotine_li(*signals, q[:few_samples])) < size + 2 * million


def test_sign_of_rest_is_zero_and_may_be_smoothed(robot: Robot, regressor: Regressor) -> None:
    q, dq, ddq = states(np.random.default_rng(4), robot, 4)
    dq[0] = [0.0, -0.0, 0.5]
    dq[1] = [0.3, -0.7 * 0.5, 0.5]  # joint 3's motor stands still: 0.7·q̇2 + q̇3 = 0 needs q̇2 = −q̇3/0.7
    dq[1, 1] = -dq[1, 2] / 0.7
    at = {name: k for k, name in enumerate(regressor.names)}
    exact = regressor.torque(q, dq, ddq)
    for j in range(3):
        others = [i for i in range(3) if i != j]
        np.testing.assert_array_equal(exact[:, j, at[f"Fs{j + 1}"]], np.sign(dq[:, j]))
        np.testing.assert_array_equal(exact[:, others, at[f"Fs{j + 1}"]], 0.0)
        np.testing.assert_array_equal(exact[:, j, at[f"Fv{j + 1}"]], dq[:, j])
        np.testing.assert_array_equal(exact[:, j, at[f"off{j + 1}"]], 1.0)
    assert not exact[0, :2, at["Fs1"]].any()
    smooth = regressor.torque(q, dq, ddq, sign=smooth_sign(0.8))
    np.testing.assert_array_equal(smooth[:, 2, at["Fs3"]], np.clip(dq[:, 2] / 0.8, -1, 1))
    motor = 0.7 * dq[:, 1] + dq[:, 2]
    np.testing.assert_allclose(smooth[:, 1, at["Fsm3"]], 0.7 * np.clip(motor / 0.8, -1, 1), atol=1e-15)
    theta = np.random.default_rng(0).normal(size=regressor.p)
    found = regressor.inverse_dynamics(q, dq, ddq, theta, sign=smooth_sign(0.8))
    np.testing.assert_allclose(found, smooth @ theta, rtol=1e-11, atol=1e-11)
    reference = regressor.slotine_li(q, dq, dq, ddq, sign=smooth_sign(0.8))
    np.testing.assert_allclose(reference, smooth, rtol=0, atol=1e-11)
    np.testing.assert_allclose(
        regressor.power(dq, sign=smooth_sign(0.8))[:, at["Fsm3"]], motor * np.clip(motor / 0.8, -1, 1), atol=1e-15
    )


def full_friction(robot: Robot, dq: np.ndarray) -> np.ndarray:
    """(N, n) friction of the drives, from the definition [2.63]."""
    drives = [joint.drive for joint in robot.joints]
    columns = [d.viscous * v + d.coulomb * np.sign(v) + d.offset for d, v in zip(drives, dq.T, strict=True)]
    return np.array(columns).T


@pytest.mark.parametrize("seed", range(10))
def test_numeric_twin(seed: int) -> None:
    """Base parameters and friction give the torque of the standard ones, by Pinocchio and by the recurrence."""
    rng = np.random.default_rng(seed)
    robot = tilted(random_chain(rng, 2 + seed % 5, special=seed % 2 == 1, tree=seed % 3 == 2))
    if seed == 0:
        robot = unequal_rx90()
    regressor = Regressor(robot)
    theta = regressor.parameters
    q, dq, ddq = states(rng, robot, 40)
    graph = Graph()
    recurrence = function_of(graph, robot.n, direct_torque(graph, robot, list(robot.standard)))(q, dq, ddq)
    for rigid in (oracle.inverse_dynamics(robot, q, dq, ddq), recurrence):
        expected = rigid + full_friction(robot, dq)
        tolerance = 1e-11 * np.abs(expected).max()
        np.testing.assert_allclose(regressor.torque(q, dq, ddq) @ theta, expected, rtol=0, atol=tolerance)
        np.testing.assert_allclose(regressor.inverse_dynamics(q, dq, ddq, theta), expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize("seed", range(4))
def test_energy_against_pinocchio(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = tilted(random_chain(rng, 5, tree=seed % 2 == 1)) if seed else unequal_rx90()
    regressor = Regressor(robot, friction=False)
    q, dq, _ = states(rng, robot, 20)
    model, order = oracle.pinocchio_model(robot), oracle.branch_order(robot)
    data = model.createData()
    expected = np.array(
        [
            pin.computeKineticEnergy(model, data, a[order], b[order])
            + pin.computePotentialEnergy(model, data, a[order])
            for a, b in zip(q, dq, strict=True)
        ]
    )
    found = regressor.energy(q, dq) @ regressor.parameters
    np.testing.assert_allclose(np.diff(found), np.diff(expected), rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("seed", range(8))
def test_work_is_stored_or_lost_column_by_column(seed: int) -> None:
    """∫q̇ᵀY dt = Δh + ∫power dt for every parameter, friction and coupled motors included."""
    rng = np.random.default_rng(seed)
    robot = coupled(tilted(random_chain(rng, 4, tree=seed % 2 == 1)))
    regressor = Regressor(robot)
    motion = Motion(rng, robot.n, monotonic=True)  # no joint or motor turns round: the sign is smooth on the way
    q, dq, ddq = motion.at(motion.nodes)
    assert dq.min() > 0
    work = motion.weights @ np.einsum("kn,knp->kp", dq, regressor.torque(q, dq, ddq))
    start, end = regressor.energy(*motion.at(np.array([0.0, 1.0]))[:2])
    lost = motion.weights @ regressor.power(dq)
    scale = np.maximum(np.abs(work), np.abs(regressor.energy(q, dq)).max(axis=0))
    assert (np.abs(work) > 1e-6 * scale).all()
    np.testing.assert_array_less(np.abs(work - (end - start) - lost), 1e-10 * scale)


def test_slotine_li_at_the_reference_is_the_torque(robot: Robot, regressor: Regressor) -> None:
    q, dq, ddq = states(np.random.default_rng(6), robot, 30)
    expected = regressor.torque(q, dq, ddq)
    np.testing.assert_allclose(
        regressor.slotine_li(q, dq, dq, ddq), expected, rtol=0, atol=1e-13 * np.abs(expected).max()
    )


@pytest.mark.parametrize("seed", [0, 1, 2, 5, 6])
def test_slotine_li_is_the_christoffel_form(seed: int) -> None:
    """Linear in the reference; Ȧ − 2C antisymmetric; C(q,u)·v symmetric in u and v, as Christoffel symbols are."""
    rng = np.random.default_rng(seed)
    robot = coupled(tilted(random_chain(rng, 4, tree=seed % 2 == 1)))
    regressor = Regressor(robot)
    theta = rng.uniform(0.5, 2, regressor.p)
    n, rest = robot.n, np.zeros(robot.n)
    q, u = states(rng, robot, 2)[:2, 0]

    def coriolis(q: np.ndarray, u: np.ndarray) -> np.ndarray:
        columns = [regressor.slotine_li(q, u, e, rest) - regressor.slotine_li(q, u, rest, rest) for e in np.eye(n)]
        return np.array([c @ theta for c in columns]).T

    def inertia(q: np.ndarray) -> np.ndarray:
        columns = [
            regressor.slotine_li(q, rest, rest, e) - regressor.slotine_li(q, rest, rest, rest) for e in np.eye(n)
        ]
        return np.array([c @ theta for c in columns]).T

    a, c = inertia(q), coriolis(q, u)
    scale = np.abs(c).max()
    assert scale > 1e-2
    np.testing.assert_allclose(a, a.T, rtol=0, atol=1e-12 * np.abs(a).max())
    step = 1e-5
    rate = (inertia(q + step * u) - inertia(q - step * u)) / (2 * step)
    skew = rate - 2 * c
    np.testing.assert_allclose(skew, -skew.T, rtol=0, atol=1e-7 * scale)
    v, acceleration = rng.normal(size=(2, n))
    np.testing.assert_allclose(coriolis(q, v) @ u, c @ v, rtol=0, atol=1e-11 * scale)
    held = regressor.slotine_li(q, u, v, acceleration) @ theta
    parts = regressor.slotine_li(q, u, rest, rest) @ theta + a @ acceleration + c @ v
    np.testing.assert_allclose(held, parts, rtol=0, atol=1e-11 * np.abs(parts).max())


def test_slotine_li_rubs_at_the_actual_speed(robot: Robot, regressor: Regressor) -> None:
    q, dq, ddq = states(np.random.default_rng(8), robot, 5)
    found = regressor.slotine_li(q, dq, dq[::-1], ddq)
    at_speed = regressor.torque(q, dq, ddq)
    inertial = len(regressor.base.names)
    np.testing.assert_array_equal(found[:, :, inertial:], at_speed[:, :, inertial:])


def test_oracles_of_the_rx90() -> None:
    """Torque, A, C, Q and energies of ../shared/oracles/rx90-dynamics.json, which names the tools that made it."""
    data = stored_values("rx90-dynamics.json")
    robot = unequal_rx90()
    assert (robot.joints[2].d, robot.joints[3].r, list(robot.gravity)) == (data["D3"], data["RL4"], data["gravity_0g"])
    regressor = Regressor(robot)
    order = [name.rstrip("1").replace("Ia", "IA") for name in robot.standard_names[:11]]
    standard = np.ravel([[link[name] for name in order] for link in data["std_params"]])
    base = regressor.base.matrix @ standard
    assert [name.replace("Ia", "IA") for name in regressor.base.names] == data["base_order"]
    np.testing.assert_allclose(base, [data["base_params"][name] for name in data["base_order"]], rtol=1e-12, atol=1e-14)
    friction = np.ravel([[link["FV"], link["FS"], 0.0] for link in data["std_params"]])
    theta = np.concatenate([base, friction])
    q, dq, ddq = (np.array(data[key]) for key in ("q", "qd", "qdd"))
    rest = np.zeros(6)

    def close(found: np.ndarray, expected: list | np.ndarray) -> None:
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())

    close(regressor.torque(q, dq, ddq)[:, :40] @ base, data["tau_rigid_with_IA"])
    close(regressor.torque(q, dq, ddq)[:, 40:] @ friction, data["tau_friction"])
    without_wrench = np.array(data["tau_total"]) - data["tau_external"]
    close(regressor.inverse_dynamics(q, dq, ddq, theta), without_wrench)
    gravity = regressor.torque(q, rest, rest)[:, :40] @ base
    close(gravity, data["Q"])
    bare = Regressor(robot, friction=False)
    inertia = np.array([bare.torque(q, rest, e) @ base - gravity for e in np.eye(6)]).T
    close(inertia, data["A"])
    close(bare.torque(q, dq, rest) @ base - gravity, data["C_qd"])
    christoffel = np.array([bare.slotine_li(q, dq, e, rest) @ base - gravity for e in np.eye(6)]).T
    close(christoffel, data["C_christoffel"])
    kinetic = (bare.energy(q, dq) - bare.energy(q, rest)) @ base
    assert kinetic == pytest.approx(data["kinetic_energy_with_IA"], rel=1e-10)
    drives = 0.5 * np.array([link["IA"] for link in data["std_params"]]) @ dq**2
    assert kinetic - drives == pytest.approx(data["kinetic_energy_rigid"], rel=1e-10)
    # Energy is defined up to a constant: compare the change since q = 0, where y or z of every link stands upright
    # and O_4, O_5, O_6 lie RL4 above the base, so that U = 9.81·(Σ upright first moments + RL4·(M4 + M5 + M6)) [2.62].
    links = data["std_params"]
    upright = sum(link[axis] for link, axis in zip(links, ("MZ", "MY", "MY", "MZ", "MY", "MZ"), strict=True))
    at_zero = 9.81 * (upright + data["RL4"] * sum(link["M"] for link in links[3:]))
    raised = (bare.energy(q, rest) - bare.energy(rest, rest)) @ base
    assert raised == pytest.approx(data["potential_energy"] - at_zero, rel=1e-10)
