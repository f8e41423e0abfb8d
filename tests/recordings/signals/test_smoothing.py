"""Filtering: no delay, noise down by what the bandwidth says, gaps bridged, outliers found and motion left alone."""

import numpy as np
import pytest

from trunkline.recordings.signals.smoothing import fill_gaps, low_pass, noise_level, outliers, resample

RATE = 120.0
TIME = np.arange(600) / RATE


def swing(time):
    """0.2 m at 2 Hz: 2.5 m/s, 32 m/s²."""
    return 0.2 * np.column_stack([np.sin(4 * np.pi * time), np.cos(4 * np.pi * time)])


def test_low_pass_has_no_delay_and_half_gain_at_the_cutoff():
    slow = low_pass(swing(TIME), RATE, 20.0, 4)
    np.testing.assert_allclose(slow[60:-60], swing(TIME)[60:-60], atol=2e-5)
    edge = np.sin(2 * np.pi * 20.0 * TIME)[:, None]
    gain = low_pass(edge, RATE, 20.0, 4)[120:-120].std() / edge[120:-120].std()
    assert gain == pytest.approx(0.5, rel=0.02)


def test_low_pass_leaves_of_white_noise_what_lies_in_its_band():
    noise = np.random.default_rng(0).normal(size=(6000, 4))
    ratio = np.tan(np.pi * np.linspace(0, 59.9, 2000) / RATE) / np.tan(np.pi * 20 / RATE)
    gain = 1 / (1 + ratio**8)  # Butterworth of order 4, passed twice
    expected = np.sqrt(np.mean(gain**2))
    assert low_pass(noise, RATE, 20.0, 4).std() == pytest.approx(expected, rel=0.03)


def test_low_pass_rounds_a_release_symmetrically_by_less_than_a_millimetre():
    since = np.clip(TIME - 2.0, 0, None)
    fall = (10.0 * since**2)[:, None]  # let go at 2 s, 20 m/s²
    error = low_pass(fall, RATE, 20.0, 4) - fall
    assert np.abs(error[120:480]).max() < 1e-3


def test_outliers_are_found_and_fast_motion_is_not():
    rng = np.random.default_rng(3)
    clean = swing(TIME) + rng.normal(scale=3e-4, size=(600, 2))
    assert not outliers(TIME, clean, 8.0).any()
    places = [0, 100, 101, 350, 599]
    spoiled = clean.copy()
    spoiled[places] += [0.02, -0.015]
    assert np.flatnonzero(outliers(TIME, spoiled, 8.0)).tolist() == places


def test_resampling_bridges_jitter_and_short_gaps():
    rng = np.random.default_rng(4)
    visible = np.ones(600, bool)
    visible[200:206] = False  # 58 ms between the neighbours
    time = (TIME + rng.normal(scale=1e-3, size=600))[visible]
    error = np.linalg.norm(resample(time, swing(time), TIME) - swing(TIME), axis=1)
    assert error[5:-5].max() < 2e-4


def test_noise_level_sees_through_motion_and_gaps():
    rng = np.random.default_rng(5)
    columns = swing(TIME) + rng.normal(scale=[3e-4, 6e-4], size=(600, 2))
    columns[100:120] = np.nan
    np.testing.assert_allclose(noise_level(columns), [3e-4, 6e-4], rtol=0.15)


def test_gaps_are_filled_by_time_held_at_the_ends_and_zero_where_nothing_was_seen():
    time = np.array([0.0, 1.0, 3.0, 4.0, 9.0])
    columns = np.array([[np.nan, 1, 3, np.nan, np.nan], [5, np.nan, np.nan, 9, np.nan], [np.nan] * 5]).T
    expected = np.array([[1, 1, 3, 3, 3], [5, 6, 8, 9, 9], [0] * 5]).T
    np.testing.assert_array_equal(fill_gaps(time, columns), expected)
