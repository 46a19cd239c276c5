"""MJCF robots against MuJoCo's own dynamics of the same file; what is held, left out and refused."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from chains import random_chain, random_link

from identify.errors import RobotError
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot
from identify.robot.mjcf import depth_first, to_mjcf
from identify.robot.mjcf_reading import read_mjcf
from identify.robot.robot import Link, Robot
from identify.robot.selection import parse_selection
from identify.robot.toml import read_toml, write_toml
from identify.robot.transforms import link_frames
from identify.validation.engines import pinocchio_torque


def spaced(values: object) -> str:
    return " ".join(repr(float(x)) for x in values)  # type: ignore[attr-defined]


def random_mjcf(rng: np.random.Generator, count: int) -> str:
    """A tree of `count` bodies: welded, with one joint or with several; axes, anchors, refs and frames at random."""
    bodies: dict[int, str] = {}
    parents = [int(rng.integers(-1, k)) for k in range(count)]
    number = 0
    for k in reversed(range(count)):
        link, joints = random_link(rng), ""
        for _ in range(1 if k == 0 else int(rng.choice([0, 1, 1, 2, 3]))):
            number += 1
            kind = rng.choice(["hinge", "slide"], p=[0.7, 0.3])
            joints += (
                f'<joint name="j{number}" type="{kind}" axis="{spaced(rng.normal(size=3))}"'
                f' pos="{spaced(rng.normal(size=3) * 0.2)}" ref="{rng.uniform(-0.5, 0.5)!r}"'
                f' armature="{rng.uniform(0, 1)!r}" damping="{rng.uniform(0, 1)!r}" range="-2 2"/>'
            )
        ixx, ixy, ixz, iyy, iyz, izz = link.inertia
        inertial = (
            f'<inertial pos="{spaced(link.com)}" mass="{link.mass!r}"'
            f' fullinertia="{spaced((ixx, iyy, izz, ixy, ixz, iyz))}"/>'
        )
        below = "".join(bodies[c] for c in range(count) if parents[c] == k)
        bodies[k] = (
            f'<body name="b{k}" pos="{spaced(rng.normal(size=3) * 0.4)}" euler="{spaced(rng.uniform(-3, 3, 3))}">'
            f"{joints}{inertial}{below}</body>"
        )
    top = "".join(bodies[c] for c in range(count) if parents[c] == -1)
    return (
        '<mujoco model="random"><compiler angle="radian" balanceinertia="false"/>'
        f'<option gravity="{spaced(rng.normal(size=3) * 5)}"/><worldbody>{top}</worldbody></mujoco>'
    )


def reference(text: str, robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """(n,) rigid torque by MuJoCo's inverse dynamics of the original file, joints in the robot's order."""
    model = mujoco.MjModel.from_xml_string(text)
    flags = mujoco.mjtDisableBit
    model.opt.disableflags |= flags.mjDSBL_LIMIT | flags.mjDSBL_CONTACT | flags.mjDSBL_FRICTIONLOSS
    model.dof_damping[:] = 0.0
    data = mujoco.MjData(model)
    at = [model.joint(name).qposadr[0] for name in robot.joint_names]
    rows = [model.joint(name).dofadr[0] for name in robot.joint_names]
    data.qpos[at], data.qvel[rows], data.qacc[rows] = q, dq, ddq
    mujoco.mj_inverse(model, data)
    return data.qfrc_inverse[rows].copy()


@pytest.mark.parametrize("seed", range(20))
def test_torque_equals_mujocos(seed: int) -> None:
    rng = np.random.default_rng(seed)
    text = random_mjcf(rng, int(rng.integers(1, 8)))
    robot = read_mjcf(text, "random.xml")
    for _ in range(3):
        q, dq, ddq = rng.uniform(-2, 2, (3, robot.n))
        torque = reference(text, robot, q, dq, ddq)
        ours = pinocchio_torque(robot, robot.standard, q, dq, ddq)[0]
        assert np.abs(ours - torque).max() <= 1e-9 * np.abs(torque).max()
    assert read_toml(write_toml(robot), "random.xml") == robot


@pytest.mark.parametrize("name", ["rx90", "seed 0", "seed 1", "seed 2", "seed 3"])
def test_our_own_mjcf_reads_back_as_the_same_robot(name: str) -> None:
    """Chains whose frames are modified Denavit-Hartenberg ones, rx90 and random: frames and parameters are kept."""
    kind, _, seed = name.partition(" ")
    robot = load_robot(kind) if not seed else random_chain(np.random.default_rng(int(seed)), 6, special=seed == "1")
    back = read_mjcf(to_mjcf(robot), "back.xml")
    assert back.joint_names == robot.joint_names
    scale = np.abs(robot.standard).max()
    np.testing.assert_allclose(back.standard, robot.standard, rtol=0, atol=1e-10 * scale)
    for ours, theirs in zip(back.joints, robot.joints, strict=True):
        assert (ours.drive.viscous, ours.drive.coulomb) == (theirs.drive.viscous, theirs.drive.coulomb)
        assert ours.limits.position == theirs.limits.position
        assert ours.parent == theirs.parent
    first, second = Regressor(robot, friction=False), Regressor(back, friction=False)
    assert first.names == second.names
    q, dq, ddq = np.random.default_rng(1).uniform(-2, 2, (3, 50, robot.n))
    y = first.torque(q, dq, ddq)
    np.testing.assert_allclose(second.torque(q, dq, ddq), y, rtol=0, atol=1e-10 * np.abs(y).max())
    np.testing.assert_allclose(second.parameters, first.parameters, rtol=0, atol=1e-10 * np.abs(first.parameters).max())


@pytest.mark.parametrize("seed", range(4))
def test_our_own_mjcf_of_a_tree_has_the_same_torque(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(rng, 6, tree=True)
    back = read_mjcf(to_mjcf(robot), "back.xml")
    order = list(depth_first(robot))
    q, dq, ddq = rng.uniform(-2, 2, (3, 20, robot.n))
    expected = pinocchio_torque(robot, robot.standard, q, dq, ddq)[:, order]
    found = pinocchio_torque(back, back.standard, q[:, order], dq[:, order], ddq[:, order])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


ARM = """<mujoco model="arm">
  <compiler meshdir="nowhere"/>
  <size memory="1P"/>
  <option timestep="0" gravity="0 0 -9.5"/>
  <asset><mesh name="m" file="missing.stl"/><texture name="t" type="2d" file="missing.png"/>
    <material name="steel" texture="t"/></asset>
  <default><default class="drive"><joint armature="0.2" damping="3" frictionloss="0.7"/></default>
    <default class="visual"><geom type="mesh" material="steel"/></default></default>
  <worldbody>
    <light pos="0 0 3"/><geom type="plane" size="1 1 1" material="steel"/>
    <body name="pillar" pos="0 0 0.5"><geom size="1"/>
      <body name="upper" pos="0.1 0 0.2">
        <joint name="shoulder" class="drive" axis="0 1 0" range="-90 45"/>
        <inertial pos="0.1 0.02 0.03" mass="2" diaginertia="0.02 0.03 0.025"/>
        <geom class="visual" mesh="m"/>
        <body name="fore" pos="0.4 0 0"><joint name="elbow" class="drive" type="slide" axis="1 0 0" range="0 0.3"/>
          <geom class="visual" mesh="m"/>
          <body name="hand" pos="0 0 0.1">
            <geom type="box" size="0.05 0.04 0.03" mass="0.5" material="steel"/><site name="tcp" material="steel"/>
            <body name="left"><joint name="left" type="slide" axis="0 1 0"/><geom size="0.01"/></body>
            <body name="right"><joint name="right" type="slide" axis="0 -1 0"/><geom size="0.01"/></body>
          </body>
        </body>
      </body>
    </body>
    <body name="box" pos="1 0 0"><freejoint/><geom size="0.1"/></body>
  </worldbody>
  <equality><joint joint1="right" joint2="left" polycoef="0.01 1 0 0 0"/></equality>
  <tendon><fixed name="split"><joint joint="left" coef="0.5"/><joint joint="right" coef="0.5"/></fixed></tendon>
  <actuator>
    <motor joint="shoulder" gear="50" ctrlrange="-2 2" ctrllimited="true" armature="0.001" damping="0.002"/>
    <position joint="elbow" kp="100" forcerange="-80 60"/>
    <general tendon="split" ctrlrange="0 255" ctrllimited="true"/>
  </actuator>
  <keyframe><key qpos="1 2 3"/></keyframe>
