"""A plan that was run corrects itself by where its tip is seen: by the rules of a live session, at the stand-in."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rehearsal.experiments import corrected
from rehearsal.experiments.corrected import correct, measured, tell_correction
from rehearsal.experiments.result import Result
from rehearsal.robot.sensors import Readings
from rehearsal.session import RATE, RehearsedRobot, RehearsedSession
from tests.ar.teleop.test_plan import LIMITS, OFFSET, START, STRAIGHT
from tests.support.operator import PACKAGE
from trunkline.ar.session.correction_steps import CorrectionAnswer
from trunkline.ar.teleop.messages import Target, Targets, World
from trunkline.ar.teleop.plan import Plan

TARGET = (0.5, 0.1, 0.2)
TARGETS = Targets(Target((0.5, 0.0, 0.6)), Target(TARGET), (0.0, 0.0, -1.0), 0.0, 0, 0.0)
OFF, STEP = 6e-3, 2e-3  # m, of the tip as the plan arrives, and by which a step pulls it nearer
WORLD = World("world")


class Pulled:
    """A robot whose tip is OFF its target to a side, less what the first motor pulls."""

    def __init__(self):
        self.joints, self.pulls, self.time = np.array([START]), np.zeros(3), 0.0

    def send(self, joints, pulls):
        self.joints, self.pulls = np.array([joints]), pulls

    def advance(self, dt):
        self.time += dt

    @property
    def tip(self):
        return np.array(TARGET) + [OFF - self.pulls[0], 0.0, 0.0]

    def readings(self):
        turn = np.array([1.0, 0, 0, 0])
        return Readings(self.time, self.time - 0.01, self.joints[0], self.pulls, self.tip, turn, np.zeros(3), turn)

    def truth(self):
        return SimpleNamespace(tip=self.tip)


class Steps:
    """A planner whose steps are all alike until the tip is within STEP."""

    def __init__(self):
        self.planner, self.orders = None, []
        self.robot_model = SimpleNamespace(lacking=None)

    def answers(self, order):
        self.orders.append(order)
        if np.linalg.norm(order.tip - order.bounds.target) < STEP / 2:
            yield CorrectionAnswer(order.serial, order.number, None, "arrived")
            return
        rows = order.commands - np.linspace(0, 1, 30)[:, None] * STEP * np.eye(3)[0]
        joints = np.tile(order.joints, (len(rows), 1))
        plan = Plan(1 / RATE, joints, rows, (("correction", 0),), order.package, order.world.digest)
        yield CorrectionAnswer(order.serial, order.number, plan, "")


def arrived() -> tuple[RehearsedSession, Plan]:
    """A robot that has run a plan which moves nothing."""
    session, robot = object.__new__(RehearsedSession), Pulled()
    package = SimpleNamespace(straight=STRAIGHT, digest=PACKAGE)
    session.robot, session.planner = robot, Steps()  # type: ignore[assignment]
    session.executor = RehearsedRobot(robot, package, LIMITS, OFFSET)  # type: ignore[arg-type]
    session.config = SimpleNamespace(mount_offset=OFFSET)  # type: ignore[assignment]
    session.controller = SimpleNamespace(world=WORLD)  # type: ignore[assignment]
    session.in_client_frame = lambda place: place  # type: ignore[method-assign]
    plan = Plan(0.1, np.tile(START, (6, 1)), np.tile(STRAIGHT, (6, 1)), (("approach", 0),), PACKAGE, WORLD.digest)
    assert session.executor.start(plan, plan.digest()) == ""
    while session.executor.state().mode != "done":
        session.executor.permit()
        session.executor.advance()
    return session, plan


@pytest.fixture(autouse=True)
def allowed(monkeypatch):
    monkeypatch.setattr(corrected, "why_uncorrected", lambda *args: "")


def test_steps_follow_one_another_until_the_tip_is_at_its_target():
    session, plan = arrived()
    result = Result("reach", 0, True)
    tell_correction(result, session, plan, TARGETS, session.robot.truth().tip)
    assert result.off_target_mm == pytest.approx(6.0)
    assert result.corrected_mm == pytest.approx(0.0, abs=1e-6)
    assert result.correction.startswith("corrected from 6.0 to 0.0 mm in 3 steps: arrived")
    assert [order.number for order in session.planner.orders] == [0, 1, 2, 3]  # type: ignore[attr-defined]


def test_what_may_not_correct_itself_stays_and_says_why(monkeypatch):
    monkeypatch.setattr(corrected, "why_uncorrected", lambda *args: "mount tilted 80 degrees, trials went up to 60")
    session, plan = arrived()
    result = Result("reach", 0, True)
    tell_correction(result, session, plan, TARGETS, session.robot.truth().tip)
    assert result.correction == "not corrected: mount tilted 80 degrees, trials went up to 60"
    assert (result.off_target_mm, result.corrected_mm) == pytest.approx((6.0, 6.0))


def test_a_tip_that_is_too_far_off_is_left_where_it_is():
    session, plan = arrived()
    far = replace(TARGETS, tip=Target((TARGET[0] - 0.1, *TARGET[1:])))
    assert "expected at most 30 mm" in correct(session, plan, far)
    assert len(session.planner.orders) == 0  # type: ignore[attr-defined]


def test_cameras_see_the_tip_late():
    readings = arrived()[0].robot.readings()
    arm = measured(readings)
    assert (arm.stamp, arm.age, arm.fault, arm.mount) == (readings.pose_time, pytest.approx(0.01), "", None)
    np.testing.assert_array_equal(arm.tip, readings.tip)
