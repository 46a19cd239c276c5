"""What the page of a batch draws: distances in stated standard deviations."""

from __future__ import annotations

import numpy as np

from identify.report.batch_figures import distances


def test_estimates_that_differ_by_chance_alone_lie_in_the_band_however_sure_each_log_is() -> None:
    sigma = np.array([1.0, 0.1])[:, None] * np.ones((2, 2000))
    x = 7.0 + sigma * np.random.default_rng(0).standard_normal(sigma.shape)
    away = distances(x, sigma, np.zeros(x.shape, dtype=bool))
    assert np.all((np.abs(away) <= 2).mean(axis=1) > 0.94)
    # The weights are those of the best estimate: what is left of the sum of squares has one degree of freedom.
    np.testing.assert_allclose((away**2).sum(axis=0).mean(), 1.0, atol=0.1)


def test_an_odd_estimate_is_far_and_leaves_the_others_where_they_are() -> None:
    sigma = np.full((4, 1), 0.5)
    x = np.array([[1.0], [1.2], [0.8], [90.0]])
    odd = x > 50
    away = distances(x, sigma, odd)
    np.testing.assert_allclose(away[:3], (x[:3] - 1.0) / 0.5, atol=1e-12)
    np.testing.assert_allclose(away[3], 178.0)
    np.testing.assert_allclose(distances(x, sigma, np.ones_like(odd)), (x - 1.1) / 0.5)
