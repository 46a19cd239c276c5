"""Normal equations block by block: what the whole regressor gives, and as exact as QR once refined."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest
from beside import c_compiler
from chains import random_chain
from symbolic_models import states, tilted

from identify.regressor.columns import smooth_sign
from identify.regressor.compiler import VARIABLE
from identify.regressor.kernel import BLOCK
from identify.regressor.normal_equations import NormalEquations
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot

COUNT = 2 * BLOCK + 37
WEIGHTS = np.array([0.3, 2.0, 7.0, 40.0])


@pytest.fixture(scope="module", params=[False, True], ids=["numpy", "c"])
def regressor(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Regressor]:
    """By NumPy and by C, whatever the environment says of compilers and caches."""
    if request.param:
        c_compiler()
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        environment.delenv(VARIABLE, raising=False)
        made = Regressor(tilted(random_chain(np.random.default_rng(2), 4)), compiler=request.param)
        yield made
        assert made.backend.startswith("C (") == request.param, made.backend


def measured(regressor: Regressor, noise: float = 0.1, count: int = COUNT) -> tuple[np.ndarray, ...]:
    """q, dq, ddq and noisy effort (count, n)."""
    rng = np.random.default_rng(3)
    q, dq, ddq = states(rng, regressor.robot, count)
    theta = rng.normal(size=regressor.p)
    return q, dq, ddq, regressor.inverse_dynamics(q, dq, ddq, theta) + noise * rng.normal(size=q.shape)


def test_sums_are_those_of_the_whole_regressor(regressor: Regressor) -> None:
    q, dq, ddq, effort = measured(regressor)
    sign = smooth_sign(0.5)
    sums = NormalEquations.of(regressor, q, dq, ddq, effort, sign)
    y = regressor.torque(q, dq, ddq, sign=sign)
    expected = np.einsum("tjk,tjl->jkl", y, y)
    np.testing.assert_allclose(sums.gram, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    expected = np.einsum("tjk,tj->jk", y, effort)
    np.testing.assert_allclose(sums.moment, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(sums.power, (effort**2).sum(axis=0), rtol=1e-12)
    assert sums.samples == COUNT
    theta = np.random.default_rng(0).normal(size=regressor.p)
    np.testing.assert_allclose(sums.residual_power(theta), ((effort - y @ theta) ** 2).sum(axis=0), rtol=1e-11)


def test_a_row_touches_its_own_links_alone(regressor: Regressor) -> None:
    q, dq, ddq, effort = measured(regressor)
    y = regressor.torque(q, dq, ddq)
    seen = 0
    for block in regressor.rows(q, dq, ddq, effort):
        m = block[0].shape[1]
        for j, (rows, support) in enumerate(zip(block, regressor.supports, strict=True)):
            np.testing.assert_array_equal(rows[:-1], y[seen : seen + m, j, support].T)
            np.testing.assert_array_equal(rows[-1], effort[seen : seen + m, j])
            assert not np.delete(y[:, j], support, axis=1).any()
        seen += m
    assert seen == COUNT


def test_sums_of_parts_add_up(regressor: Regressor) -> None:
    signals = measured(regressor)
    whole = NormalEquations.of(regressor, *signals)
    first, second = (
        NormalEquations.of(regressor, *(s[part] for s in signals)) for part in (slice(700), slice(700, None))
    )
    both = first + second
    for name in ("gram", "moment", "power"):
        np.testing.assert_allclose(getattr(both, name), getattr(whole, name), rtol=1e-12, atol=1e-9)
    assert both.samples == COUNT


def test_weighted_least_squares_is_that_of_qr(regressor: Regressor) -> None:
    q, dq, ddq, effort = signals = measured(regressor)
    sums = NormalEquations.of(regressor, *signals)
    root = np.sqrt(WEIGHTS)
    w = (regressor.torque(q, dq, ddq) * root[:, None]).reshape(-1, regressor.p)
    norm = np.linalg.norm(w, axis=0)
    factor, triangle = np.linalg.qr(w / norm)
    expected = np.linalg.solve(triangle, factor.T @ (effort * root).ravel()) / norm
    np.testing.assert_allclose(
        sums.solution(WEIGHTS) * norm, expected * norm, rtol=0, atol=1e-11 * max(expected * norm)
    )
    assert sums.condition_number(WEIGHTS) == pytest.approx(np.linalg.cond(triangle), rel=1e-9)


def test_one_more_pass_makes_up_for_the_squared_condition(regressor: Regressor) -> None:
    """A motion so small that the columns are nearly dependent: the error of the Gram matrix goes with cond²."""
    rng = np.random.default_rng(5)
    q, dq, ddq = states(rng, regressor.robot, 4000)
    q, dq, ddq = 0.2 * q, 0.05 * dq, 0.3 * ddq
    theta = rng.normal(size=regressor.p)
    effort = regressor.inverse_dynamics(q, dq, ddq, theta)
    sums = NormalEquations.of(regressor, q, dq, ddq, effort)
    plain = sums.solution(WEIGHTS)
    better = sums.refined(plain, WEIGHTS, regressor, q, dq, ddq, effort)
    norm = np.sqrt(np.tensordot(WEIGHTS, sums.gram, 1).diagonal())
    before, after = (np.abs((x - theta) * norm).max() / np.abs(theta * norm).max() for x in (plain, better))
    assert sums.condition_number(WEIGHTS) > 100
    assert before > 1e-14
    assert after < before / 5


def test_what_the_samples_do_not_tell_is_refused(regressor: Regressor) -> None:
    rest = np.zeros((50, regressor.robot.n))
    with pytest.raises(ValueError, match="nothing about"):
        NormalEquations.of(regressor, rest, rest, rest, rest).solution(WEIGHTS)
    q, dq, ddq, effort = measured(regressor)
    with pytest.raises(ValueError, match="tell"):
        NormalEquations.of(regressor, q[:2], dq[:2], ddq[:2], effort[:2]).solution(WEIGHTS)


def test_the_regressor_is_never_kept() -> None:
    regressor = Regressor(load_robot("rx90"), compiler=False)
    signals = measured(regressor, count=30_000)
    NormalEquations.of(regressor, *(s[:10] for s in signals))
    tracemalloc.start()
    sums = NormalEquations.of(regressor, *signals)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert sums.samples == 30_000
    assert peak < 5e6 < 0.06 * signals[0].nbytes * regressor.p
