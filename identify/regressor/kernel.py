"""Code generated from expressions, run over samples: NumPy in blocks, or compiled C."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from identify.regressor.backend import Backend
from identify.regressor.native import NativeKernel, native_source
from identify.symbolic.circular import as_arithmetic
from identify.symbolic.expression import Expression, Graph, Scalar
from identify.symbolic.printing import Block, Single, compiled, compiled_for_one

BLOCK = 1024
"""Samples worked on at a time: 2 MB of intermediate values for six axes, enough to hide NumPy's overhead."""

WORTH = 700_000
"""Samples on which NumPy is at work for as long as a compiler would be, whatever the size of the code. Compiling after
them costs at most twice what knowing the future would."""

ALONE = 80
"""Samples of a block that cost as much as one in a call of its own."""

NOWHERE = np.empty(0, dtype=np.intp)


class Kernel:
    """Generated code for the entries of a matrix that are not zero, and where they belong.

    Inputs are the symbols prefix1 … prefixn of each prefix and sign1 … of `signs` signs, one value a sample, then
    K1 … of `constants` values. `shape` of the matrix. NumPy and C do the same sums and products in the same order:
    which of them runs shows in nothing but time.
    """

    def __init__(
        self,
        graph: Graph,
        entries: Mapping[tuple[int, int], Scalar],
        n: int,
        prefixes: Sequence[str],
        constants: int = 0,
        signs: int = 0,
        shape: tuple[int, int] | None = None,
        backend: Backend | None = None,
    ) -> None:
        lifted = {
            at: entry if isinstance(entry, Expression) else graph.constant(entry) for at, entry in entries.items()
        }
        live = {at: expression for at, expression in lifted.items() if expression.value != 0}
        self.row = np.array([i for i, _ in live], dtype=np.intp)
        self.column = np.array([k for _, k in live], dtype=np.intp)
        self.shape = shape or (n, int(self.column.max(initial=-1)) + 1)
        self.widths = [n] * len(prefixes) + [signs] * bool(signs)
        self.signals = sum(self.widths)
        names = [f"{prefix}{j + 1}" for prefix in prefixes for j in range(n)]
        names += [f"sign{k + 1}" for k in range(signs)] + [f"K{k + 1}" for k in range(constants)]
        self.constants = constants
        self.inputs = {name: row for row, name in enumerate(names)}
        self.outputs = list(live.values())
        self._backend = backend or Backend(False)
        self._native: NativeKernel | None = None
        self._done = 0

    @cached_property
    def _arithmetic(self) -> list[Expression]:
        return as_arithmetic(self.outputs)

    @cached_property
    def _block(self) -> tuple[Block, int]:
        return compiled("regressor", self.inputs, self._arithmetic)

    @cached_property
    def _single(self) -> Single:
        return compiled_for_one("regressor", self.inputs, self._arithmetic)

    @cached_property
    def _source(self) -> str:
        return native_source(self.inputs, self._arithmetic, self.widths, self.constants)

    @cached_property
    def _blank(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the entries that are zero."""
        zero = np.ones(self.shape, dtype=bool)
        zero[self.row, self.column] = False
        row, column = np.nonzero(zero)
        return row, column

    def compiled(self, samples: int) -> NativeKernel | None:
        """The kernel in C, if it is there or, with these samples to come, worth compiling."""
        if self._native is None and self.outputs:
            first = self._done == 0
            self._done += samples if samples > 1 else ALONE
            due = self._backend.eager or self._done >= WORTH
            if (first or due) and self._backend.compiler:
                library = self._backend.library(self._source, due)
                if library is not None:
                    where = self.row * self.shape[1] + self.column
                    self._native = NativeKernel(library, self.widths, self.constants, self.shape, where)
        return self._native

    def one(self, out: np.ndarray | None, *signals: np.ndarray, constants: np.ndarray | None = None) -> np.ndarray:
        """The matrix at one sample, signals (n,) each; in `out` where that is given."""
        native = self._native or self.compiled(1)
        if native:
            return native.one(out, signals, constants)
        if out is None:
            out = np.empty(self.shape)
        inputs = np.concatenate([*signals, *(() if constants is None else (constants,))])
        out[...] = 0.0
        out[self.row, self.column] = self._single(inputs.tolist())
        return out

    def workspace(self, samples: int, place: np.ndarray, rows: int) -> Callable[..., np.ndarray]:
        """A function of signals (m, n) each, m ≤ min(samples, BLOCK), and of constants, that returns (rows, m) with
        the entries' values in the rows `place` (entries,); the others are the caller's. Its next call uses them again.
        """
        out = _buffer(rows, min(BLOCK, samples))
        native = self.compiled(samples)
        if native is None:
            return self._in_numpy(out, place)
        where = place * (out.strides[0] // out.itemsize)

        def evaluate(*signals: np.ndarray, constants: np.ndarray | None = None) -> np.ndarray:
            native.many(out, 1, where, NOWHERE, signals, constants)
            return out[:, : len(signals[0])]

        return evaluate

    def _in_numpy(self, out: np.ndarray, place: np.ndarray) -> Callable[..., np.ndarray]:
        function, work_rows = self._block
        x, work = (_buffer(rows, out.shape[1]) for rows in (self.signals, work_rows))

        def evaluate(*signals: np.ndarray, constants: np.ndarray | None = None) -> np.ndarray:
            m = len(signals[0])
            np.concatenate([signal.T for signal in signals], out=x[:, :m])
            function(
                [*x[:, :m], *(() if constants is None else constants)], [out[row, :m] for row in place], work[:, :m]
            )
            return out[:, :m]

        return evaluate

    def filler(self, out: np.ndarray) -> Callable[..., None]:
        """A function of consecutive rows of out (N, *shape), and of signals and constants there, that fills them."""
        native = self.compiled(len(out))
        if native and not any(step % out.itemsize for step in out.strides):
            stride, *steps = (step // out.itemsize for step in out.strides)
            where = self.row * steps[0] + self.column * steps[1]
            blank = self._blank[0] * steps[0] + self._blank[1] * steps[1]

            def fill_in_c(rows: slice, *signals: np.ndarray, constants: np.ndarray | None = None) -> None:
                native.many(out[rows], stride, where, blank, signals, constants)

            return fill_in_c
        buffer = _buffer(len(self.outputs), min(BLOCK, len(out)))
        evaluate = self._in_numpy(buffer, np.arange(len(buffer)))

        def fill(rows: slice, *signals: np.ndarray, constants: np.ndarray | None = None) -> None:
            out[rows] = 0.0
            out[rows, self.row, self.column] = evaluate(*signals, constants=constants).T

        return fill


def _buffer(rows: int, size: int) -> np.ndarray:
    """(rows, size) whose rows are no power of two apart: they would share their places in the processor's cache."""
    return np.empty((rows, size + 8))[:, :size]


def blocks(samples: int) -> Iterator[slice]:
    """Consecutive ranges of at most BLOCK samples."""
    return (slice(start, min(start + BLOCK, samples)) for start in range(0, samples, BLOCK))
