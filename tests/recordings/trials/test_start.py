"""The moment of release, and of the first pull."""

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from trunkline.recordings.signals.smoothing import low_pass
from trunkline.recordings.trials import start
from trunkline.recordings.trials.start import cycle_time

RATE = 120.0


def release_time(time, positions, smooth, measured=None):
    """Of markers that were all measured, if nothing else is said."""
    return start.release_time(time, positions, everywhere(positions) if measured is None else measured, smooth)


def free_time(time, positions, begin, measured=None):
    return start.free_time(time, positions, everywhere(positions) if measured is None else measured, begin)


def everywhere(positions):
    return np.ones(positions.shape[:2], bool)


def smooth(columns):
    """The low-pass that `ring_down` went through."""
    return low_pass(columns, RATE, 20.0, 4)


def ring_down(release: float, noise: float, seed: int, hand: float = 0.0, duration: float = 3.0):
    """Three markers held at up to 0.2 m aside until `release`, while a hand drifts by `hand` m/s."""
    time = np.arange(int(duration * RATE)) / RATE
    since = np.clip(time - release, 0, None)
    omega, decay = 2 * np.pi * 1.3, 1.0
    swing = np.exp(-decay * since) * (np.cos(omega * since) + decay / omega * np.sin(omega * since))
    pushed = hand * (np.minimum(time, release) + np.exp(-decay * since) * np.sin(omega * since) / omega)
    along = np.array([0.05, 0.12, 0.2])
    positions = np.zeros((len(time), 3, 3))
    positions[..., 0] = (swing + pushed[:, None].T[0] / 0.2)[:, None] * along
    positions += np.random.default_rng(seed).normal(scale=noise, size=positions.shape)
    return time, smooth(positions.reshape(len(time), -1)).reshape(positions.shape)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("release", "hand"), [(0.3, 0.0), (0.5037, 0.0), (1.0, 0.01)])
def test_release_is_found_to_a_frame(release, hand, seed):
    time, positions = ring_down(release, 3e-4, seed, hand)
    begin = release_time(time, positions, smooth)
    assert begin.time == pytest.approx(release, abs=1.5 / RATE if hand else 0.7 / RATE)
    assert abs(begin.time - release) < 4 * begin.sigma < 0.03
    assert not begin.in_motion
    assert not begin.swaying


@pytest.mark.parametrize("frequency", [0.3, 1.0, 2.0])
@pytest.mark.parametrize("sway", [0.05, 0.1])
def test_a_hand_that_sways_when_it_lets_go_is_not_taken_for_the_release(sway, frequency):
    """Of the tip, m/s. The arm goes on with the velocity that it has then."""
    errors, missed = [], []
    for seed in range(6):
        phase = seed + 0.3
        time, positions = ring_down(0.8037, 3e-4, seed)
        since, omega, way = time - 0.8037, 2 * np.pi * 1.3, 2 * np.pi * frequency
        speed = sway * np.cos(phase)
        after = sway / way * np.sin(phase) * np.cos(omega * since) + speed / omega * np.sin(omega * since)
        moved = np.where(since < 0, sway / way * np.sin(way * since + phase), np.exp(-np.maximum(since, 0)) * after)
        shape = np.array([0.25, 0.6, 1.0])[:, None] * [0.6, 0.8, 0]
        begin = release_time(time, positions + moved[:, None, None] * shape, smooth)
        errors.append(begin.time - 0.8037)
        missed.append(abs(speed) > 0.06 and not begin.swaying)
        assert abs(errors[-1]) < 4 * begin.sigma
    assert np.sqrt(np.mean(np.square(errors))) < 1 / RATE
    assert not any(missed)


def test_a_hold_that_creeps_is_not_taken_for_the_release():
    time, positions = ring_down(1.0, 3e-4, 0)
    crept = 0.02 * np.exp(-np.minimum(time, 1.0) / 0.3)
    positions = positions + crept[:, None, None] * np.array([0.25, 0.6, 1.0])[:, None] * [0, 1.0, 0]
    begin = release_time(time, positions, smooth)
    assert begin.time == pytest.approx(1.0, abs=1.5 / RATE)
    assert begin.speed < 0.01


@pytest.mark.parametrize("gentle", [0.0, 0.1, 0.2])
def test_the_arm_is_free_when_the_hand_has_gone(gentle):
    """x'' = -ω² x - c x' + hand, whose force fades within `gentle` s from 0.5 s on; two markers follow."""
    fine, omega, damping = np.arange(0, 3, 1e-4), 8.2, 3.0
    hand = 0.2 * omega**2 * np.clip(1 - (fine - 0.5) / max(gentle, 1e-9), 0, 1)
    hand[fine < 0.5] = 0.2 * omega**2
    x, v, path = 0.2, 0.0, []
    for force in hand:
        v += 1e-4 * (force - omega**2 * x - damping * v)
        x += 1e-4 * v
        path.append(x)
    time = np.arange(0, 2.9, 1 / RATE)
    positions = np.interp(time, fine, path)[:, None, None] * np.array([0.2, 0.6, 1.0])[:, None] * [1.0, 0, 0]
    positions += np.random.default_rng(0).normal(scale=1e-5, size=positions.shape)
    positions = low_pass(positions.reshape(len(time), -1), RATE, 20.0, 4).reshape(positions.shape)
    begin = release_time(time, positions, smooth).time
    assert free_time(time, positions, begin) == pytest.approx(0.5 + gentle, abs=0.035)


