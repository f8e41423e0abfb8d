"""What the simulated operator confirms, and what not: of a preview's tip, of a probability, of an offer."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rehearsal import settings
from rehearsal.experiments.bench import ORIGINS
from rehearsal.operator.hands import RayHand
from rehearsal.operator.scripts import HAND_OVERS, LIFTED, Ending, Operator, on_object, sure_enough
from rehearsal.session import REFERENCE, View
from trunkline.ar.teleop.messages import World

RADIUS, ACCEPT = 0.03, 0.75
PLANS = 3  # that the operator asks for before giving up
OBJECT = np.array([0.6, 0.1, 0.1])
BESIDE = np.array([-0.1, 0.0, 0.4])
RATE = 60.0  # Hz
MIDDLE = np.zeros(3)


@pytest.mark.parametrize(("off", "confirmed"), [
    ((0.0, 0.0, 0.0), True),
    ((np.nextafter(RADIUS, 0), 0.0, 0.0), True),
    ((RADIUS, 0.0, 0.0), False),
    ((0.0, -RADIUS, 0.0), False),
    ((0.02, 0.02, 0.02), False),  # each within, together beyond
    ((1.0, 0.0, 0.0), False),
    ((np.nan, 0.0, 0.0), False),
])  # fmt: skip
def test_a_tip_within_the_object_is_confirmed(off, confirmed):
    assert on_object(np.array(off), RADIUS) is confirmed


@pytest.mark.parametrize(("probability", "confirmed"), [
    (1.0, True), (ACCEPT, True), (np.nextafter(ACCEPT, 0), False), (0.0, False), (np.nan, False), (None, True),
])  # fmt: skip
def test_what_is_as_sure_as_asked_for_is_confirmed(probability, confirmed):
    assert sure_enough(probability, ACCEPT) is confirmed


class Shown:
    """A session that does as it is asked at once: rays end where hands aim, and each trigger goes one mode further.

    states: probabilities of the plans, one after the other, the last one for all others. offers: likewise of the
    assistant. tips: by how much previews' tips are beside the object, (3,), m, likewise. lifts: m, by what is run.
    """

    def __init__(self, states=(None,), offers=(None,), tips=(MIDDLE,), lifts: float = 1.0) -> None:
        rng = np.random.default_rng(0)
        person = replace(settings.person(), patience=PLANS, reaction_spread=0.0, disparity_deg=0.0)
        self.hands = [RayHand(origin, REFERENCE, person, 0.15, rng) for origin in ORIGINS]
        self.operator = Operator(person, tuple(self.hands), np.array([0.1, 0.0, -0.4]), RADIUS, 0.03, rng)
        self.states, self.offers, self.tips, self.lifts = list(states), list(offers), list(tips), lifts
        self.now, self.mode, self.object, self.executed, self.plans = 0.0, "aim", OBJECT.copy(), 0, 0
        self.before: set[str] = set()
        self.since = 0.0

    def view(self) -> View:
        self.now += 1 / RATE
        left, right = self.hands
        buttons = {f"right {name}" for name in right.pressed} | {f"left {name}" for name in left.pressed}
        pressed, self.before = buttons - self.before, buttons
        if self.mode == "aim" and "right trigger" in pressed:
            self._to("ready")
            self.plans += 1
        elif self.mode == "ready" and "right trigger" in pressed:
            self._to("execute")
            self.executed += 1
        elif self.mode == "ready" and pressed & {"left grip", "left primary"}:
            self._to("aim")
        elif self.mode == "execute" and self.now > self.since + 0.5:
            self.object = self.object + [0.0, 0.0, self.lifts]
            self._to("aim")
        tip = SimpleNamespace(position=tuple(right.goal), reach="inside", offer=None)
        rigid = SimpleNamespace(position=tuple(left.goal), reach="inside", offer=None)
        targets = SimpleNamespace(tip=tip, rigid=rigid)
        intent = SimpleNamespace(mode=self.mode, notice="", targets=targets, rays=(tuple(left.goal), tuple(right.goal)))
        view = View(self.now, intent, self.object, right.goal, None, World("w"))  # type: ignore[arg-type]
        if self.mode == "ready":
            view.previewed, view.probability = self.object + self._of(self.tips), self._of(self.states)
            offered = self._of(self.offers)
            view.offer = None if offered is None else SimpleNamespace(probability=offered)  # type: ignore[assignment]
        return view

    def _to(self, mode: str) -> None:
        self.mode, self.since = mode, self.now

    def _of(self, values: list):
        """Of the newest plan."""
        return values[min(self.plans, len(values)) - 1]

    def play(self, script) -> Ending:
        next(script)
        while self.now < 300.0:
            try:
                script.send(self.view())
            except StopIteration as end:
                return end.value
        raise AssertionError("the script did not end")


LOW, HIGH = np.nextafter(ACCEPT, 0), ACCEPT


@pytest.mark.parametrize(("states", "offers", "executed", "plans", "taken"), [
    ([HIGH], [None], 1, 1, 0),
    ([LOW, HIGH], [None], 1, 2, 0),
    ([LOW], [None], 0, PLANS, 0),
    ([0.0], [None], 0, PLANS, 0),
    ([np.nan], [None], 0, PLANS, 0),
    ([None], [None], 1, 1, 0),
    ([LOW, HIGH], [HIGH, None], 1, 2, 1),  # the offer is taken, and then confirmed
    ([LOW, LOW, HIGH], [LOW, None], 1, 3, 0),  # an offer that is no better is not
    ([LOW], [HIGH], 0, PLANS, PLANS),
    ([HIGH], [1.0], 1, 1, 0),
])  # fmt: skip
def test_a_grasp_is_run_only_where_its_preview_is_sure_enough(states, offers, executed, plans, taken):
    shown = Shown(states, offers)
    ending = shown.play(shown.operator.grasp(BESIDE, ACCEPT, 0.1))
    assert (shown.executed, ending.plans, ending.offers) == (executed, plans, taken)
    assert ending.done is (executed == 1)
    stated = states[min(plans, len(states)) - 1]
    expected = np.nan if stated is None or not executed else stated
    np.testing.assert_equal(ending.probability, expected)
    if not executed:
        last = "as sure to hold as its offer" if taken else "sure enough to hold"
        assert ending.why == f"aim: no preview was {last}"


@pytest.mark.parametrize(("states", "lifts", "executed", "why"), [
    ([HIGH, HIGH], 1.0, 2, ""),
    ([HIGH, LOW, HIGH], 1.0, 2, ""),
    ([HIGH, LOW], 1.0, 1, "aim: no preview was sure enough to rest"),
    ([HIGH, np.nan], 1.0, 1, "aim: no preview was sure enough to rest"),
    ([LOW], 1.0, 0, "aim: no preview was sure enough to hold"),
    ([HIGH, HIGH], LIFTED + 1e-6, 2, ""),
    ([HIGH, HIGH], LIFTED - 1e-6, 1, "slip: it was not lifted"),
    ([HIGH, HIGH], 0.0, 1, "slip: it was not lifted"),
])  # fmt: skip
def test_a_hand_over_is_run_only_after_a_lift_and_where_its_preview_is_sure_enough(states, lifts, executed, why):
    shown = Shown(states, lifts=lifts)
    ending = shown.play(
        shown.operator.handle(BESIDE, lambda view: np.array(view.intent.targets.tip.position), ACCEPT, 0.1)
    )
    assert (shown.executed, ending.done, ending.why) == (executed, executed == 2, why)
    assert ending.plans <= PLANS + HAND_OVERS


ON, OFF = np.array([0.0, 0.0, 0.9 * RADIUS]), np.array([0.0, 0.0, 1.1 * RADIUS])


@pytest.mark.parametrize(("tips", "executed", "plans"), [
    ([ON], 1, 1), ([OFF, ON], 1, 2), ([OFF], 0, PLANS), ([np.full(3, np.nan)], 0, PLANS),
])  # fmt: skip
def test_a_reach_is_run_only_where_its_preview_is_on_the_object(tips, executed, plans):
    shown = Shown(tips=tips)
    ending = shown.play(shown.operator.reach())
    assert (shown.executed, ending.plans, ending.done) == (executed, plans, executed == 1)


def test_an_operator_who_does_not_judge_runs_a_reach_whose_preview_is_beside():
    shown = Shown(tips=[OFF])
    shown.operator.judged = False
    assert shown.play(shown.operator.reach()).done
    assert shown.executed == 1
