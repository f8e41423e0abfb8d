"""The stand-in lab's instruments: each imperfection is there, in its size, and seeded."""

from dataclasses import replace

import numpy as np
import pytest

from demo.instruments import measure, rotation_mocap_world
from demo.recorder import write_log
from tests.support.sessions import curl_truth, instruments, static_truth
from trunkline.recordings.signals.smoothing import noise_level

CLEAN = instruments(
    position_noise_mm=0, orientation_noise_deg=0, occlusions_per_s=0, dropped_frames=0, outliers=0,
    stamp_jitter_ms=0, tendon_noise_mm=0, clock_offset_s=0,
)  # fmt: skip


def see(truth=None, **changes):
    return measure(truth or curl_truth(), replace(CLEAN, **changes), np.random.default_rng(0))


def test_without_imperfections_the_truth_comes_through():
    truth, m = curl_truth(), see()
    turn = rotation_mocap_world(CLEAN)
    rows = np.searchsorted(truth.time, m.frames / 120 - 1e-9)
    expected = turn.apply(truth.positions[rows, 2]) + CLEAN.origin
    np.testing.assert_allclose(m.positions[:, 3], expected, atol=1e-6)
    np.testing.assert_allclose((m.stamps - m.stamps[0]) * 1e-9, m.frames / 120, atol=1e-8)


def test_noise_has_its_size():
    m = see(static_truth(30.0), position_noise_mm=0.3, orientation_noise_deg=0.3)
    assert 1e3 * noise_level(m.positions.reshape(len(m.frames), -1)).mean() == pytest.approx(0.3, rel=0.1)
    vector = 2 * np.linalg.norm(m.quaternions - m.quaternions.mean(axis=0), axis=-1)
    assert np.degrees(np.sqrt(np.mean(vector**2) / 3)) == pytest.approx(0.3, rel=0.1)


def test_gaps_drops_outliers_and_jitter_are_as_frequent_as_asked():
    m = see(occlusions_per_s=2.0, dropped_frames=0.1, stamp_jitter_ms=1.0)
    hidden = np.isnan(m.positions[..., 0])
    assert hidden.mean() == pytest.approx(1 - np.exp(-2.0 * 0.175), rel=0.35)
    assert len(m.frames) == pytest.approx(0.9 * 300, rel=0.06)
    assert np.std(m.stamps * 1e-9 - m.stamps[0] * 1e-9 - m.frames / 120) == pytest.approx(1e-3, rel=0.2)
    spoiled = np.linalg.norm(see(outliers=0.05).positions - see().positions, axis=-1)
    assert np.mean(spoiled > 0.01) == pytest.approx(0.05, rel=0.3)
    assert spoiled.max() <= 0.04 + 1e-9


def test_motors_have_their_own_clock():
    m, apart = see(), see(clock_offset_s=0.2)
    np.testing.assert_array_equal(apart.tendon_stamps - m.tendon_stamps, 200_000_000)
    np.testing.assert_array_equal(apart.command_stamps - m.command_stamps, 200_000_000)
    np.testing.assert_array_equal(apart.stamps, m.stamps)


def test_the_same_seed_gives_the_same_log(tmp_path):
    logs = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        write_log(
            tmp_path / name, measure(curl_truth(), instruments(), np.random.default_rng(seed))
        )
        logs.append((tmp_path / name).read_bytes())
    assert logs[0] == logs[1] != logs[2]
