"""Every form of friction in generated code, against its formula."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from beside import c_compiler
from chains import random_chain

from identify.codegen.generate import generate, identifier
from identify.regressor.friction import FURTHER
from identify.regressor.regressor import Regressor

ARM = random_chain(np.random.default_rng(3), 3)
FADING = 0.2
THETA = np.random.default_rng(0).normal(size=Regressor(ARM, FURTHER).p)


@pytest.mark.parametrize("width", [None, 0.1])
def test_python_has_every_form(width: float | None) -> None:
    """Beside what code without further forms gives: the formulas, presliding at its end and the load its mean."""
    plain = Regressor(ARM)
    texts = [
        generate(ARM, "python", theta, None, forms, width, FADING)
        for theta, forms in ((THETA, FURTHER), (THETA[: plain.p], ()))
    ]
    found = []
    q, dq, ddq = np.random.default_rng(1).uniform(-1, 1, (3, 3))
    dq[1] *= 0.05
    for (text,) in (each.values() for each in texts):
        space: dict[str, object] = {"__name__": "generated"}
        exec(compile(text, "generated", "exec"), space)
        found.append(space["inverse_dynamics"](q, dq, ddq))  # type: ignore[operator]
    sign = np.sign(dq) if width is None else np.clip(dq / width, -1, 1)
    root, fades = np.sign(dq) * np.abs(dq) ** (1 / 3), np.exp(-np.abs(dq) / FADING)
    laws = np.stack([root, sign, sign * fades, np.abs(dq), sign], axis=1)
    further = (THETA[plain.p :].reshape(3, 5) * laws).sum(axis=1)
    np.testing.assert_allclose(found[0] - found[1], further, rtol=0, atol=1e-11)
    told = " ".join(texts[0].popitem()[1].split())
    assert "that under the mean load of the training logs" in told


def test_c_has_them_too(tmp_path: Path) -> None:
    """Its self-test holds it against the regressor, warnings off by being right."""
    compiler = c_compiler()
    for name, text in generate(ARM, "c", THETA, None, FURTHER, 0.1, FADING).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    source = f"{identifier(ARM.name)}.c"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-DSELF_TEST"]
    subprocess.run([compiler, *flags, source, "-o", "self_test", "-lm"], cwd=tmp_path, check=True)
    subprocess.run(["./self_test"], cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    assert "exp(-fabs(dq[0]) / 0.2)" in (tmp_path / source).read_text()
