"""Operator, core, planner and a robot that goes where it is sent: from hands to a motion, only after a confirmation."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rehearsal import settings
from rehearsal.experiments.bench import ORIGINS, rehearse
from rehearsal.operator.hands import RayHand
from rehearsal.operator.scripts import Operator
from rehearsal.session import RATE, REFERENCE, TICKS, RehearsedRobot, RehearsedSession
from tests.ar.teleop.test_plan import BENT, LIMITS, NETWORK, OFFSET, START, STRAIGHT
from tests.support.operator import PACKAGE, Everywhere, config
from trunkline.ar.hybrid.rollout_batch import Stated
from trunkline.ar.preview.grasp_preview import GraspPreviewer
from trunkline.ar.session.robot_process import DEAD_MAN
from trunkline.ar.teleop.executor import BRAKE
from trunkline.ar.teleop.following import Following
from trunkline.ar.teleop.messages import ExecutorReport, World
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.trajectory import JOINTS, gentle
from trunkline.errors import InputError

OBJECT = np.array([0.6, 0.1, 0.1])


def prediction(tip: np.ndarray) -> SimpleNamespace:
    """Of a plan that ends with the tip there, m (3,)."""
    preview = SimpleNamespace(
        stated=Stated(np.zeros(1), tip[None], np.zeros(1)), interval=None, probability=None, samples=(),
        nominal=SimpleNamespace(tip=tip[None, None]), shown=tip[None], unknown="",
    )  # fmt: skip
    return SimpleNamespace(preview=preview, begins=0.0, offer=None)


class Arc:
    """A package of an arm of constant curvature. `off`: m by which its first previews are beside the aim."""

    def __init__(self, off: list[float]):
        self.digest, self.reach, self.straight, self.off = PACKAGE, Everywhere(), STRAIGHT, off
        self.period = 0.6

    def planner(self, _):
        return Planner(RigidIK(OFFSET), NETWORK, STRAIGHT, LIMITS, OFFSET, step=0.01)

    def tip(self, mount, targets, commands):
        return np.array(targets.tip.position)

    def predictions(self, order, *_):
        yield prediction(np.array(order.request.targets.tip.position) + [0, 0, self.off.pop(0) if self.off else 0])


class Sent:
    """A robot that is where it is sent."""

    def __init__(self):
        self.joints, self.sent, self.time = np.array([START]), [], 0.0
        self.instruments = SimpleNamespace(turn=Rotation.identity(), shift=np.zeros(3))

    def readings(self):
        none = np.full(4, np.nan)
        return SimpleNamespace(
            joints=self.joints[0], wound=np.zeros(3), tip=np.zeros(3), tip_quaternion=none, object=none[:3],
            object_quaternion=none,
        )  # fmt: skip

    def links(self):
        return np.zeros((1, 3)), np.zeros((1, 3))

    def truth(self):
        return SimpleNamespace(tip=np.zeros(3))

    def send(self, joints, pulls):
        self.joints = np.array([joints])
        self.sent.append(np.append(joints, pulls))

    def advance(self, dt):
        self.time += dt


def session(off: list[float]) -> tuple[RehearsedSession, Operator]:
    rng = np.random.default_rng(0)
    person = replace(settings.person(), patience=3)
    left, right = (RayHand(origin, REFERENCE, person, 0.15, rng) for origin in ORIGINS)
    operator = Operator(person, (left, right), BENT, 0.03, 0.03, rng)
    robot_model = SimpleNamespace(rest_time=0.0, lacking=None, lean=lambda hangs: None)
    previewer = GraspPreviewer(robot_model, {}, settings.previewing())  # type: ignore[arg-type]
    made = RehearsedSession(Arc(off), config(), Sent(), (left, right), World("world"), lambda now: OBJECT, previewer)  # type: ignore[arg-type]
    made.planner._predictions = made.package.predictions  # type: ignore[method-assign, attr-defined]
    return made, operator


@pytest.mark.parametrize("off", [[], [0.07, 0.07]])  # m by which the arm is above its target: then aimed below it
def test_the_robot_moves_only_after_a_preview_on_the_object_was_confirmed(off):
    plans, beside = max(len(off), 1), sum(off[:1])
    made, operator = session(off)
    ending, _, views = rehearse(made, operator.reach())
    assert ending.done
    assert ending.plans == plans
    modes = [view.intent.mode for view in views]
    assert modes.count("execute") > 0
    assert sum(a != b == "preview" for a, b in zip(modes, modes[1:], strict=False)) == plans
    first = next(view.now for view in views if view.intent.motion != "hold")
    assert first == next(view.now for view in views if view.intent.mode == "execute")
    np.testing.assert_allclose(made.robot.joints[0], made.controller.plan.joints[-1], atol=1e-9)
    assert np.linalg.norm(np.array(views[-1].intent.targets.tip.position) + [0.0, 0.0, beside] - OBJECT) < 0.05


def test_following_moves_the_robot_until_the_path_is_over():
    made, operator = session([])
    begun = []
    script = operator.follow(begin=begun.append, finished=lambda now: now > begun[0] + 2.0, place=lambda now: OBJECT)
    made.robot.truth = lambda: SimpleNamespace(tip=OBJECT)
    ending, frames, views = rehearse(made, script)
    assert ending.done
    assert views[-1].intent.mode == "follow"
    assert len(made.robot.sent) > 0
    assert made.controller.fault == ""
    # a hand that trembles at the edge of this arm's reach is refused now and then, and the robot holds meanwhile
    assert {why.partition(":")[0] for _, why in made.refusals} <= {"out of reach"}
    assert len(made.refusals) < 0.1 * len(views)


@pytest.fixture(scope="module")
def ran() -> tuple[RehearsedSession, list, list]:
    """A reach whose client takes another frame for the base, with previews that count what is rolled out."""
    made, operator = session([])
    made.robot.instruments = SimpleNamespace(
        turn=Rotation.from_rotvec([0.0, 0.05, 0.1]), shift=np.array([0.01, -0.02, 0.03])
    )
    made.robot.truth = lambda: SimpleNamespace(tip=np.array([0.5, 0.2, 0.4]))
    asked = []
    foreseen = prediction(made.robot.instruments.turn.apply(OBJECT) + made.robot.instruments.shift)
    made.planner._predictions = lambda order, planned, *_: (
        asked.append((planned.plan, order, foreseen)) or iter([foreseen])
    )
    ending, _, views = rehearse(made, operator.reach())
    assert ending.done
    return made, views, asked


def test_tip_and_object_are_seen_with_the_whole_error_of_the_alignment(ran):
    """Also the path that is held against the preview's."""
    made, views, _ = ran
    turn, shift = made.robot.instruments.turn, made.robot.instruments.shift
    tip = turn.apply([0.5, 0.2, 0.4]) + shift
    np.testing.assert_allclose([view.tip for view in views], [tip] * len(views))
    np.testing.assert_allclose([view.object for view in views], [turn.apply(OBJECT) + shift] * len(views))
    assert len(made.tips) > 0
    np.testing.assert_allclose([place for _, place in made.tips], [tip] * len(made.tips))


