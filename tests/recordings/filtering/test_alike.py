"""Both signs of a quaternion are one orientation; what is smooth has no noise; a mean of one frame is that frame."""

from dataclasses import replace

import numpy as np
import pytest

from tests.recordings.filtering.test_gaps import SETTINGS, TIME, raw
from trunkline.recordings.filtering.filter import average_static, filter_raw_trial


@pytest.mark.parametrize("every", [2, 7, 360])
def test_whichever_sign_quaternions_have_they_are_filtered_alike(every):
    plain, mixed = raw(oriented=True), raw(oriented=True)
    for source in (plain, mixed):
        angle = np.pi / 2 + 0.2 * np.sin(6 * TIME)  # to both sides of half a turn, where the sign that is usual changes
        source.quaternions[:, 1] = np.stack([np.cos(angle), np.sin(angle), 0 * angle, 0 * angle], axis=1)
    mixed.quaternions[::every, 1] *= -1
    expected, effect = filter_raw_trial(plain, SETTINGS)
    result, same = filter_raw_trial(mixed, SETTINGS)
    assert same.outliers == effect.outliers == 0
    np.testing.assert_allclose(np.abs(np.sum(result.quaternions * expected.quaternions, axis=2)), 1.0, atol=1e-9)
    np.testing.assert_array_equal(result.measured, expected.measured)


@pytest.mark.parametrize("oriented", [False, True])
def test_noise_is_what_the_low_pass_takes_away(oriented):
    smooth, noisy = raw(oriented=oriented), raw(oriented=oriented)
    noisy.positions[:] += 1e-3 * np.random.default_rng(0).normal(size=noisy.positions.shape)
    assert filter_raw_trial(smooth, SETTINGS)[1].position_noise < 1e-5
    assert 0.6e-3 < filter_raw_trial(noisy, SETTINGS)[1].position_noise < 1e-3  # what lies in its band stays


@pytest.mark.parametrize("count", [1, 2, 50])
def test_the_mean_of_what_was_measured_is_over_as_many_frames(count):
    trial, _ = filter_raw_trial(raw(), SETTINGS)
    measured = np.zeros_like(trial.measured)
    measured[100 : 100 + count, 0] = True
    result = average_static(replace(trial, measured=measured))
    np.testing.assert_allclose(result.positions[0, 0], trial.positions[100 : 100 + count, 0].mean(axis=0))
    assert result.measured.tolist() == [[True, False]]
