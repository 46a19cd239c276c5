"""The public Python names, used as the interface writes them: one pass from a robot to a result read back."""

from __future__ import annotations

import inspect
from pathlib import Path

import numpy as np
import pytest
import sympy
from exact_logs import arm, exact_log, fitted

import identify


def test_robot() -> None:
    robot = identify.load_robot("rx90")
    assert isinstance(robot, identify.Robot)
    with pytest.raises(AttributeError):
        robot.name = "other"  # type: ignore[misc]
    letters = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M", "Ia")
    assert robot.standard_names == tuple(f"{letter}{j}" for j in range(1, 7) for letter in letters)
    assert robot.standard_names[0] == "XX1"
    assert robot.standard_names[-1] == "Ia6"
    assert robot.standard.shape == (66,)


def test_base_parameters() -> None:
    robot = identify.load_robot("rx90")
    base = identify.base_parameters(robot)
    assert len(base.names) == 40
    assert set(base.grouping) == set(base.names)
    lengths = {"D3": 0.45, "RL4": 0.45}
    values = dict(zip(robot.standard_names, robot.standard, strict=True)) | lengths
    assert base.matrix.shape == (40, 66)
    grouped = base.matrix @ robot.standard
    for at, name in enumerate(base.names):
        expression = base.grouping[name]
        assert isinstance(expression, sympy.Expr)
        assert all(type(symbol) is sympy.Symbol for symbol in expression.free_symbols)
        number = expression.subs({symbol: values[symbol.name] for symbol in expression.free_symbols})
        assert float(number) == pytest.approx(grouped[at], rel=1e-12, abs=1e-14)


def test_regressor() -> None:
    robot = identify.load_robot("tx40")
    reg = identify.Regressor(robot, friction=True)
    bare = identify.Regressor(robot, friction=False)
    friction = tuple(f"{letter}{j}" for j in range(1, 7) for letter in ("Fv", "Fs", "off"))
    assert bare.names == identify.base_parameters(robot).names
    assert reg.names == (*bare.names, *friction, "Iam6", "Fvm6", "Fsm6")
    assert identify.Regressor(robot).names == reg.names
    p, n = len(reg.names), 6
    q, dq, ddq, dq_ref, ddq_ref = np.random.default_rng(0).uniform(-1, 1, (5, 20, n))
    theta = np.random.default_rng(1).normal(size=p)
    Y = reg.torque(q, dq, ddq, out=None)
    out = np.empty((20, n, p))
    assert Y.shape == reg.torque(q, dq, ddq, out=out).shape == (20, n, p)
    np.testing.assert_array_equal(out, Y)
    assert reg.torque(q[0], dq[0], ddq[0]).shape == (n, p)
    at_rest = reg.torque(q[0], np.zeros(n), ddq[0])
    assert not at_rest[:, [reg.names.index(f"Fs{j}") for j in range(1, 7)]].any()  # sign(0) = 0
    h = reg.energy(q, dq)
    assert h.shape == (20, p)
    assert reg.energy(q[0], dq[0]).shape == (p,)
    assert not h[:, [k for k, name in enumerate(reg.names) if name in friction]].any()
    Ys = reg.slotine_li(q, dq, dq_ref, ddq_ref)
    assert Ys.shape == (20, n, p)
    assert reg.slotine_li(q[0], dq[0], dq_ref[0], ddq_ref[0]).shape == (n, p)
    np.testing.assert_allclose(reg.slotine_li(q, dq, dq, ddq), Y, rtol=0, atol=1e-12)
    tau = reg.inverse_dynamics(q, dq, ddq, theta)
    assert tau.shape == (20, n)
    np.testing.assert_allclose(tau, Y @ theta, rtol=0, atol=1e-12)
    assert reg.inverse_dynamics(q[0], dq[0], ddq[0], theta).shape == (n,)


def test_trajectory_log_and_result(tmp_path: Path) -> None:
    robot = arm(1)
    trajectory = identify.excite(robot, criterion="torque", seed=0)
    assert isinstance(trajectory, identify.Trajectory)
    q, dq, ddq = trajectory.sample(np.linspace(0, trajectory.duration, 50))
    assert q.shape == dq.shape == ddq.shape == (50, 3)
    trajectory.save(tmp_path / "trajectory.toml")
    trajectory = identify.Trajectory.load(tmp_path / "trajectory.toml")
    log = identify.simulate(robot, trajectory, noise="standard", seed=0)
    assert isinstance(log, identify.Log)
    log.save(tmp_path / "log.mcap")
    log = identify.read_log(tmp_path / "log.mcap", map=None)
    assert log.time.shape == (log.samples,)
    assert log.position.shape == log.effort.shape == (log.samples, 3)
    assert log.velocity is None or log.velocity.shape == log.position.shape
    assert log.joints == robot.joint_names
    log2 = exact_log(robot, 2)
    result = identify.fit(log, robot, test=[log2])
    assert isinstance(result, identify.Identification)
    p = len(result.names)
    assert result.names == identify.Regressor(robot).names
    assert result.parameters.shape == result.std.shape == (p,)
    assert result.covariance.shape == (p, p)
    np.testing.assert_allclose(result.std, np.sqrt(np.diag(result.covariance)))
    folder = tmp_path / "result"
    result.save(folder)
    again = identify.Identification.load(folder)
    np.testing.assert_array_equal(again.predict(log2), result.predict(log2))
    assert result.predict(log2).shape == log2.position.shape
    with pytest.raises(identify.errors.InputError):
        result.save(folder)


def test_summary_is_worth_reading() -> None:
    """Verdict, every joint's residuals, every parameter with its standard deviation and unit."""
    result = fitted()
    text = result.summary()
    lines = [line.split() for line in text.splitlines()]
    for name in (*result.names, *result.robot.joint_names):
        assert [line for line in lines if line and line[0] == name]
    (row,) = [line for line in lines if line and line[0] == "Fv2"]
    value, plus, std = row[1:4]
    assert plus == "±"
    assert float(value) == pytest.approx(result.parameters[result.names.index("Fv2")], rel=1e-2)
    assert float(std) == pytest.approx(result.std[result.names.index("Fv2")], rel=0.05)
    assert row[4] == "N·m·s/rad"
    assert "accepted" in text
    assert all(len(line) < 160 for line in text.splitlines())


@pytest.mark.parametrize(
    ("function", "start"),
    [
        ("excite", "(robot, criterion='torque', "),
        ("simulate", "(robot, trajectory="),
        ("fit", "(log, robot, test="),
        ("read_log", "(path, map=None"),
        ("load_robot", "("),
    ],
)
def test_signatures(function: str, start: str) -> None:
    signature = inspect.signature(getattr(identify, function))
    bare = signature.replace(
        parameters=[p.replace(annotation=p.empty) for p in signature.parameters.values()],
        return_annotation=signature.empty,
    )
    assert str(bare).startswith(start)
    assert "seed" in signature.parameters or function not in ("excite", "simulate")
    assert getattr(identify, function).__doc__


def test_names_there_are() -> None:
    assert set(identify.__all__) <= set(dir(identify))
    with pytest.raises(AttributeError, match="no attribute 'Robots'"):
        identify.Robots  # noqa: B018
