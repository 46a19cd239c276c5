"""How well parameters will be known after an experiment, before it is run (Fisher's information)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.experiment.fourier import one_period
from identify.experiment.knowledge import Knowledge
from identify.experiment.trajectory import Trajectory
from identify.regressor.regressor import Regressor

SHOWN = 10
"""Parameters in the table, the worst."""

NONE = 1e-12
"""Share of a parameter's standard deviation below which its value counts as zero."""


@dataclass(frozen=True, eq=False)
class Forecast:
    """Standard deviations to expect of a fit of the model named, in the order of `Regressor.names`, SI.

    values (p,): of the parameters as they are known now, std (p,): after the experiment together with what was known,
    before (p,): by earlier experiments alone, None without any. Infinite where a parameter can't be told from others.
    noise: what was assumed of it, in words.
    """

    model: str
    noise: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    std: np.ndarray
    before: np.ndarray | None

    @property
    def relative_percent(self) -> np.ndarray:
        """(p,) 100·std / |value|; NaN where the value is zero or not known."""
        return _relative(self.std, self.values)

    @property
    def order(self) -> np.ndarray:
        """(p,) parameters, the worst first: by relative standard deviation, before the experiment where that is known;
        those without a value last."""
        std = self.std if self.before is None else self.before
        return np.argsort(-np.nan_to_num(_relative(std, self.values), nan=-1.0, posinf=np.inf), kind="stable")

    def table(self) -> str:
        """The worst parameters, one a line, and how the others stand."""
        shown, rest = self.order[:SHOWN], self.order[SHOWN:]
        wide = max(len(self.names[i]) for i in self.order)
        head = ["parameter".ljust(max(9, wide)), f"{'value':>11}"]
        head += [f"{'σ before':>10}", f"{'%':>8}"] if self.before is not None else []
        head += [f"{'σ expected':>10}", f"{'%':>8}", "unit"]
        lines = [f"expected of a fit of the {self.model} model, noise {self.noise}:", "  " + " ".join(head)]
        relative = self.relative_percent
        for i in shown:
            row = [self.names[i].ljust(max(9, wide)), f"{self.values[i]:11.4g}"]
            if self.before is not None:
                row += [f"{self.before[i]:10.2g}", _percent(_relative(self.before, self.values)[i])]
            row += [f"{self.std[i]:10.2g}", _percent(relative[i]), self.units[i]]
            lines.append("  " + " ".join(row))
        if len(rest):
            known = relative[rest][np.isfinite(relative[rest])]
            blank = len(rest) - len(known)
            words = f"{len(known)} more at {known.max():.2g} % or less" if len(known) else ""
            words += f"{', ' if words else ''}{blank} of which no value is known" if blank else ""
            lines.append(f"  {words}")
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """All of it for JSON, null where there is nothing to say."""
        relative = self.relative_percent
        rows = [
            {
                "name": name,
                "unit": unit,
                "value": float(self.values[i]),
                "std": _finite(self.std[i]),
                "relative_std_percent": _finite(relative[i]),
                "std_before": None if self.before is None else _finite(self.before[i]),
            }
            for i, (name, unit) in enumerate(zip(self.names, self.units, strict=True))
        ]
        return {"model": self.model, "noise": self.noise, "parameters": rows}


def forecast(
    regressor: Regressor, trajectory: Trajectory, known: Knowledge, model: str, samples: int, every: int
) -> Forecast:
    """What to expect of a fit of "torque" or "energy" to the motion and to what is known.

    samples of a period on which this is summed up, `every` of them a window of the energy model. White noise of the
    known density is all that counts: a fit's low-pass takes away what lies beyond the motion's frequencies, and neither
    adds to nor takes from what the motion tells.
    """
    information = experiment_information(regressor, trajectory, known.density, model, samples, every)
    before = None
    if known.information is not None:
        before = standard_deviations(known.information)
        information = information + known.information
    return Forecast(
        model=model,
        noise=known.noise,
        names=regressor.names,
        units=regressor.units,
        values=regressor.parameters,
        std=standard_deviations(information),
        before=before,
    )


def experiment_information(
    regressor: Regressor, trajectory: Trajectory, density: np.ndarray, model: str, samples: int, every: int
) -> np.ndarray:
    """(p, p) Fisher's information of all periods: ∫ Yᵀ·diag(density)⁻¹·Y dt, or of the energy model's windows, whose
    work has the variance Σ_j density_j ∫ q̇_j² dt."""
    step = trajectory.period / samples
    q, dq, ddq = (signal.T for signal in one_period(trajectory, samples))
    if model == "torque":
        rows = (regressor.torque(q, dq, ddq) / np.sqrt(density / step)[:, None]).reshape(-1, regressor.p)
    else:
        heat = step * _windows(dq**2 @ density, every)
        stored = regressor.energy(q[::every], dq[::every])
        work = step * _windows(regressor.power(dq), every)
        rows = (np.roll(stored, -1, axis=0) - stored + work) / np.sqrt(np.maximum(heat, 1e-6 * heat.max()))[:, None]
    return trajectory.periods * (rows.T @ rows)


def standard_deviations(information: np.ndarray) -> np.ndarray:
    """(p,) roots of the diagonal of its inverse; infinite for parameters that it can't tell from others."""
    size = np.sqrt(np.diag(information))
    scaled = information / np.outer(*(np.where(size > 0, size, 1.0),) * 2)
    values, vectors = np.linalg.eigh(scaled)
    told = values > 1e-13 * values[-1]
    variance = (vectors[:, told] ** 2 / values[told]).sum(axis=1)
    lost = np.abs(vectors[:, ~told]).max(axis=1, initial=0.0) > 1e-6
    return np.where(lost, np.inf, np.sqrt(variance)) / np.where(size > 0, size, 1.0)


def _windows(signal: np.ndarray, every: int) -> np.ndarray:
    """Sums over windows of a closed period by the trapezoidal rule, (K,) or (K, c) from (N,) or (N, c)."""
    whole = (signal + np.roll(signal, -1, axis=0)) / 2
    return whole.reshape(-1, every, *signal.shape[1:]).sum(axis=1)


def _relative(std: np.ndarray, values: np.ndarray) -> np.ndarray:
    size = np.abs(values)
    zero = size <= NONE * np.where(np.isfinite(std), std, 1.0)
    return np.where(zero, np.nan, 100 * std / np.where(zero, 1.0, size))


def _percent(value: float) -> str:
    return f"{'':>8}" if np.isnan(value) else f"{value:8.2g}"


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
