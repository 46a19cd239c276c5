"""The few functions that lead a value through the rooms: excite, simulate, fit, and their demonstration."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identify.errors import LogError, UnsupportedLogError
from identify.logs.log import Log
from identify.robot.robot import Link, Robot

if TYPE_CHECKING:
    from identify.estimation.identification import Identification
    from identify.experiment.trajectory import Trajectory
    from identify.logs.triage import Findings
    from identify.regressor.regressor import Regressor
    from identify.validation.review import Review

Progress = Callable[[float, str], None] | None
Folder = str | os.PathLike[str]

PHYSICAL = "physical"
"""Name of the prediction by the robot nearest to the estimate that physics allows, beside those of the models."""


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
    import scipy.linalg  # noqa: F401  loaded before the limit, which reaches only libraries that are there
    from threadpoolctl import threadpool_limits

    from identify.estimation.estimators.registry import choice
    from identify.logs.triage import refusals
    from identify.regressor.friction import chosen_forms
    from identify.regressor.regressor import Regressor
    from identify.validation.possible import check_prior

    choice(model, estimator)
    forms = chosen_forms(friction)
    check_prior(robot, prior)
    train = _for_robot([log] if isinstance(log, Log) else log, robot)
    test = _for_robot(test, robot)
    for each in test:
        if each.effort is None:
            raise LogError(f"{each.source or 'test log'}: holds no effort to test against; leave it out of --test")
    if progress:
        progress(0.0, "triage")
    # Threads cost more than they bring on matrices of this size: each hand-over takes longer than the work.
    with threadpool_limits(1, "blas"):
        regressor = Regressor(robot)
        triage = looked_over([*train, *test], robot, regressor)
        for found in triage[: len(train)]:
            if reasons := refusals(found):
                raise UnsupportedLogError(*reasons)
        return _identified(regressor, train, test, model, estimator, forms, prior, command, triage, progress)


def looked_over(logs: Sequence[Log], robot: Robot, regressor: Regressor | None = None) -> list[Findings]:
    """What triage finds in each log, by itself and by the robot's limits and dynamics."""
    from identify.regressor.regressor import Regressor
    from identify.validation.log_checks import look_over

    regressor = regressor or Regressor(robot)
    return [look_over(log, robot, regressor) for log in logs]


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
    try:
        result = fit(logs, robot, test, model, estimator, command, progress, friction, prior)
        record, curves = result.record, result.curves
    except UnsupportedLogError as error:
        train, held_out = _for_robot(logs, robot), _for_robot(test, robot)
        triage, of_model = looked_over([*train, *held_out], robot), choice(model, estimator).model
        record = records.rejected(
            records.head(robot, of_model, train, held_out, command, triage),
            rejected(error.reasons),
        )
        curves = _raw_curves(train)
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


def _for_robot(logs: Sequence[Log], robot: Robot) -> list[Log]:
    """The logs with the robot's joints in its order. LogError where one lacks a joint."""
    from identify.logs.slicing import select

    return [select(log, robot.joint_names) for log in logs]


