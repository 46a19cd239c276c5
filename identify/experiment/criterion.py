"""What a motion is worth to the estimate of the torque model, of the energy model, or of both."""

from __future__ import annotations

import numpy as np

from identify.experiment.entries import Motion
from identify.experiment.fourier import one_period
from identify.experiment.information import EnergyModel, TorqueModel, log_variance, reference_factor, scaled_condition
from identify.experiment.knowledge import Knowledge, parameter_sizes, root_of, standard_deviations
from identify.experiment.limits import WorkingLimits
from identify.experiment.trajectory import random_trajectory
from identify.regressor.regressor import Regressor

CRITERIA = ("torque", "energy", "both")

REFERENCES = 6
"""Random motions whose torque the parameters are meant to predict."""


class Criterion:
    """`information.log_variance` of the models named, on a grid of one period, with exact derivatives.

    samples of the period and `every` of a window of the energy model. What is known of earlier experiments counts as
    so many more rows beside those of `periods` periods; what is to be predicted well are then not torques but the
    parameters themselves, in shares of their sizes, so that the worst count most (A-optimal).
    """

    def __init__(
        self,
        regressor: Regressor,
        name: str,
        limits: WorkingLimits,
        duration: float,
        harmonics: int,
        samples: int,
        every: int,
        known: Knowledge,
        periods: int,
    ) -> None:
        self.name, self.regressor, self.samples, self.windows = name, regressor, samples, samples // every
        step, noise = duration / samples, np.sqrt(known.density)
        width = np.maximum(limits.acceleration * step, 0.01 * limits.velocity)
        self.torque = TorqueModel(regressor, samples, width, noise)
        self.energy = EnergyModel(regressor, samples, every, step, width, limits.velocity, noise)
        self._set_reference(1 / duration, harmonics)
        self._torque_known = self._energy_known = None
        if known.information is not None:
            root = root_of(known.information)
            torque, energy = periods * duration, periods * self.windows / self.energy.loudest
            self._torque_known = root * (self.torque_scale / np.sqrt(torque))
            self._energy_known = root * (self.energy_scale / np.sqrt(energy))
            self._reference = np.diag(_shares(regressor, known.information))

    def _set_reference(self, hz: float, harmonics: int) -> None:
        """Sizes of the columns, and the rows that stand for the torque of motions of this kind."""
        robot, p = self.regressor.robot, self.regressor.p
        random = (random_trajectory(robot, 1000 + k, fundamental_hz=hz, harmonics=harmonics) for k in range(REFERENCES))
        motions = [one_period(trajectory, self.samples) for trajectory in random]
        weight = self.torque.weight[:, None]
        torque = np.concatenate([(self.torque.columns(m) * weight).reshape(p, -1) for m in motions], axis=1)
        energy = np.concatenate([self.energy.columns(m) for m in motions], axis=1)
        self.torque_scale, self.energy_scale = (_column_scale(columns, REFERENCES) for columns in (torque, energy))
        self._reference = reference_factor(torque)

    def value(self, motion: Motion) -> float:
        """The criterion, in log variance a parameter: the smaller the better."""
        return self.worth(motion, self.torque.columns(motion))[0]

    def worth(self, motion: Motion, columns: np.ndarray) -> tuple[float, np.ndarray, Motion]:
        """The criterion, and its derivatives with respect to the torque model's columns and, by way of the energy
        model, to the motion."""
        value, to_columns = 0.0, np.zeros_like(columns)
        to_motion: Motion = (np.zeros_like(motion[0]),) * 3
        share = 0.5 if self.name == "both" else 1.0
        if self.name != "energy":
            scale = self.torque_scale / np.sqrt(self.samples)
            rows = np.concatenate(list(self.torque.factors(columns))) * scale
            worth, turn = log_variance(rows, self._reference * self.torque_scale, self._torque_known)
            value += share * worth
            turn *= share * np.outer(scale, scale)
            for j, (support, weight) in enumerate(zip(self.torque.supports, self.torque.weight, strict=True)):
                to_columns[support, j] = (weight**2 * turn[np.ix_(support, support)]) @ columns[support, j]
        if self.name != "torque":
            scale = self.energy_scale[:, None] / np.sqrt(self.windows)
            scaled = self.energy.columns(motion) * scale
            worth, turn = log_variance(scaled.T, self._reference * self.energy_scale, self._energy_known)
            value += share * worth
            to_motion = self.energy.pull_back(motion, share * (turn @ scaled) * scale)
        return float(value), to_columns, to_motion

    def condition(self, motion: Motion) -> str:
        """Column-scaled condition numbers of the criterion's models, in words."""
        words = []
        if self.name != "energy":
            columns = self.torque.columns(motion).reshape(self.regressor.p, -1)
            words.append(f"torque cond {scaled_condition(columns)[0]:.3g}")
        if self.name != "torque":
            columns = self.energy.unweighted(motion)[0]
            words.append(f"energy cond {scaled_condition(columns)[0]:.3g}")
        return ", ".join(words)


def _column_scale(columns: np.ndarray, motions: int) -> np.ndarray:
    """(p,) factors that bring the norm of each column (p, K) over one of several motions to 1 on average."""
    norm = np.sqrt(np.sum(columns**2, axis=1) / motions)
    return 1 / np.where(norm > 0, norm, 1.0)


def _shares(regressor: Regressor, information: np.ndarray) -> np.ndarray:
    """(p,) what deviations of the parameters are multiplied by to be shares of their sizes; of those that can't be told
    from zero, or have no size, to be shares of what they are now."""
    size, known = parameter_sizes(regressor), standard_deviations(information)
    told = np.isfinite(known)
    return 1 / np.where(told, np.maximum(size, known), np.where(size > 0, size, np.inf))