def test_the_plan_that_was_run_was_foreseen_before(ran):
    """By the planner of a page, in the client's world."""
    made, _, asked = ran
    ((plan, order, foreseen),) = asked
    assert plan is made.controller.plan
    assert order.world is made.controller.world
    assert made.prediction is foreseen
    assert made.controller.prediction.digest == plan.digest()
    np.testing.assert_allclose(made.robot.joints[0], plan.joints[-1], atol=1e-9)


# --- the robot, by itself


FRAMES = round((DEAD_MAN + BRAKE) * RATE) + 2  # in which one that is not permitted any more has come to rest


class Refusing(Sent):
    """A robot that takes no command from the one numbered `first` on."""

    def __init__(self, first):
        super().__init__()
        self.first = first

    def send(self, joints, pulls):
        super().send(joints, pulls)
        if len(self.sent) >= self.first:
            raise InputError(f"command {len(self.sent)}: refused")


def rehearsed(stand_in, turn=0.5) -> tuple[RehearsedRobot, Plan]:
    """At rest, and a plan from there on."""
    here = np.append(START, STRAIGHT)
    rows = gentle(here, here + turn * np.eye(len(here))[0], LIMITS, 0.01, 2.0)
    plan = Plan(0.01, rows[:, :JOINTS], rows[:, JOINTS:], (("approach", 0),), PACKAGE, "world")
    return RehearsedRobot(stand_in, Arc([]), LIMITS, OFFSET), plan  # type: ignore[arg-type]


