"""The moment of release, and of the first pull."""

import numpy as np
import pytest

from trunkline.signals.smoothing import low_pass
from trunkline.trials.start import cycle_time, free_time, release_time

RATE = 120.0


def ring_down(release: float, noise: float, seed: int, hand: float = 0.0, duration: float = 3.0):
    """Three segments held at up to 0.2 m aside until `release`, while a hand drifts by `hand` m/s."""
    time = np.arange(int(duration * RATE)) / RATE
    since = np.clip(time - release, 0, None)
    omega, decay = 2 * np.pi * 1.3, 1.0
    swing = np.exp(-decay * since) * (np.cos(omega * since) + decay / omega * np.sin(omega * since))
    held = hand * np.minimum(time, release)
    along = np.array([0.05, 0.12, 0.2])
    positions = np.zeros((len(time), 3, 3))
    positions[..., 0] = (swing + held[:, None].T[0] / 0.2)[:, None] * along
    positions += np.random.default_rng(seed).normal(scale=noise, size=positions.shape)
    return time, low_pass(positions.reshape(len(time), -1), RATE, 20.0, 4).reshape(positions.shape)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("release", "hand"), [(0.3, 0.0), (0.5037, 0.0), (1.0, 0.01)])
def test_release_is_found_to_a_frame(release, hand, seed):
    time, positions = ring_down(release, 3e-4, seed, hand)
    assert release_time(time, positions) == pytest.approx(release, abs=1.5 / RATE if hand else 0.7 / RATE)


@pytest.mark.parametrize("gentle", [0.0, 0.1, 0.2])
def test_the_arm_is_free_when_the_hand_has_gone(gentle):
    """x'' = -ω² x - c x' + hand, whose force fades within `gentle` s from 0.5 s on; two segments follow."""
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
    begin = release_time(time, positions)
    assert free_time(time, positions, begin) == pytest.approx(0.5 + gentle, abs=0.035)


def test_an_arm_that_swings_from_the_first_frame_was_released_before():
    time, positions = ring_down(0.0, 3e-4, 0)
    swinging = time > 0.15
    assert release_time(time[swinging] - time[swinging][0], positions[swinging]) == 0.0


def test_cycle_begins_with_the_first_command():
    time = np.arange(240) / RATE
    pull = np.interp(time, [0.5, 1.5], [0.0, 0.04])
    commands = np.column_stack([pull, np.full(240, -0.3)])
    assert cycle_time(time, commands) == pytest.approx(0.5, abs=1.5 / RATE)
    assert cycle_time(time, np.full((240, 2), -0.3)) == 0.0
    assert cycle_time(time, np.empty((240, 0))) == 0.0
