"""Least squares: exact on exact rows, numpy's solution elsewhere, and a standard deviation that holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from identify.errors import UnsupportedLogError
from identify.estimation.least_squares import (
    Estimate,
    ordinary_least_squares,
    rows_per_effective_sample,
    scaled_solution,
    weighted_least_squares,
)
from identify.estimation.observation import Observation
from identify.estimation.reduction import reduced

NOISE = (0.05, 1.0, 6.0)
TRUTH = np.array([3.0, -0.2, 40.0, 1e-3, 7.0])
NAMES = ("ZZR1", "MX2", "XX2", "Fv1", "off1")


def matrices(rows: int, seed: int = 0) -> tuple[np.ndarray, ...]:
    """Three joints' columns of unequal size, the first joint blind to the third parameter."""
    rng = np.random.default_rng(seed)
    scale = 1 / np.abs(TRUTH)
    parts = [rng.normal(size=(rows, len(TRUTH))) * scale * (j + 1.0) for j in range(3)]
    parts[0][:, 2] = 0.0
    return tuple(parts)


def observed(w: tuple[np.ndarray, ...], noise: np.ndarray | float = 0.0, rate: float = 20.0) -> Observation:
    """Rows of TRUTH with noise (joints, rows) added."""
    noise = np.broadcast_to(noise, (len(w), len(w[0])))
    effort = tuple(a @ TRUTH + e for a, e in zip(w, noise, strict=True))
    time = np.arange(len(w[0])) / rate
    return Observation(w, effort, time, np.ones((len(time), len(w))), rate, NAMES)


def solved(solve: Callable, rows: Observation) -> Estimate:
    """The estimate from rows brought in two blocks."""
    half = len(rows.time) // 2
    blocks = [
        replace(
            rows,
            matrix=tuple(a[part] for a in rows.matrix),
            effort=tuple(b[part] for b in rows.effort),
            time=rows.time[part],
            weight=rows.weight[part],
        )
        for part in (slice(half), slice(half, None))
    ]
    return solve(
        reduced(blocks),
        lambda x: np.transpose([b - a @ x for a, b in zip(rows.matrix, rows.effort, strict=True)]),
    )


def white(rows: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(3, rows)) * np.array(NOISE)[:, None]


@pytest.mark.parametrize("solve", [ordinary_least_squares, weighted_least_squares])
def test_exact_rows_give_exact_parameters(solve) -> None:
    estimate = solved(solve, observed(matrices(80)))
    np.testing.assert_allclose(estimate.parameters, TRUTH, rtol=1e-12)
    assert (estimate.std < 1e-11 * np.abs(TRUTH)).all()
    assert estimate.rows == 240


def test_ols_is_numpys_least_squares() -> None:
    observation = observed(matrices(90), white(90, 1))
    expected = np.linalg.lstsq(np.vstack(observation.matrix), np.concatenate(observation.effort), rcond=None)[0]
    np.testing.assert_allclose(solved(ordinary_least_squares, observation).parameters, expected, rtol=1e-10)


def test_wls_is_numpys_least_squares_of_rows_over_their_noise() -> None:
    observation = observed(matrices(90), white(90, 2))
    w, y = np.vstack(observation.matrix), np.concatenate(observation.effort)
    first = y - w @ np.linalg.lstsq(w, y, rcond=None)[0]
    noise = np.repeat(np.linalg.norm(first.reshape(3, -1), axis=1), 90)
    expected = np.linalg.lstsq(w / noise[:, None], y / noise, rcond=None)[0]
    np.testing.assert_allclose(solved(weighted_least_squares, observation).parameters, expected, rtol=1e-10)


def test_wls_finds_each_joints_noise_and_beats_ols() -> None:
    w = matrices(400)
    draws = [observed(w, white(400, seed)) for seed in range(60)]
    weighted = [solved(weighted_least_squares, d) for d in draws]
    np.testing.assert_allclose(np.mean([e.sigma for e in weighted], axis=0), NOISE, rtol=0.02)
    errors = [
        np.std([e.parameters for e in es], axis=0)
        for es in (weighted, [solved(ordinary_least_squares, d) for d in draws])
    ]
    assert (errors[0] < 0.5 * errors[1]).all()


