"""Steps of a correction as the process that plans makes them: of a small arm that is not as its twin."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.ar.session.test_controller import some_plan
from tests.ar.session.test_preview_process import made
from tests.ar.session.test_preview_process import order as plain
from tests.ar.teleop.test_plan import OFFSET, START, request
from tests.support.small_arm import small_spec
from trunkline.ar.correction.correction import CorrectionSettings
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session.correction_steps import (
    DOWN,
    CorrectionAnswer,
    CorrectionOrder,
    CorrectionSteps,
    why_uncorrected,
)
from trunkline.ar.session.previewer import PlanAnswer, PreviewBegun, PreviewPlanner
from trunkline.ar.teleop.alignment import base_quaternion
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.ar.teleop.messages import Obstacle, WorldObject
from trunkline.ar.teleop.plan import CorrectionBounds
from trunkline.frames import rotation_from_wxyz
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated
from trunkline.twin.discrepancy import Discrepancy, Lacking

SETTINGS = CorrectionSettings()
WORLD = make_world(())
CHAIN = read_chain(small_spec().compile()).smooth
PLANNER = replace(made().planner, chain=CHAIN)
assert np.allclose(PLANNER.straight, CHAIN.straight_lengths)
BEYOND = Lacking("", Discrepancy(np.array([[0.01, 0.0, 0.0]]), 16), 180.0, 180.0, 1.0, 4.0)


def tip_of(chain, commands):
    """In the base frame."""
    place, turn = base_frames(START, OFFSET)
    return place + turn @ actuated(chain, commands[None], DOWN @ turn).position[0]


def pulled(*pulls):
    return CHAIN.straight_lengths - np.array(pulls)


def order(number, commands, tip, target, **changes):
    bounds = CorrectionBounds(tuple(map(float, target)), SETTINGS.steps, SETTINGS.longest, SETTINGS.astray)
    arguments = {"bounds": bounds, "settings": SETTINGS} | changes
    joints, world = START, changes.pop("world", WORLD)
    arguments.pop("world", None)
    return CorrectionOrder(
        7, number, joints=joints, commands=commands, tip=tip, world=world, package="p" * 64, **arguments
    )


ARMS = {
    "bent at rest": CHAIN._replace(rest=CHAIN.rest + 0.02),
    "soft cables": CHAIN._replace(gain=0.3 * CHAIN.gain),
    "heavier": CHAIN._replace(mass=2 * CHAIN.mass),
}


@pytest.mark.parametrize("name", ARMS)
def test_steps_bring_an_arm_that_is_not_as_its_twin_to_the_target_within_their_bounds(name):
    arm, steps, commands = ARMS[name], CorrectionSteps(PLANNER, BEYOND), pulled(0.02, 0, 0)
    target, errors = tip_of(CHAIN, commands), []
    begin = commands
    for number in range(SETTINGS.steps + 2):
        tip = tip_of(arm, commands)
        errors.append(np.linalg.norm(tip - target))
        answer = steps.answer(order(number, commands, tip, target))
        assert (answer.serial, answer.number) == (7, number)
        if answer.plan is None:
            break
        plan = answer.plan
        np.testing.assert_array_equal(plan.commands[0], commands)
        np.testing.assert_array_equal(plan.joints, np.tile(START, (len(plan.joints), 1)))
        assert np.linalg.norm(plan.commands - commands, axis=1).max() <= SETTINGS.longest + 1e-12
        assert np.linalg.norm(plan.commands - begin, axis=1).max() <= SETTINGS.steps * SETTINGS.longest
        speed = np.abs(np.diff(plan.commands, axis=0)).max() / plan.step
        assert speed <= PLANNER.limits.velocity[7]
        assert (plan.world, plan.correction) == (WORLD.digest, None)
        commands = plan.commands[-1]
    print(f"errors, mm: {np.round(1e3 * np.array(errors), 2)}; {answer.ended}")
    assert errors[0] > 1.2e-3
    assert errors[-1] < 0.5 * errors[0]
    assert answer.ended


def test_the_soft_base_is_the_one_by_which_plans_are_made():
    plan = PLANNER.plan(request((0.5, 0.1, 0.5), tuple(tip_of(CHAIN, pulled(0.02, 0, 0)) - base_frames(START, OFFSET)[0]
                                                       + (0.5, 0.1, 0.5))), WORLD, START, PLANNER.straight)  # fmt: skip
    place, turn = base_frames(plan.joints[-1], OFFSET)
    np.testing.assert_allclose(
        turn, rotation_from_wxyz(np.array(base_quaternion((0, 0, -1), 0.0))).as_matrix(), atol=1e-3
    )
    assert np.linalg.norm(place - (0.5, 0.1, 0.5)) < 0.02


def test_the_way_back_is_taken_where_the_last_step_led_away_and_is_no_longer_than_a_step():
    once = iter([""])  # of the way back it is not asked
    steps = CorrectionSteps(PLANNER, SimpleNamespace(beyond=lambda pulls, tilt_deg: next(once)))
    commands = pulled(0.02, 0, 0)
    tip = tip_of(CHAIN, commands)
    target = tip + np.array([5e-3, 0, 0])
    first = steps.answer(order(0, commands, tip, target, settings=replace(SETTINGS, steps=1)))
    there = first.plan.commands[-1]
    worse = order(1, there, tip - np.array([5e-3, 0, 0]), target, settings=replace(SETTINGS, steps=1))
    back = steps.answer(worse)
    assert back.ended == "1 steps are done"
    np.testing.assert_allclose(back.plan.commands[-1], commands, atol=1e-12)
    again = CorrectionSteps(PLANNER, BEYOND)
    again.answer(order(0, commands, tip, target, settings=replace(SETTINGS, steps=1)))
    short = again.answer(replace(worse, bounds=replace(worse.bounds, longest=1e-4)))
    assert np.linalg.norm(short.plan.commands[-1] - there) == pytest.approx(1e-4)


def test_no_step_is_longer_than_its_bound_where_a_loose_cable_lies_farther_away():
    loose = pulled(0.02, 0, 0)
    loose[1:] = actuated(CHAIN, (loose + [0, 0.05, 0.05])[None], DOWN).lengths[0, 1:] + 8e-3
    tip = tip_of(CHAIN, loose)
    for aside in (5e-3, -5e-3):
        plan = CorrectionSteps(PLANNER, BEYOND).answer(order(0, loose, tip, tip + np.array([0, aside, 0]))).plan
        assert np.linalg.norm(plan.commands[-1] - loose) <= SETTINGS.longest + 1e-12
        assert (plan.commands[-1, 1:] < loose[1:]).any()


def test_a_step_into_an_obstacle_is_none():
    commands = pulled(0.02, 0, 0)
    tip = tip_of(CHAIN, commands)
    low, high = tip - 0.05, tip + 0.05
    wall = Obstacle("the wall", tuple(map(float, low)), tuple(map(float, high)))
    answer = CorrectionSteps(PLANNER, BEYOND).answer(
        order(0, commands, tip, tip + np.array([5e-3, 0, 0]), world=make_world((wall,)))
    )
    assert answer.plan is None
    assert answer.ended.startswith("world: the arm")


@pytest.mark.parametrize(
    ("bounds", "reason"),
    [
        ({"pull": 0.0201}, "a motor pulls 2.* mm, in trials up to 20.1 mm"),
        ({"pulls": 0.0201}, "motors pull 2.* mm together, in trials up to 20.1 mm"),
        ({"pulled_tilt_deg": -1.0}, "mount tilted by 0°, trials with pulls up to -1°"),
    ],
)
def test_a_step_beyond_what_trials_went_up_to_is_not_sent(bounds, reason):
    commands = pulled(0.02, 0, 0)
    tip = tip_of(CHAIN, commands)
    further = order(0, commands, tip, tip_of(CHAIN, pulled(0.023, 0, 0)))
    sent = CorrectionSteps(PLANNER, BEYOND).answer(further)
    assert (PLANNER.straight - sent.plan.commands[-1]).max() > 0.0201
    answer = CorrectionSteps(PLANNER, replace(BEYOND, **bounds)).answer(further)
    assert answer.plan is None
    assert re.fullmatch(reason, answer.ended), answer.ended
    unsaid = CorrectionSteps(PLANNER, None).answer(further)
    assert (unsaid.plan, unsaid.ended) == (None, UNTRIED)


def test_before_a_later_step_that_would_go_beyond_the_best_commands_come_back():
    commands = pulled(0.02, 0, 0)
    tip = tip_of(CHAIN, commands)
    target = tip_of(CHAIN, pulled(0.023, 0, 0))
    words = iter(["", "beyond"])  # of the first step, and of the second
    steps = CorrectionSteps(PLANNER, SimpleNamespace(beyond=lambda pulls, tilt_deg: next(words)))
    there = steps.answer(order(0, commands, tip, target)).plan.commands[-1]
    back = steps.answer(order(1, there, tip + 0.1 * (tip - target), target))
    assert back.ended == "beyond"
    np.testing.assert_allclose(back.plan.commands[-1], commands, atol=1e-12)


@pytest.mark.parametrize("changes", [{"serial": 8}, {"number": 2}, {"number": 1}])
def test_what_it_does_not_know_of_is_no_step(changes):
    steps, commands = CorrectionSteps(PLANNER, BEYOND), pulled(0.02, 0, 0)
    tip = tip_of(CHAIN, commands)
    later = replace(order(1, commands, tip, tip + np.array([5e-3, 0, 0])), **changes)
    assert steps.answer(later) == CorrectionAnswer(
        later.serial, later.number, None, "the process that plans has lost it"
    )


def test_a_package_without_statics_has_no_step():
    commands = pulled(0.02, 0, 0)
    tip = tip_of(CHAIN, commands)
    answer = CorrectionSteps(replace(PLANNER, chain=None), BEYOND).answer(order(0, commands, tip, tip + 5e-3))
    assert (answer.plan, answer.ended) == (None, "the process that plans has lost it")


def test_a_step_that_changes_nothing_is_none():
    steps, commands = CorrectionSteps(PLANNER, BEYOND), pulled(0.02, 0, 0)
    steps._measured = lambda order: SimpleNamespace(commands=order.commands, ended="")
    answer = steps.answer(order(0, commands, np.zeros(3), np.zeros(3)))
    assert (answer.plan, answer.ended) == (None, "no motor brings the tip nearer")


@pytest.mark.parametrize("number", [1, 3])
def test_an_answer_is_to_the_next_step_alone(number):
    steps, commands = CorrectionSteps(PLANNER, BEYOND), pulled(0.02, 0, 0)
    tip = tip_of(CHAIN, commands)
    first = order(0, commands, tip, tip + np.array([5e-3, 0, 0]))
    for later in (first, replace(first, number=1)):
        assert steps.answer(later).plan is not None
    assert steps.answer(replace(first, number=number)).ended == "the process that plans has lost it"
    assert steps.answer(replace(first, number=2, serial=8)).ended == "the process that plans has lost it"


# --- whether a plan may correct itself


def near(distance):
    x, y, z = BOUNDS.target
    return Obstacle("the table", (x + distance, y - 1, z - 1), (x + 1, y + 1, z + 1))


BOUNDS = CorrectionBounds((0.5, 0.1, 0.2), 5, 5e-3, 30e-3)
def cup(aside):
    x, y, z = BOUNDS.target
    return WorldObject("the cup", "box", 0.06, 0.1, 0.1, (x + 0.03 + aside, y, z))


UNTRIED = "no trial at rest was held out, or the package is of an earlier release"
MAY = [
    ("", (), PLANNER, BEYOND, ""),
    ("the cup", (), PLANNER, BEYOND, "the arm would touch the cup"),
    ("", (), replace(PLANNER, chain=None), BEYOND, "the package has no statics of the arm"),
    ("", (near(0.031),), PLANNER, BEYOND, ""),
    ("", (near(0.029),), PLANNER, BEYOND, "the table is 29 mm from the tip's target, expected 30 mm"),
    ("", (near(-0.1),), PLANNER, BEYOND, "the table is 0 mm from the tip's target, expected 30 mm"),
    ("", (cup(0.031),), PLANNER, BEYOND, ""),
    ("", (cup(0.029),), PLANNER, BEYOND, "the cup is 29 mm from the tip's target, expected 30 mm"),
    ("", (), PLANNER, None, UNTRIED),
    ("", (), PLANNER, replace(BEYOND, pull=0.019), "a motor pulls 20.0 mm, in trials up to 19.0 mm"),
    ("", (), PLANNER, replace(BEYOND, pull=0.021), ""),
]


@pytest.mark.parametrize(("object", "beside", "planner", "lacking", "reason"), MAY)
def test_which_plans_may_correct_themselves(object, beside, planner, lacking, reason):
    plan = replace(some_plan(), commands=np.tile(pulled(0.02, 0, 0), (2, 1)))
    planner = replace(planner, straight=CHAIN.straight_lengths)
    targets = replace(request((0, 0, 0), BOUNDS.target).targets, object=object)
    things, solids = (tuple(b for b in beside if isinstance(b, kind)) for kind in (WorldObject, Obstacle))
    assert why_uncorrected(plan, targets, make_world(solids, things), BOUNDS, planner, lacking) == reason


@pytest.mark.parametrize(("lacking", "unasked"), [(BEYOND, ""), (None, ""), (BEYOND, "cameras: silent")])
def test_the_digest_that_is_previewed_has_the_bounds_or_the_reason_why_there_are_none(lacking, unasked):
    robot_model = replace(made().robot_model, lacking=lacking)
    planning = PreviewPlanner(PLANNER, replace(made().foresight, robot_model=robot_model), ())
    tip = base_frames(START, OFFSET)[0]
    tip = np.array((0.5, 0.1, 0.5)) + tip_of(CHAIN, pulled(0.02, 0, 0)) - tip
    asked = plain(tip=tuple(map(float, tip)))
    bounds = replace(BOUNDS, target=asked.request.targets.tip.position)
    wishes = {"uncorrected": unasked} if unasked else {"correction": bounds}
    answers = planning.answers(replace(asked, **wishes))
    planned, begun = next(answers), next(answers)
    assert isinstance(planned, PlanAnswer)
    assert isinstance(begun, PreviewBegun)
    assert planned.plan is not None, planned.report.refused
    corrected = lacking is not None and not unasked
    assert planned.plan.correction == begun.preview.correction == (bounds if corrected else None)
    assert planned.report.digest == planned.plan.digest() == begun.preview.digest
    assert begun.preview.uncorrected == (unasked or ("" if corrected else UNTRIED))
    plainly = next(planning.answers(asked))
    assert (plainly.report.digest == planned.report.digest) == (not corrected)
