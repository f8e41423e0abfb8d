"""What has changed since a plan was asked for, and what is a plan: each term decides by itself, in each mode in which
it counts and in no other."""

from dataclasses import replace

import pytest

from tests.support.operator import REFERENCE, config
from trunkline.ar.teleop.events import answered, changed_since, detect_events, refusal, takes_offer
from trunkline.ar.teleop.messages import (
    Controller,
    ExecutorReport,
    Input,
    Offer,
    PlanReport,
    Pose,
    Request,
    Target,
    Targets,
    World,
)
from trunkline.ar.teleop.recorder import PLAN
from trunkline.ar.teleop.state import Pinned, TeleoperationState
from trunkline.ar.teleop.tracked_controller import Hand
from trunkline.ar.teleop.transitions import MODES
from trunkline.ar.teleop.vectors import DOWN

SETTINGS, PACKAGE, WORLD = config().core, "a" * 64, World("world")
NEAR, FORWARD = 1e-6, (1.0, 0.0, 0.0, 0.0)
TARGETS = Targets(Target((0.5, 0.0, 0.5)), Target((0.6, 0.0, 0.2)), DOWN, 0.0, 0, 0.0, object="the cup")
REQUEST = Request(3, TARGETS, "world", PACKAGE)
ENDS = ((0.5, 0.0, 0.5), (0.6, 0.0, 0.2))
GRIPPING = Hand(0.6, buttons=("grip",), gripped_at=ENDS[0])
OPEN = Hand(0.6)
OFFER = Offer("the cup", (0.5, 0.0, 0.6), DOWN, 0.9)
PLANNED = ("plan", "preview", "ready", "delay", "execute", "follow")


def state(mode, **changes) -> TeleoperationState:
    return replace(
        TeleoperationState(GRIPPING, OPEN, mode, digest=PLAN, pinned=Pinned(REQUEST, REFERENCE, WORLD)), **changes
    )


def heard(**changes) -> Input:
    hand = Controller((0.0, 0.0, 0.0), FORWARD)
    message = Input(100.0, hand, hand, REFERENCE, (0.0,) * 7, WORLD, PACKAGE, PlanReport(3, PLAN, "", PACKAGE, "world"),
                  PLAN)  # fmt: skip
    return replace(message, **changes)


def aside(by: float):
    """Ends of the rays, the left one `by` m from where its grip was pressed."""
    (x, y, z), right = ENDS
    return (x, y + by, z), right