@pytest.mark.parametrize("solve", [ordinary_least_squares, weighted_least_squares])
def test_covariance_is_the_spread_over_many_draws(solve) -> None:
    """Joints of unequal noise: (mean stated covariance)⁻¹ × (covariance of 3000 draws) has eigenvalues about 1.

    The spread of sample eigenvalues, (1 ± √(5/3000))², and the few percent that inflation ≥ 1 adds set the bounds.
    """
    w = matrices(300)
    estimates = [solved(solve, observed(w, white(300, seed))) for seed in range(3000)]
    stated = np.mean([e.covariance for e in estimates], axis=0)
    seen = np.cov(np.array([e.parameters for e in estimates]).T)
    half = np.linalg.inv(np.linalg.cholesky(stated))
    eigenvalues = np.linalg.eigvalsh(half @ seen @ half.T)
    assert eigenvalues.min() > 0.75
    assert eigenvalues.max() < 1.2
    np.testing.assert_array_equal(estimates[0].std, np.sqrt(np.diag(estimates[0].covariance)))


def coloured(rows: int, rho: float, rng: np.random.Generator) -> np.ndarray:
    """(3, rows) unit-variance AR(1) noise times each joint's level."""
    from scipy.signal import lfilter

    raw = rng.normal(size=(3, rows + 200))
    return lfilter([np.sqrt(1 - rho**2)], [1, -rho], raw, axis=1)[:, 200:] * np.array(NOISE)[:, None]


def test_coloured_noise_is_counted_by_effective_samples() -> None:
    """AR(1) noise, ρ = 0.6, under slow columns: 4 rows count once, and the stated σ is within 15 % of what is seen."""
    rho, rows = 0.6, 1500
    t = np.arange(rows) / rows
    columns = [np.cos(2 * np.pi * (k * t + 0.13 * k**2)) for k in range(len(TRUTH))]
    w = tuple(np.array(np.roll(columns, j, axis=0)).T / np.abs(TRUTH) for j in range(3))
    rng = np.random.default_rng(3)
    estimates = [solved(weighted_least_squares, observed(w, coloured(rows, rho, rng))) for _ in range(300)]
    seen = np.std([e.parameters for e in estimates], axis=0)
    stated = np.mean([e.std for e in estimates], axis=0)
    np.testing.assert_allclose(stated / seen, 1.0, atol=0.15)
    np.testing.assert_allclose(np.mean([e.inflation for e in estimates], axis=0), 4.0, rtol=0.1)
    np.testing.assert_allclose(np.mean([e.effective_samples for e in estimates]), 3 * rows / 4, rtol=0.1)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8])
def test_rows_per_effective_sample_of_ar1_noise(rho: float) -> None:
    noise = coloured(60_000, rho, np.random.default_rng(5))[0]
    assert rows_per_effective_sample(noise, 20.0) == pytest.approx((1 + rho) / (1 - rho), rel=0.06)


def test_noise_that_alternates_counts_no_row_twice() -> None:
    assert rows_per_effective_sample(np.tile([1.0, -1.0], 50), 20.0) == 1.0
    assert rows_per_effective_sample(np.zeros(50), 20.0) == 1.0


def test_rows_at_rest_change_nothing() -> None:
    """Rows that are zero on both sides and have no weight leave estimate and textbook standard deviation as they are;
    the frequencies that noise is told at are others, so that its σ agrees up to their scatter."""
    rows, rest = 1200, 700
    plain = observed(matrices(rows), white(rows, 4))

    def longer(x: np.ndarray) -> np.ndarray:
        return np.concatenate([x, np.zeros((rest, *x.shape[1:]))])

    padded = Observation(
        tuple(map(longer, plain.matrix)),
        tuple(map(longer, plain.effort)),
        np.arange(rows + rest) / 20,
        longer(plain.weight),
        plain.rate,
        NAMES,
    )
    for solve in (ordinary_least_squares, weighted_least_squares):
        alone, with_rest = solved(solve, plain), solved(solve, padded)
        np.testing.assert_allclose(with_rest.parameters, alone.parameters, rtol=1e-12)
        assert with_rest.noise is not None
        assert alone.noise is not None
        np.testing.assert_allclose(with_rest.noise.textbook, alone.noise.textbook, rtol=1e-12)
        np.testing.assert_allclose(with_rest.std, alone.std, rtol=0.01)
        assert with_rest.effective_samples == pytest.approx(alone.effective_samples, rel=1e-12)


