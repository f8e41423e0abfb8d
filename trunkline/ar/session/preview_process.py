"""Plans and their previews, in a process of its own: what takes longer than a frame.

One order at a time; a newer order ends the one before within a quarter of a simulated second. The answers to an order
are a `PlanAnswer`; then, if there is a plan, a `PreviewBegun`, each `PreviewPiece` of the nominal twin's motion as soon
as it is simulated, and a `PredictionAnswer`, the result of the batch of rollouts, again where the assistant has an
offer.
"""

import itertools
import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from trunkline.ar.hybrid.preview import WITHIN, nominal
from trunkline.ar.hybrid.rollouts import FRAME, CommandTrajectory, ComposedTwin
from trunkline.ar.preview.grasp_preview import GraspPreviewer, PlanPrediction
from trunkline.ar.preview.package import Package, read_package
from trunkline.ar.preview.preview_twin import at_rest, compose_twin, robot_model_of
from trunkline.ar.preview.settings import Previewing
from trunkline.ar.session import messages
from trunkline.ar.session.bodies import BodyPoses
from trunkline.ar.teleop.config import TeleoperationConfig
from trunkline.ar.teleop.following import sought
from trunkline.ar.teleop.messages import PlanReport, Request, Target, Targets, Thing, World
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.vectors import DOWN
from trunkline.compute.processes import end_with_parent, leave_signals_to_parent
from trunkline.compute.threads import thread_count
from trunkline.errors import InputError
from trunkline.kinematics.panda.kinematics import mount_pose

NICE = 10
PULL = 0.03  # m of the first cable, for a plan that is thrown away


@dataclass(frozen=True)
class Order:
    """A plan that is asked for, from the robot at rest at `joints` (7,), rad, and `commands` (K,), m."""

    request: Request
    world: World
    joints: np.ndarray
    commands: np.ndarray


@dataclass(frozen=True)
class FollowRequest:
    """What `targets` ask of a robot that follows is asked for, the nearest to `joints` (7,), rad; targets None: nothing
    that it may follow."""

    serial: int
    targets: Targets | None
    joints: np.ndarray
    world: World


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
    foreseen: messages.PredictionMessage


@dataclass(frozen=True)
class Ready:
    """The process has compiled what it needs, and hears orders."""


Answer = PlanAnswer | PreviewBegun | PreviewPiece | PredictionAnswer | FollowAnswer


class Overtaken(Exception):
    """A newer order has come."""