def frames(robot: RehearsedRobot, count: int, permits: bool) -> None:
    for _ in range(count):
        if permits:
            robot.permit()
        robot.advance()


def test_a_rehearsed_robot_does_not_begin_without_a_permit():
    robot, plan = rehearsed(Sent())
    assert robot.start(plan, plan.digest()) == ""
    frames(robot, 60, permits=False)
    np.testing.assert_array_equal(robot.axes.joints, START)
    assert not robot.moved


def test_a_rehearsed_robot_is_sent_where_its_axes_are_and_outlasts_a_few_frames_without_a_permit():
    robot, plan = rehearsed(stand_in := Sent())
    assert robot.start(plan, plan.digest()) == ""
    while robot.state().mode == "running":
        frames(robot, 1, permits=True)
        frames(robot, int(DEAD_MAN * RATE) - 1, permits=False)
        np.testing.assert_array_equal(stand_in.sent[-1], [*robot.axes.joints, *(STRAIGHT - robot.axes.commands)])
    assert robot.state() == ExecutorReport("done", plan.digest())
    assert stand_in.time == pytest.approx(len(stand_in.sent) / RATE / TICKS)


@pytest.mark.parametrize(("follows", "count"), [(False, 40), (True, 15)])  # frames until it is under way
def test_a_rehearsed_robot_that_is_not_permitted_any_more_rests_and_goes_on_by_another_start_alone(follows, count):
    robot, plan = rehearsed(Sent())
    begins = partial(robot.start, plan, plan.digest())
    if follows:
        begins = partial(robot.follow, Following(0.3, 0.0, OFFSET))
    assert begins() == ""
    for _ in range(count):
        robot.hear(0.0, np.append(plan.joints[-1], plan.commands[-1]) if follows else None)
        frames(robot, 1, permits=True)
    assert robot.state().mode == "running"
    frames(robot, FRAMES + 30 * follows, permits=False)
    assert robot.state().mode == "idle"
    rests = robot.axes.joints.copy()
    assert START[0] + 0.01 < rests[0] < plan.joints[-1, 0] - 0.01
    frames(robot, 60, permits=True)
    np.testing.assert_array_equal(robot.axes.joints, rests)
    assert (begins() == "") == follows, "the plan begins elsewhere"


def test_a_rehearsed_robot_brakes_as_soon_as_it_refuses_a_command_and_says_the_first():
    """As the process of a live session's robot does: it does not wait until it is not permitted any more."""
    robot, plan = rehearsed(Refusing(first=60))
    assert robot.start(plan, plan.digest()) == ""
    while robot.state().mode == "running":
        frames(robot, 1, permits=True)
    assert robot.state() == ExecutorReport("fault", plan.digest(), "command 60: refused")
    frames(robot, round(BRAKE * RATE) + 1, permits=True)
    rests = robot.axes.joints.copy()
    frames(robot, 60, permits=True)
    np.testing.assert_array_equal(robot.axes.joints, rests)
    assert rests[0] < plan.joints[-1, 0] - 0.01
    assert robot.state().fault == "command 60: refused"
