"""Frames that came late: their times evened out, losses counted, ordinary jitter left."""

import numpy as np
import pytest

from trunkline.recordings.signals.even_times import even_times, is_uneven
from trunkline.recordings.signals.smoothing import resample

RATE = 50.0


def arrivals(lost=(), frames=200, seed=0):
    """When frames were taken, and when they arrived over a network, 6 ms late in the mean."""
    numbers = np.setdiff1d(np.arange(frames), lost)
    taken = numbers / RATE
    arrived = taken + np.random.default_rng(seed).exponential(6e-3, len(taken))
    return taken, np.sort(arrived), numbers


def in_bursts(seed=0):
    """The same by a recorder that stalls four times, and then logs what waited 20 µs apart."""
    rng = np.random.default_rng(seed)
    taken = np.arange(200) / RATE
    logged = taken + rng.exponential(2e-4, len(taken))
    for begin in (0.5, 1.3, 2.2, 3.1):
        waits = (logged > begin) & (logged < begin + 0.13)
        logged[waits] = begin + 0.13 + 2e-5 * np.arange(waits.sum())
    return taken, logged


@pytest.mark.parametrize("lost", [(), (60,), (40, 41, 130)], ids=["none", "one", "three"])
@pytest.mark.parametrize("numbered", [True, False])
def test_times_of_arrival_are_evened_out_and_losses_counted(lost, numbered):
    taken, arrived, numbers = arrivals(lost)
    even = even_times(arrived, numbers if numbered else None)
    assert even is not None
    assert even.missing == len(lost)
    assert even.rate == pytest.approx(RATE, rel=2e-3)
    off = even.time - taken
    assert np.mean(np.abs(off - np.median(off)) < 3e-3) > 0.95, "but for some frames beside a loss"


@pytest.mark.parametrize("seed", range(3))
def test_what_a_recorder_logged_in_bursts_is_evened_out_without_frame_numbers(seed):
    taken, logged = in_bursts(seed)
    even = even_times(logged, None)
    assert even is not None
    assert even.missing == 0
    np.testing.assert_allclose(even.time - taken, 0, atol=2e-3)


def test_only_what_no_camera_does_is_uneven():
    assert is_uneven(arrivals()[1])
    assert is_uneven(in_bursts()[1])
    rng = np.random.default_rng(1)
    for rate in (50.0, 120.0):
        frames = np.setdiff1d(np.arange(1000), rng.choice(1000, 10))
        assert not is_uneven(frames / rate + rng.normal(0, 1e-3, len(frames))), "1 ms of jitter and losses"
    assert not is_uneven(np.arange(5) * 1e-5), "too few to tell a rate"


def test_no_curve_through_samples_that_nearly_coincide():
    rng = np.random.default_rng(0)
    taken, logged = in_bursts()
    columns = np.sin(2 * np.pi * taken)[:, None] + rng.normal(0, 1e-3, (len(taken), 1))
    between = resample(logged, columns, np.arange(480) / 120)
    assert np.abs(between).max() < 2, "a spline through both goes to 145"
