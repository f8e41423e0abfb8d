"""How far ahead limbs are sent where they shall be, whatever the machine's process is late by."""

from types import SimpleNamespace

import numpy as np
import pytest

from trunkline.ar.drivers.driver import TICK
from trunkline.ar.drivers.hardware_robot import LEAD, HardwareRobot
from trunkline.ar.session import simulated
from trunkline.ar.session.simulated import drive

STRAIGHT = np.zeros(3)


class Clock:
    """What time and waiting are to `drive`. It is late once, by so many s, at `late[0]` s, and so on."""

    def __init__(self, late):
        self.now, self._late = 100.0, {100.0 + at: by for at, by in late.items()}

    def monotonic(self):
        return self.now

    def acquire(self, timeout):
        """Waits."""
        self.now += timeout
        for at in [at for at in self._late if at <= self.now]:
            self.now += self._late.pop(at)
        return False


class Sent:
    """A limb that notes how far ahead it is sent, s."""

    fault, ready, sent = "", True, np.zeros(7)

    def __init__(self, clock):
        self._clock, self.ahead = clock, []

    def send(self, due, axes):
        self.ahead.append(due - self._clock.now)

    def turn(self, now):
        pass


@pytest.mark.parametrize("by", [0.02, LEAD, LEAD + 0.0005, LEAD + TICK, 0.06, 0.2, 1.0])
def test_after_it_was_late_setpoints_are_as_far_ahead_as_before(monkeypatch, by):
    """Three times, as what is left of it would add up."""
    clock = Clock({0.1: by, 0.5: by, 0.9: by})
    arm = Sent(clock)
    machine = HardwareRobot(arm, None, STRAIGHT, clock.monotonic)
    machine.begin(np.zeros(7))
    loop = SimpleNamespace(
        plant=machine, moves=False, turn=lambda *_: None, tell=lambda _: None, channel=SimpleNamespace(wake=clock),
        advance=lambda: machine.move(np.zeros(7), STRAIGHT),
    )  # fmt: skip
    end = clock.now + 3 * by + 2.0
    monkeypatch.setattr(simulated, "time", clock)
    monkeypatch.setattr(simulated.os, "getppid", lambda: 1 if clock.now < end else 0)
    drive(loop, 1, lambda: machine.behind)
    assert max(arm.ahead) < LEAD + 2 * TICK
    assert arm.ahead[-1] > LEAD - TICK
