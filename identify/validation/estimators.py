"""Every estimator on the same logs, beside one another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from identify.errors import UnsupportedLogError
from identify.estimation.estimators.problem import Problem
from identify.estimation.estimators.registry import DEFAULTS, ESTIMATORS, WHY
from identify.estimation.fitting import ModelFit, fitted
from identify.estimation.scoring import RESIDUALS
from identify.logs.log import Log
from identify.validation.held_out import figures_on

FIGURES = ("condition_number", "train", "test")


def compared(problem: Problem, test: Sequence[Log]) -> list[dict[str, Any]]:
    """A row an estimator: its residuals [% of the torque] on training and held-out logs of other motions, and its
    condition number.

    Where the logs do not support it, its figures are null and "reason" says what it lacks. "why" is that of a default.
    """
    rows = {name: _row(name) for name in ESTIMATORS}
    fits: dict[str, ModelFit] = {}
    for name, row in rows.items():
        try:
            fits[name] = fitted(problem, ESTIMATORS[name])
        except UnsupportedLogError as error:
            row |= dict.fromkeys(("reason", *(f"{key}_reason" for key in FIGURES)), str(error))
        else:
            row["condition_number"] = fits[name].estimate.condition_number
    predictors = {name: fit.predictor for name, fit in fits.items()}
    for role, logs in (("train", problem.logs), ("test", test)):
        found = figures_on(logs, predictors) if logs and fits else {}
        for name, figures in found.items():
            rows[name][role] = {key: figures[key] for key in RESIDUALS}
    why = {} if test else {"test_reason": "no held-out log of another motion was given"}
    return [row if "reason" in row else row | why for row in rows.values()]


def _row(name: str) -> dict[str, Any]:
    by = ESTIMATORS[name]
    return {
        "estimator": name,
        "title": by.title,
        "model": by.model,
        "default": DEFAULTS[by.model] == name,
        **({"why": WHY[by.model]} if DEFAULTS[by.model] == name else {}),
        **dict.fromkeys(FIGURES),
    }
