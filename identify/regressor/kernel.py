"""Code generated from expressions, run over samples block by block."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from identify.symbolic.expression import Expression, Graph, Scalar
from identify.symbolic.printing import Block, Single, compiled, compiled_for_one

BLOCK = 1024
"""Samples worked on at a time: 2 MB of intermediate values for six axes, enough to hide NumPy's overhead."""


class Kernel:
    """Generated code for the entries of a regressor that are not zero, and where they belong.

    Inputs are the symbols prefix1 … prefixn of each prefix, one value a sample, then K1 … of `constants` values.
    """

    def __init__(
        self,
        graph: Graph,
        entries: Mapping[tuple[int, int], Scalar],
        n: int,
        prefixes: Sequence[str],
        constants: int = 0,
    ) -> None:
        lifted = {
            at: entry if isinstance(entry, Expression) else graph.constant(entry) for at, entry in entries.items()
        }
        live = {at: expression for at, expression in lifted.items() if expression.value != 0}
        self.row = np.array([i for i, _ in live], dtype=int)
        self.column = np.array([k for _, k in live], dtype=int)
        names = [f"{prefix}{j + 1}" for prefix in prefixes for j in range(n)]
        self.signals = len(names)
        names += [f"K{k + 1}" for k in range(constants)]
        self.inputs = {name: row for row, name in enumerate(names)}
        self.outputs = list(live.values())

    @cached_property
    def _block(self) -> tuple[Block, int]:
        return compiled("regressor", self.inputs, self.outputs)

    @cached_property
    def _single(self) -> Single:
        return compiled_for_one("regressor", self.inputs, self.outputs)

    def workspace(self, samples: int) -> Callable[..., np.ndarray]:
        """A function of signals (m, n) each, m ≤ min(samples, BLOCK), and of constants, that returns the entries'
        values (entries, m). They lie in a buffer that its next call uses again."""

        def evaluate_one(*signals: np.ndarray, constants: Sequence[float] = ()) -> np.ndarray:
            inputs = np.concatenate([*(signal[0] for signal in signals), constants])
            return np.array(self._single(inputs.tolist()))[:, None]

        if samples == 1:
            return evaluate_one
        function, work_rows = self._block
        size = min(BLOCK, samples)
        x, out, work = (np.empty((rows, size)) for rows in (self.signals, len(self.outputs), work_rows))

        def evaluate(*signals: np.ndarray, constants: Sequence[float] = ()) -> np.ndarray:
            m = len(signals[0])
            np.concatenate([signal.T for signal in signals], out=x[:, :m])
            function([*x[:, :m], *constants], out[:, :m], work[:, :m])
            return out[:, :m]

        return evaluate


def blocks(samples: int) -> Iterator[slice]:
    """Consecutive ranges of at most BLOCK samples."""
    return (slice(start, min(start + BLOCK, samples)) for start in range(0, samples, BLOCK))
