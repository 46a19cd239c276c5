"""Generated code for the entries of a matrix along a motion, and for its reverse-mode derivative."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from identify.regressor.kernel import Kernel
from identify.symbolic.chain import input_symbols
from identify.symbolic.expression import Graph, Scalar, gradient
from identify.symbolic.printing import compiled

Motion = tuple[np.ndarray, np.ndarray, np.ndarray]
"""q, q̇, q̈, or the derivatives of a number with respect to them, each (n, N): samples along memory."""


class Entries:
    """Entries that are not zero, at (row, column), as functions of `inputs` (q, dq, ddq) of n joints, along `samples`
    samples."""

    def __init__(
        self, graph: Graph, entries: Mapping[tuple[int, int], Scalar], n: int, inputs: Sequence[str], samples: int
    ) -> None:
        kernel = Kernel(graph, entries, n, inputs)
        self.row, self.column, self.n = kernel.row, kernel.column, n
        self._forward, forward_rows = compiled("entries", kernel.inputs, kernel.outputs)
        weights = [graph.symbol(f"weight{k}") for k in range(len(kernel.outputs))]
        names = kernel.inputs | {f"weight{k}": kernel.signals + k for k in range(len(weights))}
        derivative = gradient(kernel.outputs, weights, input_symbols(graph, n, *inputs))
        self._reverse, reverse_rows = compiled("derivative", names, derivative)
        rows = (len(names), len(weights), kernel.signals, forward_rows, reverse_rows)
        self._inputs, self._values, self._derivative, *self._work = (np.empty((count, samples)) for count in rows)

    def values(self, motion: Sequence[np.ndarray]) -> np.ndarray:
        """(entries, N), in a buffer that the next call uses again."""
        inputs = self._inputs[: len(self._derivative)]
        np.concatenate(motion, out=inputs)
        self._forward(inputs, self._values, self._work[0])
        return self._values

    def pull_back(self, motion: Sequence[np.ndarray], weights: np.ndarray) -> list[np.ndarray]:
        """Derivatives (n, N) of Σ weights·entries, weights (entries, N), with respect to each signal."""
        np.concatenate([*motion, weights], out=self._inputs)
        self._reverse(self._inputs, self._derivative, self._work[1])
        return [self._derivative[at : at + self.n].copy() for at in range(0, len(self._derivative), self.n)]
