"""Plans and previews: what comes of an order, in which order, and how soon a newer one ends it."""

import os
import time
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from tests.ar.session.test_robot_process import simulation
from tests.ar.teleop.test_plan import LIMITS, MOUNT, NETWORK, OFFSET, TIP, request
from tests.support.answering import answering
from tests.support.operator import config
from tests.support.small_arm import small_spec
from trunkline.ar.hybrid.grasp_poses import SideGrip
from trunkline.ar.hybrid.settings import HybridModelSettings
from trunkline.ar.hybrid.uncertainty import Contact, GraspUncertainty
from trunkline.ar.preview.grasp_preview import GraspPreviewer
from trunkline.ar.preview.preview_twin import RobotModel
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session import preview_process, previewer
from trunkline.ar.session.preview_process import Overtaken
from trunkline.ar.session.previewer import (
    InlinePreviewer,
    Order,
    PlanAnswer,
    PredictionAnswer,
    PreviewBegun,
    PreviewPiece,
    PreviewPlanner,
)
from trunkline.ar.session.settings import SessionConfig
from trunkline.ar.teleop.grasping import Grasping
from trunkline.ar.teleop.messages import Obstacle, Target, WorldObject
from trunkline.ar.teleop.object_shapes import below_grip
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.errors import InputError
from trunkline.model.arm.contact_geometry import read_geometry
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.twin.discrepancy import Discrepancy, Lacking

FUTURES = 3
REST = 1.0  # s of an arm without branches: as futures that hold something


@cache
def made() -> PreviewPlanner:
    s, spec = simulation(), small_spec()
    live, robot = (
        load_folder(SessionConfig, PROJECT / "conf/live"),
        load_folder(HybridModelSettings, PROJECT / "conf/hybrid").robot,
    )
    grips = {"hanging": SideGrip(config().hanging, read_geometry(spec))}
    rigid = RigidIK(OFFSET)
    grasping = Grasping(rigid, OFFSET, s.commands, grips, config().handling)
    bends = lambda poses: {k: v - 0.5 + s.commands if k != "tip" else v for k, v in NETWORK.ask(poses).items()}  # noqa: E731
    planner = Planner(rigid, replace(NETWORK, ask=bends), s.commands, LIMITS, OFFSET, step=0.01, grasping=grasping)
    robot_model = RobotModel(spec, GraspUncertainty(contact=Contact()), robot, live.preview.alignment)
    return PreviewPlanner(planner, GraspPreviewer(robot_model, grips, replace(live.preview, futures=FUTURES)), s.bodies)


def order(serial=1, object="", tip=TIP) -> Order:
    s, asked = simulation(), request(MOUNT, tip)
    objects = (WorldObject(object, "cylinder", 0.045, 0.12, 0.1, TIP),) if object else ()
    targets = replace(asked.targets, object=object)
    return Order(replace(asked, serial=serial, targets=targets), make_world((), objects), s.joints, s.commands)


def test_a_plan_then_its_preview_in_pieces_then_the_batch():
    answers = list(made().answers(order(7)))
    planned, begun, *pieces, prediction = answers
    assert [type(answer) for answer in (planned, begun, prediction)] == [
        PlanAnswer,
        PreviewBegun,
        PredictionAnswer,
    ]
    assert planned.report.digest == planned.plan.digest() == begun.preview.digest == prediction.prediction.digest
    assert {answer.report.serial if isinstance(answer, PlanAnswer) else answer.serial for answer in answers} == {7}
    assert [piece.last for piece in pieces] == [False] * (len(pieces) - 1) + [True]
    frames = np.cumsum([0] + [len(piece.poses) for piece in pieces])
    assert [piece.first for piece in pieces] == list(frames[:-1])
    assert abs(frames[-1] * begun.preview.step - begun.preview.duration) < 2 * begun.preview.step
    assert begun.preview.duration == pytest.approx(planned.plan.duration + REST, abs=0.02)
    poses = np.concatenate([piece.poses for piece in pieces])
    assert np.isfinite(poses).all()
    mount = simulation().bodies.index("base")
    assert np.linalg.norm(poses[-1, mount, :3] - np.array(MOUNT)) < 0.03
    assert (prediction.prediction.futures, prediction.prediction.probability) == (FUTURES, None)
    assert len(prediction.prediction.times) == len(prediction.prediction.tip)
    miss = np.linalg.norm(prediction.prediction.tip[-1] - np.array(TIP))
    assert prediction.prediction.miss == pytest.approx(miss, abs=2e-3)
    assert (prediction.prediction.spread, prediction.prediction.unknown[:8]) == ((), "no trial")


