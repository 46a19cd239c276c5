"""Shortening keeps what a reader looks for: peaks, gaps, spans of rest."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from identify.report.envelope import binned, envelope, quantiles, runs, spans

quick = settings(max_examples=80, deadline=None)
signals = arrays(float, st.integers(2, 300), elements=st.floats(-1e6, 1e6))


@quick
@given(signals, st.integers(1, 60))
def test_every_bin_keeps_its_extremes_in_order(signal: np.ndarray, bins: int) -> None:
    time = np.linspace(3.0, 7.0, len(signal))
    x, y = envelope(time, signal, bins)
    assert len(x) <= 2 * bins
    assert (np.diff(x) > 0).all()
    np.testing.assert_array_equal(y, signal[np.searchsorted(time, x)])
    edges = np.unique(np.linspace(0, len(signal), min(bins, len(signal)) + 1).astype(int))
    for a, b in pairwise(edges):
        kept = y[(x >= time[a]) & (x <= time[b - 1])]
        assert (kept.min(), kept.max()) == (signal[a:b].min(), signal[a:b].max())


def test_lines_break_at_gaps_and_at_missing_values() -> None:
    time = np.concatenate([np.arange(50) * 0.01, 9.0 + np.arange(50) * 0.01])
    signal = np.ones(100)
    signal[20] = np.nan
    x, y = envelope(time, signal, 10)
    assert ((x > time[49]) & (x <= time[50]) & np.isnan(y)).any()
    assert np.isnan(y[x == time[20]]).all()
    assert np.isnan(envelope(time, np.full(100, np.nan), 10)[1]).all()


@quick
@given(arrays(bool, st.integers(2, 400)), st.integers(5, 100))
def test_spans_cover_every_sample_at_rest(mask: np.ndarray, resolution: int) -> None:
    time = np.linspace(-1.0, 4.0, len(mask))
    found = spans(time, mask, resolution)
    for t in time[mask]:
        assert any(a <= t <= b for a, b in found)
    least = 5.0 / resolution
    assert all(b[0] - a[1] >= least for a, b in pairwise(found))
    if not mask.any():
        assert found == []


@quick
@given(arrays(int, st.integers(1, 60), elements=st.integers(0, 3)))
def test_runs_rebuild_the_levels(levels: np.ndarray) -> None:
    rebuilt = np.full(len(levels), -1)
    for level in range(4):
        for a, b in runs(levels, level):
            rebuilt[a:b] = level
    np.testing.assert_array_equal(rebuilt, levels)


def test_bins_hold_root_mean_squares_and_quantiles() -> None:
    rng = np.random.default_rng(4)
    x = rng.uniform(-2, 3, 20000)
    y = 5 * x + rng.normal(0, 0.3, 20000)
    centres, bands = quantiles(x, y, 20)
    np.testing.assert_allclose(bands[:, 1], 5 * centres, atol=0.2)
    assert (bands[:, 0] < bands[:, 1]).all()
    assert (bands[:, 1] < bands[:, 2]).all()
    rows = np.column_stack([np.full(40, 3.0), np.tile([1.0, -7.0], 20)])
    np.testing.assert_allclose(binned(rows, 10), np.tile([3.0, 5.0], (10, 1)))
    assert quantiles(np.ones(5), np.ones(5))[0].size == 0
