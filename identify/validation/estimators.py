"""Every estimator on the same logs, beside one another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from identify.errors import UnsupportedLogError
from identify.estimation.estimators.problem import Problem
from identify.estimation.estimators.registry import DEFAULTS, ESTIMATORS
from identify.estimation.fitting import fitted
from identify.logs.log import Log
from identify.validation.held_out import figures

RESIDUALS = ("relative_residual_percent", "moving_relative_residual_percent")


def compared(problem: Problem, test: Sequence[Log]) -> list[dict[str, Any]]:
    """A row an estimator: its residuals [% of the torque] on training and held-out logs, and its condition number.

    Where the logs do not support it, its figures are null and "reason" says what it lacks.
    """
    return [_row(problem, name, test) for name in ESTIMATORS]


def _row(problem: Problem, name: str, test: Sequence[Log]) -> dict[str, Any]:
    by = ESTIMATORS[name]
    row: dict[str, Any] = {
        "estimator": name,
        "title": by.title,
        "model": by.model,
        "default": DEFAULTS[by.model] == name,
        "condition_number": None,
        "train": None,
        "test": None,
    }
    try:
        fit = fitted(problem, by)
    except UnsupportedLogError as error:
        return row | {"reason": str(error)}
    row["condition_number"] = fit.estimate.condition_number
    for role, logs in (("train", problem.logs), ("test", test)):
        if logs:
            found = figures(fit.regressor, logs, fit.estimate.parameters, fit.settings)[0]
            row[role] = {key: found[key] for key in RESIDUALS}
    return row if test else row | {"test_reason": "no held-out log was given"}
