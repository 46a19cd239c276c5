"""Filters without phase, derivatives of known curves, clocks made even."""

from __future__ import annotations

import numpy as np
import pytest

from identify.estimation.motion import (
    GROUP,
    Smoothing,
    clock,
    continuation,
    decimated,
    differentiated,
    low_pass,
    motion_at,
    resampled,
    settled,
    thinned,
    uniform,
)
from identify.logs.log import Log

RATE = 500.0
TIME = np.arange(0, 8, 1 / RATE)
INSIDE = slice(500, -500)


def log_of(time: np.ndarray, position: np.ndarray) -> Log:
    names = tuple(f"j{k}" for k in range(position.shape[1]))
    return Log(time, position, None, position.copy(), names)


@pytest.mark.parametrize(("frequency", "gain"), [(0.5, 1.0), (3.0, 1.0), (10.0, 0.5), (40.0, 0.0)])
def test_low_pass_keeps_the_phase_of_every_sinusoid(frequency: float, gain: float) -> None:
    """|H|² of an order-4 Butterworth, twice: 1 in the pass band, ½ at the cut-off, 0 far above, and never a shift."""
    wave = np.column_stack([np.sin(2 * np.pi * frequency * TIME), np.cos(2 * np.pi * frequency * TIME)])
    np.testing.assert_allclose(low_pass(wave, 10.0, RATE)[INSIDE], gain * wave[INSIDE], atol=2e-4)


def test_low_pass_of_time_reversed_is_time_reversed() -> None:
    x = np.random.default_rng(0).normal(size=(2000, 2))
    np.testing.assert_allclose(low_pass(x[::-1], 10.0, RATE)[::-1][INSIDE], low_pass(x, 10.0, RATE)[INSIDE], atol=1e-9)


def test_low_pass_bears_any_length_and_any_cut_off() -> None:
    for length in range(1, 40):
        x = np.linspace(0.0, 1.0, length)[:, None]
        assert low_pass(x, 10.0, RATE).shape == x.shape
    slow = np.random.default_rng(0).normal(size=(100, 1))
    np.testing.assert_array_equal(low_pass(slow, 60.0, 20.0), low_pass(slow, 8.0, 20.0))


def test_derivatives_of_a_sinusoid_converge_with_the_square_of_the_step() -> None:
    omega = 2 * np.pi * 0.7
    errors = []
    for rate in (100.0, 200.0):
        t = np.arange(0, 8, 1 / rate)
        q, dq, ddq = differentiated(np.sin(omega * t)[:, None], 30.0, rate)
        inside = slice(round(rate), -round(rate))
        exact = np.sin(omega * t), omega * np.cos(omega * t), -(omega**2) * np.sin(omega * t)
        errors.append([np.abs(a[inside, 0] - b[inside]).max() for a, b in zip((q, dq, ddq), exact, strict=True)])
    np.testing.assert_allclose(errors[0][1:], [omega * (omega / 100) ** 2 / 6, omega**2 * (omega / 100) ** 2 / 3], 0.02)
    np.testing.assert_allclose(np.divide(errors[0][1:], errors[1][1:]), 4.0, rtol=0.02)
    assert errors[0][0] < 1e-6


@pytest.mark.parametrize(("cutoff", "share"), [(15.0, 0.3), (40.0, 0.15)])
def test_a_motion_cut_anywhere_keeps_its_acceleration_to_the_ends(cutoff: float, share: float) -> None:
    """A reflected record would have none there, an error of the whole acceleration."""
    for start in (0.0, 0.31, 0.9):
        t = start + np.arange(0, 3, 1 / RATE)
        omega = 2 * np.pi * np.array([0.5, 1.3])
        q, dq, ddq = differentiated(np.sin(np.outer(t, omega)), cutoff, RATE)
        exact = np.sin(np.outer(t, omega)), omega * np.cos(np.outer(t, omega)), -(omega**2) * np.sin(np.outer(t, omega))
        for got, wanted, part in zip((q, dq, ddq), exact, (0.01, 0.1, 1.0), strict=True):
            assert np.all(np.abs(got - wanted).max(axis=0) < part * share * np.abs(wanted).max(axis=0))


def test_a_parabola_goes_on_as_itself_and_any_record_is_continued() -> None:
    t = np.arange(200.0)
    x = np.column_stack([3 - 0.2 * t + 0.01 * t**2, 1 + 0.5 * t])
    before = -np.arange(1.0, 61.0)
    np.testing.assert_allclose(
        continuation(x, 60), np.column_stack([3 - 0.2 * before + 0.01 * before**2, 1 + 0.5 * before]), atol=1e-9
    )
    for length in range(2, 30):
        assert all(part.shape == (length, 1) for part in differentiated(np.linspace(0, 1, length)[:, None], 10.0, RATE))


