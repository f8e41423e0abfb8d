"""The tendons' motors against simulated ones, on a clock that a test turns."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.motors import PLANTS, Workbench, homed, motor_settings
from trunkline.ar.drivers.gm6020 import Feedback
from trunkline.ar.drivers.motors import MotorGroup
from trunkline.ar.drivers.simulated_motors import WATCHDOG, MotorParameters
from trunkline.ar.drivers.winch import Winch


def rms(off):
    return np.sqrt((off**2).mean(axis=0)).max()


def test_homing_finds_where_the_tension_is_the_pretension():
    bench = homed()
    assert bench.motors.homed
    true = [plant.slack + bench.motors._settings.reel.pretension / plant.stiffness for plant in PLANTS]
    np.testing.assert_allclose(bench.zeros, true, atol=5e-4)
    bench.rest(0.5)
    np.testing.assert_allclose(bench.pulls, 0.0, atol=5e-4)


def test_homing_without_a_cable_is_a_fault():
    bench = Workbench((MotorParameters(), replace(PLANTS[1], stiffness=0.0), MotorParameters())).home()
    assert bench.motors.fault == "motor 2: found no tension within 100 mm, expected 6 N"
    assert bench.currents == [0.0, 0.0, 0.0]


def test_a_pull_of_90_mm_is_followed():
    off, _ = homed().pull()
    assert rms(off) <= 0.5e-3


def test_a_pull_is_followed_though_one_frame_of_a_hundred_is_lost():
    bench = Workbench(lost=0.01).home()
    assert rms(bench.pull()[0]) <= 1e-3
    assert bench.motors.fault == ""


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_it_comes_to_rest_with_another_inertia_than_it_believes(factor):
    bench = Workbench(tuple(replace(plant, inertia=factor * plant.inertia) for plant in PLANTS)).home()
    off, _ = bench.pull()
    assert rms(off) <= 1.5e-3
    bench.rest(0.5)
    still = [bench.tick() or bench.pulls for _ in range(300)]
    assert np.ptp(still, axis=0).max() < 0.1e-3


def test_where_the_encoder_wraps_nothing_jumps():
    bench = homed()
    off, counted = bench.pull()
    assert PLANTS[2].begins + 0.09 / (2 * np.pi * 0.015) * 8192 > 8192  # so it did
    away = counted - (off + 0.045 * (1 - np.cos(np.pi * 1e-3 * np.arange(1, 4001)[:, None] / 2)))
    assert np.abs(away).max() < 0.3e-3
    assert np.abs(np.diff(counted, axis=0)).max() < 0.3e-3


@pytest.mark.parametrize(("first", "then", "turned"), [(8190, 3, 5), (3, 8190, -5), (0, 4095, 4095), (100, 90, -10)])
def test_turns_are_counted_the_shorter_way(first, then, turned):
    winch = Winch(motor_settings().reel, 1)
    winch.read(Feedback(1, first, 0, 0.0, 30), 0.0)
    winch.read(Feedback(1, then, 0, 0.0, 30), 0.001)
    assert winch.pull == pytest.approx(turned / 8192 * 2 * np.pi * 0.015)


def test_without_commands_simulated_motors_drive_no_current():
    bench = homed()
    bench.rest(0.3, pull=0.01)
    assert min(np.abs(bench.currents)) > 0.05
    bench.rest(WATCHDOG - 0.002, commanding=False)
    assert min(np.abs(bench.currents)) > 0.05
    bench.rest(0.004, commanding=False)
    assert bench.currents == [0.0, 0.0, 0.0]


def test_feedback_of_other_motors_is_nothing():
    motors = MotorGroup(motor_settings(), 0.0)
    motors.hear(Feedback(7, 1, 1, 0.0, 200), 0.0)
    assert motors.fault == ""


@pytest.mark.parametrize(
    ("changes", "reason"),
    [({"sides": (1, 1)}, "sides: found 2, expected one for each of 3 motors"),
     ({"numbers": (1, 2, 2)}, "numbers: found [1, 2, 2], expected each once")],
)  # fmt: skip
def test_settings_that_cannot_be_meant(changes, reason):
    with pytest.raises(ValueError, match=reason.replace("[", r"\[").replace("]", r"\]")):
        replace(motor_settings(), **changes)
