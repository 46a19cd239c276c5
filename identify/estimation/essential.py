"""Essential parameters: those that are left when what the log hardly tells is set to zero, one after the other.

Backward elimination (Pham & Gautier 1991; Gautier 1997): the parameter with the largest relative standard deviation is
dropped as long as that is more than RATIO times the smallest, and as an F-test on effective samples finds the model
without all those dropped no worse. The test takes the covariance that accounts for coloured residuals (Wald), not the
residuals themselves: where noise is white both are the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RATIO = 30.0
"""Largest relative standard deviation over the smallest that a set of essential parameters may have."""

SIGNIFICANCE = 0.05
"""Probability of the F-test below which a model is worse beyond doubt."""


@dataclass(frozen=True)
class Essential:
    """The reduced model: kept (k,) indices of the essential parameters; parameters (p,), zero where dropped, and
    covariance (p, p) of the model that has those alone; dropped: (index, probability of the F-test that the model is no
    worse without it and those before) in the order of dropping; ratio: of the largest relative standard deviation to
    the smallest in the end; refused: (index, probability) of the one that the F-test would not let go, or None."""

    kept: tuple[int, ...]
    parameters: np.ndarray
    covariance: np.ndarray
    dropped: tuple[tuple[int, float], ...]
    ratio: float
    refused: tuple[int, float] | None


def essential_parameters(parameters: np.ndarray, covariance: np.ndarray, effective_samples: float) -> Essential:
    """Backward elimination from estimates (p,) with covariance (p, p) out of so many independent samples."""
    from scipy.special import fdtrc

    free = max(effective_samples - len(parameters), 1.0)
    x, c = parameters.copy(), covariance.copy()
    kept = list(range(len(x)))
    dropped: list[tuple[int, float]] = []
    worse, refused = 0.0, None
    while True:
        relative = np.sqrt(c[kept, kept]) / np.maximum(np.abs(x[kept]), 1e-300)
        ratio = float(relative.max() / max(relative.min(), 1e-300))
        if ratio <= RATIO or len(kept) == 1:
            break
        worst = kept[int(relative.argmax())]
        more = worse + x[worst] ** 2 / max(c[worst, worst], 1e-300)
        chance = float(fdtrc(len(dropped) + 1, free, more / (len(dropped) + 1)))
        if chance < SIGNIFICANCE:
            refused = worst, chance
            break
        # What is best for the rest once this one is known to be zero.
        gain = c[:, worst] / c[worst, worst]
        x, c, worse = x - gain * x[worst], c - np.outer(gain, c[worst]), more
        kept.remove(worst)
        dropped.append((worst, chance))
        x[worst] = c[worst] = c[:, worst] = 0.0
    return Essential(tuple(kept), x, c, tuple(dropped), ratio, refused)
