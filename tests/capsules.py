"""Distances between a robot's capsules by MuJoCo, on frames by Pinocchio: an oracle that shares no code with ours."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
import pinocchio as pin
from oracle import pinocchio_model

from identify.experiment.clearance import Clearance
from identify.robot.robot import Robot


def ends(robot: Robot, q: np.ndarray, foot: np.ndarray, tip: np.ndarray) -> np.ndarray:
    """(n + 2, 3) foot, O_1 … O_n and tip in the world, by Pinocchio."""
    model = pinocchio_model(robot)
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    base = pin.SE3(np.array(robot.base))
    frames = [base * data.oMi[j] for j in range(1, robot.n + 1)]
    return np.array([foot, *(frame.translation for frame in frames), frames[-1].act(tip)])


def engine_gaps(clearance: Clearance, q: np.ndarray) -> Iterator[float]:
    """The gaps at one pose (n,) by MuJoCo: capsules placed in the world, and a plane for the floor."""
    points = ends(clearance.robot, q, clearance.foot, clearance.tip)[list(clearance.points)]
    shapes = "".join(
        f'<geom name="link{s}" type="capsule" size="{radius}" fromto="{" ".join(map(str, (*a, *b)))}"/>'
        for s, (radius, a, b) in enumerate(zip(clearance.radius, points[:-1], points[1:], strict=True))
    )
    floor = 0.0 if clearance.floor is None else clearance.floor
    shapes += f'<geom name="floor" type="plane" size="9 9 1" pos="0 0 {floor}"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{shapes}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)

    def distance(first: str, second: str) -> float:
        numbers = (mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name) for name in (first, second))
        return float(mujoco.mj_geomDistance(model, data, *numbers, 10.0, None))

    for i, k in clearance.pairs:
        yield distance(f"link{i}", f"link{k}")
    for at in clearance.over:
        # the lower end of the thicker of the two capsules that meet in this point
        meeting = [s for s in (at - 1, at) if s < len(clearance.radius)]
        thick = max(clearance.radius[s] for s in meeting)
        yield float(points[at, 2]) - floor - thick