class PreviewPlanner:
    """Plans and previews. `bodies`: names of those whose poses are told."""

    def __init__(self, planner: Planner, foresight: GraspPreviewer, bodies: tuple[str, ...]) -> None:
        self.planner, self.foresight, self.bodies = planner, foresight, bodies
        self.robot_model, self.previewing = foresight.robot_model, foresight.settings
        self._composed: tuple[tuple, ComposedTwin | None] = ((), None)
        self._grasped: PlanPrediction | None = None  # the last grasp: of a thing that is held, the one that was run

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

    def answers(self, order: Order | FollowRequest, go_on: Callable[[], None] = lambda: None) -> Iterator[Answer]:
        """All that comes of an order, each as soon as it is known. `go_on` raises where it need not be."""
        if isinstance(order, FollowRequest):
            yield FollowAnswer(order.serial, *sought(self.planner, order.targets, order.joints, order.world))
            return
        request, serial = order.request, order.request.serial
        try:
            plan = self.planner.plan(request, order.world, order.joints, order.commands)
        except InputError as error:
            yield PlanAnswer(PlanReport(serial, refused=str(error)))
            return
        digest = plan.digest()
        yield PlanAnswer(PlanReport(serial, digest, "", plan.package, plan.world), plan)
        way = self.foresight.whole(plan)
        held_object = _held_object(order)
        if held_object is not None and self._grasped is not None:
            twin = self.foresight.carrying(held_object, order.world, way, None, self._grasped)
        else:
            twin = self._twin(order.world, _beside(order), way.joints[0], way.commands[0])
        phases = tuple((name, plan.step * row) for name, row in plan.phases)
        step = twin.model.opt.timestep * max(round(FRAME / twin.model.opt.timestep), 1)
        yield PreviewBegun(serial, messages.PreviewMessage(digest, step, way.duration, step, phases))
        go_on()
        yield from self._shown(serial, twin, way, go_on)
        for prediction in self._foreseen(order, plan, twin, way, go_on):
            yield PredictionAnswer(serial, prediction_message(digest, prediction))

    def prepare(self, order: Order) -> None:
        """Compose its twin, which the next order takes, where nothing has changed."""
        self._twin(order.world, _beside(order), order.joints, order.commands)

    def _twin(self, world: World, thing: Thing | None, joints: np.ndarray, commands: np.ndarray) -> ComposedTwin:
        """The last one where nothing has changed: to compile another takes longer than a piece of a preview."""
        composed, twin = self._composed
        if twin is not None and composed == (world.boxes, thing):
            twin = at_rest(twin, joints, commands, self.robot_model.robot.mount_offset)
        else:
            twin = compose_twin(self.robot_model, world, thing, joints, commands, self.previewing)
        self._composed = (world.boxes, thing), twin
        return twin

    def _shown(
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

    def _foreseen(
        self, order: Order, plan: Plan, twin: ComposedTwin, way: CommandTrajectory, go_on: Callable[[], None]
    ) -> Iterator[PlanPrediction]:
        targets, serial = order.request.targets, order.request.serial
        thing, held_object = order.world.thing(targets.thing) if targets.thing else None, _held_object(order)
        if thing is not None and held_object is None:
            for prediction in self.foresight.grasp(plan, targets, thing, order.world, None, serial, go_on):
                self._grasped = prediction
                yield prediction
        elif held_object is not None and self._grasped is not None:
            yield self.foresight.bring(plan, targets, held_object, order.world, None, self._grasped, serial, go_on)
        else:
            yield self.foresight.free(twin, way, serial, go_on)


def prediction_message(digest: str, prediction: PlanPrediction) -> messages.PredictionMessage:
    """As clients hear it: times from the plan's beginning on."""
    preview, stated = prediction.preview, prediction.preview.stated
    low_high = preview.interval or (None, None)
    tips = tuple((float(x), float(y), float(z)) for x, y, z in stated.tips)
    return messages.PredictionMessage(
        digest, preview.probability, *low_high, tuple(map(float, prediction.begins + stated.times)), tips,
        tuple(map(float, stated.radii)), WITHIN, len(preview.samples), prediction.offer,
    )  # fmt: skip


def _beside(order: Order) -> Thing | None:
    """What the twin may touch: one thing, the one that is meant, else any; none that the arm holds."""
    things = [thing for thing in order.world.things if thing.support != "held"]
    meant = [thing for thing in things if thing.name == order.request.targets.thing]
    return (meant or things or [None])[0]


def _held_object(order: Order) -> Thing | None:
    """The thing that is brought elsewhere, None where none is."""
    name = order.request.targets.thing
    thing = order.world.thing(name) if name else None
    return thing if thing is not None and thing.support == "held" else None


class PreviewProcess:
    """The process, seen from the server; another one where it has ended. `heard` is called by a thread of its own with
    every answer, and with None once the process has ended."""

    def __init__(self, run: Callable, setup: tuple, heard: Callable[[Answer | None], None]) -> None:
        self._run, self._setup, self._heard = run, setup, heard
        self._context = multiprocessing.get_context("spawn")
        self._newest, self._closed, self._lock = self._context.RawValue("Q", 0), False, threading.Lock()
        self.ready = threading.Event()
        self._begin()
        threading.Thread(target=self._listen, daemon=True).start()

    def _begin(self) -> None:
        """With a pipe and a queue of its own: those of one that was killed may be locked for ever."""
        self._answers, theirs = self._context.Pipe(duplex=False)
        self._orders = self._context.Queue()
        arguments = theirs, self._orders, self._newest, *self._setup
        self._process = self._context.Process(target=self._run, args=arguments, daemon=True, name="foreseer")
        self._process.start()
        theirs.close()

    @property
    def pid(self) -> int | None:
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether its process is there."""
        return self._process.is_alive()

    def order(self, order: Order | FollowRequest) -> None:
        """It does not wait; the order before is left."""
        with self._lock:
            self._newest.value += 1
            self._orders.put((self._newest.value, order))

    def leave(self) -> None:
        """What was ordered is not wanted any more."""
        with self._lock:
            self._newest.value += 1

    def close(self) -> None:
        with self._lock:
            self._closed = True
        self._orders.cancel_join_thread()
        self._process.terminate()
        self._process.join(5.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _listen(self) -> None:
        while True:
            try:
                answer = self._answers.recv()
                if isinstance(answer, Ready):
                    self.ready.set()
                else:
                    self._heard(answer)
            except (EOFError, OSError):
                self._heard(None)
                with self._lock:
                    if self._closed or not self.ready.is_set():  # one that never began would not begin again
                        return
                    self.ready.clear()
                    self._orders.cancel_join_thread()
                    self._process.join()
                    self._begin()


def run(
    answers,
    orders,
    newest,
    path: Path,
    config: TeleoperationConfig,
    previewing: Previewing,
    bodies: tuple[str, ...],
    world: World,
) -> None:
    """The process: until its parent is gone. world: the first plans are likely to be asked for in it."""
    leave_signals_to_parent()
    os.environ["TRUNKLINE_THREADS"] = str(max(thread_count() - 1, 1))  # the rest is the server's and the robot's
    with suppress(OSError):
        os.nice(NICE)
    threadpool_limits(1)  # matrices are small; threads that wait for each other cost more than they bring
    end_with_parent()
    package = read_package(path)
    planner = PreviewPlanner.of(package, config, previewing, bodies)
    warm(planner, package, world)
    answers.send(Ready())
    serve(answers, orders, newest, planner)


def warm(planner: PreviewPlanner, package: Package, world: World) -> None:
    """Plan and preview once for nothing: what is compiled on its first call would keep the first user waiting, and so
    would the twin of the `world`."""
    robot, straight = planner.robot_model.robot, package.straight
    joints = np.array(robot.ready)
    x, y, z = (float(value) for value in mount_pose(joints[None], robot.mount_offset)[0][0])
    targets = Targets(Target((x, y, z)), Target((x, y, z)), DOWN, 0.0, 0, 0.0)
    a, b, c = (float(value) for value in package.tip((x, y, z), targets, straight - PULL * np.eye(len(straight))[0]))
    request = Request(0, replace(targets, tip=Target((a, b, c))), "", package.digest)
    order = Order(request, World(""), joints, straight)
    for answer in planner.answers(order):
        if isinstance(answer, PreviewPiece):
            break
    planner.prepare(replace(order, world=world))


def serve(answers, orders, newest, planner: PreviewPlanner) -> None:
    """Orders in, answers out."""
    for number, order in (orders.get() for _ in itertools.count()):

        def go_on(number: int = number) -> None:
            if newest.value != number:
                raise Overtaken

        with suppress(Overtaken):
            go_on()
            try:
                for answer in planner.answers(order, go_on):
                    answers.send(answer)
            except (InputError, ArithmeticError, ValueError) as error:  # a plan without a preview is never confirmed
                refused = f"preview: {type(error).__name__}: {error}".splitlines()[0]
                if isinstance(order, FollowRequest):
                    answers.send(FollowAnswer(order.serial, None, refused))
                else:
                    answers.send(PlanAnswer(PlanReport(order.request.serial, refused=refused)))
