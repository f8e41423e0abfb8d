"""Hands of the simulated operator: they tremble, miss and lengthen their rays as their sources say."""

from dataclasses import replace

import numpy as np
import pytest

from rehearsal import settings
from rehearsal.operator.hands import RayHand
from rehearsal.operator.scripts import Operator
from rehearsal.session import RATE, REFERENCE
from trunkline.ar.teleop.tracked_controller import ray_length
from trunkline.ar.teleop.vectors import add, rotate, scale
from trunkline.frames import STANDARD_GRAVITY, rotation_from_wxyz

PLACE = np.array([0.5, 0.1, 0.2])
ORIGIN = np.array([0.2, -0.1, -0.3])


def hand(seed: int = 0, **changes) -> RayHand:
    person = replace(settings.person(), **changes)
    return RayHand(ORIGIN, REFERENCE, person, 0.15, np.random.default_rng(seed))


def end(hand: RayHand, now: float, length: float) -> np.ndarray:
    """Of a ray of this length, base frame, m."""
    state = hand.controller(now, None)
    place = add(state.position, scale(rotate(state.quaternion, (0.0, 0.0, -1.0)), length))
    return np.array(add(REFERENCE.position, rotate(REFERENCE.quaternion, place)))


def distance() -> float:
    return float(np.linalg.norm(rotation_from_wxyz(np.array(REFERENCE.quaternion)).inv().apply(
        PLACE - np.array(REFERENCE.position)) - ORIGIN))  # fmt: skip


def test_a_hand_without_faults_points_where_it_aims():
    aiming = hand(tremor_g=0.0, disparity_deg=0.0)
    aiming.aim(PLACE, 0.0, 0.0)
    np.testing.assert_allclose(end(aiming, 1.0, distance()), PLACE, atol=1e-9)


def test_tremor_accelerates_a_hand_by_its_share_of_gravity():
    aiming = hand(disparity_deg=0.0)
    aiming.aim(PLACE, 0.0, 0.0)
    times = np.arange(2.0, 12.0, 2.5e-3)
    ends = np.array([end(aiming, float(now), distance()) for now in times])
    person = aiming.person
    # Of the ray's end the acceleration is larger than of the hand, as the one's distance from the wrist over the other.
    acceleration = np.gradient(np.gradient(ends, times, axis=0), times, axis=0)[5:-5]
    away = (PLACE - ends.mean(axis=0)) / distance()
    assert np.linalg.norm(away) < 1e-3
    peak = person.tremor_g * STANDARD_GRAVITY * distance() / person.wrist
    # Two sines of that peak across the ray.
    assert np.sqrt((acceleration**2).sum(axis=1).mean()) == pytest.approx(peak, rel=0.05)
    frequency = np.abs(np.fft.rfft(ends - ends.mean(axis=0), axis=0)).sum(axis=1).argmax() / (times[-1] - times[0])
    assert person.tremor_hz[0] - 0.1 <= frequency <= person.tremor_hz[1] + 0.1


def test_four_of_a_hundred_aims_miss_the_width_of_what_is_aimed_at():
    aiming, width, missed = hand(tremor_g=0.0), 0.06, []
    for _ in range(4000):
        aiming.aim(PLACE, width, 0.0)
        missed.append(aiming.error[0])
    assert np.mean(np.abs(missed) > width / 2) == pytest.approx(0.0388, abs=0.01)


def test_an_aim_begins_where_the_hand_is():
    aiming = hand(tremor_g=0.0)
    aiming.aim(PLACE, 0.06, 0.0)
    before = end(aiming, 2.0, distance())
    aiming.aim(PLACE + [0.0, 0.1, 0.0], 0.06, 2.0)
    np.testing.assert_allclose(end(aiming, 2.0, distance()), before, atol=1e-9)


def test_the_stick_brings_the_rays_end_to_the_depth_that_is_aimed_at():
    from tests.support.operator import config

    aiming, rays, length = hand(tremor_g=0.0, disparity_deg=0.0), config().core.rays, 0.3
    aiming.aim(PLACE, 0.0, 0.0)
    ray_end = None
    for frame in range(240):
        aimed = aiming.controller(1.0 + frame / RATE, ray_end)
        length = ray_length(length, aimed.stick[1], 1 / RATE, rays)
        x, y, z = (float(value) for value in end(aiming, 1.0, length))
        ray_end = (x, y, z)
    assert length == pytest.approx(distance(), abs=2e-3)


def test_a_hand_that_follows_errs_smoothly_by_about_what_is_not_noticed():
    """In one direction across the ray; without a leap from frame to frame, and slower than 1.8 Hz."""
    aiming, missed = hand(tremor_g=0.0), []
    zone = np.radians(aiming.person.unnoticed_deg) * distance()
    for frame in range(int(4000 * aiming.person.correction * RATE)):
        aiming.follow(PLACE, frame / RATE)
        missed.append(aiming.missed(frame / RATE))
    across = np.array(missed)[:, 0]
    at_corrections = across[:: round(aiming.person.correction * RATE)]
    assert at_corrections.std() == pytest.approx(zone / np.sqrt(3), rel=0.05)
    assert np.abs(np.diff(across)).max() < 0.5 * zone
    power = np.abs(np.fft.rfft(across)) ** 2
    frequency = np.fft.rfftfreq(len(across), 1 / RATE)
    assert power[frequency > 1.8].sum() < 0.02 * power.sum()


@pytest.mark.parametrize(("forecast", "behind"), [(0.0, 1.0), (1.0, 0.0)])
def test_an_operator_is_behind_by_the_part_of_the_reaction_time_that_is_not_foretold(forecast, behind):
    person = replace(settings.person(), forecast=forecast)
    hands = (hand(), hand())
    operator = Operator(person, hands, PLACE, 0.03, 0.03, np.random.default_rng(0))
    velocity = np.array([0.0, 0.05, 0.02])
    place = operator._anticipated(lambda now: PLACE + velocity * now, 3.0)
    np.testing.assert_allclose(place, PLACE + velocity * (3.0 - behind * person.reaction), atol=1e-12)