def test_condition_number_is_of_the_scaled_columns() -> None:
    w = np.vstack(matrices(50))
    expected = np.linalg.cond(w / np.linalg.norm(w, axis=0))
    y = w @ TRUTH
    for units in (np.ones(5), np.array([1e4, 1e-3, 1.0, 1e-4, 30.0])):
        inverse, condition, solution = scaled_solution(w * units, y, NAMES)
        assert condition == pytest.approx(expected, rel=1e-9)
        np.testing.assert_allclose(solution, TRUTH / units, rtol=1e-10)
        np.testing.assert_allclose(inverse, np.linalg.inv(w.T @ w) / np.outer(units, units), rtol=1e-9)


def test_parameters_without_rows_are_named() -> None:
    w = matrices(50)
    for a in w:
        a[:, [1, 3]] = 0.0
    with pytest.raises(UnsupportedLogError, match=r"says nothing about MX2, Fv1:.*excite") as caught:
        solved(weighted_least_squares, observed(w))
    assert caught.value.exit_status == 1


def test_parameters_that_can_not_be_told_apart_are_named() -> None:
    w = matrices(50)
    for a in w:
        a[:, 4] = 0.3 * a[:, 0]
    with pytest.raises(UnsupportedLogError, match="can't tell") as caught:
        solved(weighted_least_squares, observed(w))
    (reason,) = caught.value.reasons
    named = reason.removeprefix("the motion can't tell ").split(" apart")[0].split(", ")
    assert set(named[:2]) == {"ZZR1", "off1"}


def test_fewer_equations_than_parameters_are_refused() -> None:
    with pytest.raises(UnsupportedLogError, match=r"3 equations are left for 5 parameters: .*longer"):
        solved(ordinary_least_squares, observed(matrices(1)))


def test_estimate_belongs_to_its_names() -> None:
    estimate = solved(ordinary_least_squares, observed(matrices(50), white(50, 0)))
    assert isinstance(estimate, Estimate)
    assert estimate.names == NAMES
    assert estimate.parameters.shape == estimate.std.shape == (5,)
    assert estimate.sigma.shape == estimate.inflation.shape == (3,)


def test_factors_stand_for_all_rows() -> None:
    """Blocked QR: RᵀR is the Gram matrix of all rows, in whatever blocks they came, fewer rows than columns too."""
    rows = observed(matrices(90), white(90, 6))
    cuts = [0, 2, 5, 60, 90]
    blocks = [
        Observation(
            tuple(a[i:j] for a in rows.matrix), tuple(b[i:j] for b in rows.effort), rows.time[i:j], rows.weight[i:j],
            rows.rate, rows.names,
        )
        for i, j in pairwise(cuts)
    ]  # fmt: skip
    reduction = reduced(blocks)
    assert reduction.equations == 270
    np.testing.assert_array_equal(reduction.effort, np.transpose(rows.effort))
    whole = [np.column_stack([a, b]) for a, b in zip(rows.matrix, rows.effort, strict=True)]
    for factor, joint in zip(reduction.factors, whole, strict=True):
        np.testing.assert_allclose(factor.T @ factor, joint.T @ joint, rtol=1e-11, atol=1e-11)
    theta = np.arange(5.0)
    power = [np.sum((joint @ np.append(-theta, 1)) ** 2) for joint in whole]
    np.testing.assert_allclose(reduction.residual_power(theta), power, rtol=1e-12)
    w, y = reduction.weighted(np.array([2.0, 3.0, 5.0]))
    direct = np.vstack([x * joint for x, joint in zip((2.0, 3.0, 5.0), whole, strict=True)])
    np.testing.assert_allclose(w.T @ y, direct[:, :-1].T @ direct[:, -1], rtol=1e-10)