def test_an_even_clock_is_left_alone() -> None:
    jitter = np.random.default_rng(1).uniform(-0.005, 0.005, len(TIME)) / RATE
    channel = np.random.default_rng(2).normal(size=(len(TIME), 3))
    time, (same,), rate = uniform(log_of(TIME + jitter, channel), channel)
    assert same is channel
    assert rate == pytest.approx(RATE, rel=1e-5)
    np.testing.assert_allclose(np.diff(time), 1 / rate, rtol=1e-6)


def test_a_jittered_clock_is_resampled() -> None:
    """Linear interpolation over steps h is off by h²/8·|x''| at most; taken as even it costs 20 times that."""
    jitter = np.random.default_rng(3).uniform(-0.3, 0.3, len(TIME)) / RATE
    omega = 2 * np.pi * 1.5
    uneven = TIME + jitter
    wave = np.column_stack([np.sin(omega * uneven), np.cos(omega * uneven)])
    time, (even, twice), rate = uniform(log_of(uneven, wave), wave, 2 * wave)
    assert len(time) == len(uneven)
    assert (time[0], time[-1]) == (pytest.approx(uneven[0]), pytest.approx(uneven[-1]))
    np.testing.assert_allclose(np.diff(time), 1 / rate, rtol=1e-9)
    bound = (1.6 / RATE) ** 2 / 8 * omega**2
    assert np.abs(even - np.column_stack([np.sin(omega * time), np.cos(omega * time)])).max() <= bound
    np.testing.assert_allclose(twice, 2 * even, rtol=1e-12)
    assert np.abs(wave - np.column_stack([np.sin(omega * time), np.cos(omega * time)])).max() > 20 * bound


def test_a_gap_and_a_slow_drift_are_resampled_too() -> None:
    ramp = 3.0 * TIME[:, None]
    missing = np.ones(len(TIME), dtype=bool)
    missing[1000:1400] = False
    drifting = TIME + 0.004 * np.sin(2 * np.pi * TIME / 8)  # steps within 2 %, the clock two samples off in between
    for own in (TIME[missing], drifting):
        values = 3.0 * own[:, None]
        time, (even,), _ = uniform(log_of(own, values), values)
        np.testing.assert_allclose(even[:, 0], 3.0 * time, rtol=0, atol=1e-12)
    assert uniform(log_of(TIME, ramp), ramp)[1][0] is ramp


def test_motion_is_of_the_positions() -> None:
    wave = np.sin(2 * np.pi * 0.5 * TIME)[:, None] * [1.0, -2.0]
    log = log_of(TIME, wave)
    motion = motion_at(log, slice(0, len(TIME)), Smoothing(20.0), clock(log))
    assert motion.rate == pytest.approx(RATE)
    expected = np.pi * np.cos(np.pi * TIME)[:, None] * [1.0, -2.0]
    np.testing.assert_allclose(motion.dq[INSIDE], expected[INSIDE], atol=2e-4)
    np.testing.assert_allclose(motion.ddq[INSIDE], -(np.pi**2) * wave[INSIDE], atol=2e-3)


def test_decimation_keeps_what_is_slow_and_folds_nothing_back() -> None:
    slow = np.sin(2 * np.pi * 1.3 * TIME)[:, None]
    folded = np.sin(2 * np.pi * 52.0 * TIME)[:, None]  # would look like 2 Hz at 50 Hz
    kept = decimated(slow + folded, 10, RATE)
    bound = 1.1 * (20 / 52) ** 8  # |H|² of order 4 (cut-off 20 Hz), passed twice
    np.testing.assert_allclose(kept[50:-50], slow[::10][50:-50], atol=bound)
    assert decimated(slow, 1, RATE) is slow


@pytest.mark.parametrize(
    ("samples", "rows", "cutoff"),
    [
        (9000, range(50, 8950, 25), 10.0),
        (9000, range(0, 9000, 7), 10.0),
        (9000, range(8000, 9000, 3), 20.0),
        (9000, range(700, 8000, 25), 400.0),
        (900, range(3, 890, 25), 10.0),
        (12, range(0, 12, 5), 10.0),
        (9000, range(20, 20, 5), 10.0),
    ],
)
def test_thinned_is_the_low_pass_at_its_rows(samples: int, rows: range, cutoff: float) -> None:
    """By the impulse response inside, at the ends and on short records by the filter itself."""
    x = np.random.default_rng(0).normal(size=(3, samples)).cumsum(axis=1)
    expected = low_pass(x.T, cutoff, RATE)[list(rows)].T
    found = thinned(x, rows, cutoff, RATE)
    assert found.shape == (3, len(rows))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(x).max())
    assert samples < 9000 or not rows or len(rows) > GROUP


