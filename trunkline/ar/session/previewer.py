"""Plans and their previews: what is asked of whoever makes them, and what is answered.

The answers to an order are a `PlanAnswer`; then, if there is a plan, a `PreviewBegun`, each `PreviewPiece` of the
nominal twin's motion as soon as it is simulated, and a `PredictionAnswer`, the result of the batch of rollouts, again
where the assistant has an offer.

Statics without friction say with which commands the arm comes to a target; the twin, run through the plan, stays short
of it by what its cables' friction holds. A reach is planned anew by that, until its preview ends at the target. One
that may correct itself is not: short of its target, its steps pull on, which the arm answers at once, while what is to
let go stays where it is until friction has turned round.

A live session has them made by a process (`preview_process.py`), a rehearsal by the same `PreviewPlanner` in line.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.ar.hybrid.rollout_batch import WITHIN, interruptible, nominal
from trunkline.ar.hybrid.rollouts import FRAME, CommandTrajectory, ComposedTwin
from trunkline.ar.preview.grasp_preview import GraspPreviewer, PlanPrediction
from trunkline.ar.preview.package import Package
from trunkline.ar.preview.preview_twin import at_rest, compose_twin, robot_model_of
from trunkline.ar.preview.settings import Previewing
from trunkline.ar.session import messages
from trunkline.ar.session.bodies import BodyPoses
from trunkline.ar.session.correction_rests import MeasuredRest, leaning_rest, learnt_from
from trunkline.ar.session.correction_steps import (
    DOWN,
    CorrectionAnswer,
    CorrectionOrder,
    CorrectionSteps,
    why_uncorrected,
)
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.ar.teleop.config import TeleoperationConfig
from trunkline.ar.teleop.following import sought
from trunkline.ar.teleop.messages import PlanReport, Request, Targets, World, WorldObject
from trunkline.ar.teleop.plan import CorrectionBounds, Plan
from trunkline.ar.teleop.planner import Planner
from trunkline.errors import InputError
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses

AIMED, ROUNDS = 1e-3, 3  # m from its target that a preview may end, and how often a reach is planned anew at most
STILL = 30  # frames at the end of a preview, in which a tip at rest keeps within AIMED of their mean
EMPTY = World("empty")


@dataclass(frozen=True)
class Order:
    """A plan that is asked for, from the robot at rest at `joints` (7,), rad, and `commands` (K,), m. hangs: where the
    straight arm's tip is seen in its base frame, (3,), m; None where nobody sees it. correction: within which it may
    correct itself, None where it may not; uncorrected: why not, where it was asked to. rests: that corrections have
    measured, from which it begins."""

    request: Request
    world: World
    joints: np.ndarray
    commands: np.ndarray
    hangs: np.ndarray | None = None
    correction: CorrectionBounds | None = None
    uncorrected: str = ""
    rests: tuple[MeasuredRest, ...] = ()


@dataclass(frozen=True)
class FollowRequest:
    """What `targets` ask of a robot that follows is asked for, the nearest to `joints` (7,), rad; targets None: nothing
    that it may follow. hangs: as of an `Order`."""

    serial: int
    targets: Targets | None
    joints: np.ndarray
    world: World
    hangs: np.ndarray | None = None


@dataclass(frozen=True)
class FollowAnswer:
    """Axes (7 + K,), rad and m; None for the last ones still, `refused` says why, "" where there are no targets."""

    serial: int
    axes: np.ndarray | None
    refused: str


@dataclass(frozen=True)
class PlanAnswer:
    """What became of it; `plan` is None where it was refused."""

    report: PlanReport
    plan: Plan | None = None


@dataclass(frozen=True)
class PreviewBegun:
    """The preview of plan request `serial` begins."""

    serial: int
    preview: messages.PreviewMessage


@dataclass(frozen=True)
class PreviewPiece:
    """Frames of the preview from the one numbered `first`, at `time` s of the plan: poses (F, N, 7), float32."""

    serial: int
    first: int
    time: float
    poses: np.ndarray
    last: bool


@dataclass(frozen=True)
class PredictionAnswer:
    """What the batch says."""

    serial: int
    prediction: messages.PredictionMessage


AnyOrder = Order | FollowRequest | CorrectionOrder
Answer = PlanAnswer | PreviewBegun | PreviewPiece | PredictionAnswer | FollowAnswer | CorrectionAnswer


@dataclass(frozen=True)
class Planned:
    """A plan, and why it does not correct itself, "" where it does or was not asked to. residual_map: by which it was
    made. hysteresis: by how far friction holds its tip beside the rest without, m (3,), None where nobody needs it."""

    plan: Plan
    uncorrected: str
    residual_map: ResidualMap | None
    hysteresis: np.ndarray | None = None


class Previewer(Protocol):
    """One order at a time, the newest."""

    def submit(self, order: AnyOrder) -> None:
        """It does not wait; the order before is left."""
        ...

    def leave(self) -> None:
        """What was ordered is not wanted any more."""
        ...

    def poll(self) -> list[Answer | None]:
        """What has been answered since the last poll; None of one that has ended."""
        ...


class PreviewPlanner:
    """Plans and previews. `bodies`: names of those whose poses are told; without any, no motion is simulated to be
    shown. `prediction`: the newest, of the plan that was ordered last."""

    def __init__(self, planner: Planner, foresight: GraspPreviewer, bodies: tuple[str, ...]) -> None:
        self.planner, self.foresight, self.bodies = planner, foresight, bodies
        self.robot_model, self.previewing = foresight.robot_model, foresight.settings
        self.prediction: PlanPrediction | None = None
        self._corrections = CorrectionSteps(planner, self.robot_model.lacking)
        self._twins: dict[str, tuple[tuple, ComposedTwin]] = {}  # of the world as it is, and of none
        self._leans: tuple[bytes | None, Rotation | None] = (None, None)
        self._grasped: PlanPrediction | None = None  # the last grasp: of an object that is held, the one that was run

    @classmethod
    def of(
        cls, package: Package, config: TeleoperationConfig, previewing: Previewing, bodies: tuple[str, ...]
    ) -> "PreviewPlanner":
        """By a package alone.

        Raises:
            InputError: it has nothing to preview with.
        """
        foresight = GraspPreviewer(robot_model_of(previewing, package.files), package.grips(config), previewing)
        return cls(package.planner(config), foresight, bodies)

    def answers(self, order: AnyOrder, go_on: Callable[[], None] = lambda: None) -> Iterator[Answer]:
        """All that comes of an order, each as soon as it is known. `go_on` raises where it need not be. A plan whose
        preview breaks off is refused, as it could never be confirmed."""
        try:
            if isinstance(order, FollowRequest):
                planner = replace(self.planner, lean=self._lean(order.hangs))
                yield FollowAnswer(order.serial, *sought(planner, order.targets, order.joints, order.world))
            elif isinstance(order, CorrectionOrder):
                yield self._corrections.answer(order)
            else:
                yield from self._answers(order, go_on)
        except (InputError, ArithmeticError, ValueError) as error:
            refused = f"preview: {type(error).__name__}: {error}".splitlines()[0]
            if isinstance(order, FollowRequest):
                yield FollowAnswer(order.serial, None, refused)
            elif isinstance(order, CorrectionOrder):
                yield CorrectionAnswer(order.serial, order.number, None, refused)
            else:
                yield PlanAnswer(PlanReport(order.request.serial, refused=refused))

    def _answers(self, order: Order, go_on: Callable[[], None]) -> Iterator[Answer]:
        request, serial = order.request, order.request.serial
        self.prediction = None
        try:
            planned = self._planned(order, go_on)
        except InputError as error:
            yield PlanAnswer(PlanReport(serial, refused=str(error)))
            return
        plan, digest = planned.plan, planned.plan.digest()
        yield PlanAnswer(PlanReport(serial, digest, "", plan.package, plan.world), plan)
        way = self.foresight.whole(plan, bool(request.targets.object))
        twin = cache(partial(self._twin_of, order, way))
        if self.bodies:
            twin()  # a preview's time begins once it is composed
        phases = tuple((name, plan.step * row) for name, row in plan.phases)
        step = self.previewing.step * max(round(FRAME / self.previewing.step), 1)
        yield PreviewBegun(serial, messages.PreviewMessage(
            digest, step, way.duration, step, phases, plan.correction, planned.uncorrected
        ))  # fmt: skip
        go_on()
        if self.bodies:
            yield from self._pieces_of(serial, twin(), way, go_on)
        else:
            yield PreviewPiece(serial, 0, 0.0, np.empty((0, 0, 7), dtype=np.float32), True)
        for prediction in self._predictions(order, planned, twin, way, go_on):
            self.prediction = prediction
            target = None if request.targets.object else np.array(request.targets.tip.position)
            yield PredictionAnswer(serial, prediction_message(digest, prediction, target))

    def _planned(self, order: Order, go_on: Callable[[], None]) -> Planned:
        """From rests that were measured, and for an arm that leans as it is seen to.

        Raises:
            InputError: what forbids it.
        """
        targets, bounds, uncorrected = order.request.targets, order.correction, order.uncorrected
        planner = replace(self.planner, residual_map=self._learnt(order), lean=self._lean(order.hangs))
        plan = self._plan_by(planner, order)
        if bounds is not None:
            lacking = self.robot_model.lacking
            uncorrected = why_uncorrected(plan, targets, order.world, bounds, self.planner, lacking)
            plan = plan if uncorrected else replace(plan, correction=bounds)
        planned = Planned(plan, uncorrected, planner.residual_map)
        aims = plan.correction is None
        if targets.object or planner.chain is None or not (aims or planner.residual_map):
            return planned
        missed, hysteresis = self._missed(planner, plan, order, go_on)
        for _ in range(ROUNDS if aims else 0):
            if not AIMED < np.linalg.norm(missed) <= planner.tolerance:
                break
            x, y, z = (float(value) for value in planner.overshoot + missed)
            planner = replace(planner, overshoot=(x, y, z))
            try:
                nearer = self._plan_by(planner, order)
            except InputError:  # out of reach, or in the way of something
                break
            left, nearer_hysteresis = self._missed(planner, nearer, order, go_on)
            if not np.linalg.norm(left) < np.linalg.norm(missed):
                break
            plan, missed, hysteresis = nearer, left, nearer_hysteresis
        return replace(planned, plan=plan, hysteresis=hysteresis)

    def _plan_by(self, planner: Planner, order: Order) -> Plan:
        beside = 0.0 if order.hangs is None else float(order.hangs[1])
        return planner.plan(order.request, order.world, order.joints, order.commands, beside)

    def _missed(
        self, planner: Planner, plan: Plan, order: Order, go_on: Callable[[], None]
    ) -> tuple[np.ndarray, np.ndarray]:
        """From its target to where a reach's preview ends that touches nothing; and by how far friction holds the tip
        there beside the rest without. Both (3,), m, NaN where MuJoCo warns, the arm swings, or statics find no rest."""
        assert planner.chain is not None, "plans without are not looked at"
        way = self.foresight.whole(plan, False)
        twin = self._composed(EMPTY, None, planner.lean, way.joints[0], way.commands[0])
        pieces = list(interruptible(nominal(twin, way), go_on))
        tips = np.concatenate([piece.tip[0] for piece in pieces])[-STILL:]
        tip = tips.mean(axis=0)
        if not pieces[-1].sound[0] or np.linalg.norm(tips - tip, axis=1).max() > AIMED:
            tip = np.full(3, np.nan)
        place, base = base_frames(plan.joints[-1], planner.mount_offset)
        gravity = (DOWN @ base)[None]
        rest, tips_without = leaning_rest(planner.chain, plan.commands[-1:], gravity, planner.lean)
        hysteresis, shift = tip - place - base @ tips_without[0], np.zeros(3)
        if planner.residual_map is not None:
            learnt, poses = planner.residual_map, RestingPoses.of(planner.chain, rest, gravity)
            shift = base @ learnt.mean(poses)[0] - (1 - learnt.unknown(poses)[0]) * hysteresis
        return tip + shift - order.request.targets.tip.position, hysteresis

    def _lean(self, hangs: np.ndarray | None) -> Rotation | None:
        """How the arm is turned on its mount, the last where that is seen as it was."""
        key = None if hangs is None else hangs.tobytes()
        if key != self._leans[0]:
            self._leans = key, self.robot_model.lean(hangs)
        return self._leans[1]

    def _learnt(self, order: Order) -> ResidualMap | None:
        """Of the arm, beside a twin that leans as it is seen to."""
        planner = self.planner
        if planner.chain is None or not order.rests:
            return planner.residual_map
        lean = self._lean(order.hangs)
        return learnt_from(order.rests, planner.chain, planner.mount_offset, planner.residual_map, lean)

    def prepare(self, order: Order) -> None:
        """Compose its twin, which the next order takes, where nothing has changed."""
        self._twin(order, order.joints, order.commands)

    def _twin_of(self, order: Order, way: CommandTrajectory) -> ComposedTwin:
        held_object = _held_object(order)
        if held_object is not None and self._grasped is not None:
            return self.foresight.carrying(held_object, order.world, way, order.hangs, self._grasped)
        return self._twin(order, way.joints[0], way.commands[0])

    def _twin(self, order: Order, joints: np.ndarray, commands: np.ndarray) -> ComposedTwin:
        """It leans as the robot does. The last one where nothing has changed: to compile another takes longer than a
        piece of a preview."""
        return self._composed(order.world, _beside(order), self._lean(order.hangs), joints, commands)

    def _composed(
        self,
        world: World,
        object: WorldObject | None,
        lean: Rotation | None,
        joints: np.ndarray,
        commands: np.ndarray,
    ) -> ComposedTwin:
        """At rest at `joints` (7,), rad, and `commands` (K,), m. The last of a `world`, and of EMPTY, is not composed
        anew."""
        kind, now = "empty" if world is EMPTY else "", (world.obstacles, object, lean)
        before, twin = self._twins.get(kind, ((), None))
        if twin is not None and before == now:
            twin = at_rest(twin, joints, commands, self.planner.mount_offset, lean)
        else:
            twin = compose_twin(self.robot_model, world, object, joints, commands, self.previewing, lean)
        self._twins[kind] = now, twin
        return twin

    def _pieces_of(
        self, serial: int, twin: ComposedTwin, way: CommandTrajectory, go_on: Callable[[], None]
    ) -> Iterator[Answer]:
        poses, first, piece_answer = BodyPoses(twin.model, self.bodies), 0, None
        for piece in nominal(twin, way):
            if piece_answer is not None:
                yield piece_answer
            frames = poses.of_piece(piece)
            piece_answer = PreviewPiece(serial, first, float(piece.time[0]), frames, False)
            first += len(frames)
            if piece.time[-1] + 2 * FRAME < way.duration:  # not the last: it need not wait for the next
                yield piece_answer
                piece_answer = None
            go_on()
        if piece_answer is not None:
            yield PreviewPiece(serial, piece_answer.first, piece_answer.time, piece_answer.poses, True)

    def _predictions(
        self,
        order: Order,
        planned: Planned,
        twin: Callable[[], ComposedTwin],
        way: CommandTrajectory,
        go_on: Callable[[], None],
    ) -> Iterator[PlanPrediction]:
        plan, targets, serial = planned.plan, order.request.targets, order.request.serial
        object, held_object = order.world.object(targets.object) if targets.object else None, _held_object(order)
        if object is not None and held_object is None:
            for prediction in self.foresight.grasp(plan, targets, object, order.world, order.hangs, serial, go_on):
                self._grasped = prediction
                yield prediction
        elif held_object is not None and self._grasped is not None:
            yield self.foresight.bring(
                plan, targets, held_object, order.world, order.hangs, self._grasped, serial, go_on
            )
        else:
            learnt = planned.residual_map if order.rests else None
            yield self.foresight.free(twin(), way, order.hangs, serial, go_on, learnt, planned.hysteresis)


class InlinePreviewer:
    """A `Previewer` in the caller's process: the same `answers`, all there at the next poll."""

    def __init__(self, answers: Callable[[AnyOrder], Iterator[Answer]]) -> None:
        self._answers = answers
        self._ready: list[Answer | None] = []

    def submit(self, order: AnyOrder) -> None:
        self._ready += self._answers(order)

    def leave(self) -> None:
        """Nothing goes on by itself here."""

    def poll(self) -> list[Answer | None]:
        answers, self._ready = self._ready, []
        return answers


