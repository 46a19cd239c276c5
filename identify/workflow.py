"""The few functions that lead a value through the rooms: excite, simulate, fit, and their demonstration."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identify.errors import InputError, UnsupportedLogError
from identify.fit_workflow import Progress, identified, raw_curves, triaged
from identify.logs.log import Log
from identify.robot.robot import Link, Robot
from identify.side_by_side import one_blas_thread

if TYPE_CHECKING:
    from identify.estimation.identification import Identification
    from identify.experiment.trajectory import Trajectory

Folder = str | os.PathLike[str]


def excite(
    robot: Robot,
    criterion: str = "torque",
    duration: float = 10.0,
    seed: int = 0,
    progress: Progress = None,
    *,
    periods: int = 3,
    harmonics: int | None = None,
    starts: int = 3,
    collision: bool = True,
    earlier: Sequence[Identification] = (),
) -> Trajectory:
    """A Fourier trajectory that excites the parameters of the torque model, the energy model or both.

    duration: one period [s]. It respects the robot's limits, keeps a serial arm's links off each other and off the
    floor, and is at rest at both ends. earlier: results that it adds most to; the last one's parameters then tell the
    effort. See `identify.experiment.excitation.designed_excitation`.
    """
    from identify.estimation.earlier import next_excitation

    options = {"periods": periods, "harmonics": harmonics, "starts": starts, "collision": collision}
    return next_excitation(robot, earlier, criterion, duration, seed, progress=progress, **options).trajectory


def simulate(
    robot: Robot,
    trajectory: Trajectory | None = None,
    noise: str = "standard",
    seed: int = 0,
    progress: Progress = None,
    load: Link | None = None,
) -> Log:
    """The log of a simulated experiment in MuJoCo, 1 kHz; without a trajectory, one is designed (torque model).

    load: what the last link carries, in R_n, of which the controller knows nothing.
    """
    return _simulated(robot, trajectory, noise, seed, progress, load)[0]


def run_experiment(
    robot: Robot,
    path: Folder,
    trajectory: Trajectory | None = None,
    noise: str = "standard",
    seed: int = 0,
    force: bool = False,
    progress: Progress = None,
    load: Link | None = None,
) -> Log:
    """Simulate and write LOG.mcap, with robot and trajectory attached, and LOG.truth.json beside it.

    The log is written while the plant runs; a run that is killed leaves LOG.mcap.partial, which can be read.
    """
    from identify.experiment.simulation import record_experiment, refuse_existing_log
    from identify.logs.reading import read_log

    refuse_existing_log(Path(path), force)
    if trajectory is None:
        trajectory = excite(robot, progress=progress)
    record_experiment(robot, trajectory.for_robot(robot), Path(path), noise, seed, force, progress, load)
    return read_log(path)


def fit(
    log: Log | Sequence[Log],
    robot: Robot,
    test: Sequence[Log] = (),
    model: str | None = None,
    estimator: str | None = None,
    command: str = "",
    progress: Progress = None,
    friction: str | Collection[str] | None = None,
    prior: float | None = None,
) -> Identification:
    """Identify base and friction parameters from one log or several, and check them on `test` logs.

    model: "torque" (the default) or "energy"; both are fitted, this one is the result. estimator: a name of
    estimation.estimators.registry.ESTIMATORS, which tells the model too; "all" for a table of all of them beside.
    friction: forms of it beside viscous, Coulomb and offset, of regressor.friction.FURTHER, with commas between or in a
    collection; "plain" for none of them; by default ("auto") those that cross-validation finds worth it. prior: how far
    links may be from those of the robot's file, a standard deviation in shares of them; by default these settle what
    the data leave open and nothing else. Estimates are the same with it, the links that physics allows are not.
    UnsupportedLogError, with its reasons, where the logs can't support a result.
    """
    with one_blas_thread():
        task = triaged(log, robot, test, model, estimator, friction, prior, progress)
        return identified(task, command, progress)


def fit_to_folder(
    logs: Sequence[Log],
    robot: Robot,
    folder: Folder,
    test: Sequence[Log] = (),
    model: str | None = None,
    estimator: str | None = None,
    force: bool = False,
    command: str = "",
    progress: Progress = None,
    friction: str | Collection[str] | None = None,
    prior: float | None = None,
) -> dict[str, Any]:
    """Fit, and write the result folder with its report; for logs that can't support a result, one that says why.

    Returns the record; its verdict's status tells the two apart.
    """
    from identify import record as records
    from identify.estimation.estimators.registry import choice
    from identify.estimation.identification import RECORD, save_folder
    from identify.logs.folders import check_replaceable
    from identify.report.page import render
    from identify.validation.verdict import rejected

    check_replaceable(folder, RECORD, force)
    curves: dict[str, np.ndarray]
    with one_blas_thread():
        task = triaged(logs, robot, test, model, estimator, friction, prior, progress)
        try:
            result = identified(task, command, progress)
            record, curves = result.record, result.curves
        except UnsupportedLogError as error:
            of_model = choice(model, estimator).model
            head = records.head(robot, of_model, task.train, task.test, command, task.triage)
            record, curves = records.rejected(head, rejected(error.reasons)), raw_curves(task.train)
    if progress:
        progress(0.95, "report")
    save_folder(record, curves, robot, folder, force, {"report.html": render(record, curves)})
    return record


def export(
    source: Folder,
    form: str,
    path: Folder,
    force: bool = False,
    joints: str | Sequence[str] = (),
    gravity: Sequence[float] | None = None,
) -> tuple[str, ...]:
    """Write a robot as form "toml", "urdf" or "mjcf"; what the format leaves out.

    source: a result folder, whose identified robot is meant, or a built-in name or robot file, of which joints and
    gravity choose as for `load_robot`. InputError where it is none of these; OutputError where path exists and force
    is not set.
    """
    from identify.estimation.identification import RECORD, Identification
    from identify.estimation.identified_robot import exported
    from identify.logs.files import refuse_existing, replacing
    from identify.robot.library import built_in, load_robot
    from identify.robot.writing import not_carried, written

    folder = Path(source)
    if (folder / RECORD).is_file() or (folder.is_dir() and str(source) not in built_in()):
        if joints or gravity is not None:
            raise InputError(f"{source}: is a result folder, whose robot is whole; leave --joints and --gravity out")
        text, lost = exported(Identification.load(folder), form)
    else:
        robot = load_robot(os.fspath(source), joints, gravity)
        lost = not_carried(robot, form)
        text = written(robot, form, lost)
    refuse_existing(path, force)
    with replacing(Path(path)) as stream:
        stream.write(text.encode())
    return lost


def demo(folder: Folder, force: bool = False, progress: Progress = None) -> dict[str, Any]:
    """The whole path on the built-in RX-90: design, simulate, log, identify, test on an unseen motion, report."""
    from identify.estimation.identification import RECORD
    from identify.experiment.trajectory import random_trajectory
    from identify.logs.folders import check_replaceable
    from identify.logs.reading import read_log
    from identify.robot.library import load_robot

    place = Path(folder)
    check_replaceable(place / "result", RECORD, force)
    place.mkdir(parents=True, exist_ok=True)
    robot = load_robot("rx90")

    def part(start: float, stop: float) -> Progress:
        return None if progress is None else lambda share, text: progress(start + (stop - start) * share, text)

    trajectory = excite(robot, progress=part(0.0, 0.4))
    trajectory.save(place / "trajectory.toml")
    unseen = random_trajectory(robot, seed=2)
    run_experiment(robot, place / "train.mcap", trajectory, seed=0, force=True, progress=part(0.4, 0.5))
    run_experiment(robot, place / "test.mcap", unseen, seed=1, force=True, progress=part(0.5, 0.6))
    train, test = (read_log(place / name) for name in ("train.mcap", "test.mcap"))
    command = f"identify demo -o {folder}"
    return fit_to_folder(
        [train], robot, place / "result", [test], force=force, command=command, progress=part(0.6, 1.0)
    )


def _simulated(
    robot: Robot, trajectory: Trajectory | None, noise: str, seed: int, progress: Progress, load: Link | None
) -> tuple[Log, dict[str, Any], Trajectory]:
    from identify.experiment.simulation import simulate as run

    if trajectory is None:
        trajectory = excite(robot, progress=progress)
    trajectory = trajectory.for_robot(robot)
    return (*run(robot, trajectory, noise, seed, progress, load), trajectory)
