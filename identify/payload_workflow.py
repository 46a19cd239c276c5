"""From a fit of the arm and a log with a load to the load: estimate, check, record, report."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identify.errors import InputError, LogError, UnsupportedLogError
from identify.fit_workflow import Progress, for_robot, looked_over
from identify.logs.log import Log
from identify.side_by_side import one_blas_thread

if TYPE_CHECKING:
    from identify.estimation.drive_gains import DriveGains
    from identify.estimation.identification import Identification
    from identify.estimation.payload import LoadEstimate
    from identify.estimation.payload_result import Payload
    from identify.estimation.settings import Settings
    from identify.logs.triage import Findings
    from identify.regressor.regressor import Regressor

Folder = str | os.PathLike[str]


def payload(
    result: Identification | Folder,
    log: Log | Sequence[Log],
    test: Sequence[Log] = (),
    mass: float | None = None,
    unloaded: Sequence[Log] = (),
    friction: bool = True,
    command: str = "",
    progress: Progress = None,
) -> Payload:
    """The load on the last link, from a fit of the arm without it and one log or several of the arm with it.

    result: the fit, or its folder. test: further logs with the load, not fitted. mass [kg]: the load's, where it is
    known; then the effort of each joint may be in any unit, a current say, and its gain is estimated too, from the logs
    that were fitted, given as `unloaded`. friction: whether it may have changed with the load. InputError for what
    can't be used; UnsupportedLogError, with its reasons, where the logs can't tell the load.
    """
    from identify.estimation.identification import Identification
    from identify.payload_record import fit_digest

    folder = "" if isinstance(result, Identification) else str(Path(result))
    digest = fit_digest(Path(folder)) if folder else ""
    fitted = result if isinstance(result, Identification) else Identification.load(result)
    logs = [log] if isinstance(log, Log) else list(log)
    with one_blas_thread():
        return _payload(fitted, (folder, digest), logs, test, mass, unloaded, friction, command, progress)


def payload_to_folder(
    folder: Folder,
    logs: Sequence[Log],
    output: Folder,
    test: Sequence[Log] = (),
    mass: float | None = None,
    unloaded: Sequence[Log] = (),
    friction: bool = True,
    force: bool = False,
    command: str = "",
    progress: Progress = None,
) -> dict[str, Any]:
    """`payload` of a fit's folder into a result folder with its report; for logs that can't tell a load, one that says
    why. Returns the record."""
    from identify.estimation.identification import Identification
    from identify.estimation.payload_result import RECORD, save_payload
    from identify.logs.folders import check_replaceable
    from identify.payload_record import fit_digest, payload_head, rejected_payload
    from identify.report.payload import render
    from identify.validation.payload_verdict import rejected_load

    check_replaceable(output, RECORD, force)
    curves: dict[str, np.ndarray]
    try:
        found = payload(folder, logs, test, mass, unloaded, friction, command, progress)
        record, curves = found.record, found.curves
    except UnsupportedLogError as error:
        fitted = Identification.load(folder)
        every = for_robot([*logs, *test], fitted.robot)
        triage = [_burdened(found) for found in looked_over(every, fitted.robot, fitted.regressor.with_forms(()))]
        known, others = every[: len(logs)], every[len(logs) :]
        digest = fit_digest(Path(folder))
        head = payload_head(fitted, str(Path(folder)), digest, known, others, triage, command)
        record, curves = rejected_payload(head, rejected_load(error.reasons)), {}
    if progress:
        progress(0.95, "report")
    save_payload(record, curves, output, force, render(record, curves))
    return record


def _payload(
    fitted: Identification,
    origin: tuple[str, str],
    logs: Sequence[Log],
    test: Sequence[Log],
    mass: float | None,
    unloaded: Sequence[Log],
    friction: bool,
    command: str,
    progress: Progress,
) -> Payload:
    from identify import payload_record as records
    from identify.estimation.drive_gains import calibrated
    from identify.estimation.payload import Unloaded, estimate_load
    from identify.estimation.payload_result import Payload
    from identify.estimation.prediction import Predictor
    from identify.logs.triage import refusals
    from identify.validation import held_out
    from identify.validation.payload_verdict import load_verdict
    from identify.validation.review import reviewed
    from identify.validation.truth import true_load

    tell = progress or (lambda share, text: None)
    robot, regressor, settings = fitted.robot, fitted.regressor, fitted.settings
    loaded, tests, without = (for_robot(each, robot) for each in (logs, test, unloaded))
    _check(fitted, loaded, tests, without, mass)
    tell(0.0, "triage")
    triage = [_burdened(found) for found in looked_over([*loaded, *tests], robot, regressor.with_forms(()))]
    for found in triage[: len(loaded)]:
        if reasons := refusals(found):
            raise UnsupportedLogError(*reasons)
    tell(0.2, "load")
    gains, arm = None, fitted.parameters
    if mass is None:
        known = Unloaded(regressor, settings, fitted.parameters, fitted.covariance)
        estimate = estimate_load(known, loaded, friction)
    else:
        gains, settings = _gains(fitted, without, loaded, mass)
        estimate, arm = gains.load, gains.load.arm
        loaded, tests = ([calibrated(log, gains.gains) for log in each] for each in (loaded, tests))
        regressor = settings.suited(regressor)
    tell(0.6, "residuals")
    burdened = estimate.settings.suited(regressor)
    carrying = {"with": Predictor(burdened, estimate.loaded, estimate.settings)}
    empty = {"without": Predictor(regressor, arm, settings)}
    reviews = [reviewed(log, carrying | empty) for log in loaded]
    figures = held_out.figures(reviews, robot)
    bare, with_load = figures["without"], figures["with"]
    still = [name for name, moves in zip(robot.joint_names, _moving(triage[: len(loaded)]), strict=True) if not moves]
    _refuse_vague(fitted, estimate, with_load, still, mass)
    reason = _why_untold(regressor, still)
    record = records.payload_head(fitted, *origin, loaded, tests, triage, command) | {
        "load": records.load_tables(robot, estimate, reason, true_load(logs[0]), certain=mass is not None),
        "gains": None if gains is None else records.gain_rows(robot, gains),
        "friction": records.friction_rows(regressor, arm, estimate.change, estimate.change_std),
        "fit": {
            "without": bare,
            "with": with_load,
            "chi_squared": estimate.chi_squared,
            "degrees_of_freedom": estimate.degrees,
        },
        "settings": records.payload_settings(estimate, friction),
        "test": [{"path": log.source, **held_out.figures_on([log], carrying)["with"]} for log in tests],
        **records.physical_load(estimate, certain=mass is not None),
    }
    if gains is None:
        record["gains_reason"] = "the load's mass was not stated, so the effort is taken for a torque"
    else:
        record["fit"]["chi_squared_reason"] = "gains were estimated with the load, from both kinds of logs"
    if not tests:
        record["test_reason"] = "no further log with the load was given"
    record["versions"]["regressor"] = regressor.backend
    record["verdict"] = load_verdict(record)
    curves: dict[str, np.ndarray] = {}
    for k, review in enumerate(reviews):
        drawn = review.curves | {"without": reviewed(review.log, empty).curves["predicted"]}
        curves |= {f"loaded{k}/{name}": values for name, values in drawn.items()}
    rows = record["load"]["standard"]
    told = np.array([np.nan if row["estimate"] is None else row["estimate"] for row in rows])
    covariance = np.where(np.isnan(told)[:, None] | np.isnan(told), np.nan, estimate.covariance)
    return Payload(told, covariance, None if gains is None else gains.gains, record, curves)


def _check(fitted: Identification, loaded: list[Log], tests: list[Log], without: list[Log], mass: float | None) -> None:
    """InputError for logs that can't be with a load, or that a stated mass needs."""
    trained = {log.get("sha256") for log in fitted.record.get("logs", []) if log.get("role") == "train"} - {None, ""}
    for log in loaded:
        if log.sha256 in trained:
            raise LogError(f"{log.source}: is a log that the fit was made of, without a load; give one with the load")
    for log in [*loaded, *tests]:
        if log.effort is None:
            raise LogError(f"{log.source or 'log'}: holds no effort, which the load shows in; record it too")
    if mass is None:
        return
    if not (np.isfinite(mass) and mass > 0):
        raise InputError(f"mass is {mass:g} kg; it must be above 0")
    if fitted.robot.couplings:
        raise InputError(
            f"{fitted.robot.name}: the drives of coupled axes share their joints' effort, so that there is no gain for "
            "each joint; leave the mass out, and give the effort in N·m"
        )
    if not without:
        raise InputError("the drive gains need the logs without the load, that the fit was made of; give them too")


