"""How well parameters will be known after an experiment, before it is run (Fisher's information)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.experiment.fourier import one_period
from identify.experiment.knowledge import Knowledge, parameter_sizes, standard_deviations
from identify.experiment.trajectory import Trajectory
from identify.numbers import finite
from identify.regressor.regressor import Regressor

SHOWN = 10
"""Parameters in the table, the worst."""


@dataclass(frozen=True, eq=False)
class Forecast:
    """Standard deviations to expect of a fit of the model named, in the order of `Regressor.names`, SI.

    values (p,): of the parameters as they are known now; sizes (p,): what percentages are of, |value|, and for an
    offset at least its joint's Coulomb friction, 0 where nothing is known. std (p,): after the experiment together with
    what was known, infinite where a parameter can't be told from others; before (p,): by earlier experiments alone,
    None without any. blur (p,): std over what it would be if all other parameters were known. noise: what was assumed
    of it, in words.
    """

    model: str
    noise: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    sizes: np.ndarray
    std: np.ndarray
    before: np.ndarray | None
    blur: np.ndarray

    @property
    def relative_percent(self) -> np.ndarray:
        """(p,) 100·std / size; NaN where the size is zero."""
        return self._percent(self.std)

    @property
    def order(self) -> np.ndarray:
        """(p,) parameters, the worst first: by percentage, of before the experiment where there is one; then those
        without a size, by their blur."""
        percent = self._percent(self.std if self.before is None else self.before)
        return np.lexsort((-self.blur, -np.nan_to_num(percent, nan=-1.0, posinf=np.inf)))

    def table(self) -> str:
        """The worst parameters, one a line, and how the others stand."""
        shown, rest = self.order[:SHOWN], self.order[SHOWN:]
        wide = max(9, *(len(self.names[i]) for i in self.order))
        columns = [("expected", self.std)] if self.before is None else [("before", self.before), ("expected", self.std)]
        head = "".join(f" {f'σ {name}':>11} {'%':>8}" for name, _ in columns)
        lines = [f"expected of a fit of the {self.model} model, noise {self.noise}:"]
        lines.append(f"  {'parameter':{wide}} {'value':>11}{head} unit")
        for i in shown:
            told = "".join(f" {std[i]:11.2g} {_shown(self._percent(std)[i])}" for _, std in columns)
            value = f"{self.values[i]:11.4g}" if self.sizes[i] else f"{'not known':>11}"
            lines.append(f"  {self.names[i]:{wide}} {value}{told} {self.units[i]}")
        if len(rest):
            percent = self.relative_percent[rest]
            known = percent[np.isfinite(percent)]
            some = "" if len(known) == len(rest) else f", {len(known)} of them"
            words = f"{some} at {known.max():.2g} % or less" if len(known) else ""
            lines.append(f"  and {len(rest)} more{words}")
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """All of it for JSON, null where there is nothing to say."""
        relative = self.relative_percent
        rows = [
            {
                "name": name,
                "unit": unit,
                "value": float(self.values[i]) if self.sizes[i] else None,
                "std": finite(self.std[i]),
                "relative_std_percent": finite(relative[i]),
                "std_before": None if self.before is None else finite(self.before[i]),
                "blur": finite(self.blur[i]),
            }
            for i, (name, unit) in enumerate(zip(self.names, self.units, strict=True))
        ]
        return {"model": self.model, "noise": self.noise, "parameters": rows}

    def _percent(self, std: np.ndarray) -> np.ndarray:
        known = self.sizes > 0
        return np.where(known, 100 * std / np.where(known, self.sizes, 1.0), np.nan)


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
    std = standard_deviations(information)
    return Forecast(
        model=model,
        noise=known.noise,
        names=regressor.names,
        units=regressor.units,
        values=regressor.parameters,
        sizes=parameter_sizes(regressor),
        std=std,
        before=before,
        blur=std * np.sqrt(np.diag(information)),
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


def _windows(signal: np.ndarray, every: int) -> np.ndarray:
    """Sums over windows of a closed period by the trapezoidal rule, (K,) or (K, c) from (N,) or (N, c)."""
    whole = (signal + np.roll(signal, -1, axis=0)) / 2
    return whole.reshape(-1, every, *signal.shape[1:]).sum(axis=1)


def _shown(percent: float) -> str:
    return f"{'':>8}" if np.isnan(percent) else f"{percent:8.2g}"