def prediction_message(
    digest: str, prediction: PlanPrediction, target: np.ndarray | None
) -> messages.PredictionMessage:
    """As clients hear it: times from the plan's beginning on. target: of the tip, m, (3,); None of an object."""
    preview, stated = prediction.preview, prediction.preview.stated
    low_high = preview.interval or (None, None)
    tips = tuple((float(x), float(y), float(z)) for x, y, z in stated.tips)
    return messages.PredictionMessage(
        digest, preview.probability, *low_high, tuple(map(float, prediction.begins + stated.times)), tips,
        tuple(map(float, stated.radii)), WITHIN, len(preview.samples),
        None if target is None else float(np.linalg.norm(preview.shown[-1] - target)), preview.unknown,
        prediction.offer,
    )  # fmt: skip


def _beside(order: Order) -> WorldObject | None:
    """What the twin may touch: one object, the one that is meant, else any; none that the arm holds."""
    objects = [object for object in order.world.objects if object.support != "held"]
    targeted = [object for object in objects if object.name == order.request.targets.object]
    return (targeted or objects or [None])[0]


def _held_object(order: Order) -> WorldObject | None:
    """The object that is brought elsewhere, None where none is."""
    name = order.request.targets.object
    object = order.world.object(name) if name else None
    return object if object is not None and object.support == "held" else None
