"""What stands around the core: inputs in, and plans, previews and the robot's motion as it wants them.

It has no sockets and no clock: whoever drives it, a live server or a rehearsal, calls it with the time. Every decision
that can move the robot is here or in the core. It holds wherever it does not know.
"""

import math
import re
from collections import deque
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from trunkline.ar.correction.correction import CorrectionSettings
from trunkline.ar.preview.world_model import update_world
from trunkline.ar.session import messages
from trunkline.ar.session.arm_cameras import MeasuredArm
from trunkline.ar.session.binary import MARKERS
from trunkline.ar.session.camera_alignment import CameraAlignment, CamerasAligned
from trunkline.ar.session.controller_input import NOWHERE
from trunkline.ar.session.correction_control import CorrectionControl
from trunkline.ar.session.correction_rests import MeasuredRest
from trunkline.ar.session.correction_steps import CorrectionAnswer
from trunkline.ar.session.follow import FollowControl
from trunkline.ar.session.hanging import HangingWatch
from trunkline.ar.session.log_writer import LogWriter
from trunkline.ar.session.previewer import (
    Answer,
    FollowAnswer,
    Order,
    PlanAnswer,
    PreviewBegun,
    Previewer,
    PreviewPiece,
)
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.session.ui_text import next_action, next_key
from trunkline.ar.teleop.alignment import base_quaternion
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.executor import FOLLOWS
from trunkline.ar.teleop.following import Following
from trunkline.ar.teleop.messages import (
    Controller,
    ExecutorReport,
    Input,
    Intent,
    Joints,
    PlanReport,
    Pose,
    Target,
    Targets,
    Vector,
    World,
)
from trunkline.ar.teleop.plan import CorrectionBounds, Plan
from trunkline.frames import rotation_from_wxyz

JUST_AFTER = 1e-3  # s of the core's clock between the last input of whom controlled and the first of who does now
HERE = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))  # of poses that are in the base frame already
NUMBER = re.compile(r"[\d.]+")
DIGITS = 4  # after the decimal point, of targets that are told
UNDRAWN = 0.25  # s in which who moves the robot may have drawn no new pose of it
MOST_UNDRAWN, UNBEGUN = 2.0, 0.75  # s likewise, in which a plan waits, and one that was not yet seen to move
SLOW = 1.0  # s since it waited last, in which that is noticed
ACTING = ("delay", "execute", "follow")  # modes in which it moves, or is about to
SWINGS, RARELY = 10.0, 0.25  # s after a motion in which all that cameras see is logged, and from one to the next later
MOST_INPUTS = 8  # of a tick; older ones than these are left out, presses and all


class Robot(Protocol):
    """An `Executor` that has to be permitted anew all the time."""

    def start(self, plan: Plan, digest: str) -> str: ...
    def follow(self, following: Following) -> str: ...
    def hear(self, age: float, axes: np.ndarray | None) -> None: ...
    def permit(self, waits: bool = False) -> None: ...
    def stop(self) -> None: ...
    def state(self) -> ExecutorReport: ...
    def robot_state(self) -> RobotState: ...


@dataclass(frozen=True)
class HandInput:
    stamp: float
    left: Controller
    right: Controller
    correct: bool = False


class Cameras(Protocol):
    """What sees the arm; simulated ones are shown where the robot's drawn bodies are, (N, 7). pose: of their frame, in
    the base."""

    pose: Pose

    def show(self, bodies: np.ndarray) -> None: ...
    def latest(self) -> MeasuredArm: ...
    def align(self, pose: Pose) -> None: ...


