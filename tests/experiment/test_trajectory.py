"""Laws of the Fourier motion: derivatives, rest, periods, limits, and its file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chains import random_chain, without
from hypothesis import given, settings
from hypothesis import strategies as st

from identify.errors import InputError, OutputError
from identify.experiment.trajectory import Trajectory, at_rest, random_trajectory
from identify.robot.robot import Joint, Limits, Robot


def example(seed: int = 0, n: int = 3, harmonics: int = 4, **changes: object) -> Trajectory:
    rng = np.random.default_rng(seed)
    a, b = at_rest(*rng.normal(size=(2, n, harmonics)))
    names = tuple(f"joint_{j + 1}" for j in range(n))
    settings = {"fundamental_hz": 0.13, "periods": 2, "rest": 0.4, **changes}
    return Trajectory(names, rng.normal(size=n), a, b, **settings)  # type: ignore[arg-type]


def test_derivatives_are_those_of_the_position() -> None:
    motion = example()
    step = 1e-5
    t = np.linspace(-0.3, motion.duration + 0.3, 400)
    before, now, after = (motion.sample(t + shift) for shift in (-step, 0.0, step))
    for low in (0, 1):
        numeric = (after[low] - before[low]) / (2 * step)
        # a jerk begins where a rest ends, so there the difference is only of first order
        assert np.abs(numeric - now[low + 1]).max() < 2e-4 * np.abs(now[low + 1]).max()
    inside = (t > motion.rest + 0.1) & (t < motion.rest + 0.9 * motion.period)
    for low in (0, 1):
        numeric = (after[low] - before[low])[inside] / (2 * step)
        assert np.abs(numeric - now[low + 1][inside]).max() < 1e-8 * np.abs(now[low + 1]).max()


def test_position_is_the_series() -> None:
    motion = example(n=2, harmonics=3)
    t = 1.234
    omega = 2 * np.pi * 0.13
    for j in range(2):
        expected = motion.q0[j]
        for l in (1, 2, 3):  # noqa: E741
            expected += motion.a[j, l - 1] / (l * omega) * np.sin(l * omega * t)
            expected -= motion.b[j, l - 1] / (l * omega) * np.cos(l * omega * t)
        assert motion.sample(motion.rest + t)[0][0, j] == pytest.approx(expected, rel=1e-13)


def test_every_period_repeats_and_meets_its_neighbours_at_rest() -> None:
    motion = example(periods=3)
    t = motion.rest + np.linspace(0, motion.period, 57)[1:-1]
    for first, third in zip(motion.sample(t), motion.sample(t + 2 * motion.period), strict=True):
        assert np.allclose(first, third, rtol=0, atol=1e-10)
    joints = motion.rest + motion.period * np.arange(4)
    q, dq, ddq = motion.sample(joints)
    assert np.abs(dq).max() < 1e-12
    assert np.abs(ddq).max() < 1e-11
    assert np.ptp(q, axis=0).max() < 1e-12


def test_rests_hold_the_pose_exactly_and_time_is_clamped() -> None:
    motion = example()
    t = np.array([-5.0, 0.0, 0.2, motion.rest, motion.duration - 0.2, motion.duration, motion.duration + 9.0])
    q, dq, ddq = motion.sample(t)
    assert not dq.any()
    assert not ddq.any()
    assert np.array_equal(q, np.tile(q[0], (len(t), 1)))
    assert motion.duration == pytest.approx(2 * 0.4 + 2 / 0.13)


@given(st.integers(0, 10_000), st.integers(1, 7), st.integers(1, 8))
@settings(max_examples=30, deadline=None)
def test_projection_on_rest_is_the_nearest_point_and_idempotent(seed: int, n: int, harmonics: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, n, harmonics))
    still_a, still_b = at_rest(a, b)
    order = np.arange(1, harmonics + 1)
    assert np.abs(still_a.sum(axis=1)).max() < 1e-12
    assert np.abs(still_b @ order).max() < 1e-12
    # what is taken away is normal to the constraint: a multiple of (1 … 1), and of (1 … L)
    assert np.allclose(a - still_a, (a - still_a)[:, :1])
    assert np.allclose((b - still_b) / order, (b - still_b)[:, :1])
    again = at_rest(still_a, still_b)
    assert np.allclose(again[0], still_a, rtol=0, atol=1e-14)
    assert np.allclose(again[1], still_b, rtol=0, atol=1e-14)


def test_a_motion_that_does_not_start_at_rest_is_refused() -> None:
    motion = example()
    a = motion.a.copy()
    a[1, 0] += 1e-3
    with pytest.raises(InputError, match="joint_2 doesn't start at rest"):
        replace(motion, a=a)


def test_arrays_cannot_be_changed_behind_its_back() -> None:
    q0 = np.zeros(1)
    motion = Trajectory(("axis",), q0, *at_rest(np.ones((1, 3)), np.ones((1, 3))), fundamental_hz=0.1)
    q0[0] = 5.0
    assert motion.q0[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        motion.a[0, 0] = 1.0


def test_file_gives_every_bit_back(tmp_path: Path) -> None:
    motion = example(seed=3, note='say "hi" \\ \n\t\x7f é', criterion="torque")
    motion = replace(motion, joints=('a "b"', "ü", "joint.3"), seed=17, fundamental_hz=0.1, rest=1 / 3)
    motion.save(tmp_path / "motion.toml")
    back = Trajectory.load(tmp_path / "motion.toml")
    for name in ("q0", "a", "b"):
        assert np.array_equal(getattr(motion, name), getattr(back, name))
    for name in ("joints", "fundamental_hz", "periods", "rest", "criterion", "seed", "note"):
        assert getattr(motion, name) == getattr(back, name)
    assert back.to_toml() == motion.to_toml()
    assert [path.name for path in tmp_path.iterdir()] == ["motion.toml"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("periods = 2", "periods = = 2"), "not valid TOML"),
        (lambda text: text.replace("identify/trajectory/1", "something else"), "not a trajectory file"),
        (lambda text: "\n".join(line for line in text.splitlines() if "fundamental" not in line), "missing"),
        (lambda text: text.replace('joints = ["joint_1", ', "joints = ["), "q0 has shape"),
        (lambda text: text.replace("joints = [", "joints = [1, "), "list of names"),
        (lambda text: text.replace("q0 = [", 'q0 = ["x", '), "list of numbers"),
        (lambda text: text.replace("a = [\n  [", "a = [\n  [0.0, "), "rows of different lengths"),
        (lambda text: text.replace("a = [\n  [", "a = [\n  [nan, 0.0],\n  ["), "rows of different lengths"),
        (lambda text: text.replace("q0 = [", f"q0 = [1{'0' * 400}, "), "range of a float"),
        (
            lambda text: text.replace("q0 = [", "q0 = [nan, ").replace('["joint_1"', '["joint_0", "joint_1"'),
            "a has shape",
        ),
        (lambda text: text.replace("fundamental_hz = 0.13", "fundamental_hz = -0.13"), "positive frequency"),
        (lambda text: text.replace("fundamental_hz = 0.13", "fundamental_hz = true"), "fundamental_hz is True"),
        (lambda text: text.replace("periods = 2", "periods = 0"), "at least one period"),
        (lambda text: text.replace("periods = 2", "periods = 2.5"), "periods is 2.5"),
        (lambda text: text.replace("rest = 0.4", "rest = -1"), "at least 0 s"),
        (lambda text: text.replace("rest = 0.4", 'rest = "x"'), "rest is 'x'"),
    ],
)
def test_a_bad_file_is_refused_in_one_line_that_names_it(tmp_path: Path, change, words: str) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "motion.toml"
    text = example().to_toml()
    changed = change(text)
    assert changed != text
    path.write_text(changed, encoding="utf-8")
    with pytest.raises(InputError, match=words) as caught:
        Trajectory.load(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_file_that_cannot_be_read_or_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such trajectory"):
        Trajectory.load(tmp_path / "absent.toml")
    with pytest.raises(InputError, match="can't be read"):
        Trajectory.load(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InputError, match="not a text file"):
        Trajectory.load(tmp_path / "binary.toml")
    with pytest.raises(OutputError, match="absent"):
        example().save(tmp_path / "absent" / "motion.toml")


def test_rows_follow_the_robots_order_and_strangers_are_refused() -> None:
    motion = example()
    robot = Robot("arm", tuple(Joint(name, parent=j - 1) for j, name in enumerate(["joint_3", "joint_1", "joint_2"])))
    mine = motion.for_robot(robot)
    t = np.linspace(0, 5, 7)
    for own, theirs in zip(mine.sample(t), motion.sample(t), strict=True):
        assert np.allclose(own, theirs[:, [2, 0, 1]], rtol=0, atol=1e-14)
    with pytest.raises(InputError, match="robot has"):
        motion.for_robot(replace(robot, name="robot", joints=robot.joints[:2]))


@pytest.mark.parametrize("seed", range(6))
def test_random_motion_fills_the_limits_and_keeps_inside_them(seed: int) -> None:
    robot = random_chain(np.random.default_rng(seed), 5)
    limits = [Limits((-1.0 - j, 0.5 * j + 0.3), 0.7 + j, 3.0 + 2 * j) for j in range(5)]
    robot = replace(
        robot, joints=tuple(replace(joint, limits=own) for joint, own in zip(robot.joints, limits, strict=True))
    )
    motion = random_trajectory(robot, seed, fill=0.9)
    q, dq, ddq = motion.sample(np.arange(0, motion.duration, 1e-3))
    for j, own in enumerate(limits):
        low, high = own.position
        used = (
            np.ptp(q[:, j]) / (high - low),
            np.abs(dq[:, j]).max() / own.velocity,
            np.abs(ddq[:, j]).max() / own.acceleration,
        )
        assert max(used) == pytest.approx(0.9, rel=1e-3)
        assert low < q[:, j].min()
        assert q[:, j].max() < high
    assert np.array_equal(motion.a, random_trajectory(robot, seed, fill=0.9).a)
    assert not np.array_equal(motion.a, random_trajectory(robot, seed + 1, fill=0.9).a)


def test_random_motion_of_a_robot_without_limits_stays_modest() -> None:
    robot = without(random_chain(np.random.default_rng(1), 6), limits=Limits())
    assert {joint.type for joint in robot.joints} == {"revolute", "prismatic"}
    motion = random_trajectory(robot, 0)
    q, dq, ddq = motion.sample(np.arange(0, motion.duration, 1e-3))
    size = np.array([1.0 if joint.revolute else 0.2 for joint in robot.joints])
    assert np.all(np.abs(q).max(axis=0) < 1.5 * size)
    assert np.all(np.abs(dq).max(axis=0) < 1.5 * size)
    assert np.all(np.abs(ddq).max(axis=0) < 3.0 * size)
    one_sided = without(robot, limits=Limits(position=(2.0, float("inf"))))
    assert random_trajectory(one_sided, 0).sample(0.0)[0].min() > 2.0


def test_random_motion_needs_two_harmonics_and_a_seed() -> None:
    robot = random_chain(np.random.default_rng(1), 2)
    with pytest.raises(InputError, match="harmonics"):
        random_trajectory(robot, 0, harmonics=1)
    with pytest.raises(InputError, match="seed"):
        random_trajectory(robot, -1)
