"""The training motion once more, by the arm that was estimated, under the controller that the logs tell of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from identify.errors import InputError, UnsupportedLogError
from identify.estimation.estimators.problem import Problem
from identify.estimation.identified_robot import plain_friction, with_standard
from identify.estimation.least_squares import Estimate, weighted_least_squares
from identify.estimation.physical import information_of, nearest_consistent
from identify.estimation.reference import reference
from identify.estimation.settings import Settings
from identify.experiment.control import Control, control_of
from identify.logs.log import Log
from identify.logs.slicing import select
from identify.regressor.columns import column_kind
from identify.regressor.regressor import Regressor
from identify.robot.robot import Robot

LONGEST_S = 600.0
"""Logs that are longer together [s] are not simulated, with which a fit would take minutes."""

SIMULATIONS = 10

CLOSE = 0.05
"""Simulations end when no parameter moves by more than this share of its standard deviation."""


def closed(problem: Problem, improved: Callable[[Estimate, list[Log], np.ndarray], Estimate]) -> Estimate:
    """From weighted least squares of the torque model on, one estimate after the other until it stays.

    improved: the next estimate, of the last one, its simulated logs and the parameters (p,) of the arm in them.
    UnsupportedLogError where SIMULATIONS are not enough.
    """
    controls = controls_of(problem)
    estimate = weighted_least_squares(problem.reduction, problem.residual)
    for _ in range(SIMULATIONS):
        new = improved(estimate, *simulated(problem, controls, estimate))
        moved = np.max(np.abs(new.parameters - estimate.parameters) / new.std)
        estimate = new
        if moved < CLOSE:
            return estimate
    raise UnsupportedLogError(f"{SIMULATIONS} simulations did not come to one estimate")


def controls_of(problem: Problem) -> list[Control]:
    """The controller of each log. UnsupportedLogError where one does not tell it, or where the logs are too long."""
    joints = problem.regressor.robot.joint_names
    controls = [control_of(log, joints) for log in problem.logs]
    if sum(log.duration for log in problem.logs) > LONGEST_S:
        raise UnsupportedLogError(f"logs of more than {LONGEST_S:g} s together are not simulated: give a shorter one")
    return controls


def simulated(problem: Problem, controls: Sequence[Control], last: Estimate) -> tuple[list[Log], np.ndarray]:
    """The logs as the arm of the last estimate would have written them, exact, and the parameters (p,) of that arm."""
    regressor = problem.regressor
    try:
        arm, parameters = possible_arm(regressor, problem.settings, last, controls)
        logs = []
        for log, control in zip(problem.logs, controls, strict=True):
            position, effort = control.simulated(arm, log.time)
            logs.append(replace(select(log, arm.joint_names), position=position, velocity=None, effort=effort))
    except InputError as error:
        raise UnsupportedLogError(f"the arm of an estimate on the way can't be simulated: {error}") from error
    return logs, parameters


def possible_arm(
    regressor: Regressor, settings: Settings, estimate: Estimate, controls: Sequence[Control]
) -> tuple[Robot, np.ndarray]:
    """An arm to simulate for an estimate, and its own parameters (p,).

    What physics does not allow can't be simulated: the arm is the one nearest to the estimate that it does, with
    neutral bodies for what the data leave open, so that nothing of the robot's description but geometry and stops comes
    in. It has viscous and Coulomb friction alone, those nearest to further forms up to the speeds that are asked for,
    and no coupled motors. InputError where there is none.
    """
    possible = nearest_consistent(
        regressor,
        estimate.parameters,
        information_of(estimate.covariance),
        reference(regressor, estimate.parameters, description=False),
        coulomb_velocity=settings.coulomb_velocity,
    )
    friction = plain_friction(regressor, possible.extra, settings, _fastest(regressor, controls))
    own = {name: value for name, value in friction.items() if column_kind(name) in ("Fv", "Fs", "off")}
    return with_standard(regressor.robot, possible.standard, own), regressor.theta(possible.standard, own)


def _fastest(regressor: Regressor, controls: Sequence[Control]) -> np.ndarray:
    """(arms,) the fastest that joints and coupled motors are asked to go."""
    asked = [c.trajectory.sample(np.arange(0.0, c.trajectory.duration, 0.01))[1] for c in controls]
    dq = np.concatenate(asked)
    return np.abs(regressor.extra.speeds(dq) if regressor.extra else dq).max(axis=0)
