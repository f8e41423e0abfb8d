"""Input shaping and swings: shapers end the swings that they are for, and swings are those of a pendulum and of the
model."""

import mujoco
import numpy as np
import pytest

from tests.support.bent_chain import stump
from trunkline.ar.teleop import vibration
from trunkline.ar.teleop.shaping import Shaper, Shaping, mode_shaper, shaped, shaper_of
from trunkline.ar.teleop.vibration import VibrationModes, shaper_for, slowest, vibration_modes
from trunkline.frames import gravity_in_base
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import read_chain

PERIOD, DAMPING = 0.6, 0.03


def residual(shaper: Shaper, period: float, damping: float) -> float:
    """Amplitude of the swing of a mode after the last impulse, as a share of that after one impulse of 1 (there is less
    than 1 % left where a shaper suits the mode)."""
    decay = 2 * np.pi / period * damping / np.sqrt(1 - damping**2)
    phase = 2 * np.pi / period * shaper.times
    grown = shaper.shares * np.exp(decay * shaper.times)
    left = np.exp(-decay * shaper.delay) * np.hypot((grown * np.cos(phase)).sum(), (grown * np.sin(phase)).sum())
    return float(left)


def swing_left(rows: np.ndarray, step: float, period: float, damping: float, at: int) -> float:
    """Largest distance from its end of an oscillator that follows `rows` (T,), from row `at` on; stepped exactly."""
    decay, pace = 2 * np.pi / period * damping / np.sqrt(1 - damping**2), 2 * np.pi / period
    factor = np.exp((-decay + 1j * pace) * step)
    state, distances = 0j, []
    for before, now in zip(rows, rows[1:], strict=False):
        state = (state + before - now) * factor  # each change starts a swing about the new place
        distances.append(abs(state))
    return max(distances[at:])


@pytest.mark.parametrize("kind", ["zv", "zvd"])
def test_a_step_ends_without_the_swing_that_it_was_shaped_for(kind):
    shaper = mode_shaper(PERIOD, DAMPING, kind)
    assert shaper.shares.sum() == pytest.approx(1.0)
    assert residual(shaper, PERIOD, DAMPING) < 1e-12
    assert residual(mode_shaper(PERIOD, DAMPING, "none"), PERIOD, DAMPING) == pytest.approx(1.0)


def test_two_swings_are_both_ended():
    periods, dampings = np.array([0.62, 0.26]), np.array([0.03, 0.06])
    shaper = shaper_of(periods, dampings, "zvd")
    for period, damping in zip(periods, dampings, strict=True):
        assert residual(shaper, period, damping) < 1e-12
    single = mode_shaper(periods[0], dampings[0], "zvd")
    assert residual(single, periods[1], dampings[1]) > 0.01
    assert (np.diff(shaper.times) >= 0).all()


def test_zvd_bears_a_wrong_period_better_than_zv():
    for off in (0.9, 1.1):
        zv, zvd = (residual(mode_shaper(PERIOD, 0.0, kind), off * PERIOD, 0.0) for kind in ("zv", "zvd"))
        assert zvd == pytest.approx(zv**2)  # of an undamped swing, by its definition
        assert zvd < 0.2 * zv


def test_shaped_rows_end_as_they_did_and_swing_no_more():
    step = 1e-3
    rows = np.linspace(0, 1, 200)[:, None] ** [1, 2]
    shaper = mode_shaper(PERIOD, DAMPING, "zv")
    result = shaped(rows, step, shaper)
    np.testing.assert_allclose(result[0], rows[0])
    np.testing.assert_allclose(result[-1], rows[-1])
    assert len(result) == len(rows) + np.ceil(shaper.delay / step)
    extended = np.concatenate([result[:, 0], np.ones(300)])
    plain = np.concatenate([rows[:, 0], np.ones(300)])
    assert swing_left(extended, step, PERIOD, DAMPING, len(result)) < 0.01 * swing_left(
        plain, step, PERIOD, DAMPING, len(rows)
    )


def test_shaping_keeps_every_limit_of_speed():
    rows = np.cumsum(np.random.default_rng(0).uniform(0, 1, (300, 3)), axis=0)
    result = shaped(rows, 1e-3, shaper_of(np.array([0.2, 0.1]), np.array([0.1, 0.1]), "zvd"))
    assert np.diff(result, axis=0).max() <= np.diff(rows, axis=0).max() + 1e-12


