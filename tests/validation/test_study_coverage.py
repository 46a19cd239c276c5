"""The study of coverage counts what it says: held intervals of true, of narrow and of biased deviations."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest
from script_modules import script

from identify.estimation.settings import Settings

RUNS, NAMES = 4000, ("ZZR1", "MX2", "Fv1", "off1")
STD = np.array([0.2, 3.0, 1e-3, 5.0])


@pytest.fixture(scope="module")
def study() -> ModuleType:
    return script("study_coverage")


def made(study: ModuleType, stated: float, bias: float = 0.0, seed: int = 0) -> list:
    """Outcomes whose errors have STD and a bias of the first parameter in units of it, σ stated `stated` times as wide;
    the textbook's is true, and the last parameter is not identified."""
    errors = np.random.default_rng(seed).normal(size=(RUNS, 4)) * STD + bias * STD * [1, 0, 0, 0]
    known = np.array([True, True, True, False])
    return [study.Outcome(NAMES, e, stated * STD, STD, known, (Settings(), None)) for e in errors]


@pytest.mark.parametrize(("stated", "held", "met"), [(1.0, 95.0, True), (0.6, 76.0, False), (1.5, 99.7, False)])
def test_share_of_intervals_is_that_of_the_gaussian(study: ModuleType, stated: float, held: float, met: bool) -> None:
    found = study.coverage("made", made(study, stated), [0] * RUNS)
    assert found.names == NAMES[:3]
    assert found.pooled == pytest.approx(held, abs=0.6)
    assert found.pooled_textbook == pytest.approx(95.0, abs=0.6)
    assert found.met is met
    np.testing.assert_allclose(found.ratio, stated, rtol=0.04)
    assert found.rms == pytest.approx(1 / stated, rel=0.02)


def test_one_biased_parameter_misses_the_bar_and_is_named(study: ModuleType) -> None:
    found = study.coverage("made", made(study, 1.0, bias=1.3), [0] * RUNS)
    assert found.bias[0] == pytest.approx(1.3, abs=0.05)
    assert found.stated[0] == pytest.approx(74.5, abs=2.0)
    assert not found.met
    assert "(ZZR1)" in found.row(True)[4]


def test_spread_and_bias_are_taken_within_each_motion(study: ModuleType) -> None:
    """Two motions with opposite bias: the spread is not widened by what lies between them."""
    outcomes = made(study, 1.0, bias=2.0)[: RUNS // 2] + made(study, 1.0, bias=-2.0, seed=1)[: RUNS // 2]
    found = study.coverage("made", outcomes, [0] * (RUNS // 2) + [1] * (RUNS // 2))
    np.testing.assert_allclose(found.ratio, 1.0, rtol=0.05)
    assert abs(found.bias[0]) == pytest.approx(2.0, abs=0.1)


def test_an_outcome_is_that_of_a_fit(study: ModuleType) -> None:
    settings = Settings(position_cutoff_hz=30.0)
    found = study.outcome(study.Task("torque", 11, 0, (settings, None)))
    assert len(found.names) == len(found.error) == 58
    assert 40 < found.identified.sum() < 58
    assert np.sqrt(np.mean((found.error / found.std) ** 2)) < 1.5
    assert np.isfinite(found.textbook).all()
    assert found.choice == (settings, None)
