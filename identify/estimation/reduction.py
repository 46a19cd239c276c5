"""Rows reduced to triangular factors, joint by joint: all that least squares needs of them, whatever their number."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from identify.estimation.observation import Observation
from identify.estimation.spectra import Spectra, band_products


@dataclass(frozen=True)
class Reduction:
    """Rows [W Γ] of each joint as a triangular R with RᵀR = [W Γ]ᵀ[W Γ], which loses no digits and can be weighted.

    factors (n, p + 1, p + 1); effort (rows, n) [N·m or N] and weight (rows, n), the share of each row that is not at
    rest; rate of the rows [Hz]; names (p,); spectra of the rows, None where they were not asked for.
    """

    factors: np.ndarray
    effort: np.ndarray
    weight: np.ndarray
    rate: float
    names: tuple[str, ...]
    spectra: Spectra | None = None

    @property
    def equations(self) -> int:
        """Number of rows, of all joints together."""
        return self.effort.size

    def weighted(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n·(p + 1), p) and (n·(p + 1),): few rows that stand for all, joint j's times weights[j]."""
        rows = (self.factors * weights[:, None, None]).reshape(-1, len(self.names) + 1)
        return rows[:, :-1], rows[:, -1]

    def residual_power(self, parameters: np.ndarray) -> np.ndarray:
        """(n,) Σ (Γ − W·θ)² of each joint."""
        return ((self.factors @ np.append(-parameters, 1.0)) ** 2).sum(axis=1)


def reduced(blocks: Iterable[Observation], shares: np.ndarray | None = None, spectral: bool = True) -> Reduction:
    """The blocks' rows, one block after another brought into the factors (blocked QR).

    shares (rows, n): what each row is multiplied by, 1 where they are None. spectral: whether spectra are asked for,
    which covariances need; rows of a block are then taken to follow one another in time."""
    factors: list[np.ndarray] = []
    products: list[np.ndarray] = []
    effort, weight = [], []
    done = 0
    for block in blocks:
        rows = [np.column_stack([a, b]) for a, b in zip(block.matrix, block.effort, strict=True)]
        if shares is not None:
            part = shares[done : done + len(block.time)]
            rows = [row * share[:, None] for row, share in zip(rows, part.T, strict=True)]
            done += len(block.time)
        if not factors:
            factors = [np.zeros((rows[0].shape[1],) * 2) for _ in rows]
        if spectral:
            # The noise of a row that is partly at rest is that much smaller.
            more = [
                band_products(row[:, :-1] * root[:, None])
                for row, root in zip(rows, np.sqrt(block.weight).T, strict=True)
            ]
            products = [a + b for a, b in zip(products, more, strict=True)] if products else more
        for j, (factor, new) in enumerate(zip(factors, rows, strict=True)):
            factors[j] = np.asarray(np.linalg.qr(np.concatenate([factor, new]), mode="r"))
        effort.append(np.transpose(block.effort))
        weight.append(block.weight)
    spectra = Spectra(np.array(products), tuple(len(part) for part in weight)) if spectral else None
    return Reduction(
        np.array(factors), np.concatenate(effort), np.concatenate(weight), block.rate, block.names, spectra
    )
