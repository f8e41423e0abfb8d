"""When the assistant is asked, and what it may offer: a place that holds more surely than the user's, or nothing."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.ar.teleop.test_plan import targets
from trunkline.ar.hybrid.outcomes import Holding
from trunkline.ar.hybrid.uncertainty import GraspUncertainty
from trunkline.ar.preview import grasp_preview
from trunkline.ar.preview.grasp_preview import GraspPreviewer
from trunkline.ar.session.settings import SessionConfig
from trunkline.ar.teleop.messages import World, WorldObject
from trunkline.ar.teleop.plan import Plan
from trunkline.pipeline.config import PROJECT, load_folder

SETTINGS = replace(load_folder(SessionConfig, PROJECT / "conf/live").preview, sure=0.9, assistant=2, hold=1.0)
CUP = WorldObject("the cup", "cylinder", 0.05, 0.1, 0.1, (0.6, 0.0, 0.2))
MOUNT = (0.55, 0.0, 0.5)
PLACES = np.array([[-0.04, 0.0, 0.32], [-0.06, 0.0, 0.3], [-0.03, 0.0, 0.3]])  # of the mount about the cup, m
ROWS, STEP = 301, 0.01
PLAN = Plan(
    STEP, np.zeros((ROWS, 7)), np.zeros((ROWS, 3)), (("approach", 0), ("curl", 100), ("lift", 200)), "package", "world"
)


class Grip:
    """`turned`: the rotation and the place for which it was asked."""

    rise = 0.3

    def near(self, rotation, mount, diameter):
        self.turned = rotation, mount, diameter
        return PLACES


class Tried:
    """What `preview` and `try_places` were called with, in place of any physics."""

    def __init__(self, monkeypatch, probability, shares, again=None):
        self.previewed, self.places = [], []
        monkeypatch.setattr(grasp_preview, "compose_twin", lambda *arguments: arguments)
        monkeypatch.setattr(grasp_preview, "preview", self._preview)
        monkeypatch.setattr(grasp_preview, "try_places", self._try)
        self._probability, self._shares, self._again = probability, shares, shares if again is None else again

    def _preview(self, twin, way, doubts, holding, count, seed, go_on):
        self.previewed.append((way, holding, count, seed))
        return SimpleNamespace(probability=self._probability)

    def _try(self, twin, way, doubts, holding, offsets, count, seed, go_on):
        self.places.append((way, holding, offsets, count, seed))
        away = PLACES - (np.array(MOUNT) - CUP.position)
        at = [int(np.abs(away - offset).sum(axis=1).argmin()) for offset in offsets]
        return np.array(self._shares if len(self.places) == 1 else self._again)[at]


def grasped(monkeypatch, probability, shares=(0.0, 0.0, 0.0), again=None, **settings):
    """What is foreseen of a grasp whose futures hold with this `probability`, the places' with these `shares`, and with
    those of `again` where they are tried once more."""
    tried, grip = Tried(monkeypatch, probability, shares, again), Grip()
    robot_model = SimpleNamespace(uncertainty=GraspUncertainty(), lean=lambda hangs: None)
    made = GraspPreviewer(robot_model, {"hanging": grip}, replace(SETTINGS, **settings))
    asked = replace(targets(MOUNT, CUP.position), object=CUP.name)
    return list(made.grasp(PLAN, asked, CUP, World("world", (), (CUP,)), None, 7)), tried, grip


@pytest.mark.parametrize(
    ("probability", "shares", "place"),
    [
        (0.5, (0.5, 0.5, 0.5), None),  # as sure as where the user has it: nothing better
        (0.5, (0.4, 0.0, 0.49), None),
        (0.5, (0.0, 0.51, 0.0), 1),
        (0.5, (0.6, 0.7, 1.0), 2),
        (0.0, (0.0, 0.0, 0.0), None),
        (0.0, (0.1, 0.0, 0.0), 0),
        (0.89, (0.0, 0.88, 0.9), 2),
    ],
)
def test_only_what_holds_more_surely_is_offered(monkeypatch, probability, shares, place):
    (first, last), _, _ = grasped(monkeypatch, probability, shares)
    assert first.offer is None
    assert last.probability == first.probability == probability
    if place is None:
        assert last.offer is None
    else:
        assert last.offer.object == CUP.name
        assert last.offer.probability == shares[place]
        assert last.offer.rigid == pytest.approx(tuple(np.array(CUP.position) + PLACES[place]))
        assert last.offer.pointing == (0.0, 0.0, -1.0)


@pytest.mark.parametrize(
    ("again", "place", "probability"),
    [
        ((0.5, 0.75, 1.0), 1, 0.75),  # the third was not among the best two, so nobody asks it again
        ((0.7, 0.6, 0.0), 0, 0.7),
        ((0.5, 0.5, 1.0), None, None),
    ],
)
def test_what_is_offered_is_as_sure_as_it_was_when_it_was_tried_once_more(monkeypatch, again, place, probability):
    """Of few futures of many places the best seems surer than it is."""
    (_, last), tried, _ = grasped(monkeypatch, 0.5, (1.0, 0.75, 0.5), again)
    assert len(tried.places[1][2]) == 2
    assert (last.offer and last.offer.probability) == probability
    if place is not None:
        assert last.offer.rigid == pytest.approx(tuple(np.array(CUP.position) + PLACES[place]))


def test_of_places_that_seem_as_sure_the_nearest_two_are_tried_once_more_and_the_nearest_is_offered(monkeypatch):
    (_, last), tried, _ = grasped(monkeypatch, 0.2, (0.8, 0.8, 0.8))
    (_, _, offsets, _, _), (_, _, few, _, _) = tried.places
    order = np.argsort(np.linalg.norm(offsets, axis=1))
    assert (order[0], order[-1]) == (1, 0), "a sort by shares alone would leave out the third, and offer the first"
    np.testing.assert_allclose(few, offsets[order[:2]])
    assert last.offer.rigid == pytest.approx(tuple(np.array(CUP.position) + PLACES[1]))


@pytest.mark.parametrize(
    ("probability", "assistant", "asked"), [(0.89, 2, True), (0.9, 2, False), (1.0, 2, False), (0.0, 0, False)]
)
def test_it_is_asked_where_a_grasp_is_not_sure_to_hold_and_there_is_one(monkeypatch, probability, assistant, asked):
    foreseen, tried, _ = grasped(monkeypatch, probability, (1.0, 1.0, 1.0), assistant=assistant)
    assert len(foreseen) == 1 + asked
    assert len(tried.places) == 2 * asked


def test_places_are_tried_as_the_plan_is_with_other_futures(monkeypatch):
    """From where the arm closes on, and until it has held for a while; about the middle of what is grasped."""
    _, tried, grip = grasped(monkeypatch, 0.0)
    ((way, holding, count, seed),), ((same, again, offsets, few, other), last) = tried.previewed, tried.places
    assert way is same is last[0]
    assert (last[1], last[3]) == (holding, SETTINGS.futures)
    assert len({seed, other, last[4]}) == 3
    assert holding == again == Holding(PLAN.duration - 1.0, SETTINGS.sag, SETTINGS.slip, SETTINGS.lifted)
    assert way.duration == pytest.approx(PLAN.duration - 1.0 + SETTINGS.hold)
    assert (count, few) == (SETTINGS.futures, SETTINGS.assistant)
    np.testing.assert_allclose(offsets, PLACES - (np.array(MOUNT) - CUP.position))
    np.testing.assert_allclose(grip.turned[1], np.array(MOUNT) - CUP.position)
    assert grip.turned[2] == CUP.diameter
