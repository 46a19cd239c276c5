"""Which columns of a regressor say nothing new: combinations of the columns before them."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

TOLERANCE = 1e-9
"""Share of a column, in random states, below which what the other columns leave of it counts as rounding."""


def dependent_columns(
    samples: np.ndarray, names: Sequence[str], candidates: Collection[str]
) -> dict[str, dict[str, float]]:
    """Candidates that are combinations of the other columns, {name: {kept column: factor}}.

    samples (rows, p) holds the columns at more random states than there are columns. Candidates are taken in their
    order, each against the columns that are no candidates and the candidates kept so far.
    """
    norms = np.linalg.norm(samples, axis=0)
    scale = np.where(norms > 0, norms, 1.0)
    scaled = samples / scale
    kept = [at for at, name in enumerate(names) if name not in candidates]
    basis = np.linalg.qr(scaled[:, kept])[0]
    found: dict[str, dict[str, float]] = {}
    for at in (at for at, name in enumerate(names) if name in candidates):
        left = scaled[:, at] - basis @ (basis.T @ scaled[:, at])
        left -= basis @ (basis.T @ left)  # once more, for what rounding left behind
        if np.linalg.norm(left) > TOLERANCE:
            kept.append(at)
            basis = np.column_stack([basis, left / np.linalg.norm(left)])
            continue
        factors = np.linalg.lstsq(scaled[:, kept], scaled[:, at], rcond=None)[0]
        found[names[at]] = {
            names[k]: float(factor * scale[at] / scale[k])
            for k, factor in zip(kept, factors, strict=True)
            if abs(factor) > TOLERANCE
        }
    return found