PRESSED = replace(OPEN, pressed=("primary",), buttons=("primary",))
CHANGES = {  # what changes: of the state, of what is heard, the ends, what is said, and in which modes
    "nothing": ({}, {}, ENDS, "", ()),
    "world": ({}, {"world": World("other")}, ENDS, "world changed", PLANNED),
    "world of the same digest": ({}, {"world": World("world", (), ("cup",))}, ENDS, "world changed", PLANNED),
    "alignment": (
        {}, {"alignment": Pose((0.0, 0.0, 0.0), FORWARD)}, ENDS, "base alignment changed", PLANNED
    ),
    "alignment lost": ({}, {"alignment": None}, ENDS, "base alignment changed", PLANNED),
    "another plan shown": ({}, {"shown": "e" * 64}, ENDS, "another plan was shown", ("ready", "delay")),
    "no plan shown any more": ({}, {"shown": ""}, ENDS, "another plan was shown", ("ready", "delay")),
    "offer taken": ({"left": PRESSED}, {"offer": OFFER}, ENDS, "the offer was taken", ("preview", "ready")),
    "ray moved": ({}, {}, aside(SETTINGS.moved + NEAR), "target moved", ("plan", "preview", "ready")),
    "ray moved by less": ({}, {}, aside(SETTINGS.moved - NEAR), "", ()),
    "ray moved, not held": ({"left": replace(GRIPPING, buttons=())}, {}, aside(1.0), "", ()),
    "ray moved, grip of before": ({"left": replace(GRIPPING, gripped_at=None)}, {}, aside(1.0), "", ()),
    "ray gone": ({}, {}, (None, ENDS[1]), "", ()),
    "other ray moved": (
        {"left": OPEN, "right": replace(GRIPPING, gripped_at=ENDS[1])}, {}, (ENDS[0], (0.6, 0.1, 0.2)), "target moved",
        ("plan", "preview", "ready"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("mode", PLANNED)
@pytest.mark.parametrize("name", CHANGES)
def test_what_voids_a_plan(name, mode):
    changes, fields, ends, expected, modes = CHANGES[name]
    reason = changed_since(state(mode, **changes), heard(**fields), ends, SETTINGS)
    assert reason == (expected if mode in modes else "")


@pytest.mark.parametrize("mode", MODES)
def test_where_no_plan_was_asked_for_nothing_is_void(mode):
    message = heard(world=World("other"), alignment=None, shown="e" * 64, offer=OFFER)
    assert changed_since(state(mode, pinned=None, left=PRESSED), message, aside(1.0), SETTINGS) == ""


def test_of_several_changes_the_first_is_told():
    order = [
        ({"world": World("other")}, "world changed"), ({"alignment": None}, "base alignment changed"),
        ({"offer": OFFER}, "the offer was taken"), ({"shown": "e" * 64}, "another plan was shown"),
        ({}, "target moved"),
    ]  # fmt: skip
    right = replace(GRIPPING, gripped_at=ENDS[1])
    ends = (ENDS[0], (0.6, 0.1, 0.2))
    for first, (_, reason) in enumerate(order):
        fields = {name: value for change, _ in order[first:] for name, value in change.items()}
        assert changed_since(state("ready", left=PRESSED, right=right), heard(**fields), ends, SETTINGS) == reason


@pytest.mark.parametrize(
    ("hand", "offer", "pinned", "takes"),
    [
        (PRESSED, OFFER, True, True),
        (OPEN, OFFER, True, False),
        (replace(PRESSED, buttons=("primary", "grip")), OFFER, True, False),
        (replace(PRESSED, pressed=()), OFFER, True, False),
        (PRESSED, None, True, False),
        (PRESSED, replace(OFFER, object="the box"), True, False),
        (PRESSED, OFFER, False, False),
    ],
)
def test_an_offer_is_taken_by_the_rigid_hand_with_its_grip_let_go(hand, offer, pinned, takes):
    before = state("preview", left=hand)
    before = before if pinned else replace(before, pinned=None)
    assert takes_offer(before, heard(offer=offer), SETTINGS) == takes
    other = replace(before, left=OPEN, right=hand)
    assert not takes_offer(other, heard(offer=offer), SETTINGS)


REPORTS = [
    (PlanReport(3, PLAN, "", PACKAGE, "world"), True, ""),
    (PlanReport(2, PLAN, "", PACKAGE, "world"), False, ""),
    (PlanReport(4, PLAN, "", PACKAGE, "world"), False, ""),
    (None, False, ""),
    (PlanReport(3, PLAN, "", "b" * 64, "world"), True, "no plan: it was made for another package or world"),
    (PlanReport(3, PLAN, "", PACKAGE, "other"), True, "no plan: it was made for another package or world"),
    (PlanReport(3, "", "", PACKAGE, "world"), True, "no plan: it has no digest"),
    (PlanReport(3, "", "out of reach", PACKAGE, "world"), True, "no plan: out of reach"),
    (PlanReport(3, PLAN, "out of reach", PACKAGE, "world"), True, "no plan: out of reach"),
    (PlanReport(3, "", "out of reach"), True, "no plan: out of reach"),
    (PlanReport(3, "", "", "b" * 64), True, "no plan: it was made for another package or world"),
]


@pytest.mark.parametrize(("report", "answer", "reason"), REPORTS)
def test_what_is_a_plan(report, answer, reason):
    message, waits = heard(plan=report), state("plan", waited=0.0)
    assert answered(waits, message) == answer
    assert refusal(waits, message, SETTINGS) == reason
    events, _ = detect_events(waits, message, TARGETS, ENDS, SETTINGS)
    assert events["planned"] == (answer and not reason)
    assert events["refused"] == bool(reason)


@pytest.mark.parametrize(("late", "mode", "refused"), [(-NEAR, "plan", ""), (NEAR, "plan", "no plan within 30 s"),
                                                       (NEAR, "preview", "")])  # fmt: skip
def test_a_plan_that_does_not_come_is_refused_after_a_while(late, mode, refused):
    waits = state(mode, waited=SETTINGS.safety.plan_wait + late)
    assert refusal(waits, heard(plan=None), SETTINGS) == refused
    assert refusal(waits, heard(), SETTINGS) == ""


def event(name: str, before: TeleoperationState, message: Input, targets=TARGETS) -> bool:
    return detect_events(before, message, targets, ENDS, SETTINGS)[0][name]


RUNS = {"mode": "execute", "running": True}
GRIPPED, LET_GO = {"left": GRIPPING}, {"left": OPEN}


def trigger(**changes) -> Hand:
    return replace(OPEN, pressed=("trigger",), buttons=("trigger",), **changes)


def sides(by: float) -> float:
    return SETTINGS.safety.settle + by


EVENTS = [
    ("done", RUNS, {"executor": ExecutorReport("done", PLAN)}, True),
    ("done", RUNS | {"running": False}, {"executor": ExecutorReport("done", PLAN)}, False),
    ("done", RUNS, {"executor": ExecutorReport("done", "e" * 64)}, False),
    ("done", RUNS, {"executor": ExecutorReport("running", PLAN)}, False),
    ("done", RUNS, {"executor": ExecutorReport("idle", PLAN)}, False),
    ("shown", {"mode": "preview"}, {}, True),
    ("shown", {"mode": "preview"}, {"shown": "e" * 64}, False),
    ("shown", {"mode": "preview", "digest": ""}, {"shown": ""}, False),
    ("confirm", {"mode": "ready", "right": trigger()} | GRIPPED, {}, True),
    ("confirm", {"mode": "ready", "right": trigger()} | LET_GO, {}, False),
    ("confirm", {"mode": "ready", "right": replace(trigger(), pressed=())} | GRIPPED, {}, False),
    ("released", RUNS | GRIPPED, {}, False),
    ("released", RUNS | LET_GO, {}, True),
    ("released", RUNS | LET_GO | {"right": GRIPPING}, {}, False),
    ("elapsed", {"mode": "delay", "waited": SETTINGS.delay}, {}, True),
    ("elapsed", {"mode": "delay", "waited": SETTINGS.delay - NEAR}, {}, False),
    ("settled", {"mode": "hold", "sound_for": sides(0.0)} | LET_GO, {}, True),
    ("settled", {"mode": "hold", "sound_for": sides(-NEAR)} | LET_GO, {}, False),
    ("settled", {"mode": "hold", "sound_for": sides(9.0)} | GRIPPED, {}, False),
    ("settled", {"mode": "hold", "sound_for": sides(9.0), "right": trigger()} | LET_GO, {}, False),
    ("fault", RUNS, {"executor": ExecutorReport("fault", PLAN, "reflex")}, True),
    ("fault", RUNS, {"executor": ExecutorReport("fault", PLAN)}, True),
    ("fault", {"mode": "execute", "waited": SETTINGS.safety.start_wait + NEAR}, {}, True),
    ("fault", {"mode": "execute", "waited": SETTINGS.safety.start_wait - NEAR}, {}, False),
    ("fault", RUNS | {"waited": 9.0}, {"executor": ExecutorReport("running", PLAN)}, False),
    ("fault", {"mode": "delay", "waited": 9.0}, {}, False),
    ("stop", RUNS, {"left": Controller((0.0, 0.0, 0.0), FORWARD, secondary=True)}, True),
    ("stop", RUNS, {"right": Controller((0.0, 0.0, 0.0), FORWARD, tracked=False, secondary=True)}, True),
    ("stop", RUNS, {"right": Controller((0.0, 0.0, 0.0), FORWARD, primary=True, trigger=True, grip=True)}, False),
    ("follow", {"mode": "aim", "right": replace(OPEN, pressed=("stick_pressed",))} | GRIPPED, {}, True),
    ("follow", {"mode": "aim", "right": replace(OPEN, pressed=("stick_pressed",))} | LET_GO, {}, False),
    ("ask", {"mode": "aim", "right": trigger(), "stamp": 100.0, "history": ((99.0, TARGETS),)} | GRIPPED, {}, True),
    ("ask", {"mode": "aim", "right": trigger(), "stamp": 100.0} | GRIPPED, {}, False),
    ("void", {"mode": "plan"}, {}, False),
]


@pytest.mark.parametrize(("name", "before", "fields", "expected"), EVENTS)
def test_when_an_event_has_happened(name, before, fields, expected):
    before = dict(before)
    assert event(name, state(before.pop("mode"), **before), heard(**fields)) == expected


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


@pytest.mark.parametrize(("reach", "turned"), [("outside", 0.0), ("blocked", 0.0), ("inside", None)])
def test_what_is_out_of_reach_is_neither_asked_for_nor_followed(reach, turned):
    beyond = replace(TARGETS, tip=replace(TARGETS.tip, reach=reach), turned=turned)
    asking = state("aim", right=trigger(), stamp=100.0, history=((99.0, beyond),))
    assert not event("ask", asking, heard(), TARGETS)
    assert not event("follow", state("aim", right=replace(OPEN, pressed=("stick_pressed",))), heard(), beyond)


NEEDED = "both targets are needed: hold a grip to set each"


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("button", "hand", "targets", "notice"),
    [
        ("trigger", GRIPPING, None, NEEDED),
        ("stick_pressed", GRIPPING, None, NEEDED),
        ("stick_pressed", OPEN, TARGETS, "hold a grip to follow"),
        ("stick_pressed", GRIPPING, TARGETS, ""),
        ("primary", GRIPPING, None, ""),
    ],
)
def test_what_was_asked_for_in_vain_is_said_as_one_aims_and_only_then(mode, button, hand, targets, notice):
    before = state(mode, left=hand, right=replace(OPEN, pressed=(button,)), pinned=None, stamp=100.0, waited=0.0)
    _, line = detect_events(before, heard(), targets, ENDS, SETTINGS)
    usual = {"grips let go; holding", "robot: no reason given; stopped"}
    assert line == (notice if mode == "aim" else "") or (mode != "aim" and line in usual)


@pytest.mark.parametrize(
    ("mode", "fields", "changes", "notice"),
    [
        ("execute", {"executor": ExecutorReport("fault", PLAN, "reflex")}, RUNS, "robot: reflex; stopped"),
        ("execute", {"executor": ExecutorReport("fault", PLAN)}, RUNS, "robot: no reason given; stopped"),
        ("execute", {}, {"waited": 9.0}, "robot: did not start within 1 s; stopped"),
        ("execute", {"world": World("other")}, RUNS, "world changed; the plan is void"),
        ("execute", {}, RUNS | LET_GO, "grips let go; holding"),
        ("plan", {"plan": PlanReport(3, "", "out of reach")}, {}, "no plan: out of reach"),
        ("execute", {"left": Controller((0.0, 0.0, 0.0), FORWARD, secondary=True)}, RUNS,
         "stopped; primary button goes on"),
        ("execute", {"left": Controller((0.0, 0.0, 0.0), FORWARD, secondary=True),
                     "executor": ExecutorReport("fault", PLAN, "reflex")}, RUNS, "stopped; primary button goes on"),
    ],
)  # fmt: skip
def test_what_is_said_of_what_happened(mode, fields, changes, notice):
    changes = {name: value for name, value in changes.items() if name != "mode"}
    assert detect_events(state(mode, **changes), heard(**fields), TARGETS, ENDS, SETTINGS)[1] == notice
