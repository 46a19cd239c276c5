"""A kernel in C: samples in and out of vector lanes, called through ctypes."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from threading import Lock

import numpy as np

from identify.symbolic.expression import Expression
from identify.symbolic.printing import c_source

LANES = 8
"""Samples worked on side by side: one AVX-512 register, two of AVX2, four of SSE2 or NEON."""

AROUND = """\
#include <stddef.h>

enum {{ LANES = {lanes}, INPUTS = {inputs}, CONSTANTS = {constants}, OUTPUTS = {outputs}, SIGNALS = {signals} }};

struct job {{
    ptrdiff_t count;              /* samples */
    const double *const *signals; /* each (count, width) */
    const double *constants;
    double *out;
    ptrdiff_t stride;             /* from sample to sample in out */
    const ptrdiff_t *where;       /* place of each output in its sample */
    ptrdiff_t blanks;             /* places that are zero */
    const ptrdiff_t *blank;
}};

static const int width[SIGNALS] = {{{widths}}};

{block}
static void copy(const double *restrict from, double *restrict to, int count)
{{
    if (count == LANES)
        for (int k = 0; k < LANES; ++k) to[k] = from[k];
    else
        for (int k = 0; k < count; ++k) to[k] = from[k];
}}

void run(const struct job *job)
{{
    static const double zero[LANES];
    double x[INPUTS][LANES], values[OUTPUTS][LANES];
    double *const out = job->out;
    const ptrdiff_t *const where = job->where, *const blank = job->blank;
    for (int c = 0; c < CONSTANTS; ++c)
        for (int k = 0; k < LANES; ++k) x[INPUTS - CONSTANTS + c][k] = job->constants[c];
    for (ptrdiff_t start = 0; start < job->count; start += LANES) {{
        const ptrdiff_t left = job->count - start;
        const int live = left < LANES ? (int)left : LANES;
        int row = 0;
        for (int s = 0; s < SIGNALS; ++s)
            for (int j = 0; j < width[s]; ++j, ++row)
                for (int k = 0; k < LANES; ++k)
                    x[row][k] = job->signals[s][(start + (k < live ? k : 0)) * width[s] + j];
        block((const double(*)[LANES])x, values);
        if (job->stride == 1) {{
            for (ptrdiff_t b = 0; b < job->blanks; ++b) copy(zero, out + blank[b] + start, live);
            for (int r = 0; r < OUTPUTS; ++r) copy(values[r], out + where[r] + start, live);
            continue;
        }}
        for (int k = 0; k < live; ++k) {{
            double *const to = out + (start + k) * job->stride;
            for (ptrdiff_t b = 0; b < job->blanks; ++b) to[blank[b]] = 0.0;
            for (int r = 0; r < OUTPUTS; ++r) to[where[r]] = values[r][k];
        }}
    }}
}}
"""


class _Job(ctypes.Structure):
    _fields_ = (
        ("count", ctypes.c_ssize_t),
        ("signals", ctypes.c_void_p),
        ("constants", ctypes.c_void_p),
        ("out", ctypes.c_void_p),
        ("stride", ctypes.c_ssize_t),
        ("where", ctypes.c_void_p),
        ("blanks", ctypes.c_ssize_t),
        ("blank", ctypes.c_void_p),
    )


def native_source(
    inputs: Mapping[str, int], outputs: Sequence[Expression], widths: Sequence[int], constants: int
) -> str:
    """C99 for the outputs at many samples; inputs are the signals' symbols, `widths` of each, then the constants."""
    return AROUND.format(
        lanes=LANES,
        inputs=len(inputs),
        constants=constants,
        outputs=len(outputs),
        signals=len(widths),
        widths=", ".join(map(str, widths)),
        block=c_source("block", inputs, outputs, LANES),
    )


class NativeKernel:
    """The compiled function, with buffers of its own for calls with a single sample."""

    def __init__(
        self, library: ctypes.CDLL, widths: Sequence[int], constants: int, shape: tuple[int, int], where: np.ndarray
    ) -> None:
        """shape of a sample's whole result and the entries' places in it (outputs,), for `one`."""
        self._run = library.run
        self._run.argtypes, self._run.restype = [ctypes.c_void_p], None
        self._lock = Lock()
        self._sample, self._constants, self._result = np.empty(sum(widths)), np.empty(constants), np.zeros(shape)
        parts = np.split(self._sample, np.cumsum(widths)[:-1])
        nowhere = np.empty(0, dtype=np.intp)
        stride = self._result.size + 1  # anything but 1, which stands for another order
        self._job, *self._held = _job(1, parts, self._constants, self._result, stride, where, nowhere)
        self._address = ctypes.addressof(self._job)

    def one(
        self, out: np.ndarray | None, signals: Sequence[np.ndarray], constants: np.ndarray | None = None
    ) -> np.ndarray:
        """The whole result of a single sample, signals (n,) each, in `out` where that is given: the entries at their
        places, zero elsewhere."""
        with self._lock:
            np.concatenate(signals, out=self._sample)
            if constants is not None:
                self._constants[:] = constants
            self._run(self._address)
            if out is None:
                return self._result.copy()
            out[...] = self._result
            return out

    def many(
        self,
        out: np.ndarray,
        stride: int,
        where: np.ndarray,
        blank: np.ndarray,
        signals: Sequence[np.ndarray],
        constants: np.ndarray | None = None,
    ) -> None:
        """Fill out: sample k's entries at k·stride + where (outputs,) from its first number on, zeros at + blank."""
        signals = [np.ascontiguousarray(signal, dtype=float) for signal in signals]
        job, *held = _job(len(signals[0]), signals, constants, out, stride, where, blank)
        self._run(ctypes.addressof(job))
        del held


def _job(
    count: int,
    signals: Sequence[np.ndarray],
    constants: np.ndarray | None,
    out: np.ndarray,
    stride: int,
    where: np.ndarray,
    blank: np.ndarray,
) -> tuple:
    """The structure, and what must live as long as it does."""
    pointers = np.array([signal.ctypes.data for signal in signals])
    constants = np.empty(0) if constants is None else np.ascontiguousarray(constants)
    addresses = [array.ctypes.data for array in (pointers, constants, out)]
    job = _Job(count, *addresses, stride, where.ctypes.data, len(blank), blank.ctypes.data)
    return job, pointers, signals, constants, out, where, blank
