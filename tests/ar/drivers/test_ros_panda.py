"""What a controller of ROS 2 is asked for, whoever is late, on a clock that a test turns: before one that goes evenly
from where it is to the point that it was sent last."""

import re

import numpy as np
import pytest

from trunkline.ar.drivers import ros_panda
from trunkline.ar.drivers.driver import TICK
from trunkline.ar.drivers.ros_panda import PERIOD, RosPanda
from trunkline.ar.drivers.setpoint_filter import ROUNDING
from trunkline.ar.drivers.settings import ExecutionConfig
from trunkline.ar.drivers.watchdog import SETPOINT_TIMEOUT
from trunkline.kinematics.panda.limits import VELOCITY
from trunkline.pipeline.config import PROJECT, load_folder

SETTINGS = load_folder(ExecutionConfig, PROJECT / "conf/execution").ros
READY = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785])
LEAD, LATE = 0.03, 0.5  # s that setpoints are ahead, and when somebody is late
FAST = 0.9 * VELOCITY[0]  # rad/s


class Controller:
    """A `Link` with the controller behind it. `asked`: the speed of each point's way, rad/s. `points`: when each was
    sent, s."""

    def __init__(self, now):
        self.now, self.listeners, self.asked, self.points = now, 1, [], []
        self._begins, self._ends, self._first, self._last = now, now + TICK, READY, READY

    @property
    def joints(self):
        share = (self.now - self._begins) / (self._ends - self._begins)
        return self._first + min(share, 1.0) * (self._last - self._first)

    def send(self, seconds, joints):
        self.asked.append(np.abs(joints - self.joints).max() / max(seconds, 1e-9))
        self._first, self._last = self.joints, np.array(joints)
        self._begins, self._ends = self.now, self.now + max(seconds, 1e-9)
        self.points.append(self.now)

    def states(self):
        return [(list(SETTINGS.names), self.joints.tolist())]

    def close(self):
        pass


class Played:
    """The machine's process sends joint 1 along `way`, and the adapter turns; either may be late. Times from its
    beginning, s."""

    def __init__(self, monkeypatch, way):
        monkeypatch.setattr(ros_panda.time, "monotonic", lambda: 0.0)
        self.now, self._way, self._waiting = 0.0, way, []
        self.controller = Controller(self.now)
        monkeypatch.setattr(ros_panda, "link_of", lambda settings: self.controller)
        self.arm = RosPanda(SETTINGS)
        self.arm.turn(0.0)
        assert self.arm.ready

    def play(self, seconds, sends=True, turns=True):
        """A machine that does not send sends nothing later either; an adapter hears all that it was sent meanwhile."""
        for _ in range(round(seconds / TICK)):
            self.now = self.controller.now = self.now + TICK
            if sends:
                self._waiting.append(self.now + LEAD)
            if turns:
                for due in self._waiting:
                    self.arm.send(due, READY + self._way(due) * np.eye(7)[0])
                self._waiting = []
                self.arm.turn(self.now)

    @property
    def turned(self):
        """rad of joint 1."""
        return self.controller.joints[0]

    def assert_it_stands(self):
        """At a place on its way, whatever it is sent; it was never asked for more than its joints may do."""
        joints, points = self.controller._last[0], len(self.controller.points)
        self.play(0.5)
        assert self.turned == joints
        assert len(self.controller.points) == points
        assert self._way(self.controller.points[-1]) <= joints <= self._way(self.controller.points[-1] + LEAD)
        assert max(self.controller.asked) <= ROUNDING * VELOCITY[0]


@pytest.fixture
def played(monkeypatch):
    return Played(monkeypatch, lambda time: 0.5 * max(time - 0.1, 0.0))


def test_the_controller_is_where_it_is_sent_when_it_is_due(played):
    played.play(1.0)
    assert played.arm.fault == ""
    assert played.turned == pytest.approx(0.5 * 0.9, abs=1e-6)
    assert max(played.controller.asked) < 0.5 * 1.01
    np.testing.assert_allclose(np.diff(played.controller.points), PERIOD, atol=TICK)


@pytest.mark.parametrize("who", ["sends", "turns"])
@pytest.mark.parametrize("late", [0.06, 0.1, 0.15, 0.5])
def test_where_either_process_is_late_it_is_a_fault_and_the_controller_stands(played, who, late):
    played.play(LATE)
    played.play(late, **{who: False})
    played.play(0.01)
    assert played.arm.fault.startswith("heard no setpoint for ")
    played.assert_it_stands()


@pytest.mark.parametrize("who", ["sends", "turns"])
def test_by_less_than_that_it_goes_on(played, who):
    played.play(LATE)
    played.play(SETPOINT_TIMEOUT - 2 * TICK, **{who: False})
    played.play(0.5)
    assert played.arm.fault == ""
    assert played.turned == pytest.approx(played._way(played.now), abs=1e-6)


def test_before_its_first_setpoint_silence_is_no_fault(played):
    played.play(1.0, sends=False)
    assert played.arm.fault == ""


@pytest.mark.parametrize("late", [0.04, 0.045])
def test_what_is_too_fast_after_that_is_refused(monkeypatch, late):
    """A fast way, and a point that makes up for a pause."""
    played = Played(monkeypatch, lambda time: FAST * max(time - 0.1, 0.0))
    played.play(LATE)
    played.play(late, turns=False)
    played.play(0.01)
    assert re.fullmatch(r"setpoint: panda_joint1 asks for [2-4].* rad/s, expected at most 2.17", played.arm.fault)
    played.assert_it_stands()


def test_a_way_that_is_too_fast_is_refused_though_its_points_are_near_each_other(monkeypatch):
    played = Played(monkeypatch, lambda time: 1.1 * VELOCITY[0] * max(time - 0.1, 0.0))
    played.play(LATE)
    assert played.arm.fault == "setpoint: panda_joint1 asks for 2.26 rad/s, expected at most 2.17"
    played.assert_it_stands()


def test_a_controller_that_leaves_is_a_fault_at_once(played):
    played.play(LATE)
    played.controller.listeners = 0
    played.play(TICK)
    assert played.arm.fault == f"{SETTINGS.trajectory}: nobody listens any more"
    played.controller.listeners = 1
    played.assert_it_stands()
