"""Do the results of several logs agree: each parameter's spread between them against its stated standard deviation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify.regressor.columns import TURNING, column_kind

FAR = 7.0
"""An estimate is odd when it is farther from the median than this many times what is usual.

Of fleets whose frictions differ from robot to robot by chance, by far more than σ, 5 % of those with four logs and 2 %
of others then have a robot named that is none; of repeats of one robot none has.
"""

LEAST = 3
"""Logs below which none can be told to be the odd one."""

CHANCE = 0.99
"""Share of batches with true standard deviations whose pooled ratio lies between the stated bounds."""

_NORMAL = 1.4826


def spread(entries: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Compare fitted logs of one robot, or of several of one kind.

    entries: of each log name, unit (its sub-folder), parameters [{name, unit, estimate, std}], of which those that
    all have are compared, and independent_parameters (p²/‖correlation‖²).

    Of each parameter: mean, spread (sample standard deviation) over the logs, std (root mean square of the stated
    ones), and ratio = √(Σ((x − weighted mean)/σ)²/(k − 1)), 1 where σ is true and the logs differ by chance
    (Birge 1932). `agreement` pools the ratio over all parameters, `within` over repeats, which are logs of one
    sub-folder where there are several. `odd` names logs with an estimate farther from the median than FAR times what
    is usual: the parameter's own median deviation, and that of parameters of its kind in units of σ, at least σ.
    """
    names, units, x, sigma = _common(entries)
    logs, own = [str(e["name"]) for e in entries], [str(e["unit"]) for e in entries]
    distance = _distance(names, x, sigma)
    odd = _odd_logs(logs, names, x, sigma, distance)
    named = {o["name"] for o in odd}
    everything, kept = list(range(len(logs))), [i for i, log in enumerate(logs) if log not in named]
    independent = float(np.mean([e["independent_parameters"] for e in entries])) if entries else 0.0

    def pooled(chosen: list[int], groups: Sequence[str]) -> dict[str, Any] | None:
        marks = np.unique([groups[i] for i in chosen], return_inverse=True)[1]
        return _pooled(x[chosen], sigma[chosen], marks, independent)

    return {
        "logs": len(entries),
        "parameters": [
            row | {"odd": [log for log, far in zip(logs, away > FAR, strict=True) if far]}
            for row, away in zip(_over_logs(names, units, x, sigma), distance.T, strict=True)
        ],
        "agreement": pooled(everything, [""] * len(own)),
        "without_odd": pooled(kept, [""] * len(own)) if odd else None,
        "within": pooled(kept, own) if len(set(own)) > 1 else None,
        "odd": odd,
    }


def _common(entries: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[str], np.ndarray, np.ndarray]:
    """Names and units (m,) of the parameters that all k logs have, their estimates (k, m) and standard deviations."""
    tables = [{p["name"]: p for p in entry["parameters"]} for entry in entries]
    names = [name for name in (tables[0] if tables else ()) if all(name in table for table in tables)]
    x, sigma = (
        np.array([[table[name][key] for name in names] for table in tables], dtype=float).reshape(
            len(tables), len(names)
        )
        for key in ("estimate", "std")
    )
    return names, [tables[0][name]["unit"] for name in names], x, np.maximum(sigma, 1e-300)


def _odd_logs(
    logs: Sequence[str], names: Sequence[str], x: np.ndarray, sigma: np.ndarray, distance: np.ndarray
) -> list[dict[str, Any]]:
    """The logs with an estimate at a `distance` (k, m) of more than FAR, and those estimates, the farthest first."""
    sigmas = np.abs(x - np.median(x, axis=0)) / sigma if len(x) else distance
    return [
        {
            "name": log,
            "parameters": [
                {"name": names[j], "distance": float(row[j]), "sigmas": float(sigmas[i, j])}
                for j in np.argsort(-row, kind="stable")
                if row[j] > FAR
            ],
        }
        for i, (log, row) in enumerate(zip(logs, distance, strict=True))
        if (row > FAR).any()
    ]


def _over_logs(names: Sequence[str], units: Sequence[str], x: np.ndarray, sigma: np.ndarray) -> list[dict[str, Any]]:
    """What each parameter is over all logs, x and sigma (k, m); spread and ratio are None where they can't be told."""
    found = _ratios(x, sigma, np.zeros(len(x), dtype=int))
    return [
        {
            "name": name,
            "unit": unit,
            "mean": float(x[:, j].mean()),
            "spread": float(x[:, j].std(ddof=1)) if len(x) > 1 else None,
            "std": float(np.sqrt((sigma[:, j] ** 2).mean())),
            "ratio": None if found is None else float(found[0][j]),
            "low": float(x[:, j].min()),
            "high": float(x[:, j].max()),
        }
        for j, (name, unit) in enumerate(zip(names, units, strict=True))
    ]


def _ratios(x: np.ndarray, sigma: np.ndarray, groups: np.ndarray) -> tuple[np.ndarray, int] | None:
    """(m,) ratio of each parameter of x (k, m) about the weighted means of its groups (k,), and degrees of freedom."""
    count = len(x) - len(np.unique(groups))
    if len(x) == 0 or count < 1 or x.shape[1] == 0:
        return None
    total = np.zeros(x.shape[1])
    for group in np.unique(groups):
        mine, weight = x[groups == group], sigma[groups == group] ** -2
        middle = (weight * mine).sum(axis=0) / weight.sum(axis=0)
        total += (weight * (mine - middle) ** 2).sum(axis=0)
    return np.sqrt(total / count), count


def _pooled(x: np.ndarray, sigma: np.ndarray, groups: np.ndarray, independent: float) -> dict[str, Any] | None:
    """The ratio over all parameters, with the bounds that chance keeps it in where σ is true.

    Estimates of one log are correlated, so that the sum of squares has fewer degrees of freedom than terms
    (Satterthwaite 1946): `independent` for each parameter's (k − 1).
    """
    from scipy.special import gammaincinv

    found = _ratios(x, sigma, groups)
    if found is None:
        return None
    ratios, count = found
    freedom = count * independent
    low, high = (
        float(np.sqrt(2 * gammaincinv(freedom / 2, p) / freedom)) for p in ((1 - CHANCE) / 2, (1 + CHANCE) / 2)
    )
    ratio = float(np.sqrt((ratios**2).mean()))
    told = "wider than stated" if ratio > high else "narrower than stated" if ratio < low else "as stated"
    return {"ratio": ratio, "chance": [low, high], "logs": len(x), "degrees_of_freedom": freedom, "sigma": told}


def _distance(names: Sequence[str], x: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """(k, m) distance of each estimate from the parameter's median over the logs, in units of what is usual."""
    if len(x) < LEAST or not names:
        return np.zeros(x.shape)
    away = np.abs(x - np.median(x, axis=0))
    kinds = np.array([kind if (kind := column_kind(name)) in TURNING else "link" for name in names])
    usual = np.empty(x.shape)
    for kind in np.unique(kinds):
        mine = kinds == kind
        relative = (away / sigma)[:, mine]
        shown = relative[relative > 0]
        usual[:, mine] = sigma[:, mine] * max(1.0, _NORMAL * float(np.median(shown)) if len(shown) else 1.0)
    return away / np.maximum(usual, _NORMAL * np.median(away, axis=0))
