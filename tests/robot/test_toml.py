"""TOML robots: written and read back equal; fixed joints merged without moving anything; every refusal in one line."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chains import random_chain, random_link
from hypothesis import given, settings
from hypothesis import strategies as st

from identify.errors import RobotError
from identify.robot.library import load_robot
from identify.robot.robot import Drive, Limits, Link, Robot, Transmission
from identify.robot.toml import read_toml, write_toml
from identify.robot.transforms import from_roll_pitch_yaw, joint_transform, link_frames, to_matrix

names = st.text(st.characters(blacklist_categories=("Cs",)), min_size=1, max_size=12).filter(str.strip)
ARM = """
name = "arm"
[[joint]]
name = "shoulder"
theta = 0.3
r = 0.4
link = { mass = 2.0, com = [0.1, 0.02, -0.03], inertia = [0.02, 0.001, -0.002, 0.03, 0.003, 0.025] }
[[joint]]
name = "elbow"
type = "prismatic"
alpha = -1.2
d = 0.35
symbols = { d = "D2" }
limits = { position = [-0.2, 0.5], velocity = 1.0, effort = 50.0 }
drive = { inertia = 0.4, viscous = 2.0, coulomb = 1.5, offset = -0.2 }
"""


def random_robot(seed: int, name: str, note: str) -> Robot:
    """A random tree with every optional part present somewhere."""
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, int(rng.integers(1, 7)), special=bool(rng.integers(2)), tree=bool(rng.integers(2)))
    joints = []
    for k, joint in enumerate(robot.joints):
        limits = Limits() if rng.random() < 0.3 else Limits((-math.inf, 1 / 3), 0.1, math.inf, 1e3)
        link = Link() if rng.random() < 0.3 else joint.link
        symbols = (("d", f"D{k}"), ("r", f"RL{k}")) if rng.random() < 0.5 else ()
        joints.append(replace(joint, limits=limits, link=link, symbols=symbols))
    ratios = np.diag(rng.uniform(20, 90, robot.n)) + np.tril(rng.uniform(-9, 9, (robot.n, robot.n)), -1)
    motors = tuple(Drive(*rng.uniform(0, 2, 4)) if k % 2 else Drive() for k in range(robot.n))
    geared = Transmission(tuple(map(tuple, ratios.tolist())), motors if rng.random() < 0.5 else ())
    return replace(
        robot,
        name=name,
        note=note,
        joints=tuple(joints),
        base=to_matrix(from_roll_pitch_yaw(rng.normal(size=3), rng.uniform(-3, 3, 3))),
        tool=to_matrix(from_roll_pitch_yaw((0.0, 0.1, 0.2), (0.0, math.pi, math.pi / 2))),
        transmission=geared if rng.random() < 0.5 else None,
        source="here",
    )


@settings(max_examples=60)
@given(st.integers(0, 10**6), names, st.one_of(st.just(""), names))
def test_a_written_robot_reads_back_equal(seed: int, name: str, note: str) -> None:
    robot = random_robot(seed, name, note)
    assert read_toml(write_toml(robot), "here") == robot


@given(st.lists(names, min_size=3, max_size=3, unique=True))
def test_joint_names_of_any_letters_survive(labels: list[str]) -> None:
    robot = random_chain(np.random.default_rng(1), 3)
    parents = (-1, 0, 0)
    joints = (
        replace(joint, name=label, parent=parent)
        for joint, label, parent in zip(robot.joints, labels, parents, strict=True)
    )
    robot = replace(robot, joints=tuple(joints), source="s")
    assert read_toml(write_toml(robot), "s") == robot


def test_a_joint_called_base_is_told_from_the_base() -> None:
    robot = random_chain(np.random.default_rng(1), 3)
    labels = zip(robot.joints, ("base", "b", "c"), (-1, 0, -1), strict=True)
    robot = replace(robot, joints=tuple(replace(j, name=name, parent=p) for j, name, p in labels), source="s")
    assert read_toml(write_toml(robot), "s") == robot


@pytest.mark.parametrize("name", ["rx90", "tx40"])
def test_built_in_robots_round_trip(name: str) -> None:
    robot = load_robot(name)
    assert read_toml(write_toml(robot), robot.source) == robot


def test_defaults() -> None:
    robot = read_toml(ARM, "arm.toml")
    shoulder, elbow = robot.joints
    assert (robot.name, robot.source, robot.gravity, robot.n) == ("arm", "arm.toml", (0.0, 0.0, -9.81), 2)
    assert (shoulder.type, shoulder.parent, elbow.type, elbow.parent) == ("revolute", -1, "prismatic", 0)
    assert shoulder.limits == Limits()
    assert elbow.link == Link()
    assert elbow.symbols == (("d", "D2"),)
    assert elbow.limits == Limits((-0.2, 0.5), 1.0, math.inf, 50.0)


def test_a_file_is_read_by_its_path(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(ARM, encoding="utf-8")
    assert read_toml(path) == read_toml(ARM, str(path))


@pytest.mark.parametrize("seed", range(6))
def test_merged_fixed_joints_move_nothing(seed: int) -> None:
    """Point masses on every entry, fixed ones too: the robot's links put the same moments at the same places."""
    rng = np.random.default_rng(seed)
    full = random_chain(rng, 7, tree=True)
    kinds = [("fixed" if rng.random() < 0.4 else joint.type) for joint in full.joints]
    kinds[0], kinds[-1] = "revolute", "fixed"
    entries = [replace(j, type=kind, link=random_link(rng)) for j, kind in zip(full.joints, kinds, strict=True)]
    text = 'name = "arm"\n' + "\n".join(entry_text(entries, k) for k in range(len(entries)))
    robot = read_toml(text, "arm.toml")
    q = rng.uniform(-1, 1, robot.n)
    positions = iter(q)
    moved = [next(positions) if kind != "fixed" else 0.0 for kind in kinds]
    frames: list[np.ndarray] = []
    carriers: list[int] = []
    for k, entry in enumerate(entries):
        parent = frames[entry.parent] if entry.parent >= 0 else np.eye(4)
        frames.append(parent @ joint_transform(entry, moved[k]))
        above = carriers[entry.parent] if entry.parent >= 0 else -1
        carriers.append(above if kinds[k] == "fixed" else sum(kind != "fixed" for kind in kinds[:k]))
    places = link_frames(robot, q)
    for j in range(robot.n):
        expected = sum(pseudo_inertia(entry.link, frames[k]) for k, entry in enumerate(entries) if carriers[k] == j)
        np.testing.assert_allclose(pseudo_inertia(robot.joints[j].link, places[j]), expected, rtol=0, atol=1e-8)
    if carriers[-1] == robot.n - 1:
        np.testing.assert_allclose(places[-1] @ np.array(robot.tool), frames[-1], rtol=0, atol=1e-9)
    else:
        np.testing.assert_array_equal(robot.tool, np.eye(4))


