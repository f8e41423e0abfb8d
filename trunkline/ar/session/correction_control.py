"""Whether a plan that has arrived may correct itself further: the rules, step by step.

Until it ends, the core hears that the plan still runs. So all that holds the robot as it executes a plan holds it here:
grips let go, a stop, silence, a fault. What ends it leaves the robot where it is; nothing begins it anew.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from trunkline.ar.correction.correction import CorrectionSettings
from trunkline.ar.correction.rest import RestWatch
from trunkline.ar.session.arm_cameras import MeasuredArm
from trunkline.ar.session.correction_rests import MOST, MeasuredRest, realigned
from trunkline.ar.session.correction_steps import CorrectionAnswer, CorrectionOrder
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.ar.teleop.messages import ExecutorReport, Pose, World
from trunkline.ar.teleop.plan import CorrectionBounds, Plan

PATIENCE = 20.0  # s in which the tip has to rest
ANSWERS, STARTS = 5.0, 2.0  # s for the process that plans to answer, and for the robot to start a step
UNCHECKED = "no body is at the mount: the pose of the cameras' frame was not checked"
BLIND, STRAYS = 0.5, 0.1  # s in which the tip may be invisible as it moves, and too far from its target
ROUNDING = 1e-9  # m


class CorrectionControl:
    """submit: asks for a step. start: has the robot run it, as `Executor.start`. stop: the robot. event: into the log.
    mount_offset: from the flange to the arm's mount, m.

    Attributes:
        words: of the last correction or the one that goes on, in one line; "" where there is none.
        rests: that corrections of the session have measured, where the cameras saw the mount where the joints have it
            and the tip came nearer, or was at its target at once: else an arm that somebody leans on would count.
    """

    def __init__(
        self,
        settings: CorrectionSettings,
        submit: Callable[[CorrectionOrder], None],
        start: Callable[[Plan, str], str],
        stop: Callable[[], None],
        event: Callable[..., None],
        mount_offset: float,
    ) -> None:
        self._settings, self._mount_offset = settings, mount_offset
        self._unchecked = False  # that no body is at the mount has been told
        self._submit, self._start, self._stop, self._event = submit, start, stop, event
        self._serial = 0
        self.rests: deque[MeasuredRest] = deque(maxlen=MOST)
        self.forget()

    def bounds(self, target: tuple[float, float, float]) -> CorrectionBounds:
        """Of a plan whose tip target is there, m."""
        return bounds_of(self._settings, target)

    def realign(self, before: Pose, after: Pose) -> None:
        """The cameras' frame is not where it was `before` in the base, but `after`: nor is what was measured in it."""
        self.rests = deque(realigned(self.rests, before, after), maxlen=MOST)

    def forget(self) -> None:
        """Another motion begins, or none was corrected."""
        self.words, self._phase, self._waited = "", "", 0.0
        self._plan: Plan | None = None
        self._digests: set[str] = set()  # of its steps
        self._errors: list[float] = []
        self._measured: list[MeasuredRest] = []
        self._answer: CorrectionAnswer | None = None
        self._mounts: list[np.ndarray] = []  # as cameras see it at rest
        self._steps = 0  # after which the tip was measured
        self._ending = ""  # the reason, while its last step still moves

    # --- what is heard

    def begin(self, serial: int, plan: Plan, world: World) -> None:
        """The plan of request `serial` has been started."""
        self.forget()
        if plan.correction is not None:
            self._plan, self._serial, self._world, self._phase = plan, serial, world, "arrives"
            self._bounds, self._digest = plan.correction, plan.digest()

    def report(self, robot: ExecutorReport) -> ExecutorReport:
        """What the core hears of the `robot`: of a plan and its correction, as of one plan."""
        if self._plan is None:
            return robot
        if robot.mode == "fault" or (robot.mode == "running" and not self._phase):
            return replace(robot, digest=self._digest)
        if self._phase:
            return (
                robot if self._phase == "arrives" and robot.mode != "done" else ExecutorReport("running", self._digest)
            )
        return ExecutorReport("done", self._digest) if robot.digest in {self._digest, *self._digests} else robot

    def answer(self, answer: CorrectionAnswer | None) -> None:
        """Of the process that plans; None where that has ended."""
        if answer is None:
            if self.takes_over:
                self.end("the process that plans has ended")
        elif self._phase == "asks" and (answer.serial, answer.number) == (self._serial, len(self._errors) - 1):
            self._answer = answer

    @property
    def takes_over(self) -> bool:
        """Whether the plan has arrived and is being corrected."""
        return self._phase not in ("", "arrives")

    @property
    def over(self) -> bool:
        """Whether it has ended: nothing may move by it any more."""
        return self._plan is not None and not self._phase

    def hold(self) -> None:
        """The robot is to hold: it ends, before or after the plan has arrived."""
        if self._phase == "arrives":
            self.forget()
        elif self._phase:
            self.end("the robot holds")

    def end(self, reason: str) -> None:
        """Halt and stay."""
        if self._phase == "moves":
            self._stop()
        self._phase, self._answer = "", None
        off, steps = [1e3 * error for error in self._errors], self._steps
        if off and self._mounts and (off[-1] < off[0] or off[0] <= 1e3 * self._settings.tolerance):
            self.rests.extend(self._measured)
        if off and not self._mounts and not self._unchecked:
            self._unchecked, reason = True, f"{reason}; {UNCHECKED}"
        if steps > 0:
            many = f"{steps} step{'' if steps == 1 else 's'}" + (", and back" if self._ending else "")
            how = "the tip ended farther off than before," if off[-1] > off[0] else "corrected"
            self.words = f"{how} from {off[0]:.1f} to {off[-1]:.1f} mm in {many}: {reason}"
        else:
            self.words = f"not corrected{f', {off[0]:.1f} mm off' if off else ''}: {reason}"
        self._event("corrected", digest=self._digest, errors=self._errors, reason=reason)

    # --- what is done

    def advance(self, dt: float, robot: ExecutorReport, arm: MeasuredArm | None, state: RobotState) -> None:
        """Let `dt` s pass in which the operator lets the robot move."""
        if not self._phase:
            return
        self._waited += dt
        if self._phase == "arrives":
            if robot.mode != "done":
                return
            self._rest(state)
            assert self._plan is not None
            self._from = self._here = self._plan.commands[-1]
        if reason := self._unsound(dt, arm):
            self.end(reason)
        elif self._phase == "rests":
            assert arm is not None
            self._watch_rest(arm, robot)
        elif self._phase == "asks":
            self._take_answer(robot)
        elif self._phase == "moves":
            self._watch_move(state, robot)

    def _unsound(self, dt: float, arm: MeasuredArm | None) -> str:
        """Why nothing may be corrected by what cameras see."""
        if arm is None:
            return "there are no cameras"
        if arm.fault:
            return f"cameras: {arm.fault}"
        bounds, visible = self._bounds, bool(np.isfinite(arm.tip).all())
        off = float(np.linalg.norm(arm.tip - bounds.target))  # NaN, which is beyond nothing, while it is invisible
        self._invisible = 0.0 if visible else self._invisible + dt
        begun = bool(self._errors)  # before, an arm may still swing from its way there
        self._strayed = self._strayed + dt if begun and off > bounds.astray else 0.0
        if self._strayed > STRAYS:
            return self._too_far(off)
        if self._phase == "moves" and self._invisible > BLIND:
            return f"no camera has seen the tip for {self._invisible:.1f} s"
        return ""

    def _too_far(self, off: float) -> str:
        return f"the tip is {1e3 * off:.0f} mm off, expected at most {1e3 * self._bounds.astray:.0f} mm"

    def _rest(self, state: RobotState) -> None:
        """The robot has come to rest: wait until the tip has."""
        self._phase, self._waited, self._since, self._stamp = "rests", 0.0, state.time, -np.inf
        self._invisible = self._strayed = 0.0
        self._watch = RestWatch()
        self.words = "waits until the tip rests"

    def _watch_rest(self, arm: MeasuredArm, robot: ExecutorReport) -> None:
        if robot.mode != "done":
            return self.end("the robot has left its place")
        if self._waited > PATIENCE:
            return self.end(f"the tip is not seen at rest within {PATIENCE:g} s")
        if arm.stamp <= max(self._since, self._stamp):
            return None
        self._stamp = arm.stamp
        if arm.mount is not None:
            self._mounts.append(arm.mount)
        if not self._watch.observe(arm.stamp, arm.tip):
            return None
        assert self._plan is not None
        tip, bounds = self._watch.tip, self._bounds
        self._errors.append(float(np.linalg.norm(tip - bounds.target)))
        self._event("correction", digest=self._digest, step=len(self._errors) - 1, tip=tip.tolist(),
                    error=self._errors[-1], commands=self._here.tolist())  # fmt: skip
        if self._ending:
            return self.end(self._ending)
        self._steps = len(self._errors) - 1
        if self._steps == 0 and (reason := self._misplaced(self._plan)):
            return self.end(reason)
        if self._errors[-1] > bounds.astray:
            return self.end(self._too_far(self._errors[-1]))
        self._measured.append(MeasuredRest(self._plan.joints[-1], self._here, tip))
        self._phase, self._waited, self._answer = "asks", 0.0, None
        self.words = f"the tip is {1e3 * self._errors[-1]:.1f} mm off"
        self._submit(CorrectionOrder(
            self._serial, len(self._errors) - 1, bounds, self._settings, self._plan.joints[-1], self._here, tip,
            self._world, self._plan.package,
        ))  # fmt: skip
        return None

    def _misplaced(self, plan: Plan) -> str:
        """Why the cameras' frame is not where it is set, by the mount as they see it; "" where it may be, as where they
        see none. A frame that is turned about the mount itself does not show."""
        visible = [place for place in self._mounts if np.isfinite(place).all()]
        if not self._mounts:
            return ""
        if not visible:
            return "no camera has seen the body at the mount"
        apart = float(np.linalg.norm(np.median(visible, axis=0) - base_frames(plan.joints[-1], self._mount_offset)[0]))
        most = self._settings.misplaced
        self._event("mount", apart=apart, expected=most)
        words = f"cameras see the mount {1e3 * apart:.1f} mm from where the joints have it"
        return f"{words}, expected at most {1e3 * most:g} mm" if apart > most else ""

    def _take_answer(self, robot: ExecutorReport) -> None:
        answer = self._answer
        if robot.mode != "done":
            return self.end("the robot has left its place")
        if answer is None:
            if self._waited > ANSWERS:
                self.end(f"the process that plans has not answered for {self._waited:.1f} s")
            return None
        if answer.plan is None:
            return self.end(answer.ended)
        assert self._plan is not None
        if reason := beyond_bounds(answer.plan, self._plan, self._from, self._here) or self._beyond_steps(answer):
            return self.end(reason)
        digest = answer.plan.digest()
        if refused := self._start(answer.plan, digest):
            return self.end(refused)
        self._digests.add(digest)
        self._here = answer.plan.commands[-1]
        self._phase, self._waited, self._moved, self._ending = "moves", 0.0, digest, answer.ended
        back = f"back to the best place: {answer.ended}" if answer.ended else f"step {len(self._errors)}"
        self.words = f"the tip was {1e3 * self._errors[-1]:.1f} mm off; {back}"
        return None

    def _beyond_steps(self, answer: CorrectionAnswer) -> str:
        """The way back after the last step is none."""
        steps = self._bounds.steps
        return "" if answer.ended or len(self._errors) <= steps else f"found a step after {steps}, expected none"

    def _watch_move(self, state: RobotState, robot: ExecutorReport) -> None:
        if robot.digest == self._moved and robot.mode == "done":
            self._rest(state)
        elif robot.digest == self._moved and robot.mode == "idle":
            self.end("the robot has come to rest by itself")
        elif robot.mode != "running" and self._waited > STARTS:
            self.end(f"a step did not start within {STARTS:g} s")


