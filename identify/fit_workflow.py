"""From logs to a result: triage, both models, links that physics allows, residuals, cross-checks, the record."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from identify.errors import InputError, LogError, UnsupportedLogError
from identify.logs.log import Log
from identify.robot.robot import Robot
from identify.side_by_side import give_back

if TYPE_CHECKING:
    from identify.estimation.identification import Identification
    from identify.logs.triage import Findings
    from identify.regressor.regressor import Regressor
    from identify.validation.review import Review

Progress = Callable[[float, str], None] | None

PHYSICAL = "physical"
"""Name of the prediction by the robot nearest to the estimate that physics allows, beside those of the models."""


@dataclass(frozen=True, eq=False)
class Task:
    """What is asked of a fit, and what triage found in its training and then its test logs."""

    regressor: Regressor
    train: list[Log]
    test: list[Log]
    model: str | None
    estimator: str | None
    forms: tuple[str, ...] | None
    prior: float | None
    triage: list[Findings]


def triaged(
    log: Log | Sequence[Log],
    robot: Robot,
    test: Sequence[Log],
    model: str | None,
    estimator: str | None,
    friction: str | Collection[str] | None,
    prior: float | None,
    progress: Progress,
) -> Task:
    """What is asked for, its logs looked over, of the robot's joints in its order. InputError for what can't be."""
    from identify.estimation.estimators.registry import choice
    from identify.regressor.friction import chosen_forms
    from identify.regressor.regressor import Regressor
    from identify.validation.possible import check_prior

    by = choice(model, estimator)
    forms = chosen_forms(friction)
    if forms and by.model == "energy":
        raise InputError(
            f"friction {', '.join(forms)} is of the torque model alone; leave it out with the energy model"
        )
    check_prior(robot, prior)
    train = for_robot([log] if isinstance(log, Log) else log, robot)
    test = for_robot(test, robot)
    for each in test:
        if each.effort is None:
            raise LogError(f"{each.source or 'test log'}: holds no effort to test against; leave it out of --test")
    if progress:
        progress(0.0, "triage")
    regressor = Regressor(robot)
    triage = looked_over([*train, *test], robot, regressor)
    give_back()
    return Task(regressor, train, test, model, estimator, forms, prior, triage)


def identified(task: Task, command: str, progress: Progress) -> Identification:
    """The result; UnsupportedLogError, with its reasons, where the logs can't support one."""
    from identify import record as records
    from identify.estimation.estimators.registry import ALL
    from identify.estimation.fitting import agreement, fit_models
    from identify.estimation.identification import Identification
    from identify.estimation.prediction import Predictor
    from identify.estimation.reference import reference
    from identify.logs.triage import refusals
    from identify.validation import cross_check, held_out
    from identify.validation.estimators import compared
    from identify.validation.possible import cost, possible_robot
    from identify.validation.review import reviewed
    from identify.validation.statistics import statistics
    from identify.validation.truth import true_parameters
    from identify.validation.verdict import refusals_of_fit, verdict

    train, test, triage = task.train, task.test, task.triage
    for found in triage[: len(train)]:
        if reasons := refusals(found):
            raise UnsupportedLogError(*reasons)
    tell = progress or (lambda share, text: None)
    regressor, robot = task.regressor, task.regressor.robot
    both = fit_models(
        regressor, train, task.model, task.estimator, task.forms, lambda share, text: tell(0.7 * share, text)
    )
    chosen, model = both.chosen, both.chosen.model
    regressor, estimate, settings = chosen.regressor, chosen.estimate, chosen.settings
    tell(0.7, "links that physics allows")
    nominal = None if any(log.simulated for log in train) else held_out.nominal_parameters(regressor)
    prior_reason = (
        "the log is a simulation of the robot file itself"
        if nominal is None and train[0].simulated
        else "the robot file gives no inertias"
    )
    known = nominal is not None or task.prior is not None
    bodies = reference(regressor, estimate.parameters, known)
    possible, why_none = possible_robot(chosen, bodies, task.prior)
    tell(0.75, "residuals and held-out logs")
    give_back()
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
        physical = {"physical": records.physical(chosen, possible, bodies, why, scores, speeds, paid, task.prior)}
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
    if task.estimator == ALL:
        # What repeats the training motion is no test of any of them, as it is none of the result.
        repeated = [(row["motion"]["repeat"] or {}).get("repeats") for row in tests]
        record["estimators"] = compared(both.problem, [log for log, is_ in zip(test, repeated, strict=True) if not is_])
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


def raw_curves(logs: Sequence[Log]) -> dict[str, np.ndarray]:
    """What a refused log looks like: its effort and position as recorded, thinned."""
    curves: dict[str, np.ndarray] = {}
    for k, log in enumerate(logs):
        rows = slice(None, None, max(1, log.samples // 3000))
        curves[f"train{k}/time"] = log.time[rows]
        curves[f"train{k}/position"] = log.position[rows].astype(np.float32)
        if log.effort is not None:
            curves[f"train{k}/measured"] = log.effort[rows].astype(np.float32)
    return curves


def looked_over(logs: Sequence[Log], robot: Robot, regressor: Regressor | None = None) -> list[Findings]:
    """What triage finds in each log, by itself and by the robot's limits and dynamics."""
    from identify.regressor.regressor import Regressor
    from identify.validation.log_checks import look_over

    regressor = regressor or Regressor(robot)
    return [look_over(log, robot, regressor) for log in logs]


def for_robot(logs: Sequence[Log], robot: Robot) -> list[Log]:
    """The logs with the robot's joints in its order. LogError where one lacks a joint."""
    from identify.logs.slicing import select

    return [select(log, robot.joint_names) for log in logs]
