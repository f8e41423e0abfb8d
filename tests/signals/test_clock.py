"""Clocks: jitter averaged out, offsets recovered, silence where the data say nothing."""

import numpy as np
import pytest

from demo.instruments import measure
from tests.support.sessions import curl_truth, instruments
from trunkline.signals.clock import (
    OffsetFit,
    agree_on_offset,
    estimate_offset,
    first_motion_offset,
    fit_frames,
)


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


@pytest.mark.parametrize("speed", [0.05, 0.15])
def test_first_motion_sees_through_an_arm_that_lags(speed):
    """The tip follows the pull with a time constant of 0.1 s, the rest later, over elastic and dry friction."""
    time = np.arange(0, 4, 1 / 120)
    pull = np.interp(time, [1.0, 1.6, 2.5, 3.1], [0, 0.6 * speed, 0.6 * speed, 0])
    bend = np.zeros((len(time), 4))
    for row in range(1, len(time)):
        for place, (constant, slack) in enumerate([(0.4, 4e-3), (0.3, 3e-3), (0.2, 2e-3), (0.1, 0.3e-3)]):
            gap = pull[row - 1] - bend[row - 1, place]
            drive = np.sign(gap) * max(abs(gap) - slack, 0)
            bend[row, place] = bend[row - 1, place] + drive / constant / 120
    positions = 5 * bend[..., None] * np.array([1.0, 0.2, 0.5])
    positions += np.random.default_rng(6).normal(scale=3e-4, size=positions.shape)
    positions[200:230, 2] = np.nan
    positions[60, 1] += 0.04
    motor_time, pulls = time + 0.137, np.column_stack([pull, -pull])
    rough = estimate_offset(time, positions, motor_time, pulls, limit=1.0)
    assert rough.offset > -0.12, "a fit of the whole motion takes the lag for an offset"
    exact = first_motion_offset(time, positions, motor_time, pulls, rough.offset)
    assert exact == pytest.approx(-0.137, abs=0.012)


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
    assert agree_on_offset([*fits, OffsetFit(0.15, 0.1, onset=0.07)])[0] == pytest.approx(0.07)