def _gains(fitted: Identification, without: list[Log], loaded: list[Log], mass: float) -> tuple[DriveGains, Settings]:
    """Gains with the settings that suit the logs without load once they are in N·m: the fit's were chosen by currents.

    Friction that grows with the load on a joint is left out: what it grows with has another size in each kind of log.
    """
    from identify.estimation.drive_gains import calibrated, drive_gains
    from identify.estimation.fitting import SETTINGS_S, liveliest
    from identify.estimation.selection import choose_settings
    from identify.estimation.settings import Settings
    from identify.regressor.friction import LOAD

    plain = fitted.regressor.with_forms(())
    first = drive_gains(plain, Settings(), without, loaded, mass)
    sample = [calibrated(liveliest(log, SETTINGS_S), first.gains) for log in without]
    settings = choose_settings(plain, sample)[0]
    if LOAD in settings.friction:
        settings = choose_settings(plain, sample, friction=[form for form in settings.friction if form != LOAD])[0]
    return drive_gains(settings.suited(plain), settings, without, loaded, mass), settings


def _burdened(found: Findings) -> Findings:
    """The findings but for the effort's size against the description, which knows of no load."""
    from identify.validation.log_checks import EFFORT_UNIT

    return replace(found, findings=tuple(each for each in found.findings if each.kind != EFFORT_UNIT))


