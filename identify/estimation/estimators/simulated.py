"""The training motion once more, by the arm that was estimated, under the controller that the logs tell of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identify.errors import InputError, UnsupportedLogError
from identify.estimation.estimators.problem import Problem
from identify.estimation.identified_robot import plain_friction, with_standard
from identify.estimation.least_squares import Estimate
from identify.estimation.physical import information_of, nearest_consistent
from identify.estimation.reference import reference
from identify.experiment.control import Control, control_of
from identify.logs.log import Log
from identify.logs.slicing import select
from identify.regressor.columns import column_kind

LONGEST_S = 600.0
"""Logs that are longer together [s] are not simulated, with which a fit would take minutes."""


def controls_of(problem: Problem) -> list[Control]:
    """The controller of each log. UnsupportedLogError where one does not tell it, or where the logs are too long."""
    joints = problem.regressor.robot.joint_names
    controls = [control_of(log, joints) for log in problem.logs]
    if sum(log.duration for log in problem.logs) > LONGEST_S:
        raise UnsupportedLogError(f"logs of more than {LONGEST_S:g} s are not simulated: fit a part, with --stop")
    return controls


def simulated(problem: Problem, controls: Sequence[Control], last: Estimate) -> tuple[list[Log], np.ndarray]:
    """The logs as the arm of the last estimate would have written them, exact, and the parameters (p,) of that arm.

    An arm that physics does not allow can't be simulated: the one nearest to the estimate is, with neutral bodies for
    what the data leave open, so that nothing of the robot's description but geometry and stops comes in. It has
    viscous and Coulomb friction alone, those nearest to further forms, and no coupled motors.
    """
    regressor, settings = problem.regressor, problem.settings
    robot = regressor.robot
    try:
        possible = nearest_consistent(
            regressor,
            last.parameters,
            information_of(last.covariance),
            reference(regressor, last.parameters, description=False),
            coulomb_velocity=settings.coulomb_velocity,
        )
        friction = plain_friction(regressor, possible.extra, settings, _fastest(problem, controls))
        own = {name: value for name, value in friction.items() if column_kind(name) in ("Fv", "Fs", "off")}
        arm = with_standard(robot, possible.standard, own)
        logs = []
        for log, control in zip(problem.logs, controls, strict=True):
            position, effort = control.simulated(arm, log.time)
            logs.append(replace(select(log, robot.joint_names), position=position, velocity=None, effort=effort))
    except InputError as error:
        raise UnsupportedLogError(f"the arm of an estimate on the way can't be simulated: {error}") from error
    return logs, regressor.theta(possible.standard, own)


def _fastest(problem: Problem, controls: Sequence[Control]) -> np.ndarray:
    """(arms,) the fastest that joints and coupled motors are asked to go."""
    columns = problem.regressor.extra
    asked = [c.trajectory.sample(np.arange(0.0, c.trajectory.duration, 0.01))[1] for c in controls]
    dq = np.concatenate(asked)
    return np.abs(columns.speeds(dq) if columns else dq).max(axis=0)
