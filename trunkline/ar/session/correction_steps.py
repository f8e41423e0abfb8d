"""Steps by which a plan that has arrived corrects itself: made by the process that plans, one at a time.

A step changes the motors' commands alone, within their limits and the certificate's conditions, and is a plan of its
own, checked as any other. What may be executed of it is decided elsewhere (`correction_control.py`).
"""

from dataclasses import dataclass

import numpy as np

from trunkline.ar.correction.correction import CorrectionSettings, TipCorrection, shortened
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.ar.teleop.messages import Targets, World
from trunkline.ar.teleop.object_shapes import distance_to
from trunkline.ar.teleop.plan import CorrectionBounds, Plan
from trunkline.ar.teleop.plan_checks import check_plan
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.trajectory import JOINTS, MotionLimits, point_to_point
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY, tilt_of_gravity
from trunkline.twin.discrepancy import Lacking

PHASE = "correction"
RAMP = 0.5  # s of a step, at least
SAME = 1e-9  # m, of commands that are sent and come back
DOWN = np.array([0.0, 0.0, -STANDARD_GRAVITY])  # m/s²


@dataclass(frozen=True)
class CorrectionOrder:
    """The next step of plan request `serial` is asked for, the one after `number` steps. The robot rests at `joints`
    (7,), rad, and `commands` (K,), m, its tip measured at `tip` (3,), m, in the base frame. world, package: of the
    plan."""

    serial: int
    number: int
    bounds: CorrectionBounds
    settings: CorrectionSettings
    joints: np.ndarray
    commands: np.ndarray
    tip: np.ndarray
    world: World
    package: str


@dataclass(frozen=True)
class CorrectionAnswer:
    """The step, None where there is none. ended: why there is no further one after it, "" where there may be."""

    serial: int
    number: int
    plan: Plan | None
    ended: str


class CorrectionSteps:
    """Of one plan at a time. lacking: beyond whose conditions no step goes; None where there are none, and no step."""

    def __init__(self, planner: Planner, lacking: Lacking | None) -> None:
        self._planner, self._lacking = planner, lacking
        self._serial, self._loop = -1, None

    def answer(self, order: CorrectionOrder) -> CorrectionAnswer:
        """The step after what was measured; or, once it has ended, the way back to the best commands there were."""
        loop = self._measured(order)
        if loop is None:
            return CorrectionAnswer(order.serial, order.number, None, "the process that plans has lost it")
        if not loop.ended and (beyond := beyond_trials(self._lacking, order.joints, loop.commands, self._planner)):
            loop.refuse(beyond)
        here, there, ended = order.commands, loop.commands, loop.ended
        change = float(np.linalg.norm(there - here))
        if change <= SAME:
            return CorrectionAnswer(order.serial, order.number, None, ended or "no motor brings the tip nearer")
        there = here + shortened(there - here, order.bounds.longest)
        try:
            return CorrectionAnswer(order.serial, order.number, self._plan(order, there), ended)
        except InputError as error:
            return CorrectionAnswer(order.serial, order.number, None, str(error))

    def _measured(self, order: CorrectionOrder) -> TipCorrection | None:
        planner, settings = self._planner, order.settings
        place, turn = base_frames(order.joints, planner.mount_offset)
        if order.number == 0:
            if planner.chain is None:
                return None
            target = (np.array(order.bounds.target) - place) @ turn
            self._serial = order.serial
            self._loop = TipCorrection(planner.chain, DOWN @ turn, target, order.commands, settings)
        if self._loop is None or self._serial != order.serial or len(self._loop.errors) != order.number:
            return None
        self._loop.measured((order.tip - place) @ turn)
        return self._loop

    def _plan(self, order: CorrectionOrder, there: np.ndarray) -> Plan:
        """
        Raises:
            InputError: what forbids it.
        """
        planner, limits = self._planner, self._planner.limits
        motors = MotionLimits(limits.velocity[JOINTS:], limits.acceleration[JOINTS:], limits.jerk[JOINTS:])
        rows = point_to_point(order.commands, there, motors, planner.step, RAMP)
        joints = np.tile(order.joints, (len(rows), 1))
        plan = Plan(planner.step, joints, rows, ((PHASE, 0),), order.package, order.world.digest)
        check_plan(plan, order.world, planner.mount_offset, planner.chain)
        return plan


def why_uncorrected(plan: Plan, targets: Targets, world: World, bounds: CorrectionBounds, planner: Planner,
                    lacking: Lacking | None) -> str:  # fmt: skip
    """Why a plan that was asked to correct itself must not, "" where it may."""
    if targets.object:
        return f"the arm would touch {targets.object}"
    if planner.chain is None:
        return "the package has no statics of the arm"
    for solid in (*world.obstacles, *world.objects):
        away = distance_to(solid, bounds.target)
        if away < bounds.astray:
            return f"{solid.name} is {1e3 * away:.0f} mm from the tip's target, expected {1e3 * bounds.astray:.0f} mm"
    return beyond_trials(lacking, plan.joints[-1], plan.commands[-1], planner)


def beyond_trials(lacking: Lacking | None, joints: np.ndarray, commands: np.ndarray, planner: Planner) -> str:
    """What of the arm at rest at `joints` (7,), rad, and `commands` (K,), m, no trial went up to, "" where trials did.
    On the straight way between two commands nothing is beyond that is within at both."""
    if lacking is None:
        return "no trial at rest was held out, or the package is of an earlier release"
    gravity = DOWN @ base_frames(joints, planner.mount_offset)[1]
    pulls = np.maximum(planner.straight - commands, 0.0)
    return lacking.beyond(pulls, float(np.degrees(tilt_of_gravity(gravity))))
