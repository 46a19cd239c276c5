"""The generated C's own cosines and sines against NumPy's."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
from beside import c_compiler

from identify.codegen.c_angles import FARTHEST, cosines_sines


def test_cosines_and_sines_to_the_last_bits(tmp_path: Path) -> None:
    compiler = c_compiler()
    shell = "void run(int n, const double *a, double *c, double *s);\n"
    shell += "void run(int n, const double *a, double *c, double *s) { cosines_sines(n, a, c, s); }\n"
    (tmp_path / "angles.c").write_text("\n".join(["#include <math.h>", *cosines_sines(), shell]), encoding="ascii")
    command = [compiler, "-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-Wpedantic", "-Wconversion"]
    built = subprocess.run(
        [*command, "-shared", "-fPIC", "angles.c", "-o", "angles.so", "-lm"], cwd=tmp_path, capture_output=True
    )
    assert built.returncode == 0, built.stderr
    run = ctypes.CDLL(str(tmp_path / "angles.so")).run

    def both(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        out = np.empty_like(x), np.empty_like(x)
        run(len(x), *(a.ctypes.data_as(ctypes.c_void_p) for a in (x, *out)))
        return out

    rng = np.random.default_rng(0)
    ranges = (
        rng.uniform(-7, 7, 50_000),
        rng.uniform(-FARTHEST, FARTHEST, 50_000),
        rng.integers(-2000, 2000, 20_000) * np.pi / 2,
        rng.uniform(-1e9, 1e9, 1000),
        np.array([0.0, -0.0, 1e-300, np.pi / 4, -FARTHEST, FARTHEST]),
    )
    for x in ranges:
        cosine, sine = both(x)
        # Two units in the last place: small values keep their digits too.
        assert np.all(np.abs(cosine - np.cos(x)) <= 2 * np.spacing(np.abs(np.cos(x))))
        assert np.all(np.abs(sine - np.sin(x)) <= 2 * np.spacing(np.abs(np.sin(x))))
    cosine, sine = both(np.array([np.nan, 1.0, np.inf, -2.0]))
    np.testing.assert_array_equal(np.isnan(cosine), [True, False, True, False])
    np.testing.assert_array_equal(np.isnan(sine), [True, False, True, False])
