"""The state machine: every transition of the table happens as it says, and whatever is not in it does not."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.operator import Everywhere, Operator
from trunkline.ar.teleop.messages import Pose
from trunkline.ar.teleop.reach import Reading
from trunkline.ar.teleop.recorder import PLAN
from trunkline.ar.teleop.transitions import EVENTS, MEANING, MODES, TRANSITIONS


@pytest.mark.parametrize("event", EVENTS)
@pytest.mark.parametrize("mode", MODES)
def test_every_event_leads_where_the_table_says_and_nowhere_else(mode, event):
    operator = Operator()
    before = operator.to(mode)
    assert before.mode == mode
    if mode == "hold" and event != "settled":  # all is well again, but a grip is held
        operator.step(left={"tracked": True, "grip": True})
    if mode == "delay" and event in ("done", "planned", "shown"):
        assert operator.state.waited < 0.1  # so that the delay does not end meanwhile
    after = operator.cause(event).mode
    expected = TRANSITIONS.get((mode, event), mode)
    # What a press means depends on the mode: one button, one event. A trigger asks or confirms, a stick follows or not;
    # nothing settles unless the grips are let go.
    same = {"ask": "confirm", "confirm": "ask", "follow": "unfollow", "unfollow": "follow", "settled": "released"}
    if (mode, event) not in TRANSITIONS and event in same:
        expected = TRANSITIONS.get((mode, same[event]), mode)
    assert after == expected


def test_table_and_meanings_name_the_same():
    assert set(MEANING) == set(EVENTS) == {event for _, event in TRANSITIONS}
    assert {mode for mode, _ in TRANSITIONS} == set(MODES) == {*TRANSITIONS.values()}


@pytest.mark.parametrize("mode", MODES)
def test_stop_and_loss_lead_out_of_every_mode_to_one_in_which_the_robot_holds(mode):
    assert mode == "stopped" or TRANSITIONS[mode, "stop"] == "stopped"
    assert mode in ("hold", "stopped") or TRANSITIONS[mode, "lost"] == "hold"
    operator = Operator()
    operator.to(mode)
    assert operator.step(left={"secondary": True}, seconds=0.2, right={"tracked": False}).motion == "hold"


@pytest.mark.parametrize("mode", [mode for mode in MODES if mode not in ("execute", "follow")])
def test_robot_holds_in_every_mode_but_two(mode):
    intent = Operator().to(mode)
    assert (intent.motion, intent.execute, intent.follow) == ("hold", "", None)


def test_only_what_was_shown_and_confirmed_is_executed():
    operator = Operator()
    assert operator.to("execute").execute == PLAN
    executed = [index for index, intent in enumerate(operator.intents) if intent.execute]
    first = executed[0]
    assert any(intent.preview == PLAN for intent in operator.intents[:first])
    assert operator.inputs[first].shown == PLAN
    assert {intent.execute for intent in operator.intents[first:]} == {PLAN}
    delay = [intent.countdown for intent in operator.intents if intent.mode == "delay"]
    assert delay[0] == pytest.approx(0.5)
    assert delay == sorted(delay, reverse=True)
    assert len(delay) == pytest.approx(0.5 * 60, abs=2)


def test_a_trigger_held_since_before_the_preview_ended_confirms_nothing():
    operator = Operator()
    operator.to("preview")
    operator.step(right={"trigger": True})
    assert operator.step(shown=PLAN).mode == "ready"
    assert operator.wait(0.2).mode == "ready"
    operator.step(right={"trigger": False})
    assert operator.step(right={"trigger": True}).mode == "delay"


def moved(operator):
    operator.step(left={"grip": False})
    operator.step(left={"grip": True})
    return operator.wait(0.5, left={"position": (0.0, 0.1, 0.0)})


VOIDS = {
    "target": moved,
    "world": lambda o: o.step(world=replace(o.message.world, digest="moved")),
    "alignment": lambda o: o.step(alignment=Pose((0.21, 0.0, 1.0), o.message.alignment.quaternion)),
    "package": lambda o: o.step(package="b" * 64),
    "preview": lambda o: o.step(shown="e" * 64),
}


# A grip is what keeps the delay running; the targets are those of the plan.
@pytest.mark.parametrize(
    ("mode", "change"),
    [
        (mode, change)
        for mode in ("preview", "ready", "delay")
        for change in VOIDS
        if (mode, change) not in (("delay", "target"), ("preview", "preview"))
    ],
)
def test_any_change_of_target_world_alignment_package_or_preview_voids_the_plan(mode, change):
    operator = Operator()
    operator.to(mode)
    intent = VOIDS[change](operator)
    assert intent.mode == ("hold" if change == "package" else "aim")
    assert operator.state.digest == ""
    # Neither the old report nor a press brings it back.
    operator.wait(0.1, left={"grip": True}, right={"grip": True, "trigger": False})
    operator.step(right={"trigger": True})
    operator.wait(1.0)
    assert all(intent.execute == "" for intent in operator.intents)


def test_a_hand_that_trembles_voids_nothing():
    operator = Operator()
    operator.to("ready")
    operator.step(left={"grip": False})
    operator.step(left={"grip": True})
    for i in range(60):
        intent = operator.step(left={"position": (0.004 * (i % 2), 0.0, 0.0)})
    assert intent.mode == "ready"


def test_a_robot_that_does_not_start_is_a_fault():
    operator = Operator()
    operator.to("delay")
    operator.wait(0.6, right={"trigger": False})
    assert operator.wait(1.2).mode == "stopped"
    assert operator.intents[-1].notice == "robot: did not start within 1 s; stopped"


def test_followed_targets_are_those_of_so_long_ago():
    operator = Operator(follow_delay=0.5)
    operator.to("follow")
    for i in range(90):
        operator.step(left={"position": (0.001 * i, 0.0, 0.0)})
    now = operator.message.stamp
    then = max(i for i, message in enumerate(operator.inputs) if message.stamp <= now - 0.5)
    assert operator.intents[-1].follow == operator.intents[then].targets
    assert operator.intents[-1].follow != operator.intents[-1].targets


class Offerless(Everywhere):
    """That knows no nearest point."""

    def rigid(self, mount, pointing):
        return super().rigid(mount, pointing)._replace(offer=None)


def test_out_of_reach_the_nearest_within_is_followed_and_said():
    operator = Operator(reach=Everywhere(1.4))
    operator.to("follow")
    before = np.array(operator.intents[-1].follow.rigid.position)
    intent = operator.wait(1.5, left={"position": (0.0, 0.0, -1.0)})
    assert intent.notice.endswith("mm out of reach; the robot goes to the nearest point within")
    assert (intent.motion, intent.follow.rigid.reach, intent.targets.rigid.reach) == ("follow", "inside", "inside")
    assert np.linalg.norm(intent.follow.rigid.position) == pytest.approx(1.4)
    assert np.linalg.norm(intent.follow.rigid.position - before) > 0.1
    assert operator.wait(0.5, left={"position": (0.0, 0.0, 0.0)}).notice == ""


def test_out_of_reach_of_all_that_is_known_the_last_within_is_followed_and_said():
    operator = Operator(reach=Offerless(1.4))
    operator.to("follow")
    inside = operator.intents[-1].follow
    intent = operator.wait(1.5, left={"position": (0.0, 0.0, -1.0)})
    assert intent.targets.rigid.reach == "outside"
    assert intent.notice.endswith("mm out of reach; the robot stays at the last within reach")
    assert (intent.motion, intent.follow.rigid.reach) == ("follow", "inside")
    assert inside.rigid.position != intent.targets.rigid.position


class Short(Everywhere):
    """Whose arm reaches all that is at most `deep` m below its mount."""

    def __init__(self, most, deep):
        super().__init__(most)
        self.deep = deep

    def soft(self, tip, gravity):
        depth = float(np.dot(tip, gravity))
        if depth <= self.deep:
            return Reading("inside")
        nearest = np.array(tip) - (depth - self.deep + 1e-9) * np.array(gravity)
        return Reading("outside", depth - self.deep, tuple(map(float, nearest)))


@pytest.mark.parametrize("deep", [0.5, 1.0])
def test_the_mount_goes_to_its_nearest_point_first_and_then_the_tip_where_it_is_still_too_far(deep):
    """From where the mount was wanted the tip would be out of reach; from where it goes it may be within."""
    operator = Operator(reach=Short(1.4, deep))
    operator.to("follow")
    operator.wait(1.5, left={"position": (0.0, 3.0, 0.0)})
    wanted = operator.core._targets(operator.state, operator.message)
    assert (wanted.rigid.reach, wanted.tip.reach) == ("outside", "outside")
    followed = operator.intents[-1].follow
    mount, tip = np.array(followed.rigid.position), np.array(followed.tip.position)
    assert np.linalg.norm(mount) == pytest.approx(1.4)
    depth = mount[2] - np.array(wanted.tip.position)[2]
    assert (depth <= deep) == (deep == 1.0)
    assert mount[2] - tip[2] == pytest.approx(min(depth, deep))
    np.testing.assert_allclose(tip[:2], wanted.tip.position[:2], atol=1e-9)