class SessionController:
    """One robot, one core. `lift`: m by which a grasp lifts at least. `log_writer`: of the session. `period`: s, of the
    arm's slowest vibration mode. `cameras`: that see the arm, None without; `correction`: of plans, by what they see;
    `camera_alignment`: of their frame, and `hanging`: of the straight arm, None where they see no mount.
    """

    def __init__(
        self,
        core: Teleoperation,
        robot: Robot,
        previewer: Previewer,
        world: World,
        lift: float,
        log_writer: LogWriter | None = None,
        period: float = 0.0,
        cameras: Cameras | None = None,
        correction: CorrectionSettings | None = None,
        camera_alignment: CameraAlignment | None = None,
        hanging: HangingWatch | None = None,
    ) -> None:
        self.core, self.robot, self.previewer, self.world = core, robot, previewer, world
        self.lift, self.period = lift, period
        self.log_writer = log_writer or LogWriter()
        self.state = core.start()
        self.alignment: Pose | None = None
        self.unfit = ""
        self.plan: Plan | None = None
        self.preview: messages.PreviewMessage | None = None
        self.prediction: messages.PredictionMessage | None = None
        self.report: PlanReport | None = None
        self.pieces: list[PreviewPiece] = []
        self.intent: Intent | None = None
        self._inputs: deque[HandInput] = deque(maxlen=MOST_INPUTS)
        self._last, self._fresh = self._nobody, True
        self._shift = 0.0  # s from a client's stamps to the core's
        self._drawn, self._undrawn = False, 0.0  # since the last tick; s in which who controls has drawn nothing
        self._waits, self._slow = False, 0.0  # for a picture, on the way of a plan; s for which that is still noticed
        self._moves = False  # as a picture has shown
        self.notice = ""  # for all: the core's, or why who controls counts as silent
        self._instead = ("", "")  # a notice of the core's, and what is told instead
        self._stop, self._fault, self._shown_digest, self._since, self._believed = False, "", "", 0.0, ""
        self._requested, self._ordered, self._started, self._ran = 0, False, "", False
        self._logged: tuple = ()
        self._follow = FollowControl(previewer.submit, robot.hear)
        self.cameras, self.arm = cameras, None
        self.camera_alignment, self.hanging = camera_alignment, hanging
        self.aligned: CamerasAligned | None = None  # the last that was computed
        self._frame_by: CamerasAligned | None = None  # the last that is used
        self._moved = -math.inf  # s, when anything moved
        self._written = -math.inf  # s, of the newest of what cameras saw in the log
        self.correction = CorrectionControl(
            correction or CorrectionSettings(), previewer.submit, robot.start, robot.stop, self.log_writer.event,
            core.mount_offset,
        )  # fmt: skip
        self._bounds: CorrectionBounds | None = None  # of the plan that is asked for
        self.arrived: tuple[np.ndarray, float] | None = None  # as `_arrival` has it, of the plan that ran last

    def begin(self, rate: float, version: str = "") -> None:
        """The log's first line: all that a replay needs besides the package. rate: of ticks, Hz. version: of
        Trunkline."""
        core, subject = self.core, self.log_writer.subject
        self.log_writer.event(
            "begin", version=version, package=core.package, rate=rate, settings=core.settings,
            mount_offset=core.mount_offset, tip={"body": subject.tip[0], "place": subject.tip[1]},
            hardware=subject.hardware, measured=subject.measured, mount=subject.mount,
        )  # fmt: skip

    # --- what is heard

    def hear(self, stamp: float, left: Controller, right: Controller, drawn: bool, correct: bool = False) -> str:
        """An input of whom controls, `stamp` s by its own clock; why it does not count, "" where it does. drawn: since
        the one before, a new pose of the robot was drawn where the user sees it. correct: a plan that it asks for may
        correct itself."""
        last = self._inputs[-1] if self._inputs else self._last
        if self._fresh and math.isfinite(stamp):  # another's clock: the core's goes on from where it was
            self._shift = last.stamp + JUST_AFTER - stamp if self.state.stamp is not None else 0.0
            self._fresh = False
        elif stamp + self._shift <= last.stamp:
            heard = last.stamp - self._shift
            return f"input: stamp {stamp:.6g} s is not after {heard:.6g} s: heard before"
        stamp += self._shift
        self._drawn = self._drawn or drawn
        self._inputs.append(HandInput(stamp, left, right, correct))
        return ""

    def stop(self) -> None:
        """Of anybody: the robot is told at once, the core at its next step."""
        self._stop = True
        self.robot.stop()
        if self.intent is None or self.intent.mode != "stopped":
            self.log_writer.event("stop")

    def control(self, alignment: Pose | None, unfit: str = "") -> None:
        """Somebody else controls now, or nobody, who is aligned so."""
        self._inputs.clear()
        self._last, self._fresh = self._nobody, True
        self._drawn, self._undrawn = False, 0.0
        self.align(alignment, unfit)
        self.robot.stop()
        self.correction.hold()

    def align(self, alignment: Pose | None, unfit: str) -> None:
        """Of whom controls, its reference frame in the base; `unfit`: why nothing may be executed so, "" where it
        may."""
        self.alignment, self.unfit = alignment, unfit

    def preview_shown(self, digest: str, now: float) -> str:
        """A preview has been shown to its end; why that does not count, "" where it does."""
        preview = self.preview
        expected = self.intent.preview if self.intent is not None else ""
        if not expected or preview is None or preview.digest != expected:
            return "shown: no plan is previewed"
        if digest != expected:
            return f"shown: found digest {digest[:12]!r}, expected {expected[:12]}"
        if not self.pieces or not self.pieces[-1].last:
            return "shown: its preview is not simulated to its end yet"
        if now - self._since < preview.duration:
            return f"shown: its preview lasts {preview.duration:.2f} s, found {now - self._since:.2f} s"
        self._shown_digest = digest
        self.log_writer.event("shown", digest=digest)
        return ""

    def poll(self, now: float) -> list[Answer]:
        """What the previewer has answered since, of the plan that is wanted."""
        answers = self.previewer.poll()
        return [answer for answer in answers if self.answered(answer, now) and answer is not None]

    def answered(self, answer: Answer | None, now: float) -> bool:
        """An answer of the previewer, None if it has ended; whether it is of the plan that is wanted."""
        if answer is None:
            self.report = PlanReport(self._requested, refused="the process that plans has ended")
            self.correction.answer(None)
            return False
        if isinstance(answer, CorrectionAnswer):
            self.correction.answer(answer)
            return False
        if isinstance(answer, FollowAnswer):
            self._follow.answer(answer)
            return False
        serial = answer.report.serial if isinstance(answer, PlanAnswer) else answer.serial
        if serial != self._requested:
            return False
        if isinstance(answer, PlanAnswer):
            if self._started:  # its preview breaks off, but it runs already
                return False
            if answer.plan is not None and answer.plan.correction not in (None, self._bounds):
                refused = "correction: found bounds that nobody asked for"
                answer = PlanAnswer(PlanReport(serial, refused=refused))
            self.report, self.plan = answer.report, answer.plan
            self.log_writer.event("planned", report=answer.report)
        elif isinstance(answer, PreviewBegun):
            self.preview, self._since = answer.preview, now
            self.log_writer.event("preview", preview=answer.preview)
        elif isinstance(answer, PreviewPiece):
            self.pieces.append(answer)
            if len(answer.poses):  # none where no body is shown
                self.log_writer.piece(answer.first, answer.time, answer.poses)
        else:
            self.prediction = answer.prediction
            self.log_writer.event("foreseen", foreseen=answer.prediction)
        return True

    # --- what is done

    def tick(self, dt: float) -> Intent:
        """Let `dt` s pass; every input since the last tick is a step of the core. One that moves the robot and draws
        nothing counts as silent."""
        robot_state, executor = self.robot.robot_state(), self.correction.report(self.robot.state())
        self._see(robot_state)
        if self.state.mode in ("hold", "aim"):
            self._believe(robot_state, executor)
        joints: Joints = tuple(float(q) for q in robot_state.joints)  # type: ignore[assignment]
        steps = list(self._inputs) or [self._last]
        self._undrawn, self._drawn = 0.0 if self._drawn else self._undrawn + dt, False
        mode = self.intent.mode if self.intent is not None else ""
        self._wait(mode, dt)
        most = UNDRAWN if mode == "follow" else MOST_UNDRAWN if self._moves else UNBEGUN
        blind = mode in ACTING and bool(self._inputs) and self._undrawn > most
        if blind:
            steps = [self._silence()]
        self._inputs.clear()
        for hands in steps:
            executor = ExecutorReport("fault", "", self._fault) if self._fault else executor
            offer = self.prediction.offer if self.prediction is not None else None
            left, right = hands.left, hands.right
            if self._stop:
                left, self._stop = replace(left, secondary=True), False
            shown = self._shown_digest if self.prediction is not None else ""  # without what it states, none is ready
            core_input = Input(
                hands.stamp, left, right, self.alignment, joints, self.world, self.core.package, self.report, shown,
                executor, offer,
            )  # fmt: skip
            self.state, intent = self.core.step(self.state, core_input, dt / len(steps))
            self._ask(intent, robot_state, hands.correct)
            self._follow.advance(dt / len(steps))
            if intent.mode == "follow":
                self._follow.seek(intent.targets, robot_state.joints, self.world, self._hangs(robot_state))
            else:
                self._follow.end()
            self._drive(intent)
            if intent.motion == "execute" and not self._fault:
                self.correction.advance(dt / len(steps), self.robot.state(), self.arm, robot_state)
            self.log_writer.step(dt / len(steps), core_input, intent)
        self._last = steps[-1]
        self.intent = intent
        self._reword(intent.notice, blind)
        self._log_tick(intent, robot_state)
        return intent

    @property
    def blocked(self) -> str:
        """Why nothing may be executed, whatever the core wants; "" where it may."""
        return self.log_writer.fault or self.unfit

    def _log_tick(self, intent: Intent, robot_state: RobotState) -> None:
        """What is at the end of a tick; of what seldom changes, the changes."""
        log_writer = self.log_writer
        log_writer.robot_state(robot_state)
        robot = self.robot.state()
        notice, fault = (NUMBER.sub("", text) for text in (self.notice, robot.fault))  # what counts on is told once
        now = (intent.mode, notice), (robot.mode, fault, robot.digest), self.alignment, self.world
        mode, acts, alignment, world = self._logged or (None,) * 4
        self._logged = now
        if now[0] != mode:
            log_writer.event("mode", mode=intent.mode, notice=self.notice, digest=intent.preview or intent.execute)
        if now[1] != acts:
            log_writer.event("robot", robot=robot)
        if self.alignment != alignment:
            log_writer.event("alignment", pose=self.alignment)
            if self.alignment is not None:
                log_writer.alignment(self.alignment)
        if self.world is not world:
            log_writer.event("world", world=self.world)

    def _wait(self, mode: str, dt: float) -> None:
        """Whether what moves along a plan, or is about to, waits for a picture."""
        before, self._waits = self._waits, mode in ("delay", "execute") and self._undrawn > UNDRAWN
        self._moves = mode == "execute" and (self._moves or self._undrawn == 0.0)
        self._slow = SLOW if self._waits else max(self._slow - dt, 0.0) if mode in ("delay", "execute") else 0.0
        if self._waits and not before:
            self.log_writer.event("waits", undrawn=self._undrawn)

    def _silence(self) -> HandInput:
        """For the core, an input after a gap in which nothing was drawn: it holds as for any that is silent. The
        client's clock goes on after it."""
        self._fresh = True
        gap = self._undrawn + self.core.settings.safety.silence
        return HandInput(self._last.stamp + gap, NOWHERE, NOWHERE)

    def _reword(self, notice: str, blind: bool) -> None:
        """The core's `notice`, for as long as it lasts, in words of what was not drawn."""
        if blind:
            self._instead = notice, f"the page has drawn nothing for {self._undrawn:.2f} s; holding"
        before, instead = self._instead
        self._instead = self._instead if notice == before else ("", "")
        self.notice = instead if notice == before else notice

    @property
    def _rigid(self) -> int:
        """Which hand holds the rigid target."""
        return ("left", "right").index(self.core.settings.rigid_hand)

    @property
    def _nobody(self) -> HandInput:
        """Nothing heard, at the stamp of the last step."""
        stamp = self.state.stamp if self.state.stamp is not None else 0.0
        return HandInput(stamp, NOWHERE, NOWHERE)

    def _see(self, robot_state: RobotState) -> None:
        if self.cameras is None:
            return
        self.cameras.show(robot_state.bodies)
        before, self.arm = self.arm, self.cameras.latest()
        now = robot_state.time
        if self.intent is not None and self.intent.motion != "hold":
            self._moved = now
        if self.arm.stamp > self._written + (0.0 if now - self._moved < SWINGS else RARELY):
            self._written = self.arm.stamp
            poses = self.arm.poses.copy()
            if self.arm.mount is not None:
                poses[0, :3] = self.arm.mount  # as recordings have their base
            self.log_writer.measured(self.arm.stamp, poses)
        if before is not None and self.arm.fault != before.fault:
            self.log_writer.event("cameras", fault=self.arm.fault)
        if self.hanging is not None:
            self.hanging.observe(robot_state, self.arm)
        aligned = self.camera_alignment.observe(robot_state, self.arm) if self.camera_alignment is not None else None
        if aligned is not None:
            self.aligned = aligned
            self.log_writer.event("cameras", fault=self.arm.fault, aligned=aligned)

    @property
    def cameras_frame(self) -> str:
        """By what the cameras' frame in the base is known, in words; "" without cameras."""
        if self.cameras is None:
            return ""
        words = "frame as set" if self._frame_by is None else self._frame_by.frame_words
        if self.camera_alignment is None:
            return f"{words}, which nothing checks"
        if self.aligned is not None and self.aligned.unused:
            words += f"; {self.aligned.places} places of the mount not used: {self.aligned.unused}"
        hangs = self.hanging.words if self.hanging is not None and self._frame_by is not None else ""
        return f"{words}; {hangs}" if hangs else words

    def _hangs(self, robot_state: RobotState) -> np.ndarray | None:
        """Where the straight arm's tip was seen in its base frame, m (3,), or None."""
        if robot_state.hangs is not None or self.hanging is None or self._frame_by is None:
            return robot_state.hangs
        return self.hanging.place

    def why_uncorrected(self, targets: Targets) -> str:
        """Why a plan for these targets cannot correct itself by what cameras see, "" where it may be able to."""
        if self.cameras is None or self.arm is None:
            return "the session has no cameras"
        if self.arm.fault:
            return f"cameras: {self.arm.fault}"
        return f"the arm would touch {targets.object}" if targets.object else ""

    @property
    def _rests(self) -> tuple[MeasuredRest, ...]:
        """That corrections have measured, while the cameras' stream is sound."""
        return tuple(self.correction.rests) if self.arm is not None and not self.arm.fault else ()

    def _ask(self, intent: Intent, robot_state: RobotState, correct: bool = False) -> None:
        request = intent.request
        if request is not None and request.serial != self._requested:
            if self.cameras is not None and self.camera_alignment is not None:
                pose = self.camera_alignment.take()  # here, as the robot rests and nothing is corrected
                if pose is not None:
                    self.correction.realign(self.cameras.pose, pose)
                    self.cameras.align(pose)
                    self._frame_by = self.aligned
            self._requested, self.report, self.plan, self.preview = request.serial, None, None, None
            self.prediction, self.pieces, self._shown_digest = None, [], ""
            self._ordered = True
            self.log_writer.event("request", request=request)
            here = robot_state.joints, robot_state.commands, self._hangs(robot_state)
            uncorrected = self.why_uncorrected(request.targets) if correct else ""
            asks = correct and not uncorrected
            self._bounds = self.correction.bounds(request.targets.tip.position) if asks else None
            self.previewer.submit(Order(request, self.world, *here, self._bounds, uncorrected, self._rests))
        elif self._ordered and intent.mode in ("hold", "stopped", "aim", "execute"):
            self._ordered = False
            self.previewer.leave()

    def _drive(self, intent: Intent) -> None:
        running = self.robot.state()
        if intent.motion == "hold":
            self._fault = self._fault if intent.mode == "stopped" else ""
            if running.mode == "running" or (self._started and not self._ran):  # a start on its way reads as idle
                self.robot.stop()
            self.correction.hold()
            self._started, self._ran = "", False
            return
        if self._started != (intent.execute or FOLLOWS):
            self._begin(intent)
        self._ran = self._ran or running.mode == "running"
        if self._ran and running.mode == "idle" and not (self.correction.takes_over or self.correction.over):
            self._fault = "it has come to rest by itself"
        fault = self.blocked or (self._follow.fault if intent.motion == "follow" else "")
        if fault and not self._fault:
            self._fault = fault
            self.robot.stop()
        if not self._fault and not self.correction.over:
            self.robot.permit(self._waits)

    def _begin(self, intent: Intent) -> None:
        """Start the plan that was confirmed, or to follow, once."""
        self._started, self.arrived = intent.execute or FOLLOWS, None
        if self.hanging is not None:
            self.hanging.end()
        self.correction.forget()
        if intent.motion == "follow":
            following = Following(self.core.settings.follow_delay, self.period, self.core.mount_offset)
            self._fault = self.blocked or self.robot.follow(following)
            self.log_writer.event("follow", refused=self._fault)
            if not self._fault:
                self._follow.begin()
            return
        if self.plan is None or self.plan.digest() != intent.execute:
            self._fault = "the plan that was confirmed is not there"
            return
        self._fault = self.blocked or self.robot.start(self.plan, intent.execute)
        self.log_writer.event("execute", digest=intent.execute, refused=self._fault)
        if not self._fault:
            self.correction.begin(self._requested, self.plan, self.world)

    def _believe(self, robot_state: RobotState, executor: ExecutorReport) -> None:
        done = executor.mode == "done" and executor.digest != self._believed and self.plan is not None
        phases = tuple(name for name, _ in self.plan.phases) if done and self.plan is not None else ()
        if done:
            self._believed, self.arrived = executor.digest, self._arrival(executor.digest)
        self.world = update_world(self.world, robot_state.object, phases, self.lift)

    def _arrival(self, digest: str) -> tuple[np.ndarray, float] | None:
        """Where a plan's preview has the tip at its end (3,), m, and the radius about it that it states, m; None where
        it states none, or where the plan has corrected itself since."""
        foreseen, corrects = self.prediction, self.plan is None or self.plan.correction is not None
        if corrects or foreseen is None or foreseen.digest != digest or not foreseen.spread:
            return None
        return np.array(foreseen.tip[-1]), foreseen.spread[-1]

    # --- what is told

    @property
    def fault(self) -> str:
        """Why the robot must not go on, "" where it may."""
        return self._fault

    @property
    def refused(self) -> str:
        """Why the newest targets are not followed, "" where they are."""
        return self._follow.refused

    def drawn_tip(self) -> np.ndarray | None:
        """Where the drawn robot's tip is, m, (3,); None where its body is not drawn."""
        subject = self.log_writer.subject
        if subject.tip[0] not in subject.bodies:
            return None
        pose = self.robot.robot_state().bodies[subject.bodies.index(subject.tip[0])]
        return pose[:3] + rotation_from_wxyz(pose[3:]).apply(subject.tip[1])

    def markers(self) -> np.ndarray:
        """Poses of MARKERS, (4, 7); NaN where there are none."""
        poses = np.full((len(MARKERS), 7), np.nan)
        if self.intent is None:
            return poses
        for row, end in enumerate(self.intent.rays):
            if end is not None:
                poses[row] = (*end, 1.0, 0.0, 0.0, 0.0)
        targets = self.intent.targets
        if targets is not None:
            turn = base_quaternion(targets.pointing, targets.heading)
            poses[2], poses[3] = (*targets.rigid.position, *turn), (*targets.tip.position, *turn)
        else:
            for row, hand in ((2, self._rigid), (3, 1 - self._rigid)):
                target = self.state.hands[hand].target
                if target is not None:
                    poses[row] = (*target, 1.0, 0.0, 0.0, 0.0)
        return poses

    def state_message(self, holder: str) -> messages.StateMessage:
        """The state for clients, `holder` controlling; where nobody does, the core's notice is left out: of nobody."""
        intent, robot = self.intent, self.correction.report(self.robot.state())
        assert intent is not None
        hands = self.state.hands
        touched = hands[self._rigid].target is not None, hands[1 - self._rigid].target is not None
        words = next_action(intent.mode, intent.targets, holder, self.alignment is not None, touched)
        keys = next_key(intent.mode, intent.targets, holder, touched)
        slow = "the page draws too slowly, the robot waits for it" if self._slow else ""
        notice = self.refused or self.notice or slow if holder else ""
        return messages.StateMessage(
            intent.mode, intent.motion, _joined(notice, self.blocked), words, keys,
            round(intent.countdown, 2), intent.preview, intent.execute, _rounded(intent.targets),
            robot.mode, robot.fault, self.correction.words,
        )  # fmt: skip


def _joined(notice: str, blocked: str) -> str:
    """One line of both."""
    return notice if blocked in notice else f"{notice}; {blocked}".removeprefix("; ")


def _rounded(targets: Targets | None) -> Targets | None:
    """To 0.1 mm and 1e-4: what still changes by less is nothing new to tell."""
    if targets is None:
        return None

    def round_vector(values: Vector) -> Vector:
        x, y, z = (round(value, DIGITS) for value in values)
        return x, y, z

    def round_target(target: Target) -> Target:
        offer, by = target.offer, target.outside_by
        return replace(
            target,
            position=round_vector(target.position),
            outside_by=round(by, DIGITS),
            offer=offer and round_vector(offer),
        )

    turned = None if targets.turned is None else round(targets.turned, DIGITS)
    return replace(
        targets, rigid=round_target(targets.rigid), tip=round_target(targets.tip),
        pointing=round_vector(targets.pointing), heading=round(targets.heading, DIGITS), turned=turned,
    )  # fmt: skip