</mujoco>"""


def test_drives_limits_and_missing_meshes() -> None:
    robot = read_mjcf(ARM, "arm.xml")
    shoulder, elbow = robot.joints
    assert robot.joint_names == ("shoulder", "elbow")
    assert (shoulder.type, elbow.type) == ("revolute", "prismatic")
    # A motor's own inertia and damping count with the square of its gear.
    assert shoulder.drive.inertia == pytest.approx(0.2 + 2500 * 0.001)
    assert shoulder.drive.viscous == pytest.approx(3 + 2500 * 0.002)
    assert (elbow.drive.inertia, elbow.drive.viscous, elbow.drive.coulomb) == (0.2, 3.0, 0.7)
    assert shoulder.limits.position == pytest.approx((-math.pi / 2, math.pi / 4))
    assert (shoulder.limits.effort, elbow.limits.effort) == (100.0, 60.0)
    assert elbow.limits.position == (0.0, 0.3)
    assert np.array(robot.base)[:3, :3] @ robot.gravity == pytest.approx([0, 0, -9.5])
    assert shoulder.link.mass == 2.0
    # the hand's box and the fingers', which are held: 4/3 π r³ of 1,000 kg/m³ each; the forearm's mesh is not read
    assert elbow.link.mass == pytest.approx(0.5 + 2 * 4 / 3 * math.pi * 0.01**3 * 1000)
    for part in ("'right' at 0.01 ('right' follows 'left')", "'fore' is not known", "'box' floats on its own"):
        assert part in robot.note
    # the last body, "right", hand and finger shift included
    place = np.array(robot.base) @ link_frames(robot, [0.0, 0.2])[-1] @ np.array(robot.tool)
    assert place[:3, 3] == pytest.approx([0.7, -0.01, 0.8])


def test_a_motors_gear_counts_as_in_mujoco() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="j" armature="0.1" damping="0.3"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>'
        '<actuator><motor joint="j" gear="-7" armature="0.02" damping="0.05"/></actuator></mujoco>'
    )
    data = mujoco.MjData(model)
    data.qvel[0] = 2.0
    mujoco.mj_forward(model, data)
    matrix = np.empty((1, 1))
    mujoco.mj_fullM(model, data, matrix)
    assert matrix[0, 0] == pytest.approx(1 + 0.1 + 49 * 0.02)
    assert data.qfrc_passive[0] + data.qfrc_actuator[0] == pytest.approx(-2 * (0.3 + 49 * 0.05))


def test_joints_are_held_where_they_are_told_to_be() -> None:
    rng = np.random.default_rng(11)
    text = random_mjcf(rng, 7)
    whole = read_mjcf(text, "random.xml")
    names = whole.joint_names
    fixed = {names[k]: float(rng.uniform(-1, 1)) for k in (1, 3)}
    chosen = [name for name in names if name not in fixed]
    part = read_mjcf(text, "random.xml", parse_selection([*chosen, *(f"{n}={x!r}" for n, x in fixed.items())]))
    assert part.joint_names == tuple(chosen)
    q, dq, ddq = rng.uniform(-1, 1, (3, part.n))
    at = [names.index(name) for name in chosen]
    full = np.zeros((3, whole.n))
    full[:, at] = q, dq, ddq
    for name, position in fixed.items():
        full[0, names.index(name)] = position
    # Armature of held joints plays no part, as they don't move.
    torque = reference(text, whole, *full)[at]
    ours = pinocchio_torque(part, part.standard, q, dq, ddq)[0]
    assert np.abs(ours - torque).max() <= 1e-9 * np.abs(torque).max()


FLOATING = """<mujoco><worldbody><body name="trunk" pos="0 0 1" euler="0 90 0"><freejoint name="root"/>
<geom size="0.1"/>
<body name="leg"><joint name="hip" axis="0 1 0"/><geom type="capsule" size="0.02" fromto="0 0 0 0.1 0 0.3"/>
</body></body></worldbody></mujoco>"""


def test_a_floating_base_is_fixed_where_it_is_drawn() -> None:
    robot = read_mjcf(FLOATING, "dog.xml")
    assert robot.joint_names == ("hip",)
    assert "'trunk' floats in the file; it is taken for a fixed base" in robot.note
    fixed = FLOATING.replace('<freejoint name="root"/>', "")
    torque = reference(fixed, robot, np.array([0.3]), np.zeros(1), np.zeros(1))
    assert pinocchio_torque(robot, robot.standard, *np.array([[0.3], [0.0], [0.0]]))[0] == pytest.approx(torque)


def test_a_loop_at_the_end_of_an_arm_is_held() -> None:
    loop = ARM.replace("</equality>", '<connect body1="left" body2="right" anchor="0 0 0"/></equality>')
    loop = loop.replace('<joint joint1="right" joint2="left" polycoef="0.01 1 0 0 0"/>', "")
    robot = read_mjcf(loop, "arm.xml")
    assert robot.joint_names == ("shoulder", "elbow")
    assert "an equality closes a loop between bodies 'left' and 'right'" in robot.note
    tied = ARM.replace("<joint joint1", '<tendon tendon1="split"/><joint active="false" joint1')
    assert read_mjcf(tied, "arm.xml").joint_names == ("shoulder", "elbow")
    idle = ARM.replace("<joint joint1", '<joint active="false" joint1')
    assert read_mjcf(idle, "arm.xml").joint_names == ("shoulder", "elbow", "left", "right")


def test_files_are_included_from_the_models_folder_alone(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "secret.xml").write_text("<mujoco/>")
    start, stop = ARM.index('<body name="upper"'), ARM.index('<body name="box"')
    upper = ARM[start:stop].rstrip().removesuffix("</body>")
    (tmp_path / "parts" / "upper.xml").write_text(f"<mujocoinclude>{upper}</mujocoinclude>")
    scene = tmp_path / "scene.xml"
    scene.write_text(ARM.replace(upper, '<include file="parts/upper.xml"/>'))
    assert replace(load_robot(scene), source="") == replace(read_mjcf(ARM), source="")
    scene.write_text(ARM.replace("<asset>", '<asset><include file="textures.xml"/>'))
    assert load_robot(scene).n == 2  # nothing that matters is in it
    for name, message in {
        "parts/lower.xml": "include 'parts/lower.xml': .*no such file",
        "../secret.xml": "from the folder of the model alone",
        "/etc/passwd": "from the folder of the model alone",
        "scene.xml": "does the file include itself",
    }.items():
        scene.write_text(ARM.replace("<worldbody>", f'<worldbody><include file="{name}"/>', 1))
        with pytest.raises(RobotError, match=message) as caught:
            load_robot(scene)
        assert "\n" not in str(caught.value)


def body(inside: str, more: str = "") -> str:
    return f'<mujoco><worldbody><body name="b">{inside}</body></worldbody>{more}</mujoco>'


HINGE = '<joint name="j"/><geom size="0.1"/>'
REFUSALS = {
    "no joint": (body('<geom size="0.1"/>'), "no moving joint"),
    "ball": (body('<joint name="j" type="ball"/><geom size="1"/>'), "joint 'j': a ball joint can't be used; name the"),
    "two of a name": (body(HINGE + f"<body>{HINGE}</body>"), "MuJoCo can't compile it: .*repeated name 'j'"),
    "unknown class": (body('<joint class="none"/>'), "MuJoCo can't compile it"),
    "zero axis": (body('<joint axis="0 0 0"/><geom size="1"/>'), "MuJoCo can't compile it: .*axis"),
    "not finite": (body('<joint/><geom size="1" mass="nan"/>'), "<geom> mass: expected numbers up to 1e.10, found nan"),
    "huge": (
        body('<joint pos="1e300 0 0"/><geom size="1"/>'),
        "<joint> pos: expected numbers up to 1e.10, found 1e300",
    ),
    "impossible inertia": (
        body('<joint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 9"/>'),
        "MuJoCo can't compile it: .*inertia",
    ),
    "replicas": (
        body(f'<replicate count="100000">{HINGE}</replicate>').replace(HINGE, f"<body>{HINGE}</body>"),
        "more than 10,000 bodies, joints and shapes",
    ),
    "attach": (body('<attach model="m" body="b" prefix="p"/>'), "attaches another model"),
    "include in a text": (body('<include file="x.xml"/>'), "a text can't include files"),
    "entities": ("<!DOCTYPE m [<!ENTITY a 'b'>]>" + body(HINGE), "DOCTYPE or ENTITY"),
    "deep": (body("<body>" * 300 + "</body>" * 300), "more than 200 deep"),
    "coupled arm": (
        body(
            HINGE + '<body><joint name="k"/><geom size="0.1"/><body><joint name="l"/><geom size="0.1"/></body></body>',
            '<equality><joint joint1="k" joint2="j"/></equality>',
        ),
        "joint 'k': 'k' follows 'j', and it carries 'l': coupled joints can't be used; name the joints to keep",
    ),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_refusals(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text, message = REFUSALS[case]
    with pytest.raises(RobotError, match=message) as caught:
        read_mjcf(text, "arm.xml")
    assert str(caught.value).startswith("arm.xml: ")
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())  # MuJoCo likes to leave a log


def test_unnamed_joints_get_names_and_massless_bodies_no_inertia() -> None:
    text = body('<joint/><joint axis="1 0 0"/><body><joint name="joint_2"/><geom size="0.1"/></body>')
    robot = read_mjcf(text, "arm.xml")
    assert robot.joint_names == ("joint_1", "joint_2_", "joint_2")
    assert [joint.link == Link() for joint in robot.joints] == [True, True, False]
