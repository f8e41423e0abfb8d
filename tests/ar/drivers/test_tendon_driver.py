"""Motors as a limb, with a bench that a test turns."""

import numpy as np
import pytest

from tests.support.motors import TICK, PlayedMotors, Workbench, homed
from trunkline.ar.drivers.motors import HOMING
from trunkline.ar.drivers.tendon_driver import TendonDriver
from trunkline.ar.drivers.watchdog import SETPOINT_TIMEOUT

LEAD = 0.03  # s


class Played:
    """Cables on a bench's clock."""

    def __init__(self, bench):
        self.bench = bench
        self.cables = TendonDriver(PlayedMotors(bench), bench.now)

    def play(self, seconds, way=None, turns=True):
        """Sent `way(t)`, m, of all cables, LEAD s ahead, t from 0 on; nothing without it. turns: whether they do."""
        begun = self.bench.now
        for _ in range(round(seconds / TICK)):
            self.bench.now += TICK
            now = self.bench.now
            for frame in self.bench.simulated.advance(now):
                self.bench.hear(frame)
            if way is not None:
                self.cables.send(now + LEAD, np.full(3, way(now - begun)))
            if turns:
                self.cables.turn(now)
            self.bench.drive(*self.cables._motors.wanted, now)


def test_they_are_where_they_are_sent_when_it_is_due():
    played = Played(homed())
    played.play(1.0, lambda t: 0.03 * min(t, 1.0))
    np.testing.assert_allclose(played.cables.sent, 0.03 * (1.0 - LEAD), atol=1e-6)
    np.testing.assert_allclose(played.bench.pulls, played.cables.sent, atol=1.5e-3)
    assert played.cables.fault == ""


def test_where_setpoints_end_they_hold_and_follow_no_more():
    played = Played(homed())
    played.play(0.5, lambda t: 0.03 * t)
    played.play(LEAD + SETPOINT_TIMEOUT)
    assert played.cables.fault.startswith("heard no setpoint for 5")
    pulls = played.cables.sent
    np.testing.assert_allclose(pulls, 0.015, atol=1e-6)
    played.play(0.3, lambda t: 0.05)
    np.testing.assert_array_equal(played.cables.sent, pulls)
    np.testing.assert_allclose(played.bench.pulls, pulls, atol=5e-4)
    assert all(played.bench.currents)


@pytest.mark.parametrize(("late", "fault"), [(0.045, ""), (0.055, "heard no setpoint for 5")])
def test_where_they_are_late_themselves_it_is_a_fault_though_setpoints_wait(late, fault):
    played = Played(homed())
    played.play(0.5, lambda t: 0.03 * t)
    played.play(late, lambda t: 0.03 * (0.5 + t), turns=False)
    played.play(0.01, lambda t: 0.03 * (0.5 + late + t))
    assert played.cables.fault[: len("heard no setpoint for 5")] == fault


def test_a_setpoint_that_is_no_number_is_not_followed():
    played = Played(homed())
    played.play(0.2, lambda t: 0.0)
    played.cables.send(played.bench.now + LEAD, np.array([0.0, np.nan, 0.0]))
    played.play(0.2, lambda t: 0.01)
    assert played.cables.fault == "setpoint: found values that are not finite"
    np.testing.assert_array_equal(played.cables.sent, 0.0)


def test_motors_that_are_not_homed_in_time_are_a_fault():
    played = Played(Workbench())
    played.play(0.1)
    assert not played.cables.ready
    played.cables.turn(played.bench.now + HOMING)
    assert played.cables.fault == "not homed after 60 s"
