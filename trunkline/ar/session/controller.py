"""What stands around the core: inputs in, and plans, previews and the robot's motion as it wants them.

It has no sockets and no clock: the server calls it, with the time. Every decision that can move the robot is here or in
the core. It holds wherever it does not know.
"""

import re
from collections import deque
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from trunkline.ar.preview.world_model import believe
from trunkline.ar.session import messages, preview_process
from trunkline.ar.session.binary import MARKERS, Received
from trunkline.ar.session.controller_input import NOWHERE, controllers
from trunkline.ar.session.follow import FollowControl
from trunkline.ar.session.log_writer import LogWriter
from trunkline.ar.session.robot import RobotState
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
from trunkline.ar.teleop.plan import Plan
from trunkline.version import __version__

HERE = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))  # of poses that are in the base frame already
NUMBER = re.compile(r"[\d.]+")
DIGITS = 4  # after the decimal point, of targets that are told
MOST_INPUTS = 8  # of a tick; older ones than these are left out, presses and all


class Robot(Protocol):
    """An `Executor` that has to be permitted anew all the time."""

    def start(self, plan: Plan, digest: str) -> str: ...
    def follow(self, following: Following) -> str: ...
    def hear(self, age: float, axes: np.ndarray | None) -> None: ...
    def permit(self) -> None: ...
    def stop(self) -> None: ...
    def state(self) -> ExecutorReport: ...
    def standing(self) -> RobotState: ...


class Planning(Protocol):
    """What answers orders, some time later, by `SessionController.foreseen`."""

    def order(self, order: preview_process.Order | preview_process.FollowRequest) -> None: ...
    def leave(self) -> None: ...


@dataclass(frozen=True)
class HandInput:
    stamp: float
    left: Controller
    right: Controller


