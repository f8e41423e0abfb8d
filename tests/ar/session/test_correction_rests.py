"""What corrections have measured, and the plans that begin from it: of a small arm that is not as its twin."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.ar.session.test_correction_control import Correcting
from tests.ar.session.test_correction_steps import ARMS, BEYOND, CHAIN, PLANNER, order, pulled
from tests.ar.session.test_correction_steps import WORLD as EMPTY
from tests.ar.session.test_preview_process import made
from tests.ar.session.test_preview_process import order as asked
from tests.ar.teleop.test_plan import MOUNT, OFFSET, START, request
from trunkline.ar.preview.grasp_preview import GraspPreviewer
from trunkline.ar.session import correction_rests
from trunkline.ar.session.correction_rests import MOST, MeasuredRest, learnt_from, learnt_in_base
from trunkline.ar.session.correction_steps import DOWN, CorrectionSteps
from trunkline.ar.session.previewer import Order, PreviewPlanner
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.ar.teleop.messages import Pose
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses
from trunkline.model.statics.equilibria import actuated

PLACE, TURN = base_frames(START, OFFSET)
BY_A_CABLE = pulled(0.02, -0.05, -0.05)  # the others are loose
TARGET = np.array(MOUNT) + TURN @ actuated(CHAIN, pulled(0.02, 0, 0)[None], DOWN @ TURN).position[0]


def tip_at(chain, joints, commands):
    place, turn = base_frames(joints, OFFSET)
    return place + turn @ actuated(chain, commands[None], DOWN @ turn).position[0]


def leaning_tip(lean, joints, commands):
    """Of the twin."""
    place, turn = base_frames(joints, OFFSET)
    return place + turn @ lean.apply(actuated(CHAIN, commands[None], lean.inv().apply(DOWN @ turn)).position[0])


def planned(target, learnt=None, lean=None):
    planner = replace(PLANNER, residual_map=learnt, lean=lean)
    return planner.plan(request(MOUNT, tuple(map(float, target))), EMPTY, START, PLANNER.straight)


def error(arm, plan, target):
    return np.linalg.norm(tip_at(arm, plan.joints[-1], plan.commands[-1]) - target)


def corrected(arm, plan, target):
    """Rests of the correction of a plan."""
    steps, commands, joints, rests = CorrectionSteps(PLANNER, BEYOND), plan.commands[-1], plan.joints[-1], []
    while True:
        rests.append(MeasuredRest(joints, commands, tip_at(arm, joints, commands)))
        asks = order(len(rests) - 1, commands, rests[-1].tip, target)
        answer = steps.answer(replace(asks, joints=joints))
        if answer.plan is None or answer.ended:
            return rests
        commands = answer.plan.commands[-1]


@pytest.mark.parametrize("name", ARMS)
def test_the_next_plan_ends_nearer_where_a_plan_was_corrected_and_near_there(name):
    arm, first = ARMS[name], planned(TARGET)
    learnt = learnt_from(corrected(arm, first, TARGET), CHAIN, OFFSET, None)
    before = error(arm, first, TARGET)
    again = error(arm, planned(TARGET, learnt), TARGET)
    print(f"there: {1e3 * before:.2f} mm, then {1e3 * again:.2f} mm")
    assert before > 1e-3
    assert again < 0.1 * before
    for aside in ([8e-3, 0, 0], [0, -8e-3, 0], [0, 0, 5e-3]):
        near = TARGET + np.array(aside)
        without, with_it = error(arm, planned(near), near), error(arm, planned(near, learnt), near)
        print(f"near there: {1e3 * without:.2f} mm, then {1e3 * with_it:.2f} mm")
        assert with_it < 0.4 * without


def test_a_rest_where_a_loose_cable_stops_the_twin_alone_tells_nothing():
    """Of soft cables: as the steps pull farther, the twin bends until the second cable holds it. The residual falls
    from 3.1 to 1.8 mm by that alone, and would make plans near there gain a fifth, as they hold no such cable."""
    arm, first = ARMS["soft cables"], planned(TARGET)
    rests = corrected(arm, first, TARGET)
    commands, turn = np.array([rest.commands for rest in rests]), base_frames(rests[0].joints, OFFSET)[1]
    twins, arms = (actuated(chain, commands, DOWN @ turn).tensions[:, 1] for chain in (CHAIN, arm))
    assert twins[0] == pytest.approx(0, abs=1e-3)
    assert twins[-1] > 0.03
    assert (arms == 0).all()
    learnt = learnt_from(rests, CHAIN, OFFSET, None)
    assert 1 <= len(learnt.poses) < len(rests)
    package = ResidualMap.supposed(learnt.poses, learnt.residuals, CHAIN.length)
    assert learnt_from(rests[-1:], CHAIN, OFFSET, package) is package


def test_far_from_there_plans_are_as_before():
    learnt = learnt_from(corrected(ARMS["bent at rest"], planned(TARGET), TARGET), CHAIN, OFFSET, None)
    other = RestingPoses(np.array([[0.0, 0.03, 0.0]]), DOWN[None])
    assert np.linalg.norm(learnt.mean(other)) < 0.2 * np.linalg.norm(learnt.mean(learnt.poses)[0])


def test_rests_are_added_to_what_the_package_has_learnt():
    shift, measured = np.array([[0.0, 2e-3, 0.0]]), np.array([3e-3, 0.0, 0.0])
    commands = BY_A_CABLE
    tip = PLACE + TURN @ (actuated(CHAIN, commands[None], DOWN @ TURN).position[0] + measured)
    package = ResidualMap.supposed(RestingPoses(np.array([[0.0, 0.03, 0.0]]), DOWN[None]), shift, CHAIN.length)
    assert learnt_from((), CHAIN, OFFSET, package) is package
    both = learnt_from([MeasuredRest(START, commands, tip)], CHAIN, OFFSET, package)
    there = RestingPoses(np.array([[0.02, 0.0, 0.0]]), (DOWN @ TURN)[None])
    np.testing.assert_array_equal(both.residuals[: len(package.poses)], package.residuals)
    np.testing.assert_array_equal(both.numbers, package.numbers)
    assert np.linalg.norm(both.mean(there)[0] - measured) < 0.3e-3


def test_beside_a_twin_that_leans_as_the_arm_does_nothing_is_left():
    """Else a preview, whose twin leans already, would have it twice."""
    lean = Rotation.from_rotvec([0.03, 0.0, 0.0])
    commands = BY_A_CABLE[None]
    tips = lean.apply(actuated(CHAIN, commands, lean.inv().apply(DOWN)).position)
    assert np.linalg.norm(learnt_in_base(CHAIN, commands, DOWN[None], tips, None, lean).residuals) < 1e-9
    assert np.linalg.norm(learnt_in_base(CHAIN, commands, DOWN[None], tips).residuals) > 3e-3


def test_a_rest_to_which_the_twin_snaps_tells_nothing(monkeypatch):
    rest = MeasuredRest(START, BY_A_CABLE, TARGET)
    assert learnt_from([rest], CHAIN, OFFSET, None) is not None
    snaps = lambda *args: replace(actuated(*args), snapped=np.ones(1, bool))  # noqa: E731
    monkeypatch.setattr(correction_rests, "actuated", snaps)
    assert learnt_from([rest], CHAIN, OFFSET, None) is None


def test_what_is_not_finite_tells_nothing():
    nowhere = MeasuredRest(START, pulled(0.02, 0, 0), np.full(3, np.nan))
    assert learnt_from([nowhere], CHAIN, OFFSET, None) is None


@pytest.mark.parametrize("hangs", [None, np.array([0.01, 0.0, -0.2])])
def test_plan_and_preview_begin_from_what_was_measured(monkeypatch, hangs):
    """Beside a twin that leans as the arm was seen to hang. This one still swings, so that it is planned once."""
    foresight, heard, free = made().foresight, [], GraspPreviewer.free
    monkeypatch.setattr(GraspPreviewer, "free", lambda *arguments: heard.append(arguments[-2]) or free(*arguments))
    lean = made().robot_model.lean(hangs) or Rotation.identity()
    planning, first = PreviewPlanner(PLANNER, foresight, ()), planned(TARGET, lean=lean)
    here, off = first.commands[-1], np.array([5e-3, 0.0, 0.0])
    rest = MeasuredRest(first.joints[-1], here, leaning_tip(lean, first.joints[-1], here) + off)
    asks = replace(asked(tip=tuple(map(float, TARGET))), hangs=hangs)
    without, begins = ([*planning.answers(replace(asks, rests=rests))] for rests in ((), (rest,)))
    for (answer, *_), expected in ((without, TARGET), (begins, TARGET - off)):
        end = answer.plan
        assert np.linalg.norm(leaning_tip(lean, end.joints[-1], end.commands[-1]) - expected) < 1e-3
    assert heard[0] is None
    turn = base_frames(first.joints[-1], OFFSET)[1]
    leaning = lean.apply(actuated(CHAIN, here[None], lean.inv().apply(DOWN @ turn)).position[0])
    measured = (rest.tip - base_frames(first.joints[-1], OFFSET)[0]) @ turn
    np.testing.assert_allclose(heard[1].residuals, [measured - leaning], atol=1e-6)


def orders_of(session, kind=Order):
    """Those of plans, from now on, or of another kind."""
    submit, orders = session.planning.submit, []

    def hear(order):
        if isinstance(order, kind):
            orders.append(order)
        submit(order)

    session.planning.submit = hear
    return orders


def again(session):
    """A plan is asked for after the one that ran."""
    session.until(lambda intent: intent.mode == "aim")
    session.left = session.right = {}
    session.wait(0.5)
    session.left, session.right = {"grip": 1.0}, {"grip": 1.0}
    session.wait(0.5)
    session.right = {"grip": 1.0, "trigger": 1.0}
    session.until(lambda intent: intent.mode != "aim")


def test_the_next_order_has_what_corrections_have_measured():
    session = Correcting()
    orders = orders_of(session)
    session.executing()
    again(session)
    first, second = orders
    assert first.rests == ()
    assert len(second.rests) == 3
    np.testing.assert_allclose([rest.commands[0] - session.planning.plans[0].commands[-1][0] for rest in second.rests],
                               [0.0, -2e-3, -4e-3], atol=1e-9)  # fmt: skip
    for rest, off in zip(second.rests, (5.1e-3, 3.1e-3, 1.1e-3), strict=True):
        assert np.linalg.norm(rest.tip - first.correction.target) == pytest.approx(off, abs=1e-6)
        np.testing.assert_array_equal(rest.joints, session.planning.plans[0].joints[-1])


def frozen(session):
    session.cameras.fault = "'unit_08' has not moved"


def test_nothing_begins_from_a_stream_that_is_not_sound():
    session = Correcting()
    orders = orders_of(session)
    session.executing().until(lambda intent: intent.mode == "aim")
    assert len(session.controller.correction.rests) == 3
    frozen(session)
    again(session)
    assert orders[-1].rests == ()
    assert len(orders) == 2
    session.cameras.fault = ""
    session.wait(0.1)
    assert len(session.controller._rests) == 3  # a stream that was late is relied on again


def test_where_the_cameras_are_aligned_anew_what_they_measured_is_in_their_new_frame():
    session, half = Correcting(), np.sqrt(0.5)
    orders = orders_of(session)
    session.executing().until(lambda intent: intent.mode == "aim")
    before = [rest.tip for rest in session.controller.correction.rests]
    session.cameras.pose = Pose((0.1, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    session.cameras.align = lambda pose: None
    session.controller.camera_alignment = type(
        "Aligned", (), {"take": lambda self: Pose((0.1, 0.2, 0.0), (half, 0.0, 0.0, half)),
                        "observe": lambda self, robot, arm: None}
    )()  # fmt: skip
    again(session)
    after = [(0.1 - y, 0.2 + x - 0.1, z) for x, y, z in before]  # by a quarter about z
    np.testing.assert_allclose([rest.tip for rest in orders[-1].rests], after, atol=1e-12)


@pytest.mark.parametrize("wrong", ["mount", "shift"])
def test_a_rest_that_ends_the_correction_tells_nothing(wrong):
    session = Correcting()
    setattr(session.cameras, wrong, np.array([0.006, 0.0, 0.0] if wrong == "mount" else [0.05, 0.0, 0.0]))
    session.executing().until(lambda intent: intent.mode == "aim")
    assert "expected at most" in session.words
    assert len(session.controller.correction.rests) == 0


def test_the_newest_are_kept():
    assert Correcting().controller.correction.rests.maxlen == MOST