def _identified(
    regressor: Regressor,
    train: list[Log],
    test: list[Log],
    model: str | None,
    estimator: str | None,
    forms: tuple[str, ...] | None,
    prior: float | None,
    command: str,
    triage: list[Findings],
    progress: Progress,
) -> Identification:
    from identify import record as records
    from identify.estimation.estimators.registry import ALL
    from identify.estimation.fitting import agreement, fit_models
    from identify.estimation.identification import Identification
    from identify.estimation.prediction import Predictor
    from identify.estimation.reference import reference
    from identify.validation import cross_check, held_out
    from identify.validation.estimators import compared
    from identify.validation.possible import cost, possible_robot
    from identify.validation.review import reviewed
    from identify.validation.statistics import statistics
    from identify.validation.truth import true_parameters
    from identify.validation.verdict import refusals_of_fit, verdict

    tell = progress or (lambda share, text: None)
    robot = regressor.robot
    both = fit_models(regressor, train, model, estimator, forms, lambda share, text: tell(0.7 * share, text))
    chosen, model = both.chosen, both.chosen.model
    regressor, estimate, settings = chosen.regressor, chosen.estimate, chosen.settings
    tell(0.7, "links that physics allows")
    nominal = None if any(log.simulated for log in train) else held_out.nominal_parameters(regressor)
    prior_reason = (
        "the log is a simulation of the robot file itself"
        if nominal is None and train[0].simulated
        else "the robot file gives no inertias"
    )
    known = nominal is not None or prior is not None
    bodies = reference(regressor, estimate.parameters, known)
    possible, why_none = possible_robot(chosen, bodies, prior)
    tell(0.75, "residuals and held-out logs")
    models = {fit.model: fit.predictor for fit in (chosen, both.torque, both.energy) if fit is not None}
    further = {} if possible is None else {PHYSICAL: Predictor(regressor, possible.parameters, settings)}
    reviews = [reviewed(log, models | further) for log in train]
    figures = held_out.figures(reviews, robot)
    if reasons := refusals_of_fit(model, {name: figures[name] for name in models}):
        raise UnsupportedLogError(*reasons)
    described = {} if nominal is None else {held_out.NOMINAL: Predictor(regressor, nominal, settings)}
    seen = [reviewed(log, {model: models[model]} | described | further) for log in test]
    tests = [{"path": review.log.source, **held_out.held_out(review, reviews, robot)} for review in seen]
    physical: dict[str, Any] = {"physical": None, "physical_reason": why_none}
    if possible is not None:
        why = "the robot file's links" if known else prior_reason
        scores = {
            "fit": _residuals(figures[PHYSICAL]),
            "test": [{"path": x.log.source, **_residuals(held_out.figures([x], robot)[PHYSICAL])} for x in seen],
        }
        speeds = np.max([review.arm_speed for review in reviews], axis=0)
        paid = cost(chosen, possible, figures[model], figures[PHYSICAL])
        physical = {"physical": records.physical(chosen, possible, bodies, why, scores, speeds, paid, prior)}
    tell(0.85, "cross-check against Pinocchio and MuJoCo")
    checks = cross_check.cross_check_regressor(robot)
    base = estimate.parameters[: len(regressor.base.names)]
    checks["identified"] = cross_check.cross_check_identified(
        robot, base, None if possible is None else possible.standard
    )
    truth = true_parameters(regressor, train[0])
    record = records.head(robot, model, train, test, command, triage) | {
        "estimator": chosen.estimator,
        **records.parameters(chosen, truth, nominal, prior_reason),
        "fit": records.fit_figures(chosen, figures[model]),
        "settings": records.settings(chosen, both.tried),
        "statistics": statistics(chosen, both.problem),
        "test": tests,
        "coverage": held_out.coverage(robot, reviews),
        "models": records.models(
            both,
            figures,
            agreement(both.torque.estimate, both.energy.estimate) if both.torque and both.energy else None,
        ),
        **physical,
        "cross_check": checks,
    }
    if not tests:
        record["test_reason"] = "no held-out log was given"
    if estimator == ALL:
        record["estimators"] = compared(both.problem, test)
    record["versions"]["regressor"] = regressor.backend
    record["verdict"] = verdict(record)
    curves = _curves("train", reviews) | _curves("test", seen) | held_out.residual_autocorrelation(reviews[0])
    return Identification(
        robot, regressor.names, estimate.parameters, estimate.std, estimate.covariance, record, curves
    )


def _residuals(figures: dict[str, Any]) -> dict[str, Any]:
    from identify.estimation.scoring import RESIDUALS

    return {key: x for key, x in figures.items() if key.removesuffix("_reason") in (*RESIDUALS, "per_joint")}


def _curves(prefix: str, reviews: Sequence[Review]) -> dict[str, np.ndarray]:
    return {f"{prefix}{k}/{name}": x for k, review in enumerate(reviews) for name, x in review.curves.items()}


def _raw_curves(logs: Sequence[Log]) -> dict[str, np.ndarray]:
    """What a refused log looks like: its effort and position as recorded, thinned."""
    curves: dict[str, np.ndarray] = {}
    for k, log in enumerate(logs):
        rows = slice(None, None, max(1, log.samples // 3000))
        curves[f"train{k}/time"] = log.time[rows]
        curves[f"train{k}/position"] = log.position[rows].astype(np.float32)
        if log.effort is not None:
            curves[f"train{k}/measured"] = log.effort[rows].astype(np.float32)
    return curves