def _moving(triage: Sequence[Findings]) -> list[bool]:
    """(n,) whether each joint moves in any of the logs."""
    return [any(found.joints[j].moves for found in triage) for j in range(len(triage[0].joints))]


def _refuse_vague(
    fitted: Identification, estimate: LoadEstimate, figures: dict[str, Any], still: list[str], mass: float | None
) -> None:
    """UnsupportedLogError where the logs can't tell the load's mass, or are not explained by any load."""
    from identify.estimation.payload import load_matrix
    from identify.estimation.reference import mass_scale, mean_length
    from identify.validation.payload_verdict import refusals_of_load

    regressor = fitted.regressor
    matrix = load_matrix(regressor)
    reasons = refusals_of_load(
        told=mass is not None or estimate.tells(np.eye(10)[9]),
        felt=mass is not None or np.linalg.matrix_rank(matrix[:, :9]) < np.linalg.matrix_rank(matrix),
        mass=float(estimate.parameters[9]),
        std=float(np.sqrt(estimate.covariance[9, 9])),
        arm_mass=mass_scale(regressor, fitted.parameters, mean_length(fitted.robot)),
        still=still,
        residual=figures["moving_relative_residual_percent"],
    )
    if reasons:
        raise UnsupportedLogError(*reasons)


def _why_untold(regressor: Regressor, still: list[str]) -> str:
    from identify.estimation.payload import load_matrix

    if still:
        return f"in the loaded log {', '.join(still)} stand{'s' * (len(still) == 1)} still"
    if np.linalg.matrix_rank(load_matrix(regressor)) < 10:
        return "the joints of this arm feel it only together with others, whatever the motion"
    return "the motion holds nothing that would tell it from the others"
