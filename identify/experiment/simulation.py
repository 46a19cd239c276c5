"""A whole simulated experiment: the log that an identification may read, and the truth that it may not."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from identify.experiment.control import Control
from identify.experiment.plant import TIMESTEP, run_plant
from identify.experiment.sensors import Sensors, check_noise, findings_entry, measure, provenance
from identify.experiment.trajectory import Trajectory
from identify.logs.files import digest, refuse_existing, replacing
from identify.logs.log import Log
from identify.logs.mcap_writer import Recorder, recording, write_mcap
from identify.robot.payload import carrying
from identify.robot.robot import Link, Robot
from identify.robot.toml_writing import write_toml

TRUTH_FORMAT = "identify/truth/1"


def simulate(
    robot: Robot,
    trajectory: Trajectory,
    noise: str = "standard",
    seed: int = 0,
    progress: Callable[[float, str], None] | None = None,
    load: Link | None = None,
) -> tuple[Log, dict[str, Any]]:
    """Run `trajectory` on the simulated `robot` and measure it: the 1 kHz Log, and the truth behind it.

    noise: none, standard or high; seed of the sensor noise, the only random thing here. load: what the robot carries,
    in R_n, unknown to its controller. The truth is a table fit for JSON; nothing of it is in the log. Limits that the
    motion broke are in the log's findings.
    InputError for a trajectory of another robot; RobotError for inertias that MuJoCo can't hold.
    """
    check_noise(noise, seed)
    tell = progress or (lambda fraction, text: None)
    run = run_plant(robot, trajectory, progress=lambda fraction, text: tell(0.8 * fraction, text), load=load)
    tell(0.8, "sensors")
    log = measure(run, noise, seed, robot)
    tell(1.0, "sensors")
    return log, truth(robot, noise, seed, run.facts, load)


def truth(robot: Robot, noise: str, seed: int, facts: dict[str, str], load: Link | None = None) -> dict[str, Any]:
    """The true parameters of a simulated robot, SI, joint side, as LOG.truth.json holds them.

    standard_names and standard (11 n): XX1 … M1, Ia1, XX2 …, the last link with its load; friction, per joint Fv, Fs
    and offset; drives, per joint Ia; transmission: the extra inertia and friction of coupled motors, which the plant
    leaves at zero; payload: the load (10,) XX … M about O_n in the axes of R_n, null without one.
    """
    arm = robot if load is None else carrying(robot, load)
    return {
        "format": TRUTH_FORMAT,
        "robot": robot.name,
        "noise": noise,
        "seed": seed,
        "standard_names": list(robot.standard_names),
        "standard": [float(value) for value in arm.standard],
        "payload": None if load is None else [float(value) for value in load.standard],
        "friction": [
            {
                "joint": joint.name,
                "viscous": joint.drive.viscous,
                "coulomb": joint.drive.coulomb,
                "offset": joint.drive.offset,
            }
            for joint in robot.joints
        ],
        "drives": [{"joint": joint.name, "inertia": joint.drive.inertia} for joint in robot.joints],
        "transmission": [
            {"name": f"{name}{motor + 1}", "value": 0.0}
            for motor, _ in robot.couplings
            for name in ("Iam", "Fvm", "Fsm")
        ],
        "facts": [f"{key}: {value}" for key, value in facts.items()],
    }


def truth_path(path: str | Path) -> Path:
    """Where the truth of the log at `path` lies: run.mcap → run.truth.json, in the same folder."""
    return Path(path).with_suffix(".truth.json")


def record_experiment(
    robot: Robot,
    trajectory: Trajectory,
    path: str | Path,
    noise: str = "standard",
    seed: int = 0,
    force: bool = False,
    progress: Callable[[float, str], None] | None = None,
    load: Link | None = None,
) -> None:
    """Simulate, and write log and truth as save_experiment does, the log while the plant runs.

    Whoever is killed leaves PATH.partial, readable up to its last half second, and older files as they were.
    """
    check_noise(noise, seed)
    path = Path(path)
    refuse_existing_log(path, force)
    tell = progress or (lambda fraction, text: None)
    attached = _attachments(write_toml(robot), trajectory.to_toml())
    # Noise that is a share of the run's largest effort can't be known before its end.
    bounded = all(np.isfinite(joint.limits.effort) for joint in robot.joints)
    rate = 1 / (2 * TIMESTEP)
    sensors = Sensors(robot, noise, seed, rate)
    with ExitStack() as stack:
        recorders: list[Recorder] = []

        def each(
            time: np.ndarray, position: np.ndarray, effort: np.ndarray, facts: dict[str, str], control: Control
        ) -> None:
            if not recorders:
                told = provenance(robot, noise, seed, rate, facts)
                attachments = attached | control.attachments()
                recording_ = recording(path, robot.joint_names, metadata=told, attachments=attachments)
                recorders.append(stack.enter_context(recording_))
            measured, velocity, measured_effort = sensors.read(position, effort)
            recorders[0].append(time, measured, velocity, measured_effort)

        run = run_plant(
            robot,
            trajectory,
            progress=lambda fraction, text: tell(0.9 * fraction, text),
            each=each if bounded else None,
            load=load,
        )
        if recorders and run.findings:
            recorders[0].note(findings_entry(run.findings))
    if not bounded:
        write_mcap(measure(run, noise, seed, robot), path, attached)
    _save_truth(truth(robot, noise, seed, run.facts, load), path)
    tell(1.0, "log")


def save_experiment(
    log: Log, truth: dict[str, Any], robot_toml: str, trajectory_toml: str, path: str | Path, force: bool = False
) -> None:
    """Write `log` to `path` (MCAP, robot and trajectory attached) and `truth` beside it, each whole or not at all.

    The truth file also gets the log's digest, so that it can't be taken for another log's. OutputError if either
    file is there and `force` is False, or where they can't be written.
    """
    refuse_existing_log(Path(path), force)
    write_mcap(log, path, _attachments(robot_toml, trajectory_toml))
    _save_truth(truth, Path(path))


def refuse_existing_log(path: Path, force: bool) -> None:
    """OutputError if a log, or its truth, is at `path` already and `force` is False."""
    for target in (path, truth_path(path)):
        refuse_existing(target, force)


def _attachments(robot_toml: str, trajectory_toml: str) -> dict[str, bytes]:
    return {"robot.toml": robot_toml.encode(), "trajectory.toml": trajectory_toml.encode()}


def _save_truth(truth: dict[str, Any], path: Path) -> None:
    """Write the truth of the log at `path` beside it."""
    beside = truth_path(path)
    # Should this fail, no truth is better than another log's.
    beside.unlink(missing_ok=True)
    with replacing(beside) as stream:
        stream.write((json.dumps(truth | {"log_sha256": digest(path)}, indent=1, ensure_ascii=False) + "\n").encode())
