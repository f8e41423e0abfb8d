"""Bad input: each kind has its one line, and the robot holds, in whatever mode it comes."""

from dataclasses import replace

import pytest

from tests.support.operator import TABLE, Operator
from trunkline.ar.teleop.core import WATCHING
from trunkline.ar.teleop.messages import Obstacle, World
from trunkline.ar.teleop.recorder import FAULTS
from trunkline.ar.teleop.transitions import MODES

# what goes wrong, and the line that says so
LINES = {
    "nan position": "left controller: pose is not a number; holding",
    "infinite quaternion": "right controller: pose is not a number; holding",
    "nan stick": "right controller: pose is not a number; holding",
    "quaternion of length 2": "right controller: quaternion is not of unit length; holding",
    "controller gone": "right controller: not tracked; holding",
    "time goes back": "clock went back by 0.5 s; holding",
    "nan stamp": "stamp is not a number; holding",
    "gap": "client silent for 0.40 s; holding",
    "silent": "client silent for 0.13 s; holding",
    "no step": "step of 0 s: expected a positive time; holding",
    "nan step": "step of nan s: expected a positive time; holding",
    "other package": "package: found digest bbbbbbbbbbbb, expected aaaaaaaaaaaa; holding",
    "no package": "package: found digest none, expected aaaaaaaaaaaa; holding",
    "no alignment": "base is not aligned; holding",
    "alignment is no pose": "base alignment is not a pose; holding",
    "nan joints": "robot's joints are not numbers; holding",
    "swapped": "controllers have changed places; holding until both grips are let go",
}


def test_every_fault_has_its_line():
    assert set(LINES) == set(FAULTS)


# what does not void a plan where nothing moves: who watches need not be heard
UNHEARD = {
    "nan position", "infinite quaternion", "nan stick", "quaternion of length 2", "controller gone", "gap", "silent",
}  # fmt: skip


@pytest.mark.parametrize("bad", FAULTS)
@pytest.mark.parametrize("mode", MODES)
def test_robot_holds_and_says_why(mode, bad):
    operator = Operator()
    operator.to(mode)
    if mode == "hold":
        operator.step(left={"tracked": True, "grip": True})
    start = len(operator.intents)
    intent = FAULTS[bad](operator)
    assert intent.motion == "hold"
    unchanged = mode == "stopped" or (mode in WATCHING and bad in UNHEARD)
    assert intent.mode == (mode if unchanged else "hold")
    if bad == "silent":  # said as soon as it is known
        intent = next(intent for intent in operator.intents[start:] if intent.notice.startswith("client"))
    later = {("hold", "silent"): "client silent for 0.20 s; holding"}  # another line comes before it
    assert intent.notice == later.get((mode, bad), LINES[bad])
    assert "\n" not in LINES[bad]


@pytest.mark.parametrize("bad", FAULTS)
def test_robot_may_be_moved_again_only_by_a_new_plan_and_a_new_confirmation(bad):
    operator = Operator()
    operator.to("execute")
    good = operator.message
    FAULTS[bad](operator)
    operator.message = replace(good, stamp=operator.message.stamp if operator.message.stamp > 0 else good.stamp)
    for _ in range(120):
        assert operator.step().motion == "hold"
    assert operator.wait(1.0, left={"grip": False}, right={"grip": False}).mode == "aim"


@pytest.mark.parametrize("bad", sorted(UNHEARD))
@pytest.mark.parametrize("mode", WATCHING)
def test_a_plan_outlives_that_its_user_is_not_heard_and_is_confirmed_by_a_fresh_press_alone(mode, bad):
    operator = Operator()
    operator.to(mode)
    good, hand = operator.message, "left" if bad == "nan position" else "right"
    FAULTS[bad](operator)
    operator.message = replace(good, stamp=operator.message.stamp)
    heard = operator.step(**{hand: {"trigger": True, "grip": True}})  # held when it appears: no press
    assert (heard.mode, heard.notice) == (mode, "")
    if mode == "plan":
        operator.cause("planned")
    if mode != "ready":
        operator.cause("shown")
    assert operator.wait(0.5).mode == "ready"
    operator.step(**{hand: {"trigger": False}})
    assert operator.step(**{hand: {"trigger": True}}).mode == "delay"


def test_nothing_is_confirmed_by_one_hand_as_the_other_is_not_heard():
    operator = Operator()
    operator.to("ready")
    operator.wait(0.2, left={"tracked": False})
    intent = operator.step(right={"trigger": True, "grip": True})
    assert (intent.mode, intent.notice) == ("ready", "left controller: not tracked; holding")


def test_a_plan_does_not_outlive_a_silence_in_the_delay_before_it_runs():
    operator = Operator()
    operator.to("delay")
    assert FAULTS["silent"](operator).mode == "hold"


def test_a_controller_lost_for_a_moment_changes_nothing():
    operator = Operator()
    operator.to("execute")
    assert operator.wait(0.08, right={"tracked": False}).motion == "execute"
    assert operator.wait(0.1, right={"tracked": True}).motion == "execute"


def test_motion_stops_within_150_ms_of_the_last_pose():
    operator = Operator()
    operator.to("execute")
    lost = operator.message.stamp
    while operator.step(right={"tracked": False}).motion == "execute":
        assert operator.message.stamp - lost < 0.15


def test_motion_stops_within_400_ms_of_the_last_word_of_a_client():
    operator = Operator()
    operator.to("execute")
    steps = 1
    while operator.step(seconds=0.0).motion == "execute":
        steps += 1
    assert steps / 60 < 0.4


def test_targets_in_a_table_are_named_and_no_plan_is_asked_for():
    operator = Operator()
    operator.wait(0.5, world=World("table", (TABLE,)))
    intent = operator.wait(0.3, left={"grip": True}, right={"grip": True, "position": (0.3, -1.05, 0.0)})
    assert (intent.targets.tip.reach, intent.targets.tip.obstacle) == ("blocked", "the table")
    intent = operator.step(right={"trigger": True})
    assert (intent.mode, intent.request) == ("aim", None)
    assert intent.notice == "tip target is inside the table"


def test_buttons_held_when_a_controller_appears_are_no_presses():
    operator = Operator()
    operator.to("stopped")
    operator.step(seconds=0.2, right={"tracked": False})
    assert operator.wait(0.2, right={"tracked": True, "primary": True}).mode == "stopped"
    operator.step(right={"primary": False})
    assert operator.step(right={"primary": True}).mode == "hold"


def test_a_target_around_which_a_solid_comes_just_before_the_trigger_is_no_target():
    """What was judged before the press was judged in a world without it."""
    operator = Operator()
    operator.wait(0.5)
    x, y, z = operator.wait(0.3, left={"grip": True}, right={"grip": True}).targets.tip.position
    table = Obstacle("the table", (x - 0.1, y - 0.1, z - 0.1), (x + 0.1, y + 0.1, z + 0.1))
    operator.step(world=World("a table was moved there", (table,)))
    intent = operator.step(right={"trigger": True})
    assert intent.mode == "aim"
    assert intent.request is None
    assert "inside the table" in intent.notice