@pytest.mark.parametrize(("pull", "unknown"), [(1.0, ""), (0.0, "a motor pulls")])
def test_a_radius_is_stated_up_to_what_trials_went_up_to(pull, unknown):
    """What the model lacks is in it: 10 mm of any pose."""
    lacking = Lacking("", Discrepancy(np.array([[0.01, 0.0, 0.0]]), 16), 180.0, 180.0, pull, 4.0)
    robot_model = replace(made().robot_model, lacking=lacking)
    foresight = replace(made().foresight, robot_model=robot_model)
    *_, answer = PreviewPlanner(made().planner, foresight, ()).answers(order())
    stated = answer.prediction
    assert stated.unknown.startswith(unknown)
    assert len(stated.spread) == (0 if unknown else len(stated.times))
    assert bool(unknown) or 0.01 < stated.spread[-1] < 0.03


def test_the_preview_of_a_free_motion_leans_as_the_robot_is_seen_to():
    straight = made().robot_model.lean(np.array([0.0, 0.0, -0.5]))
    ends = {}
    for beside in (0.0, 0.02):
        *_, piece, _ = made().answers(replace(order(), hangs=np.array([beside, 0.0, -0.5])))
        ends[beside] = piece.poses[-1, :, :3]
    assert straight is not None
    assert np.abs(ends[0.0][0] - ends[0.02][0]).max() < 1e-3, "the mount is where it is"
    assert np.linalg.norm(ends[0.0][-1] - ends[0.02][-1]) > 5e-3, "the tip is not"


def test_the_first_plan_in_a_world_that_was_prepared_for_composes_no_twin(monkeypatch):
    once = PreviewPlanner(made().planner, made().foresight, made().bodies)
    once.prepare(order())
    composed = []
    monkeypatch.setattr(previewer, "compose_twin", lambda *args: composed.append(args))
    assert isinstance(
        next(answer for answer in once.answers(order(2)) if isinstance(answer, PreviewPiece)),
        PreviewPiece,
    )
    assert not composed


def test_of_a_grasp_the_batch_tells_how_surely_it_holds():
    planned, *_, prediction = made().answers(order(8, "the cylinder"))
    assert planned.report.refused == ""
    assert 0 <= prediction.prediction.probability <= 1
    assert prediction.prediction.low <= prediction.prediction.probability <= prediction.prediction.high
    curl = planned.plan.step * dict(planned.plan.phases)["curl"]
    assert curl < prediction.prediction.times[0] < curl + 0.1


def test_what_is_held_is_seen_in_the_arm_and_brought_to_rest_or_not():
    """As the grasp before it left it; without one, nobody knows how the arm holds it."""
    made_once, grasped = made(), order(8, "the cylinder")
    list(made_once.answers(grasped))
    held_object = replace(grasped.world.objects[0], support="held")
    lower, tip = ((x, y, z - 0.2) for x, y, z in (MOUNT, TIP))
    targets = replace(grasped.request.targets, rigid=Target(lower), tip=Target(tip))
    floor = Obstacle("the floor", (-3.0, -3.0, -1.0), (3.0, 3.0, tip[2] - below_grip(held_object) - 0.02))
    planner = made_once.planner
    plan = planner.plan(grasped.request, grasped.world, grasped.joints, grasped.commands)
    brought = Order(
        replace(grasped.request, targets=targets),
        make_world((floor,), (held_object,)),
        plan.joints[-1],
        plan.commands[-1],
    )
    planned, _, *pieces, prediction = made_once.answers(brought)
    assert planned.report.refused == ""
    assert [name for name, _ in planned.plan.phases] == ["transfer", "release"]
    assert prediction.prediction.probability is not None
    assert prediction.prediction.low <= prediction.prediction.probability <= prediction.prediction.high
    *_, blind = PreviewPlanner(planner, made_once.foresight, made_once.bodies).answers(brought)
    assert blind.prediction.probability is None


def test_the_assistants_offer_comes_after_what_the_batch_tells():
    foresight, bodies = made().foresight, made().bodies
    helpful = replace(foresight, settings=replace(foresight.settings, futures=2, assistant=1, sure=1.0, lifted=0.9))
    answers = list(PreviewPlanner(made().planner, helpful, bodies).answers(order(8, "the cylinder")))
    predictions = [answer for answer in answers if isinstance(answer, PredictionAnswer)]
    assert [answer.prediction.probability for answer in predictions] == [
        0.0,
        0.0,
    ]  # nothing is lifted by so much, wherever
    assert predictions[0].prediction.offer is None
    assert answers[-2:] == predictions


