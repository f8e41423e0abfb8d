"""What is noted of a stop, and what a robot's process tells before anything was started."""

from types import SimpleNamespace

import pytest

from tests.live.test_desk import ToldRobot, desk_of, intent
from tests.live.test_permits import Played
from trunkline.live.robot import HELD, MODE, MODES, READY, SERIAL


@pytest.mark.parametrize(("before", "noted"), [(None, ["stop"]), ("execute", ["stop"]), ("stopped", [])])
def test_a_stop_is_noted_unless_all_is_stopped_already(before, noted):
    events: list[str] = []
    robot = ToldRobot("running")
    desk = desk_of(robot, journal=SimpleNamespace(event=events.append))
    desk.intent = before and intent(before)
    desk.stop()
    assert (events, robot.calls) == (noted, ["stop"])


def test_before_anything_was_started_a_robot_tells_so():
    numbers, fault = Played().told
    assert (numbers[SERIAL], numbers[HELD], numbers[READY], fault) == (0, 0, 1, "")
    assert MODES[int(numbers[MODE])] == "idle"