def pseudo_inertia(link: Link, frame: np.ndarray) -> np.ndarray:
    """(4, 4) mass moments ∫ p̃ p̃ᵀ dm of the link in R_0, its frame being at `frame`."""
    xx, xy, xz, yy, yz, zz, mx, my, mz, m = link.standard
    moments = np.array(
        [
            [(yy + zz - xx) / 2, -xy, -xz, mx],
            [-xy, (xx + zz - yy) / 2, -yz, my],
            [-xz, -yz, (xx + yy - zz) / 2, mz],
            [mx, my, mz, m],
        ]
    )
    return frame @ moments @ frame.T


def entry_text(entries: list, k: int) -> str:
    joint = entries[k]
    parent = entries[joint.parent].name if joint.parent >= 0 else "base"
    geometry = "\n".join(f"{key} = {getattr(joint, key)!r}" for key in ("gamma", "b", "alpha", "d", "theta", "r"))
    link = joint.link
    com, inertia = [float(x) for x in link.com], [float(x) for x in link.inertia]
    return (
        f'[[joint]]\nname = "{joint.name}"\ntype = "{joint.type}"\nparent = "{parent}"\n{geometry}\n'
        f"link = {{ mass = {link.mass!r}, com = {com!r}, inertia = {inertia!r} }}\n"
    )