def answers_of(process, seconds=60.0) -> list:
    """What is polled once there is anything."""
    end = time.monotonic() + seconds
    while not (answers := process.poll()) and time.monotonic() < end:
        time.sleep(0.005)
    return answers


def test_another_process_plans_where_one_has_ended():
    process = preview_process.PreviewProcess(answering, ())
    try:
        first = process.pid
        for request, reply in [(5, 5), (0, None), (6, 6)]:
            process.submit(request)
            assert answers_of(process) == [reply]
        assert process.pid != first
    finally:
        process.close()


def test_a_process_that_cannot_begin_is_not_begun_again():
    process = preview_process.PreviewProcess(os._exit, ())
    assert answers_of(process) == [None]
    time.sleep(0.2)
    assert not process.alive
    process.close()


def test_a_refusal_is_one_answer():
    answers = list(made().answers(order(9, tip=(0.5, 0.1, -0.6))))
    assert len(answers) == 1
    assert answers[0].plan is None
    assert answers[0].report.refused.startswith("out of reach")


def test_a_newer_order_ends_the_one_before_within_a_piece():
    newest, sent = SimpleNamespace(value=1), []

    class Pipe:
        def send(self, answer):
            sent.append(answer)
            if sum(isinstance(answer, PreviewPiece) for answer in sent) == 2:
                newest.value = 2

    waiting = [(1, order(1)), (2, order(2, tip=(0.5, 0.1, -0.6)))]
    orders = SimpleNamespace(get=lambda: waiting.pop(0))
    with pytest.raises(IndexError):  # there is no third
        preview_process.serve(Pipe(), orders, newest, made())
    assert sum(isinstance(answer, PreviewPiece) for answer in sent) == 2
    assert isinstance(sent[-1], PlanAnswer)
    assert sent[-1].report.serial == 2


class Broken(PreviewPlanner):
    def _pieces_of(self, *args):
        raise ValueError("two\nlines")


def test_what_breaks_a_preview_refuses_its_plan_and_not_the_next():
    broken, sent, waiting = Broken(made().planner, made().foresight, made().bodies), [], [(1, order(1))]
    orders = SimpleNamespace(get=lambda: waiting.pop(0))
    with pytest.raises(IndexError):
        preview_process.serve(SimpleNamespace(send=sent.append), orders, SimpleNamespace(value=1), broken)
    assert sent[-1].report.refused == "preview: ValueError: two"


def test_a_process_whose_first_preview_breaks_off_does_not_begin():
    """No plan could ever be confirmed: that is better said before anybody comes."""
    s, asked = simulation(), order()
    plan = made().planner.plan(asked.request, asked.world, asked.joints, asked.commands)

    class Planned(Planner):
        def plan(self, *_):
            return plan

    broken = Broken(Planned(**vars(made().planner)), made().foresight, made().bodies)
    package = SimpleNamespace(straight=s.commands, digest="a package", tip=lambda *_: TIP)
    with pytest.raises(InputError, match="preview: ValueError: two"):
        preview_process.warm(broken, package, make_world(()))  # type: ignore[arg-type]


def test_an_order_that_is_left_goes_no_further():
    def go_on():
        raise Overtaken

    answers = made().answers(order(1), go_on)
    assert isinstance(next(answers), PlanAnswer)
    assert isinstance(next(answers), PreviewBegun)
    with pytest.raises(Overtaken):
        next(answers)


def test_in_line_the_same_is_answered_at_once():
    inline = InlinePreviewer(made().answers)
    inline.submit(order(7))
    first, expected = inline.poll(), list(made().answers(order(7)))
    assert [type(answer) for answer in first] == [type(answer) for answer in expected]
    assert first[-1] == expected[-1]
    assert inline.poll() == []


def test_where_no_body_is_shown_nothing_is_simulated_to_be_shown():
    """What is planned and predicted is the same."""
    *_, prediction = made().answers(order(7))
    planned, begun, piece, unseen = PreviewPlanner(made().planner, made().foresight, ()).answers(order(7))
    assert unseen == prediction
    assert piece.last
    assert len(piece.poses) == 0
    assert begun.preview.duration == pytest.approx(planned.plan.duration + REST, abs=0.02)
