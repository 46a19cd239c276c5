"""How white residuals are: Durbin-Watson and Ljung-Box, group by group, and what they say in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.estimation.noise import Noise

CHANCE = 0.01
"""Probability of the Ljung-Box test below which residuals are not white."""

SLIGHT = 0.2
"""Correlation of neighbouring rows below which colour is slight."""


@dataclass(frozen=True)
class Whiteness:
    """One group's residuals: durbin_watson, 2 for white ones, 0 where neighbours are the same (Durbin & Watson 1950);
    ljung_box over so many lags, chance: probability of as much under white noise (Ljung & Box 1978); neighbours: the
    correlation of one row with the next; told: the same in words."""

    durbin_watson: float
    ljung_box: float
    chance: float
    neighbours: float
    lags: int
    told: str


def whiteness(noise: Noise) -> list[Whiteness]:
    """Of every group of rows."""
    from scipy.special import gammaincc

    found = []
    for correlation, counted in zip(noise.autocorrelation, noise.counted, strict=True):
        lags = min(len(correlation), max(int(counted) - 1, 0))
        rows = max(float(counted), lags + 1.0)
        q = rows * (rows + 2) * float(np.sum(correlation[:lags] ** 2 / (rows - np.arange(1, lags + 1))))
        chance = float(gammaincc(lags / 2, q / 2)) if lags else 1.0
        first = float(correlation[0])
        found.append(Whiteness(2 * (1 - first), q, chance, first, lags, _told(first, chance)))
    return found


def _told(neighbours: float, chance: float) -> str:
    if chance >= CHANCE:
        return "white: no correlation between rows beyond chance"
    if abs(neighbours) < SLIGHT:
        return "slightly coloured"
    if neighbours > 0:
        return "coloured: neighbouring rows err alike, as where the model leaves something out"
    return "coloured: neighbouring rows err in opposite ways, as by the noise of positions differentiated twice"
