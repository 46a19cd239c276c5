"""A small arm, two short simulated logs of it, and the command line to try on them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from identify.cli.main import main
from identify.experiment.simulation import save_experiment, simulate
from identify.experiment.trajectory import random_trajectory
from identify.logs.log import Log
from identify.logs.reading import read_log
from identify.robot.library import load_robot

ARM = """
name = "two-joint arm"
[[joint]]
name = "shoulder"
alpha = 0.0
r = 0.3
limits = { position = [-2.0, 2.2], velocity = 3.0, acceleration = 12.0, effort = 150.0 }
link = { mass = 7.0, com = [0.05, -0.02, 0.11], inertia = [0.12, 0.011, -0.007, 0.15, 0.006, 0.09] }
drive = { inertia = 0.4, viscous = 3.1, coulomb = 4.2 }
[[joint]]
name = "elbow"
alpha = 1.5707963267948966
d = 0.35
limits = { position = [-1.8, 1.6], velocity = 4.0, acceleration = 15.0, effort = 90.0 }
link = { mass = 3.5, com = [0.17, 0.03, -0.04], inertia = [0.02, -0.003, 0.002, 0.06, 0.004, 0.05] }
drive = { inertia = 0.2, viscous = 1.9, coulomb = 2.3 }
"""

SLIDE = """
[[joint]]
name = "slide"
type = "prismatic"
alpha = 0.4
d = 0.3
link = { mass = 2.0, com = [0.03, 0.1, 0.2], inertia = [0.02, 0.0, 0.001, 0.03, 0.0, 0.01] }
"""
"""A joint to put behind others."""

MAP = """
time = "t"
side = "joint"
joints = ["shoulder", "elbow"]
position = { columns = ["q1", "q2"], unit = "rad" }
effort = { columns = ["tau1", "tau2"] }
"""


@dataclass(frozen=True)
class Outcome:
    """What a command left behind: its status and what it wrote on the two streams."""

    status: int
    out: str
    err: str

    @property
    def json(self) -> dict:
        """The one JSON object on standard output."""
        return json.loads(self.out)


@dataclass(frozen=True)
class Arm:
    """Files of one simulated arm. robot, train, test: paths; log, unseen: what the two logs hold."""

    robot: Path
    train: Path
    test: Path
    log: Log
    unseen: Log


@pytest.fixture(scope="session")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    """Two motions of 6 s each, with noise."""
    folder = tmp_path_factory.mktemp("arm")
    path = folder / "arm.toml"
    path.write_text(ARM, encoding="utf-8")
    robot = load_robot(path)
    for seed, name in enumerate(("train.mcap", "test.mcap")):
        motion = random_trajectory(robot, seed, fundamental_hz=0.2, periods=1)
        log, truth = simulate(robot, motion, "standard", seed)
        save_experiment(log, truth, ARM, motion.to_toml(), folder / name)
    train, test = folder / "train.mcap", folder / "test.mcap"
    return Arm(path, train, test, read_log(train), read_log(test))


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    """Run one command in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str | Path) -> Outcome:
        capsys.readouterr()
        status = main([str(argument) for argument in arguments])
        return Outcome(status, *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def result(arm: Arm, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The result folder of a fit with a test log."""
    folder = tmp_path_factory.mktemp("fitted") / "result"
    status = main(["fit", str(arm.train), "--robot", str(arm.robot), "--test", str(arm.test), "-o", str(folder)])
    assert status == 0
    return folder


def table(path: Path) -> tuple[list[str], np.ndarray]:
    """Header and rows of a comma-separated table."""
    with open(path, encoding="utf-8") as stream:
        header = stream.readline().strip().split(",")
        return header, np.loadtxt(stream, delimiter=",", ndmin=2)
