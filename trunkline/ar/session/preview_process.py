"""Plans and their previews, in a process of its own: what takes longer than a frame.

One order at a time; a newer order ends the one before within a quarter of a simulated second.
"""

import itertools
import multiprocessing
import os
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from trunkline.ar.preview.package import Package, read_package
from trunkline.ar.preview.settings import Previewing
from trunkline.ar.session.previewer import Answer, AnyOrder, Order, PlanAnswer, PreviewPiece, PreviewPlanner
from trunkline.ar.teleop.config import TeleoperationConfig
from trunkline.ar.teleop.messages import Request, Target, Targets, World
from trunkline.ar.teleop.vectors import DOWN
from trunkline.compute.processes import end_with_parent, leave_signals_to_parent
from trunkline.compute.threads import thread_count
from trunkline.errors import InputError
from trunkline.kinematics.panda.kinematics import mount_pose

PULL = 0.03  # m of the first cable, for a plan that is thrown away


@dataclass(frozen=True)
class Ready:
    """The process has compiled what it needs, and hears orders."""


class Overtaken(Exception):
    """A newer order has come."""


class PreviewProcess:
    """The process as a `Previewer`; another one where it has ended. A thread waits for its answers."""

    def __init__(self, run: Callable, setup: tuple) -> None:
        self._run, self._setup = run, setup
        self._ready: queue.SimpleQueue[Answer | None] = queue.SimpleQueue()
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

    def submit(self, order: AnyOrder) -> None:
        with self._lock:
            self._newest.value += 1
            self._orders.put((self._newest.value, order))

    def leave(self) -> None:
        with self._lock:
            self._newest.value += 1

    def poll(self) -> list[Answer | None]:
        return [self._ready.get_nowait() for _ in range(self._ready.qsize())]

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
                    self._ready.put(answer)
            except (EOFError, OSError):
                self._ready.put(None)
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
    threadpool_limits(1)  # matrices are small; threads that wait for each other cost more than they bring
    end_with_parent()
    package = read_package(path)
    planner = PreviewPlanner.of(package, config, previewing, bodies)
    warm(planner, package, world)
    answers.send(Ready())
    serve(answers, orders, newest, planner)


def warm(planner: PreviewPlanner, package: Package, world: World) -> None:
    """Plan and preview once for nothing: what is compiled on its first call would keep the first user waiting, and so
    would the twin of the `world`.

    Raises:
        InputError: there is a plan, but its preview breaks off, as any user's would.
    """
    robot, straight = planner.robot_model.robot, package.straight
    joints = np.array(robot.ready)
    x, y, z = (float(value) for value in mount_pose(joints[None], robot.mount_offset)[0][0])
    targets = Targets(Target((x, y, z)), Target((x, y, z)), DOWN, 0.0, 0, 0.0)
    a, b, c = (float(value) for value in package.tip((x, y, z), targets, straight - PULL * np.eye(len(straight))[0]))
    request = Request(0, replace(targets, tip=Target((a, b, c))), "", package.digest)
    order = Order(request, World(""), joints, straight)
    planned = False
    for answer in planner.answers(order):
        if isinstance(answer, PreviewPiece):
            break
        if isinstance(answer, PlanAnswer):
            if planned:
                raise InputError(answer.report.refused)
            planned = answer.plan is not None
    planner.prepare(replace(order, world=world))


def serve(answers, orders, newest, planner: PreviewPlanner) -> None:
    """Orders in, answers out."""
    for number, order in (orders.get() for _ in itertools.count()):

        def go_on(number: int = number) -> None:
            if newest.value != number:
                raise Overtaken

        with suppress(Overtaken):
            go_on()
            for answer in planner.answers(order, go_on):
                answers.send(answer)
