"""Every estimator by name, and which one a fit takes unless told otherwise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from identify.errors import InputError
from identify.estimation.energy import energy_least_squares
from identify.estimation.estimators.both import both
from identify.estimation.estimators.didim import didim
from identify.estimation.estimators.idim_iv import idim_iv
from identify.estimation.estimators.ml import ml
from identify.estimation.estimators.power import power
from identify.estimation.estimators.problem import Problem
from identify.estimation.estimators.robust import huber, tukey
from identify.estimation.least_squares import Estimate, ordinary_least_squares, weighted_least_squares

MODELS = ("torque", "energy")


@dataclass(frozen=True)
class Estimator:
    """A way from logs to parameters.

    model: whose columns the parameters are of, and whose rows they come from in the first place. estimate raises
    UnsupportedLogError where the logs lack what it needs, and says what that is.
    """

    name: str
    title: str
    model: str
    estimate: Callable[[Problem], Estimate]


ESTIMATORS = {
    estimator.name: estimator
    for estimator in (
        Estimator("ols", "ordinary least squares", "torque", lambda x: ordinary_least_squares(x.reduction, x.residual)),
        Estimator(
            "wls",
            "weighted least squares, one noise level a joint",
            "torque",
            lambda x: weighted_least_squares(x.reduction, x.residual),
        ),
        Estimator("huber", "weighted least squares, bad rows count for less (Huber)", "torque", huber),
        Estimator("tukey", "weighted least squares, worst rows left out (Tukey)", "torque", tukey),
        Estimator("idim-iv", "instrumental variables from a simulated closed loop (IDIM-IV)", "torque", idim_iv),
        Estimator("didim", "effort of a simulated closed loop fitted to the measured (DIDIM)", "torque", didim),
        Estimator("ml", "maximum likelihood over averaged periods", "torque", ml),
        Estimator("both", "weighted least squares over the rows of torque and energy", "torque", both),
        Estimator(
            "energy",
            "weighted least squares, noise of each window by the motion in it",
            "energy",
            lambda x: energy_least_squares(x.energy),
        ),
        Estimator("power", "weighted least squares over low-passed power", "energy", power),
    )
}
DEFAULTS = {"torque": "wls", "energy": "energy"}
"""The estimator of each model that a fit takes."""

WHY = {
    "torque": "Weighted least squares is the default: on the benchmark of simulated logs (scripts/bench_estimators) no "
    "other is more accurate both beyond chance and by 1 % of the error, and of those as good it is the simplest.",
    "energy": "Weighted least squares over windows of work is the default of the energy model: on the benchmark of "
    "simulated logs (scripts/bench_estimators) filtered power is no more accurate.",
}
"""Why each model's default is what it is."""

ALL = "all"
"""Asks for every estimator side by side; the default one gives the result."""


def choice(model: str | None, estimator: str | None) -> Estimator:
    """The estimator asked for by model, by name or by both; the torque model's by default, of a name's model by name.

    InputError for one that there is not, or that is of the other model.
    """
    if model is not None and model not in MODELS:
        raise InputError(f"model is {model!r}; choose one of {', '.join(MODELS)}")
    if estimator is None or estimator == ALL:
        return ESTIMATORS[DEFAULTS[model or "torque"]]
    if estimator not in ESTIMATORS:
        raise InputError(f"estimator is {estimator!r}; choose one of {', '.join(ESTIMATORS)} or {ALL}")
    found = ESTIMATORS[estimator]
    if model not in (None, found.model):
        names = ", ".join(each.name for each in ESTIMATORS.values() if each.model == model)
        raise InputError(f"estimator {estimator!r} is of the {found.model} model; of the {model} model are {names}")
    return found
