"""Core, planner and robot together: from two hands to an arm that has arrived, and a stop on the way."""

import numpy as np
import pytest

from tests.ar.teleop.test_plan import BENT, LIMITS, NETWORK, OFFSET, START, STRAIGHT
from tests.support.operator import DT, PACKAGE, Operator
from trunkline.ar.teleop.executor import PlanFollower
from trunkline.ar.teleop.messages import PlanReport
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.errors import InputError
from trunkline.kinematics.panda.kinematics import mount_pose


class Desk:
    """What stands around the core: it plans when asked, shows at once, and runs what the intent says."""

    def __init__(self):
        self.operator = Operator()
        self.planner = Planner(RigidIK(OFFSET), NETWORK, STRAIGHT, LIMITS, OFFSET, step=0.005)
        self.robot = PlanFollower(START, STRAIGHT, LIMITS, PACKAGE)
        self.plan, self.reports = None, {}

    def step(self, **changes):
        intent = self.operator.step(
            joints=tuple(map(float, self.robot.joints)), executor=self.robot.state(), **self.reports, **changes
        )
        if intent.request is not None:
            try:
                self.plan = self.planner.plan(
                    intent.request, self.operator.message.world, self.robot.joints, self.robot.commands
                )
                report = PlanReport(intent.request.serial, self.plan.digest(), "", PACKAGE, self.plan.world)
            except InputError as error:
                report = PlanReport(intent.request.serial, refused=str(error))
            self.reports["plan"] = report
        if intent.preview:
            self.reports["shown"] = intent.preview
        if intent.motion == "execute" and self.robot.state().mode != "running" and self.robot.state().mode != "done":
            assert self.robot.start(self.plan, intent.execute) == ""
        if intent.motion == "hold" and self.robot.state().mode == "running":
            self.robot.stop()
        self.robot.advance(DT)
        return intent

    def until(self, mode, seconds=20.0, **changes):
        for _ in range(round(seconds / DT)):
            intent = self.step(**changes)
            if intent.mode == mode:
                return intent
        raise AssertionError(f"{mode} did not come: {intent.mode}, {intent.notice}")

    def ask_for(self, rigid, tip):
        """Both rays at these places of the base frame, then the trigger."""
        self.until("aim")
        # The reference frame of the operator: its z is the base's -x, its x the base's -y, its y the base's z.
        places = [(-(y - 0.0), z - 1.0, -(x - 0.2) + 0.6) for x, y, z in (rigid, tip)]
        for _ in range(60):
            self.step(left={"position": places[0], "grip": True}, right={"position": places[1], "grip": True})
        return self.step(right={"trigger": True})

    def confirm(self):
        self.until("ready", right={"trigger": False})
        self.step()
        return self.step(right={"trigger": True})


MOUNT = (0.5, 0.1, 0.5)
ACROSS, DOWN = float(BENT[0]), -float(BENT[2])  # of a tip that the arm can bring there


def test_from_hands_to_an_arm_that_has_arrived():
    desk = Desk()
    intent = desk.ask_for(MOUNT, (0.5 + ACROSS, 0.1, 0.5 - DOWN))
    np.testing.assert_allclose(intent.request.targets.rigid.position, MOUNT, atol=2e-3)
    desk.confirm()
    before = desk.robot.joints.copy()
    desk.until("execute", right={"trigger": False})
    np.testing.assert_array_equal(desk.robot.commands, STRAIGHT)
    desk.until("aim")
    np.testing.assert_allclose(desk.robot.joints, desk.plan.joints[-1], atol=1e-9)
    assert np.abs(desk.robot.joints - before).max() > 0.05
    position, _ = mount_pose(desk.robot.joints[None], OFFSET)
    assert np.linalg.norm(position[0] - MOUNT) < 0.02


def test_a_refusal_is_heard_and_aiming_goes_on():
    desk = Desk()
    desk.ask_for((0.5, 0.1, 0.5), (0.5, 0.1, -0.6))
    intent = desk.until("aim", right={"trigger": False})
    assert intent.notice == "no plan: out of reach: the soft arm's tip comes no nearer to its target than 600 mm"


@pytest.mark.parametrize("way", ["stop", "grips", "loss"])
def test_a_robot_under_way_comes_to_rest_on_its_way_and_stays(way):
    desk = Desk()
    desk.ask_for((0.4, 0.4, 0.4), (0.4, 0.4 + ACROSS, 0.4 - DOWN))
    desk.confirm()
    desk.until("execute", right={"trigger": False})
    for _ in range(20):
        desk.step()
    assert desk.robot.state().mode == "running"
    left, right = {
        "stop": ({"secondary": True}, {}),
        "grips": ({"grip": False}, {"grip": False}),
        "loss": ({"tracked": False}, {}),
    }[way]
    for _ in range(30):
        desk.step(left=left, right=right)
    stopped_at = desk.robot.joints.copy()
    assert np.abs(desk.plan.joints - stopped_at).max(axis=1).min() < 0.02
    for _ in range(120):
        assert desk.step(left={"secondary": False, "tracked": True}).motion == "hold"
    np.testing.assert_array_equal(desk.robot.joints, stopped_at)
