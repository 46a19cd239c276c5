"""Maximum likelihood over averaged periods (Swevers et al. 1997), in the Fourier domain.

A periodic log is averaged over its periods and differentiated harmonic by harmonic, without end effects. How far the
periods lie apart is the noise, whatever its source and colour: the residual Γ − Y(q,q̇,q̈)·θ of each period has the
effort's noise and, through the model, that of the position. Each joint's rows at each harmonic are weighted by the
variance measured there; where the model leaves more than that, by what it leaves.
"""

from __future__ import annotations

import numpy as np

from identify.estimation.estimators.periods import Periods, periods_of
from identify.estimation.estimators.problem import Problem
from identify.estimation.least_squares import Estimate, scaled_solution
from identify.estimation.observation import WORKING_RATE_HZ, moving
from identify.estimation.settings import Settings
from identify.regressor.regressor import Regressor

PASSES = 3
"""Solutions, each weighted by the noise that the residuals of the one before tell, the first unweighted."""

AROUND = 6
"""Harmonics to either side over which a variance is averaged."""

Motion = tuple[np.ndarray, np.ndarray, np.ndarray]
"""q, q̇, q̈ (M, n) over one period."""


def ml(problem: Problem) -> Estimate:
    """Weighted least squares over the harmonics up to the effort's cut-off, of all logs.

    UnsupportedLogError for a log whose motion does not repeat itself.
    """
    regressor = problem.regressor
    parts = [
        _Average(regressor, problem.settings, periods_of(log, regressor.robot.joint_names)) for log in problem.logs
    ]
    n, p = regressor.robot.n, regressor.p
    variances = [np.ones_like(part.effort) for part in parts]
    for done in range(PASSES):
        roots = [np.sqrt(variance)[:, :, None] for variance in variances]
        w = np.concatenate([(part.matrix / root).reshape(-1, p) for part, root in zip(parts, roots, strict=True)])
        y = np.concatenate([(part.effort / root[:, :, 0]).ravel() for part, root in zip(parts, roots, strict=True)])
        inverse, condition, parameters = scaled_solution(w, y, regressor.names)
        if done < PASSES - 1:
            variances = [part.variance(parameters) for part in parts]
    misfit = y - w @ parameters
    power = np.sum([((part.effort - part.matrix @ parameters) ** 2).sum(axis=1) for part in parts], axis=0)
    return Estimate(
        names=regressor.names,
        parameters=parameters,
        covariance=inverse * max(1.0, float(misfit @ misfit) / max(len(y) - p, 1)),
        condition_number=condition,
        sigma=np.sqrt(power / sum(part.samples for part in parts)),
        inflation=np.ones(n),
        rows=len(y),
        effective_samples=float(len(y)),
    )


class _Average:
    """A log's mean period in the Fourier domain: matrix (n, 2 K, p) and effort (n, 2 K) of each joint, real parts
    before imaginary ones, their squares' sums those of M samples below the cut-off."""

    def __init__(self, regressor: Regressor, settings: Settings, periods: Periods) -> None:
        self._regressor, self._settings, self._periods = regressor, settings, periods
        self.samples = min(periods.position.shape[1], round(periods.length * WORKING_RATE_HZ))
        self._harmonics = int(settings.effort_cutoff_hz * periods.length) + 1
        q, dq, ddq = self._motion(periods.position.mean(axis=0))
        around = round(settings.guard_s * self.samples / periods.length)
        self._mask = np.ones_like(dq, dtype=bool)
        if not settings.rest_counted:
            # Round the period's end there is a beginning.
            self._mask = moving(np.concatenate([dq, dq, dq]), around)[len(dq) : 2 * len(dq)]
        columns = regressor.torque(q, dq, ddq, sign=settings.sign, slip=self._slip(q))
        effort = self._resampled(periods.effort.mean(axis=0))
        masked = (columns * self._mask[:, :, None]).swapaxes(0, 1)
        self.matrix = np.array([self._transformed(x) for x in masked])
        self.effort = self._transformed(effort * self._mask).T

    def variance(self, parameters: np.ndarray) -> np.ndarray:
        """(n, 2 K) variance of the mean's rows: by the scatter between periods, or by what the mean leaves."""
        left = []
        for position, effort in zip(self._periods.position, self._periods.effort, strict=True):
            q, dq, ddq = self._motion(position)
            hat = self._regressor.inverse_dynamics(q, dq, ddq, parameters, self._settings.sign, self._slip(q))
            left.append(self._transformed((self._resampled(effort) - hat) * self._mask).T)
        scatter = np.var(left, axis=0, ddof=1) / len(left)
        free = max(1 - len(parameters) / self.effort.size, 0.1)
        misfit = (self.effort - self.matrix @ parameters) ** 2 / free
        return np.maximum(np.maximum(_averaged(scatter), _averaged(misfit)), 1e-24)

    def _motion(self, position: np.ndarray) -> Motion:
        """One period's motion at M samples: the zero-phase low-pass of `motion.low_pass`, and exact derivatives."""
        found = np.fft.rfft(position, axis=0)[: self.samples // 2 + 1] * (self.samples / len(position))
        frequency = np.arange(len(found))[:, None] / self._periods.length
        found /= 1 + (frequency / self._settings.position_cutoff_hz) ** 8
        pulsation = 2j * np.pi * frequency
        q, dq, ddq = (np.fft.irfft(found * pulsation**k, self.samples, axis=0) for k in range(3))
        return q, dq, ddq

    def _resampled(self, x: np.ndarray) -> np.ndarray:
        """(M, n) of one period's samples x (N, n)."""
        found = np.fft.rfft(x, axis=0)[: self.samples // 2 + 1] * (self.samples / len(x))
        return np.fft.irfft(found, self.samples, axis=0)

    def _slip(self, q: np.ndarray) -> np.ndarray | None:
        """(M, arms) presliding states of the period, after one that was like it."""
        presliding = self._settings.presliding(self._regressor)
        return presliding(np.concatenate([q, q]))[len(q) :] if presliding else None

    def _transformed(self, x: np.ndarray) -> np.ndarray:
        """(2 K, c) of signals x (M, c) over one period."""
        found = np.fft.rfft(x, axis=0, norm="ortho")[: self._harmonics]
        found[1:] *= np.sqrt(2)
        return np.concatenate([found.real, found.imag])


def _averaged(power: np.ndarray) -> np.ndarray:
    """(n, 2 K) squares averaged over real and imaginary parts and over neighbouring harmonics."""
    halves = power.reshape(len(power), 2, -1).mean(axis=1)
    summed = np.concatenate([np.zeros((len(power), 1)), np.cumsum(halves, axis=1)], axis=1)
    at = np.arange(halves.shape[1])
    low, high = np.maximum(at - AROUND, 0), np.minimum(at + AROUND + 1, len(at))
    return np.tile((summed[:, high] - summed[:, low]) / (high - low), 2)
