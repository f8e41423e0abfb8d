"""Clocks: jitter averaged out, offsets recovered, silence where the data say nothing."""

import numpy as np
import pytest

from demo.instruments import InstrumentSettings, measure
from tests.sessions import curl_truth
from trunkline.recording.clock import OffsetFit, agree_on_offset, estimate_offset, fit_frames


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
    settings = InstrumentSettings(clock_offset_s=offset, occlusions_per_s=0.3)
    m = measure(curl_truth(20.0), settings, rng)
    epoch = m.stamps[0]
    seconds, motors = (m.stamps - epoch) * 1e-9, (m.tendon_stamps - epoch) * 1e-9
    fit = estimate_offset(seconds, m.positions[:, 1:], motors, m.tendon_positions, limit=1.0)
    assert fit.offset == pytest.approx(-offset, abs=3e-3)
    assert fit.ratio < 0.05


def test_tendons_at_rest_say_nothing():
    time = np.linspace(0, 1, 121)
    positions = np.random.default_rng(0).normal(scale=3e-4, size=(121, 4, 3))
    assert estimate_offset(time, positions, time, np.full((121, 3), -0.3), 1.0) is None
    assert estimate_offset(time, positions, np.empty(0), np.empty((0, 3)), 1.0) is None


def test_uncertain_trials_have_no_say():
    fits = [OffsetFit(0.1, 0.01), OffsetFit(0.102, 0.02), OffsetFit(-0.7, 0.9), OffsetFit(0.101, 0.01)]
    offset, spread = agree_on_offset(fits)
    assert offset == pytest.approx(0.101)
    assert spread < 0.002
    assert agree_on_offset([OffsetFit(0.3, 0.95)]) == (0.0, np.inf)