@pytest.mark.parametrize("hidden", [slice(20, 62), slice(None)])
def test_what_nobody_measured_does_not_tell_when_the_arm_is_let_go(hidden):
    """Whatever bridges the gap: the tip jumps in the hold, or all the time."""
    time, positions = ring_down(0.5037, 3e-4, 0)
    measured = everywhere(positions)
    measured[hidden, 2] = False
    wrong = positions.copy()
    wrong[:, 2] += np.where(np.arange(len(time)) % 30 < 15, 0.3, -0.3)[:, None] * ~measured[:, 2, None]
    begins = [release_time(time, marked, smooth, measured) for marked in (positions, wrong)]
    assert begins[0] == begins[1]
    assert begins[0].time == pytest.approx(0.5037, abs=1.5 / RATE)
    frees = [free_time(time, marked, begins[0].time, measured) for marked in (positions, wrong)]
    assert frees[0] == frees[1]
    assert release_time(time, wrong, smooth).time != pytest.approx(0.5037, abs=1.5 / RATE)


@pytest.mark.parametrize(("begin", "end"), [(0.3, 0.5), (0.45, 0.55), (0.52, 0.65), (0.55, 0.75), (0.6, 0.9)])
@pytest.mark.parametrize("hidden", [slice(2, 3), slice(None)], ids=["tip", "all"])
def test_a_gap_about_the_release_moves_it_little(begin, end, hidden):
    """Bridged evenly, as the filter does: the release of an arm that was lost for a moment is no more than a gap off,
    and such an arm was held before."""
    time, positions = ring_down(0.5037, 3e-4, 0)
    measured = everywhere(positions)
    measured[(time >= begin) & (time < end), hidden] = False
    for marker, there in enumerate(measured.T):
        for axis in range(3):
            positions[:, marker, axis] = np.interp(time, time[there], positions[there, marker, axis])
    positions = smooth(positions.reshape(len(time), -1)).reshape(positions.shape)
    measured = ~binary_dilation(~measured, np.ones((7, 1)))
    release = release_time(time, positions, smooth, measured)
    assert not release.in_motion
    assert release.time == pytest.approx(0.5037, abs=2.5 / RATE)
    assert free_time(time, positions, release.time, measured) == pytest.approx(0.5037, abs=0.07)


def test_an_arm_that_swings_from_the_first_frame_was_released_before():
    time, positions = ring_down(0.0, 3e-4, 0)
    swinging = time > 0.15
    begin = release_time(time[swinging] - time[swinging][0], positions[swinging], smooth)
    assert (begin.time, begin.in_motion) == (0.0, True)


def test_cycle_begins_with_the_first_command():
    time = np.arange(240) / RATE
    pull = np.interp(time, [0.5, 1.5], [0.0, 0.04])
    commands = np.column_stack([pull, np.full(240, -0.3)])
    assert cycle_time(time, commands).time == pytest.approx(0.5, abs=0.51 / RATE)
    assert cycle_time(time, np.full((240, 2), -0.3)).time == 0.0
    assert cycle_time(time, np.empty((240, 0))).time == 0.0


def test_a_cycle_that_fades_in_begins_before_it_is_far():
    """0.5 % of the range is passed some 70 ms after the command leaves its initial value."""
    time = np.arange(480) / RATE
    since = np.clip(time - 0.7123, 0, None)
    pull = 0.04 * np.clip(since, 0, 1) * np.sin(2 * np.pi * 0.5 * since)
    begin = cycle_time(time, np.column_stack([pull, -pull, np.full(480, -0.3)]))
    assert begin.time == pytest.approx(0.7123, abs=0.51 / RATE)
    assert begin.sigma == pytest.approx(1 / RATE / np.sqrt(12))


@pytest.mark.parametrize("seed", range(5))
def test_measured_positions_in_place_of_commands_have_noise(seed):
    time = np.arange(240) / RATE
    pull = np.interp(time, [0.5, 1.5], [0.0, 0.04])
    noise = np.random.default_rng(seed).normal(scale=5e-5, size=(240, 2))
    begin = cycle_time(time, np.column_stack([pull, np.full(240, -0.3)]) + noise)
    assert begin.time == pytest.approx(0.5, abs=1.5 / RATE)
