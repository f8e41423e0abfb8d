"""What a stop does to what runs, and what is pressed: each button is one event, and one that is not pressed is none."""

from dataclasses import replace

import pytest

from tests.ar.teleop.test_events import GRIPPED, OPEN, SETTINGS, TARGETS, event, heard, state
from tests.ar.teleop.test_executor import plan_of, robot, still
from trunkline.ar.teleop import executor
from trunkline.ar.teleop.messages import ExecutorReport


class Follower:
    """That counts how often it is told to brake."""

    refused, rests = "", False

    def __init__(self, *_) -> None:
        self.braked = 0

    def brake(self) -> None:
        self.braked += 1


@pytest.fixture
def followed(monkeypatch):
    """A robot that follows, and its follower."""
    follower = Follower()
    monkeypatch.setattr(executor, "Follower", lambda *_: follower)
    simulated = robot()
    assert simulated.follow(None, 0.01) == ""  # type: ignore[arg-type]
    return simulated, follower


def test_a_stop_brakes_what_follows_and_once(followed):
    simulated, follower = followed
    simulated.stop()
    assert follower.braked == 1
    simulated.stop()
    assert follower.braked == 1
    assert simulated.state() == ExecutorReport("running", executor.FOLLOWS)  # until it rests


def test_what_runs_takes_nothing_else(followed):
    plan, simulated = plan_of(still()), robot()
    assert simulated.start(plan, plan.digest()) == ""
    for runs in (simulated, followed[0]):
        assert runs.start(plan, plan.digest()) == "busy: another plan runs"
        assert runs.follow(None, 0.01) == "busy: another plan runs"  # type: ignore[arg-type]


def test_a_stop_of_what_does_not_run_stops_nothing_later():
    simulated, plan = robot(), plan_of(still())
    simulated.stop()
    assert simulated.state() == ExecutorReport()
    assert simulated.start(plan, plan.digest()) == ""
    simulated.advance(1.0)
    assert simulated.state() == ExecutorReport("done", plan.digest())


BUTTONS = {
    "reset": ("stopped", "primary"),
    "ask": ("aim", "trigger"),
    "confirm": ("ready", "trigger"),
    "follow": ("aim", "stick_pressed"),
    "unfollow": ("follow", "stick_pressed"),
}


@pytest.mark.parametrize("button", ["primary", "trigger", "stick_pressed", ""])
@pytest.mark.parametrize("name", BUTTONS)
def test_an_event_of_a_button_is_of_that_button_as_it_goes_down(name, button):
    mode, wanted = BUTTONS[name]
    hand = replace(OPEN, pressed=(button,) if button else (), buttons=(wanted,))
    before = state(mode, right=hand, stamp=100.0, history=((99.0, TARGETS),), **GRIPPED)
    assert event(name, before, heard()) == (button == wanted)


BACK = SETTINGS.look_back
BEYOND = replace(TARGETS, tip=replace(TARGETS.tip, reach="outside"))


@pytest.mark.parametrize(
    ("history", "asked"),
    [
        (((9.0, BEYOND), (BACK, TARGETS), (BACK / 2, BEYOND)), True),  # not the newest, and not the oldest
        (((9.0, TARGETS), (BACK, BEYOND), (BACK / 2, TARGETS)), False),
        (((9.0, TARGETS), (BACK / 2, BEYOND)), True),
        (((BACK / 2, TARGETS), (BACK / 4, BEYOND)), True),  # the oldest there are where none is old enough
        (((BACK / 2, BEYOND), (BACK / 4, TARGETS)), False),
        ((), False),
    ],
)
def test_targets_are_those_of_before_the_triggers_jerk(history, asked):
    """Those of `history` by their age, s, the oldest first."""
    stamped = tuple((100.0 - age, targets) for age, targets in history)
    before = state("aim", right=replace(OPEN, pressed=("trigger",)), stamp=100.0, history=stamped, **GRIPPED)
    assert event("ask", before, heard()) == asked