def bounds_of(settings: CorrectionSettings, target: tuple[float, float, float]) -> CorrectionBounds:
    """Of a plan whose tip target is there, m."""
    return CorrectionBounds(target, settings.steps, settings.longest, settings.astray)


def beyond_bounds(step: Plan, plan: Plan, begin: np.ndarray, here: np.ndarray) -> str:
    """By what a step leaves the bounds of the plan that it corrects, "" where it keeps them.

    Args:
        begin, here: the motors' commands with which the plan has arrived, and as they are now, m. Shape (K,).
    """
    bounds = plan.correction
    if bounds is None:
        return "the plan that was confirmed does not correct itself"
    if (step.package, step.world) != (plan.package, plan.world) or step.correction is not None:
        return "a step was made for another package, world or correction"
    if not np.isfinite(step.commands).all() or not np.array_equal(
        step.joints, np.tile(plan.joints[-1], (len(step.joints), 1))
    ):
        return "a step moves the rigid robot, or has values that are not finite"
    if off := float(np.linalg.norm(step.commands[0] - here)):
        return f"a step begins {1e3 * off:.3g} mm from the commands as they are"
    at_once = float(np.linalg.norm(step.commands - here, axis=1).max())
    if at_once > bounds.longest + ROUNDING:
        return f"a step changes the commands by {1e3 * at_once:.1f} mm, expected at most {1e3 * bounds.longest:g} mm"
    in_all, most = float(np.linalg.norm(step.commands - begin, axis=1).max()), bounds.steps * bounds.longest
    if in_all > most + ROUNDING:
        return f"the commands would be {1e3 * in_all:.1f} mm from the plan's, expected at most {1e3 * most:g} mm"
    return ""
