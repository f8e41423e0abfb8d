"""What cameras are worth at rest: a plan that has arrived corrects itself by where its tip is seen.

The rules and the steps are those of a live session. Its cameras are the client's tracking of poses, late and noisy, at
the rate of its frames. The plan is asked for anew, as one that corrects itself.
"""

from dataclasses import replace

import numpy as np

from rehearsal.experiments.result import Result
from rehearsal.robot.sensors import Readings
from rehearsal.session import RATE, RehearsedSession
from trunkline.ar.correction.correction import CorrectionSettings
from trunkline.ar.session.arm_cameras import MeasuredArm
from trunkline.ar.session.correction_control import CorrectionControl, bounds_of
from trunkline.ar.session.correction_steps import CorrectionAnswer, CorrectionOrder, why_uncorrected
from trunkline.ar.session.previewer import Order, PlanAnswer
from trunkline.ar.teleop.messages import Request, Targets
from trunkline.ar.teleop.plan import Plan


def plan_that_corrects(session: RehearsedSession, request: Request, hangs: np.ndarray | None, otherwise: Plan) -> Plan:
    """For a robot that has not moved; `otherwise` where there is none. hangs: as of an `Order`."""
    robot, bounds = session.executor.axes, bounds_of(CorrectionSettings(), request.targets.tip.position)
    order = Order(request, session.controller.world, robot.joints, robot.commands, hangs, bounds)
    answer = next(session.planner.answers(order))
    assert isinstance(answer, PlanAnswer), "a plan is asked for"
    return answer.plan or otherwise


def correct(session: RehearsedSession, plan: Plan, targets: Targets) -> str:
    """Let the robot correct `plan` for `targets`, which it has run and at whose end it rests; what came of it, in
    words."""
    planner, robot, world, orders = session.planner, session.executor, session.controller.world, []

    def submit(order: CorrectionOrder) -> None:
        orders.append(order)

    control = CorrectionControl(
        CorrectionSettings(), submit, robot.start, robot.stop, lambda kind, **fields: None, session.config.mount_offset
    )
    bounds = control.bounds(targets.tip.position)
    lacking = planner.robot_model.lacking
    if refused := why_uncorrected(plan, targets, world, bounds, planner.planner, lacking):
        return f"not corrected: {refused}"
    control.begin(0, replace(plan, correction=bounds), world)
    while not control.over:
        robot.permit()
        robot.advance()
        control.advance(1 / RATE, robot.state(), measured(session.robot.readings()), robot.robot_state())
        for answer in [answer for order in orders for answer in planner.answers(order)]:
            assert isinstance(answer, CorrectionAnswer), "no other order is given"
            control.answer(answer)
        orders.clear()
    return control.words


def measured(readings: Readings) -> MeasuredArm:
    """The arm of which cameras see the tip alone."""
    late = readings.time - readings.pose_time
    return MeasuredArm(readings.pose_time, np.empty((0, 7)), readings.tip, late, RATE, 0.0, "", None)


def tell_correction(result: Result, session: RehearsedSession, plan: Plan, targets: Targets, tip: np.ndarray) -> None:
    """How far the tip is from its target without a correction, at `tip` (3,), m, and after it."""
    target = np.array(targets.tip.position)
    result.off_target_mm = 1e3 * float(np.linalg.norm(tip - target))
    result.correction = correct(session, plan, targets)
    corrected = session.in_client_frame(session.robot.truth().tip)
    result.corrected_mm = 1e3 * float(np.linalg.norm(corrected - target))