def test_a_filter_forgets_an_end_when_it_has_settled() -> None:
    step = np.ones((4000, 1))
    step[0] = 1e3
    for cutoff in (5.0, 10.0, 100.0):
        away = np.abs(low_pass(step, cutoff, RATE) - 1.0)[settled(cutoff, RATE) :]
        assert away.max() < 1e3 * 1e-10


def test_a_part_of_a_clock_is_resampled_as_the_whole() -> None:
    time = TIME + np.random.default_rng(1).uniform(-0.4, 0.4, len(TIME)) / RATE
    log = log_of(time, np.column_stack([np.sin(time), time**2]))
    even, rate, regular = clock(log)
    assert not regular
    assert rate == pytest.approx(RATE, rel=1e-3)
    _, (whole,), _ = uniform(log, log.position)
    for part in (slice(0, 300), slice(1234, 1235), slice(3000, len(TIME))):
        np.testing.assert_array_equal(resampled(log, even[part], log.position)[0], whole[part])
    assert clock(log_of(TIME, log.position))[2]


@pytest.mark.parametrize("jitter", [0.0, 0.4])
@pytest.mark.parametrize("smoothing", [Smoothing(20.0), Smoothing(20.0, 5.0)])
def test_pieces_of_a_motion_make_the_whole(jitter: float, smoothing: Smoothing) -> None:
    generator = np.random.default_rng(2)
    time = TIME + jitter * generator.uniform(-1, 1, len(TIME)) / RATE
    noise = 1e-4 * generator.normal(size=(len(TIME), 2))
    log = log_of(time, np.column_stack([np.sin(3 * time), np.cos(2 * time) + time]) + noise)
    ticks = clock(log)
    whole = motion_at(log, slice(0, len(TIME)), smoothing, ticks)
    np.testing.assert_array_equal(whole.time, ticks[0])
    parts = [slice(start, min(start + 850, len(TIME))) for start in range(0, 4000, 850)]
    pieces = [motion_at(log, part, smoothing, ticks) for part in parts]
    for name in ("time", "q", "dq", "ddq"):
        found = np.concatenate([getattr(piece, name) for piece in pieces])
        expected = getattr(whole, name)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


SHARP, QUIET = 30.0, 4.0


def smoothed(position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q̈ by both cut-offs, by the higher and by the lower one alone."""
    lone = (differentiated(position, f, RATE)[2] for f in (SHARP, QUIET))
    return Smoothing(SHARP, QUIET)(position, RATE)[2], *lone


def noisy(position: np.ndarray, seed: int = 0) -> np.ndarray:
    return position + 2e-5 * np.random.default_rng(seed).normal(size=position.shape)


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def test_where_a_joint_moves_on_smoothly_the_lower_cut_off_rules() -> None:
    steady = noisy((0.5 * TIME + 0.1 * np.sin(TIME))[:, None])
    both, sharp, quiet = smoothed(steady)
    truth = -0.1 * np.sin(TIME)[:, None]
    np.testing.assert_allclose(both[INSIDE], quiet[INSIDE], rtol=0, atol=1e-12)
    assert rms((both - truth)[INSIDE]) < rms((sharp - truth)[INSIDE]) / 20


def test_a_reversal_that_friction_bends_keeps_the_higher_cut_off() -> None:
    """The acceleration jumps where the velocity changes sign, as where Coulomb friction turns round."""
    t = TIME - 4.0
    bent = noisy(np.where(t < 0, -t * t, -0.5 * t * t)[:, None])
    both, sharp, quiet = smoothed(bent)
    at, far = slice(1950, 2050), slice(2400, 3400)
    np.testing.assert_allclose(both[at], sharp[at], rtol=0, atol=1e-12)
    np.testing.assert_allclose(both[far], quiet[far], rtol=0, atol=1e-12)


def test_a_motion_faster_than_the_lower_cut_off_keeps_the_higher_one() -> None:
    wave = 0.01 * np.sin(2 * np.pi * 8 * TIME) * np.exp(-((TIME - 4.0) ** 2))
    both, sharp, _ = smoothed(noisy((TIME + wave)[:, None]))
    np.testing.assert_allclose(both[1250:2750], sharp[1250:2750], rtol=0, atol=1e-12)


def test_without_noise_nothing_is_lost() -> None:
    both, sharp, quiet = smoothed(np.cumsum(np.sin(TIME))[:, None] / RATE)
    assert rms(both - sharp) < 0.1 * rms(quiet - sharp)


@pytest.mark.parametrize("quiet", [None, 30.0, 50.0])
def test_a_second_cut_off_that_is_not_lower_is_none(quiet: float | None) -> None:
    position = noisy(np.sin(TIME)[:, None])
    for found, expected in zip(
        Smoothing(SHARP, quiet)(position, RATE), differentiated(position, SHARP, RATE), strict=True
    ):
        np.testing.assert_array_equal(found, expected)
