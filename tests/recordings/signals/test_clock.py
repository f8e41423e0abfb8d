"""Clocks: jitter averaged out, offsets recovered, silence where the data say nothing."""

from dataclasses import replace

import numpy as np
import pytest

from demo.instruments import measure
from tests.support.sessions import curl_truth, instruments
from trunkline.recordings.signals.clock import estimate_offset, fit_frames, offset_by_log_times


def test_frame_numbers_average_jitter_and_ignore_late_stamps():
    rng = np.random.default_rng(1)
    frames = np.delete(np.arange(600), rng.integers(0, 600, 20))
    stamps = frames / 119.9 + rng.normal(scale=1e-3, size=len(frames))
    stamps[50:55] += 0.2  # a burst that was held up
    fit = fit_frames(1_760_000_000_000_000_000 + np.round(stamps * 1e9).astype(np.int64), frames)
    assert fit.rate == pytest.approx(119.9, rel=1e-4)
    assert fit.jitter == pytest.approx(1e-3, rel=0.2)
    assert fit.worst == pytest.approx(0.2, rel=0.05)
    start = stamps[0] + fit.start  # where frame 0 was, by the fit
    assert start - frames[0] / 119.9 == pytest.approx(0, abs=2e-4)


@pytest.mark.parametrize("offset", [-0.4, 0.0, 0.137])
def test_offset_between_motors_and_cameras_is_recovered(offset):
    rng = np.random.default_rng(2)
    settings = instruments(clock_offset_s=offset, occlusions_per_s=0.3)
    m = measure(curl_truth(20.0), settings, rng)
    epoch = m.stamps[0]
    seconds, motors = (m.stamps - epoch) * 1e-9, (m.tendon_stamps - epoch) * 1e-9
    fit = estimate_offset(seconds, m.positions[:, 1:], motors, m.tendon_positions, limit=1.0)
    assert fit.offset == pytest.approx(-offset, abs=3e-3)
    assert fit.ratio < 0.05


def lagging(m, seconds):
    """What cameras and recorder see of an arm that does later by `seconds` what it did in `m`: `seconds` a multiple of
    the time between frames."""
    rows = np.maximum(np.arange(len(m.stamps)) - round(seconds * 120), 0)
    m.positions[:], m.quaternions[:] = m.positions[rows], m.quaternions[rows]


def by_both(m):
    """The offsets of a measurement by log times and by motion."""
    time, logged, motor_time, motor_logged = (
        (ns - m.stamps[0]) * 1e-9 for ns in (m.stamps, m.logged, m.tendon_stamps, m.tendon_logged)
    )
    motion = estimate_offset(time, m.positions[:, 1:], motor_time, m.tendon_positions, limit=1.0)
    return offset_by_log_times(time, logged, motor_time, motor_logged), motion


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("delivery_ms", [1.0, 3.0, 10.0])
@pytest.mark.parametrize("offset", [-0.4, 0.137])
def test_log_times_tell_the_offset_of_an_arm_that_lags(offset, delivery_ms, seed):
    settings = instruments(clock_offset_s=offset, dropped_frames=0, delivery_ms=delivery_ms, stamp_jitter_ms=0.2)
    m = measure(curl_truth(40.0), settings, np.random.default_rng(seed))
    lagging(m, 0.025)
    logged, motion = by_both(m)
    assert motion.offset == pytest.approx(-offset + 0.025, abs=4e-3), "a fit of the motion takes the lag for an offset"
    assert abs(logged.offset + offset) < logged.uncertainty
    assert 0.3e-3 * delivery_ms < logged.uncertainty < 1.5e-3 * delivery_ms


def test_a_recorder_whose_clock_drifts_or_steps_does_not_matter():
    m = measure(curl_truth(40.0), instruments(stamp_jitter_ms=0), np.random.default_rng(0))
    (before, _) = by_both(m)
    for change in (
        lambda since: since + since // 100,
        lambda since: since + 3_600_000_000_000 * (since > 1_200_000_000),
        lambda since: since - 3_600_000_000_000 * (since > 1_200_000_000),
    ):
        drifted = replace(m, logged=m.logged[0] + change(m.logged - m.logged[0]))
        drifted.tendon_logged = m.logged[0] + change(m.tendon_logged - m.logged[0])
        assert by_both(drifted)[0].offset == pytest.approx(before.offset, abs=0.2 * before.uncertainty)


def test_one_late_or_early_log_time_does_not_decide():
    m = measure(curl_truth(40.0), instruments(), np.random.default_rng(0))
    (before, _) = by_both(m)
    m.tendon_logged[150] -= 500_000_000
    m.logged[20:30] += 2_000_000_000
    assert by_both(m)[0].offset == pytest.approx(before.offset, abs=0.2 * before.uncertainty)


def test_no_offset_by_log_times_that_never_meet():
    time = np.arange(100) / 100
    assert offset_by_log_times(time, time + 5, time, time + 50) is None


@pytest.mark.parametrize(("period", "certain"), [(0.7, False), (10.0, True)])
def test_a_motion_that_repeats_itself_is_no_clock(period, certain):
    """An offset a period away explains it as well."""
    time = np.arange(0, 6, 0.01)
    wave = 0.02 * np.sin(2 * np.pi * time / period) ** 2 + (0.01 * np.exp(-(((time - 3) / 0.3) ** 2)) if certain else 0)
    positions = np.stack([wave, wave**2, 0 * wave], axis=1)[:, None]
    fit = estimate_offset(time, positions, time, wave[:, None], 1.0)
    assert fit is not None
    assert fit.certain == certain


def test_tendons_at_rest_say_nothing():
    time = np.linspace(0, 1, 121)
    positions = np.random.default_rng(0).normal(scale=3e-4, size=(121, 4, 3))
    assert estimate_offset(time, positions, time, np.full((121, 3), -0.3), 1.0) is None
    assert estimate_offset(time, positions, np.empty(0), np.empty((0, 3)), 1.0) is None
