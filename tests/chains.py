"""Random robots for tests: general ones, and ones full of the special geometries that break base-parameter rules."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from identify.robot.robot import Drive, Joint, Limits, Link, Robot


def random_link(rng: np.random.Generator) -> Link:
    """A physically consistent link with a full inertia: the second moments of random points."""
    points = rng.normal(size=(8, 3)) * 0.1 + rng.normal(size=3) * 0.15
    masses = rng.uniform(0.2, 2.0, 8)
    com = masses @ points / masses.sum()
    r = points - com
    second = (masses[:, None] * r).T @ r
    inertia = np.trace(second) * np.eye(3) - second
    return Link(float(masses.sum()), tuple(com), tuple(inertia[np.triu_indices(3)]))


def random_chain(rng: np.random.Generator, n: int, special: bool = False, tree: bool = False) -> Robot:
    """n joints, revolute or prismatic; `special`: right angles, zero lengths and gravity along an axis abound."""

    def angle() -> float:
        if special and rng.random() < 0.85:
            return float(rng.choice([0, 0, 1, -1, 2])) * math.pi / 2
        return float(np.round(rng.uniform(-3, 3), 6))

    def length() -> float:
        return 0.0 if special and rng.random() < 0.5 else float(np.round(rng.uniform(-0.6, 0.6), 6))

    joints = []
    for j in range(n):
        parent = j - 1 if not tree or j == 0 else int(rng.integers(-1, j))
        joints.append(
            Joint(
                name=f"joint_{j + 1}",
                type="prismatic" if rng.random() < 0.3 else "revolute",
                parent=parent,
                alpha=angle(),
                d=length(),
                theta=angle(),
                r=length(),
                gamma=angle() if tree else 0.0,
                b=length() if tree else 0.0,
                limits=Limits((-2.0, 2.0), 3.0, 10.0, 100.0),
                link=random_link(rng),
                drive=Drive(*rng.uniform(0.1, 2.0, 4)),
            )
        )
    gravity = [(0.0, 0.0, -9.81), (0.0, -9.81, 0.0), (9.81, 0.0, 0.0), (3.0, -4.5, 7.5)][
        int(rng.integers(4 if special else 1))
    ]
    return Robot(f"random {n}", tuple(joints), gravity)


def without(robot: Robot, **changes: object) -> Robot:
    """The robot with every joint changed alike (a drive or link replaced, say)."""
    return replace(robot, joints=tuple(replace(joint, **changes) for joint in robot.joints))  # type: ignore[arg-type]
