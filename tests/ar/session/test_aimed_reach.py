"""A reach ends at its target by its preview: of a small arm that leans on its mount, and whose cables rub."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.ar.session.test_correction_steps import BEYOND, BOUNDS
from tests.ar.session.test_preview_process import made, order
from tests.ar.teleop.test_plan import MOUNT, OFFSET, START
from tests.support.small_arm import small_spec
from trunkline.ar.session import previewer
from trunkline.ar.session.correction_rests import MeasuredRest
from trunkline.ar.session.correction_steps import DOWN
from trunkline.ar.session.previewer import FollowRequest, PlanAnswer, PredictionAnswer, PreviewPlanner
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.model.arm.guide_holes import GuideHoles, add_holes
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated

HANGS = np.array([0.012, -0.006, -0.5])  # a degree and a half
CALM = 15.0  # times the small arm's damping


@cache
def planning(friction: float = 0.1) -> PreviewPlanner:
    spec = small_spec()
    add_holes(spec, GuideHoles(friction, 2))
    for joint in spec.joints:
        joint.damping *= CALM
    robot_model = replace(made().robot_model, arm=spec, lacking=BEYOND)
    chain = read_chain(spec.copy().compile()).smooth
    settings = replace(made().foresight.settings, futures=1, step=0.002, hold=3.0)
    return PreviewPlanner(
        replace(made().planner, chain=chain), replace(made().foresight, robot_model=robot_model, settings=settings), ()
    )


def target(planning: PreviewPlanner) -> tuple[float, float, float]:
    place, turn = base_frames(START, OFFSET)
    chain = planning.planner.chain
    commands = chain.straight_lengths - [0.02, -0.05, -0.05]
    tip = np.array(MOUNT) + turn @ actuated(chain, commands[None], (DOWN @ turn)[None]).position[0]
    x, y, z = (float(value) for value in tip)
    return x, y, z


def answered(planning: PreviewPlanner, **wishes):
    """The plan and what is stated of it."""
    answers = list(planning.answers(replace(order(tip=target(planning)), **wishes)))
    plan = next(answer.plan for answer in answers if isinstance(answer, PlanAnswer))
    assert plan is not None, answers
    return plan, next(answer.prediction for answer in answers if isinstance(answer, PredictionAnswer))


@pytest.mark.parametrize("hangs", [None, HANGS])
def test_a_reach_ends_at_its_target_by_its_preview(monkeypatch, hangs):
    aimed = answered(planning(), hangs=hangs)[1]
    monkeypatch.setattr(previewer, "ROUNDS", 0)
    short = answered(planning(), hangs=hangs)[1]
    print(f"{1e3 * short.miss:.1f} mm short, then {1e3 * aimed.miss:.2f} mm")
    assert short.miss > 3e-3
    assert aimed.miss < 1.5e-3


def test_a_plan_is_for_an_arm_that_leans_as_it_is_seen_to(monkeypatch):
    """Without friction nothing is left that would have to be planned anew."""
    monkeypatch.setattr(previewer, "ROUNDS", 0)
    leaning = answered(planning(0.0), hangs=HANGS)[1]
    upright = answered(planning(0.0), hangs=None)[1]
    assert max(leaning.miss, upright.miss) < 2e-3


def test_a_plan_that_corrects_itself_stays_short_of_its_target():
    """Its steps then pull on."""
    bounds = replace(BOUNDS, target=target(planning()))
    plan, stated = answered(planning(), correction=bounds)
    assert plan.correction == bounds
    assert stated.miss > 3e-3


def test_an_arm_that_still_swings_is_not_aimed_by_where_it_is_then(monkeypatch):
    plan = answered(planning())[0]
    monkeypatch.setattr(previewer, "AIMED", 1e-9)
    planned_once = answered(planning())[0]
    monkeypatch.undo()
    monkeypatch.setattr(previewer, "ROUNDS", 0)
    assert answered(planning())[0].digest() == planned_once.digest() != plan.digest()


def test_what_is_learnt_of_an_arm_has_its_friction_in_it_already():
    """The arm is its twin: with a rest that says so, what is stated is where it ends, not that and its friction."""
    plan, stated = answered(planning())
    rest = MeasuredRest(plan.joints[-1], plan.commands[-1], np.array(stated.tip[-1]))
    again, says = answered(planning(), rests=(rest,))
    bare = planning().foresight.free(
        planning()._twin(order(), again.joints[0], again.commands[0]), planning().foresight.whole(again, False), None, 0
    )
    print(f"{1e3 * np.linalg.norm(np.array(says.tip[-1]) - bare.preview.shown[-1]):.2f} mm apart")
    assert np.linalg.norm(np.array(says.tip[-1]) - bare.preview.shown[-1]) < 1.5e-3
    assert says.miss < 1.5e-3


def test_who_is_followed_leans_too():
    previews, targets = planning(0.0), order(tip=target(planning(0.0))).request.targets
    asks = FollowRequest(1, targets, START, order().world, HANGS)
    leaning, upright = (next(previews.answers(request)).axes for request in (asks, replace(asks, hangs=None)))
    place, turn = base_frames(leaning[:7], OFFSET)
    lean, chain = previews.robot_model.lean(HANGS), previews.planner.chain
    tip = lean.apply(actuated(chain, leaning[None, 7:], lean.inv().apply(DOWN @ turn)[None]).position[0])
    assert np.linalg.norm(place + turn @ tip - targets.tip.position) < 1e-3
    assert np.linalg.norm(leaning - upright) > 1e-3
