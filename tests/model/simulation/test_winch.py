"""Winches against closed forms, alone, many at once, and where simulations are stepped."""

import numpy as np
import pytest

from tests.support.matched_plant import small_model
from trunkline.frames import gravity_in_base
from trunkline.identification.parameters.parameters import candidate_fields
from trunkline.model.arm_model import BACKLASH, RATE_LIMIT, ArmModel
from trunkline.model.simulation.drive import LOOK, drive, has_friction
from trunkline.model.simulation.motion import batch_of
from trunkline.model.simulation.rest import settle
from trunkline.model.simulation.winch import Winches, wind

STEP, STEPS = 1e-3, 1000
TIME = STEP * np.arange(1, STEPS + 1)
NONE = np.inf


def delivered(commands, rate=NONE, play=0.0):
    """What one winch that stood at 0 delivers of `commands` (T,), m. Shape (T,)."""
    stood = [np.zeros((1, 1)) for _ in range(2)]
    return wind(commands[None, :, None], *stood, np.array([rate * STEP]), np.array([play]))[0, :, 0]


@pytest.mark.parametrize("side", [1, -1])
def test_a_ramp_that_is_too_fast_lags_by_what_is_missing_and_is_caught_up(side):
    asked, rate, end = 0.3, 0.1, 0.06  # m/s, m/s, m
    result = side * delivered(side * np.minimum(asked * TIME, end), rate)
    np.testing.assert_allclose(result, np.minimum(rate * TIME, end), atol=1e-12)
    lag = np.minimum(asked * TIME, end) - result
    assert lag.max() == pytest.approx((asked - rate) * end / asked, abs=asked * STEP)
    assert TIME[np.flatnonzero(lag > 1e-9)[-1]] == pytest.approx(end / rate, abs=2 * STEP)


def test_a_ramp_within_the_limit_is_delivered_as_it_is():
    np.testing.assert_allclose(delivered(0.1 * TIME, 0.1), 0.1 * TIME, atol=1e-12)


def test_play_shifts_what_turns_round_by_its_width():
    """Out, back and out again by 30 mm: the cable trails by half the play to either side, and rests where it turns
    until the drum has come back by all of it."""
    reach, play = 0.03, 0.004
    way = reach * np.interp(TIME, [0, 0.25, 0.75, 1.0], [0, 1, -1, 0])
    result = delivered(way, play=play)
    falling, rising = (TIME > 0.25) & (TIME <= 0.75), TIME > 0.75
    np.testing.assert_allclose(result[~falling & ~rising], np.maximum(way[:250] - play / 2, 0), atol=1e-12)
    np.testing.assert_allclose(result[falling], np.minimum(way[falling] + play / 2, reach - play / 2), atol=1e-12)
    np.testing.assert_allclose(result[rising], np.maximum(way[rising] - play / 2, -reach + play / 2), atol=1e-12)
    turned = way[falling][np.flatnonzero(result[falling] < reach - play / 2 - 1e-9)[0]]
    assert turned == pytest.approx(reach - play, abs=2 * reach / 0.5 * STEP)


def test_many_winches_are_as_each_alone():
    commands = 0.03 * np.sin(np.outer(TIME, [7.0, 11.0, 13.0])) * np.linspace(0.5, 1.5, 4)[:, None, None]
    rates, plays = np.array([0.05, NONE, 0.2, NONE]), np.array([0.0, 0.002, 0.005, 0.0])
    result = wind(commands, np.zeros((4, 3)), np.zeros((4, 3)), rates * STEP, plays)
    for sent, rate, play, row in zip(commands, rates, plays, result, strict=True):
        for tendon in range(3):
            np.testing.assert_array_equal(row[:, tendon], delivered(sent[:, tendon], rate, play))
    np.testing.assert_allclose(result[3], commands[3], atol=1e-15)


def test_simulations_have_the_model_s_numbers_or_their_own_and_go_on_where_they_were():
    model = small_model(rate_limit=0.1, backlash=0.002)
    model.opt.timestep = STEP
    commands = 0.03 * np.sin(np.outer(TIME, [7.0, 11.0, 13.0]))[None].repeat(2, axis=0)
    for fields in ({}, candidate_fields(model, {"rate_limit": np.array([0.05, 0.2])})):
        batch = batch_of(model, 2)
        for name, values in fields.items():
            batch.expand(name)[:] = values
        whole, pieces = Winches(batch, np.zeros((2, 3))), Winches(batch, np.zeros((2, 3)))
        result = whole.deliver(commands, np.arange(2))
        parts = [pieces.deliver(commands[:, :300], np.arange(2)), pieces.deliver(commands[1:, 300:], np.array([1]))]
        np.testing.assert_array_equal(result[1], np.concatenate([parts[0][1], parts[1][0]]))
        for row, rate in zip(result, [0.05, 0.2] if fields else [0.1, 0.1], strict=True):
            np.testing.assert_array_equal(row[:, 1], delivered(commands[0, :, 1], rate, 0.002))


def test_without_numbers_commands_are_delivered_as_they_are():
    commands, off = np.ones((1, 5, 3)), small_model(rate_limit=0.1, backlash=0.002)
    ArmModel(off).switch_off(RATE_LIMIT, BACKLASH)
    for model in (small_model(), off):
        winches = Winches(batch_of(model, 1), np.zeros((1, 3)))
        assert winches.idle
        assert winches.deliver(commands, np.arange(1)) is commands


def test_a_drive_takes_its_time_and_ends_where_the_cable_was_left():
    """A limit changes when the arm is there, backlash where: by half of it, on the side from which it came."""
    rate, play, gravity = 0.005, 0.004, gravity_in_base(0.5)
    models = {
        "plain": small_model(4), "slow": small_model(4, rate_limit=rate), "loose": small_model(4, backlash=play)
    }  # fmt: skip
    for model in models.values():
        model.dof_damping[:] *= 10
        model.tendon_frictionloss[:] = 0
    straight = models["plain"].tendon_length0
    pull = np.array([[0.02, -0.02, -0.02]])
    command, short = straight - pull, straight - pull + np.sign(pull) * play / 2
    ends = {name: drive(model, command, gravity, 12.0) for name, model in models.items()}
    there = settle(models["plain"], command, gravity).position
    np.testing.assert_allclose(ends["slow"].end, there, atol=2e-4)
    assert ends["slow"].seconds_to_rest[0] >= 0.02 / rate - LOOK > ends["plain"].seconds_to_rest[0]
    np.testing.assert_allclose(ends["loose"].end, settle(models["plain"], short, gravity).position, atol=2e-4)
    assert np.linalg.norm(ends["loose"].end - there) > 2e-3
    assert has_friction(models["loose"])
    assert not has_friction(models["slow"])
    np.testing.assert_allclose(drive(models["loose"], command, gravity, 12.0, friction=False).end, there, atol=2e-4)