def test_a_letter_stays_where_a_fixed_joint_leaves_the_length_alone() -> None:
    turned = ARM.replace(
        '[[joint]]\nname = "elbow"', '[[joint]]\nname = "f"\ntype = "fixed"\n{}\n[[joint]]\nname = "elbow"'
    )
    assert read_toml(turned.replace("{}", "r = 0.2"), "a").joints[1].symbols == (("d", "D2"),)
    assert read_toml(turned.replace("{}", "d = 0.2"), "a").joints[1].symbols == ()


def arm(old: str, new: str) -> str:
    assert old in ARM
    return ARM.replace(old, new)


REFUSALS = {
    "syntax": ("name = arm\n[[joint", "arm.toml: not valid TOML: Invalid value (at line 1, column 8)"),
    "nested": ("name = " + "[" * 100_000, "arm.toml: not valid TOML: brackets nested too deeply"),
    "digits": ("name = " + "1" * 5000, "arm.toml: not valid TOML: "),
    "no name": ('[[joint]]\nname = "a"', "arm.toml: the robot has no name"),
    "no joint": ('name = "arm"', "arm.toml: no moving joint"),
    "only fixed": ('name = "arm"\n[[joint]]\nname = "a"\ntype = "fixed"', "arm.toml: no moving joint"),
    "single bracket": (
        'name = "arm"\n[joint]\nname = "a"',
        "arm.toml: joint: expected an array of tables; write [[joint]]",
    ),
    "joint a number": ('name = "arm"\njoint = [3]', "arm.toml: joint 1: expected a table; write [[joint]], found 3"),
    "unknown key at the top": (
        ARM.replace("name", "gravitiy = 3\nname", 1),
        "unknown key 'gravitiy'; did you mean 'gravity'?",
    ),
    "unknown key of a joint": (
        arm("theta =", "tetha ="),
        "joint 'shoulder': unknown key 'tetha'; did you mean 'theta'?",
    ),
    "unknown key of a link": (
        arm("mass =", "masse ="),
        "joint 'shoulder': link: unknown key 'masse'; did you mean 'mass'?",
    ),
    "unknown key of a limit": (
        arm("velocity =", "speed ="),
        "limits: unknown key 'speed'; expected one of position, velocity",
    ),
    "unknown symbol": (arm('{ d = "D2" }', '{ alpha = "A" }'), "joint 'elbow': symbols: unknown key 'alpha'"),
    "no symbol": (arm('"D2"', '"D 2"'), "joint 'elbow': symbols.d: 'D 2' can't be a symbol"),
    "symbol a word of C": (arm('"D2"', '"double"'), "symbols.d: 'double' can't be a symbol; it is a word of C or"),
    "symbol a word of Python": (arm('"D2"', '"lambda"'), "symbols.d: 'lambda' can't be a symbol; it is a word of"),
    "symbol a function": (arm('"D2"', '"y1"'), "symbols.d: 'y1' can't be a symbol; C, Python or sympy knows it"),
    "symbol a variable": (arm('"D2"', '"C2"'), "symbols.d: 'C2' can't be a symbol; printed models use it for a"),
    "symbol a number": (arm('"D2"', "2"), "joint 'elbow': symbols.d: expected text in quotes, found 2"),
    "text for a number": (
        arm("theta = 0.3", 'theta = "0.3"'),
        "joint 'shoulder': theta: expected a number, found '0.3'",
    ),
    "truth for a number": (
        arm("theta = 0.3", "theta = true"),
        "joint 'shoulder': theta: expected a number, found True",
    ),
    "number for a table": (
        arm('{ d = "D2" }', "3"),
        "joint 'elbow': symbols: expected a table { key = value }, found 3",
    ),
    "number for text": (arm('"arm"', "3"), "arm.toml: name: expected text in quotes, found 3"),
    "empty name": (arm('"arm"', '" "'), "arm.toml: name: expected text, found an empty string"),
    "joint without name": (arm('name = "elbow"', ""), "arm.toml: joint 2: the joint has no name"),
    "one name twice": (arm('"elbow"', '"shoulder"'), "joint 'shoulder': a second joint of this name"),
    "parent unknown": (
        arm('"elbow"', '"elbow"\nparent = "sholder"'),
        "parent: no joint 'sholder'; did you mean 'shoulder'?",
    ),
    "parent later": (arm('"shoulder"', '"shoulder"\nparent = "elbow"'), "parent: 'elbow' comes later in the file"),
    "parent itself": (arm('"elbow"', '"elbow"\nparent = "elbow"'), "parent: a joint can't be its own parent"),
    "type unknown": (arm('"prismatic"', '"prisimatic"'), "unknown joint type 'prisimatic'; did you mean 'prismatic'?"),
    "drive of a fixed joint": (arm('"prismatic"', '"fixed"'), "joint 'elbow': symbols: a fixed joint has none"),
    "negative mass": (arm("mass = 2.0", "mass = -2.0"), "joint 'shoulder': link.mass: expected 0 or more, found -2"),
    "nan": (arm("theta = 0.3", "theta = nan"), "joint 'shoulder': theta: expected a finite number, found nan"),
    "infinite": (arm("r = 0.4", "r = inf"), "joint 'shoulder': r: expected a finite number, found inf"),
    "beyond floats": (arm("r = 0.4", f"r = 1{'0' * 400}"), "joint 'shoulder': r: expected a finite number"),
    "nan in a list": (arm("0.02, -0.03]", "0.02, nan]"), "link.com[2]: expected a finite number, found nan"),
    "nan limit": (arm("velocity = 1.0", "velocity = nan"), "limits.velocity: expected a finite number, found nan"),
    "inertia of nine": (arm("0.003, 0.025]", "0.003, 0.025, 0, 0, 0]"), "link.inertia: expected 6 numbers, found 9"),
    "inertia a number": (arm("com = [0.1, 0.02, -0.03]", "com = 3"), "link.com: expected a list of 3 numbers, found 3"),
    "limits reversed": (
        arm("[-0.2, 0.5]", "[0.5, -0.2]"),
        "limits.position: the low limit comes first, found [0.5, -0.2]",
    ),
    "velocity limit 0": (arm("velocity = 1.0", "velocity = 0"), "limits.velocity: expected more than 0, found 0"),
    "effort limit negative": (arm("effort = 50.0", "effort = -5"), "limits.effort: expected more than 0, found -5"),
    "negative friction": (
        arm("viscous = 2.0", "viscous = -2.0"),
        "joint 'elbow': drive.viscous: expected 0 or more, found -2",
    ),
    "negative coulomb": (arm("coulomb = 1.5", "coulomb = -1.5"), "drive.coulomb: expected 0 or more, found -1.5"),
    "negative drive": (arm("{ inertia = 0.4", "{ inertia = -1"), "drive.inertia: expected 0 or more, found -1"),
    "gravity of two": ("gravity = [0, -9.81]\n" + ARM, "arm.toml: gravity: expected 3 numbers, found 2"),
    "gravity a number": ("gravity = -9.81\n" + ARM, "arm.toml: gravity: expected a list of 3 numbers, found -9.81"),
    "base unknown": ("base = { xzy = [0, 0, 1] }\n" + ARM, "arm.toml: base: unknown key 'xzy'; did you mean 'xyz'?"),
    "base both": (
        "base = { xyz = [0,0,1], matrix = [] }\n" + ARM,
        "base: give either matrix, or xyz and rpy, not both",
    ),
    "tool sheared": (
        "tool = { matrix = [[1,1,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]] }\n" + ARM,
        "arm.toml: tool.matrix: expected a rigid transform",
    ),
    "tool mirrored": (
        "tool = { matrix = [[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]] }\n" + ARM,
        "arm.toml: tool.matrix: expected a right-handed rotation",
    ),
    "transmission 1×1": (
        ARM + "[transmission]\nmatrix = [[3]]",
        "transmission.matrix: expected a matrix of 2 × 2, found 1 row",
    ),
    "transmission 2×1": (
        ARM + "[transmission]\nmatrix = [[3],[3]]",
        "transmission.matrix[0]: expected 2 numbers, found 1",
    ),
    "transmission singular": (ARM + "[transmission]\nmatrix = [[3,6],[1,2]]", "transmission.matrix: singular"),
    "transmission crossed": (
        ARM + "[transmission]\nmatrix = [[0,6],[1,2]]",
        "transmission.matrix[0]: motor 1 must move joint 'shoulder': found 0 on the diagonal",
    ),
    "transmission motors short": (
        ARM + "[transmission]\nmatrix = [[3,0],[1,2]]\nmotors = [{}]",
        "transmission.motors: expected a list of 2 tables",
    ),
    "transmission motor driven": (
        ARM + "[transmission]\nmatrix = [[3,0],[1,2]]\nmotors = [{}, { viscous = -1.0 }]",
        "transmission.motors[1].viscous: expected 0 or more, found -1",
    ),
    "transmission empty": (ARM + "[transmission]", "arm.toml: transmission: no matrix"),
    "inertia not positive": (
        arm("[0.02, 0.001, -0.002, 0.03, 0.003, 0.025]", "[0.02, 0.03, 0.0, 0.03, 0.0, 0.025]"),
        "joint 'shoulder': link.inertia: impossible value: the inertia about the centre of mass is not positive",
    ),
    "triangle": (
        arm("[0.02, 0.001, -0.002, 0.03, 0.003, 0.025]", "[0.02, 0.0, 0.0, 0.03, 0.0, 0.0500001]"),
        "no body has the principal moments of inertia 0.02, 0.03, 0.0500001 kg·m²: the largest exceeds the sum",
    ),
    "inertia without mass": (arm("mass = 2.0", "mass = 0"), "impossible value: the inertia is not zero"),
    "floor": ("floor = nan\n" + ARM, "arm.toml: floor: expected a finite number"),
    "radius": (
        ARM.replace("r = 0.4", "r = 0.4\nradius = 0"),
        "joint 'shoulder': radius: expected more than 0, found 0",
    ),
    "one letter, two lengths": (
        ARM.replace("r = 0.4", 'r = 0.4\nsymbols = { r = "D2" }'),
        "joint 'elbow': symbols.d: D2 is 0.35 here and 0.4 in 'shoulder'; give each length a letter of its own",
    ),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_refusals(case: str) -> None:
    text, message = REFUSALS[case]
    with pytest.raises(RobotError) as caught:
        read_toml(text, "arm.toml")
    said = str(caught.value)
    assert message in said
    assert said.startswith("arm.toml: ")
    assert "\n" not in said
    assert len(said) < 250
    assert caught.value.exit_status == 2


def test_inertias_on_the_border_of_the_possible_are_read() -> None:
    for inertia in ("[0, 0, 0, 0, 0, 0]", "[0.1, 0, 0, 0.2, 0, 0.3]", "[0.0, 0, 0, 0.3, 0, 0.3]"):
        text = arm("[0.02, 0.001, -0.002, 0.03, 0.003, 0.025]", inertia)
        assert read_toml(text, "arm.toml").joints[0].link.mass == 2.0


def test_base_and_tool_by_xyz_and_rpy() -> None:
    robot = read_toml(f"base = {{ xyz = [1, 2, 3], rpy = [{math.pi}, 0, 0] }}\n" + ARM, "arm.toml")
    assert robot.base == ((1, 0, 0, 1), (0, -1, 0, 2), (0, 0, -1, 3), (0, 0, 0, 1))


def test_floor_and_radii_are_read_and_written_where_they_are_given() -> None:
    robot = read_toml("floor = -0.25\n" + ARM.replace("r = 0.4", "r = 0.4\nradius = 0.07"), "arm.toml")
    assert robot.floor == -0.25
    assert [joint.radius for joint in robot.joints].count(0.07) == 1
    assert read_toml(write_toml(robot), "arm.toml") == robot
    plain = read_toml(ARM, "arm.toml")
    assert plain.floor is None
    assert "floor" not in write_toml(plain)
    assert "radius" not in write_toml(plain)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00robot", None])
def test_unreadable_files(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "arm.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RobotError, match="no such file" if content is None else "not a text file in UTF-8"):
        read_toml(path)