PENDULUM = """
<mujoco><option timestep="0.001"/><worldbody><body name="base"><body name="unit_01">
  <inertial pos="0 0 -0.5" mass="1" diaginertia="1e-9 1e-9 1e-9"/>
  <joint name="unit_01_x" axis="1 0 0" damping="0.1"/><joint name="unit_01_y" axis="0 1 0" damping="0.1"/>
  <site name="tip" pos="0 0 -0.5"/></body></body></worldbody></mujoco>"""


def test_a_pendulum_swings_as_the_formula_says():
    model = mujoco.MjModel.from_xml_string(PENDULUM)
    modes = vibration_modes(model, np.zeros(0), None, gravity_in_base(0.0))
    inertia, natural = 0.25, np.sqrt(9.80665 / 0.5)
    damping = 0.1 / (2 * inertia * natural)
    np.testing.assert_allclose(modes.dampings, damping, rtol=1e-5)
    np.testing.assert_allclose(modes.periods, 2 * np.pi / (natural * np.sqrt(1 - damping**2)), rtol=1e-5)


def test_swings_are_those_of_the_model_as_it_moves():
    """A small step of command: the tip swings as the sum of all swings that were found says."""
    model = stump()
    model.opt.timestep = 2e-4
    chain = read_chain(model)
    gravity, change = gravity_in_base(0.3), np.array([-1e-4, 0.0, 0.0])
    command = chain.straight_lengths + [-0.01, 0.02, 0.02]
    modes = vibration_modes(model, command, change, gravity)
    slow = slowest(modes, 1)
    assert 0.02 < slow.periods[0] < 2.0
    rest = settle(model, np.stack([command - change, command]), gravity)
    data = mujoco.MjData(model)
    model.opt.gravity[:] = gravity
    data.qpos[:] = rest.qpos[0]
    data.ctrl[:], data.act[:] = command, command
    tips = []
    for _ in range(round(3 * slow.periods[0] / model.opt.timestep)):
        mujoco.mj_step(model, data)
        tips.append(data.site("tip").xpos.copy())
    away = np.array(tips) - rest.position[1]
    along = np.linalg.svd(away, full_matrices=False)[2][0]
    signal = away @ along
    late = signal[round(slow.periods[0] / model.opt.timestep) :]
    up = np.flatnonzero((late[:-1] < 0) & (late[1:] >= 0))
    assert len(up) >= 2
    assert np.diff(up).mean() * model.opt.timestep == pytest.approx(slow.periods[0], rel=0.02)


def test_swings_of_the_same_leg_are_computed_once(monkeypatch):
    """Legs differ by gravity, command and change."""
    computed, modes = [], VibrationModes(np.array([PERIOD]), np.array([DAMPING]), np.ones(1), np.zeros(3))

    def counted(model, *leg):
        computed.append(leg)
        return modes

    monkeypatch.setattr(vibration, "vibration_modes", counted)
    shaper, legs = shaper_for(stump(), Shaping("zvd", 1)), np.eye(9)
    for row in (*legs, *legs):
        made = shaper(row[:3], row[3:6], row[6:])
        np.testing.assert_array_equal(made.times, mode_shaper(PERIOD, DAMPING, "zvd").times)
    assert len(computed) == 9
    for (command, step, gravity), row in zip(computed, legs, strict=True):
        np.testing.assert_allclose(gravity, 9.80665 * row[:3])
        np.testing.assert_array_equal(command, row[3:6])
        assert (step is None) == (not row[6:].any())
        assert step is None or step.tolist() == row[6:].tolist()


def test_the_slowest_are_chosen_among_those_that_matter():
    modes = VibrationModes(
        np.array([0.1, 0.6, 0.3, 2.0]), np.array([0.05, 0.03, 0.5, 0.03]), np.array([9, 8, 7, 0.1]), np.zeros(3)
    )
    np.testing.assert_array_equal(slowest(modes, 3).periods, [0.6, 0.1])
    np.testing.assert_array_equal(slowest(modes, 1).periods, [0.6])


def test_swings_alike_count_once():
    periods = np.array([0.60, 0.59, 0.56, 0.2])
    modes = VibrationModes(periods, np.full(4, 0.03), np.ones(4), np.zeros(3))
    np.testing.assert_array_equal(slowest(modes, 4).periods, [0.60, 0.56, 0.2])