class SessionController:
    """One robot, one core. `lift`: m by which a thing is lifted by a grasp. `journal`: what is told all of it.
    `period`: s, of the arm's slowest swing."""

    def __init__(
        self,
        core: Teleoperation,
        robot: Robot,
        planning: Planning,
        world: World,
        lift: float,
        journal: LogWriter | None = None,
        period: float = 0.0,
    ) -> None:
        self.core, self.robot, self.planning, self.world = core, robot, planning, world
        self.lift, self.period = lift, period
        self.journal = journal or LogWriter()
        self.state = core.start()
        self.alignment: Pose | None = None
        self.unfit = ""
        self.plan: Plan | None = None
        self.preview: messages.PreviewMessage | None = None
        self.foreseen: messages.PredictionMessage | None = None
        self.report: PlanReport | None = None
        self.pieces: list[preview_process.PreviewPiece] = []
        self.intent: Intent | None = None
        self._heard: deque[HandInput] = deque(maxlen=MOST_INPUTS)
        self._last, self._fresh = self._nobody, True
        self._stop, self._fault, self._shown, self._since, self._believed = False, "", "", 0.0, ""
        self._asked, self._ordered, self._started, self._ran = 0, False, "", False
        self._logged: tuple = ()
        self._seeking = FollowControl(planning.order, robot.hear)

    def begin(self, rate: float) -> None:
        """The log's first line: all that a replay needs besides the package. rate: of ticks, Hz."""
        core, subject = self.core, self.journal.subject
        self.journal.event(
            "begin", version=__version__, package=core.package, rate=rate, settings=core.settings,
            mount_offset=core.mount_offset, tip={"body": subject.tip[0], "place": subject.tip[1]},
            hardware=subject.hardware,
        )  # fmt: skip

    # --- what is heard

    def hear(self, received: Received) -> str:
        """An input of whom controls; why it does not count, "" where it does."""
        last = self._heard[-1] if self._heard else self._last
        if received.stamp <= last.stamp and not self._fresh:
            return f"input: stamp {received.stamp:.6g} s is not after {last.stamp:.6g} s: heard before"
        self._fresh = False
        self._heard.append(HandInput(received.stamp, *controllers(received)))
        return ""

    def stop(self) -> None:
        """Of anybody: the robot is told at once, the core at its next step."""
        self._stop = True
        self.robot.stop()
        if self.intent is None or self.intent.mode != "stopped":
            self.journal.event("stop")

    def control(self, alignment: Pose | None, unfit: str = "") -> None:
        """Somebody else controls now, or nobody, who is aligned so."""
        self._heard.clear()
        self._last, self._fresh = self._nobody, True
        self.align(alignment, unfit)
        self.robot.stop()

    def align(self, alignment: Pose | None, unfit: str) -> None:
        """Of whom controls, its reference frame in the base; `unfit`: why nothing may be executed so, "" where it
        may."""
        self.alignment, self.unfit = alignment, unfit

    def shown(self, digest: str, now: float) -> str:
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
        self._shown = digest
        self.journal.event("shown", digest=digest)
        return ""

    def answered(self, answer: preview_process.Answer | None, now: float) -> bool:
        """An answer of `planning`, None if it has ended; whether it is of the plan that is wanted."""
        if answer is None:
            self.report = PlanReport(self._asked, refused="the process that plans has ended")
            return False
        if isinstance(answer, preview_process.FollowAnswer):
            self._seeking.found(answer)
            return False
        serial = answer.report.serial if isinstance(answer, preview_process.PlanAnswer) else answer.serial
        if serial != self._asked:
            return False
        if isinstance(answer, preview_process.PlanAnswer):
            self.report, self.plan = answer.report, answer.plan
            self.journal.event("planned", report=answer.report)
        elif isinstance(answer, preview_process.PreviewBegun):
            self.preview, self._since = answer.preview, now
            self.journal.event("preview", preview=answer.preview)
        elif isinstance(answer, preview_process.PreviewPiece):
            self.pieces.append(answer)
            self.journal.piece(answer.first, answer.time, answer.poses)
        else:
            self.foreseen = answer.foreseen
            self.journal.event("foreseen", foreseen=answer.foreseen)
        return True

    # --- what is done

    def tick(self, dt: float) -> Intent:
        """Let `dt` s pass; every input since the last tick is a step of the core."""
        standing, executor = self.robot.standing(), self.robot.state()
        if self.state.mode in ("hold", "aim"):
            self._believe(standing, executor)
        joints: Joints = tuple(float(q) for q in standing.joints)  # type: ignore[assignment]
        steps = list(self._heard) or [self._last]
        self._heard.clear()
        for heard in steps:
            executor = ExecutorReport("fault", "", self._fault) if self._fault else executor
            offer = self.foreseen.offer if self.foreseen is not None else None
            left, right = heard.left, heard.right
            if self._stop:
                left, self._stop = replace(left, secondary=True), False
            given = Input(
                heard.stamp, left, right, self.alignment, joints, self.world, self.core.package, self.report,
                self._shown, executor, offer,
            )  # fmt: skip
            self.state, intent = self.core.step(self.state, given, dt / len(steps))
            self._ask(intent, standing)
            self._seeking.advance(dt / len(steps))
            if intent.mode == "follow":
                self._seeking.seek(intent.targets, standing.joints, self.world)
            else:
                self._seeking.end()
            self._drive(intent)
            self.journal.step(dt / len(steps), given, intent)
        self._last = steps[-1]
        self.intent = intent
        self._tell_journal(intent, standing)
        return intent

    @property
    def blocked(self) -> str:
        """Why nothing may be executed, whatever the core wants; "" where it may."""
        return self.journal.fault or self.unfit

    def _tell_journal(self, intent: Intent, standing: RobotState) -> None:
        """What is at the end of a tick; of what seldom changes, the changes."""
        journal = self.journal
        journal.standing(standing)
        robot = self.robot.state()
        said, fault = (NUMBER.sub("", text) for text in (intent.notice, robot.fault))  # what counts on is told once
        now = (intent.mode, said), (robot.mode, fault, robot.digest), self.alignment, self.world
        mode, acts, alignment, world = self._logged or (None,) * 4
        self._logged = now
        if now[0] != mode:
            journal.event("mode", mode=intent.mode, notice=intent.notice, digest=intent.preview or intent.execute)
        if now[1] != acts:
            journal.event("robot", robot=robot)
        if self.alignment != alignment:
            journal.event("alignment", pose=self.alignment)
            if self.alignment is not None:
                journal.alignment(self.alignment)
        if self.world is not world:
            journal.event("world", world=self.world)

    @property
    def _rigid(self) -> int:
        """Which hand holds the rigid target."""
        return ("left", "right").index(self.core.settings.rigid_hand)

    @property
    def _nobody(self) -> HandInput:
        """Nothing heard, at the stamp of the last step."""
        stamp = self.state.stamp if self.state.stamp is not None else 0.0
        return HandInput(stamp, NOWHERE, NOWHERE)

    def _ask(self, intent: Intent, standing: RobotState) -> None:
        request = intent.request
        if request is not None and request.serial != self._asked:
            self._asked, self.report, self.plan, self.preview = request.serial, None, None, None
            self.foreseen, self.pieces, self._shown = None, [], ""
            self._ordered = True
            self.journal.event("request", request=request)
            self.planning.order(preview_process.Order(request, self.world, standing.joints, standing.commands))
        elif self._ordered and intent.mode in ("hold", "stopped", "aim", "execute"):
            self._ordered = False
            self.planning.leave()

    def _drive(self, intent: Intent) -> None:
        running = self.robot.state()
        if intent.motion == "hold":
            self._fault = self._fault if intent.mode == "stopped" else ""
            if running.mode == "running" or (self._started and not self._ran):  # a start on its way reads as idle
                self.robot.stop()
            self._started, self._ran = "", False
            return
        if self._started != (intent.execute or FOLLOWS):
            self._begin(intent)
        self._ran = self._ran or running.mode == "running"
        if self._ran and running.mode == "idle":
            self._fault = "it has come to rest by itself"
        fault = self.blocked or (self._seeking.fault if intent.motion == "follow" else "")
        if fault and not self._fault:
            self._fault = fault
            self.robot.stop()
        if not self._fault:
            self.robot.permit()

    def _begin(self, intent: Intent) -> None:
        """Start the plan that was confirmed, or to follow, once."""
        self._started = intent.execute or FOLLOWS
        if intent.motion == "follow":
            following = Following(self.core.settings.follow_delay, self.period, self.core.mount_offset)
            self._fault = self.blocked or self.robot.follow(following)
            self.journal.event("follow", refused=self._fault)
            if not self._fault:
                self._seeking.begin()
            return
        if self.plan is None or self.plan.digest() != intent.execute:
            self._fault = "the plan that was confirmed is not there"
            return
        self._fault = self.blocked or self.robot.start(self.plan, intent.execute)
        self.journal.event("execute", digest=intent.execute, refused=self._fault)

    def _believe(self, standing: RobotState, executor: ExecutorReport) -> None:
        done = executor.mode == "done" and executor.digest != self._believed and self.plan is not None
        phases = tuple(name for name, _ in self.plan.phases) if done and self.plan is not None else ()
        if done:
            self._believed = executor.digest
        self.world = believe(self.world, standing.thing, phases, self.lift)

    # --- what is told

    def markers(self) -> np.ndarray:
        """Poses of MARKERS, (4, 7); NaN where there are none."""
        found = np.full((len(MARKERS), 7), np.nan)
        if self.intent is None:
            return found
        for row, end in enumerate(self.intent.rays):
            if end is not None:
                found[row] = (*end, 1.0, 0.0, 0.0, 0.0)
        targets = self.intent.targets
        if targets is not None:
            turn = base_quaternion(targets.pointing, targets.heading)
            found[2], found[3] = (*targets.rigid.position, *turn), (*targets.tip.position, *turn)
        else:
            for row, hand in ((2, self._rigid), (3, 1 - self._rigid)):
                target = self.state.hands[hand].target
                if target is not None:
                    found[row] = (*target, 1.0, 0.0, 0.0, 0.0)
        return found

    def told(self, holder: str) -> messages.StateMessage:
        """The state for clients, `holder` controlling; where nobody does, the core's notice is left out: of nobody."""
        intent, robot = self.intent, self.robot.state()
        assert intent is not None
        hands = self.state.hands
        touched = hands[self._rigid].target is not None, hands[1 - self._rigid].target is not None
        words = next_action(intent.mode, intent.targets, holder, self.alignment is not None, touched)
        keys = next_key(intent.mode, intent.targets, holder, touched)
        notice = intent.notice or self._seeking.refused if holder else ""
        return messages.StateMessage(
            intent.mode, intent.motion, _joined(notice, self.blocked), words, keys,
            round(intent.countdown, 2), intent.preview, intent.execute, _rounded(intent.targets),
            robot.mode, robot.fault,
        )  # fmt: skip


def _joined(notice: str, blocked: str) -> str:
    """One line of both."""
    return notice if blocked in notice else f"{notice}; {blocked}".removeprefix("; ")


def _rounded(targets: Targets | None) -> Targets | None:
    """To 0.1 mm and 1e-4: what still changes by less is nothing new to tell."""
    if targets is None:
        return None

    def vector(found: Vector) -> Vector:
        x, y, z = (round(value, DIGITS) for value in found)
        return x, y, z

    def target(found: Target) -> Target:
        offer, by = found.offer, found.outside_by
        return replace(
            found, position=vector(found.position), outside_by=round(by, DIGITS), offer=offer and vector(offer)
        )

    turned = None if targets.turned is None else round(targets.turned, DIGITS)
    return replace(
        targets, rigid=target(targets.rigid), tip=target(targets.tip), pointing=vector(targets.pointing),
        heading=round(targets.heading, DIGITS), turned=turned,
    )  # fmt: skip
