"""A robot in a process of its own, seen from the server: the four calls of an `Executor`, none of which waits.

What the robot does is read from shared memory, newest wins. It moves only while it is permitted to, which has to be
said anew all the time: where the server is silent for DEAD_MAN s, or gone, the robot brakes by itself, and goes on by
no permit, only by another start.
"""

import ctypes
import math
import multiprocessing
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from multiprocessing.context import SpawnContext

import numpy as np

from trunkline.ar.teleop.executor import FOLLOWS, PlanFollower
from trunkline.ar.teleop.following import Following
from trunkline.ar.teleop.messages import ExecutorReport
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import JOINTS, MotionLimits

DEAD_MAN = 0.08  # s without a permit
STALE = 0.15  # s without a sign of the robot's process
TELLS = 1 / 240  # s, about, from one telling of the robot's process to the next
FRESH = 0.0005  # s after which that is heard
LOOKS = 0.005  # s
RESTING = 0.5  # s that braking may take before its process is ended
TEXT = 240  # bytes of a fault
MODES = ("idle", "running", "done", "fault")
# First numbers of the robot's report; axes, sent and measured, object and bodies follow.
TIME, MODE, SERIAL, HOLD_TIME, READY = range(5)
PERMIT, PERMITTED, STOPS, WAITS = range(4)  # of what it is told
POSE = 7


def next_report_time(due: float, reported: float) -> float:
    """The first s from `due` on at which a robot that told of itself at `told`, s, should have done so anew."""
    return reported + math.ceil((due - reported) / TELLS) * TELLS + FRESH


class RobotChannel:
    """What both processes share. The robot's writes its numbers whole, with a count that is odd meanwhile; the other
    writes `requests`."""

    def __init__(self, context: SpawnContext, tendons: int, bodies: int) -> None:
        self.tendons, self.bodies = tendons, bodies
        self.size = 5 + 2 * (JOINTS + tendons) + POSE * (1 + bodies)
        self._numbers, self._number = context.RawArray(ctypes.c_double, self.size), context.RawValue(ctypes.c_uint64, 0)
        self._requests, self._fault = context.RawArray(ctypes.c_double, 4), context.RawArray(ctypes.c_char, TEXT)
        self.plans, self.wake = context.Queue(), context.Semaphore(0)

    @property
    def requests(self) -> np.ndarray:
        return np.ctypeslib.as_array(self._requests)

    def tell(self, numbers: np.ndarray, fault: str) -> None:
        """Of the robot's process."""
        self._number.value += 1
        np.ctypeslib.as_array(self._numbers)[:] = numbers
        self._fault.value = fault.encode(errors="replace")[: TEXT - 1]
        self._number.value += 1

    def hear(self) -> tuple[np.ndarray, str]:
        """The newest that was told whole."""
        for _ in range(1000):
            before = self._number.value
            numbers, fault = np.ctypeslib.as_array(self._numbers).copy(), self._fault.value
            if before % 2 == 0 and self._number.value == before:
                return numbers, fault.decode(errors="replace")
        return numbers, fault.decode(errors="replace")  # its writer was killed within: the time in it is old


@dataclass(frozen=True)
class Goal:
    """What targets asked for at `time`, s: axes (7 + K,), None for the last ones still."""

    time: float
    axes: np.ndarray | None


@dataclass(frozen=True)
class RobotState:
    """What the robot does at `time`, s.

    `joints` (7,), rad, and `commands` (K,), m, as they are sent, and poses of the `object` (7,), NaN where there is
    none, and of the `bodies` (N, 7). hold_time: s at which it was last commanded to hold. As measured: `measured`
    (7,), rad, of the joints, and `lengths` (K,), m, of the cables, and `hangs` (3,), m, where the straight arm's tip
    was in its base frame; NaN or None where nothing measures them.
    """

    time: float
    hold_time: float
    joints: np.ndarray
    commands: np.ndarray
    object: np.ndarray
    bodies: np.ndarray
    measured: np.ndarray | None = None
    lengths: np.ndarray | None = None
    hangs: np.ndarray | None = None

    @property
    def joints_now(self) -> np.ndarray:
        """As measured where all of them are, else as they are sent: (7,), rad."""
        return self.joints if self.measured is None or not np.isfinite(self.measured).all() else self.measured


class RobotProcess:
    """An `Executor` whose robot is another process, `run(channel, *setup)`."""

    def __init__(
        self, run: Callable, setup: tuple, tendons: int, bodies: int, limits: MotionLimits, package: str
    ) -> None:
        context = multiprocessing.get_context("spawn")
        self.channel = RobotChannel(context, tendons, bodies)
        self._limits, self._package, self._serial, self._digest, self._begun = limits, package, 0, "", 0.0
        edges = np.cumsum([5, JOINTS, tendons, JOINTS, tendons, POSE, POSE * bodies])
        self._places = [slice(*ends) for ends in pairwise(edges)]
        self._looked, self._alive = -math.inf, False  # when it was looked whether its process is there
        self._process = context.Process(target=run, args=(self.channel, *setup), daemon=True, name="robot")
        self._process.start()

    @property
    def pid(self) -> int | None:
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether its process is there, as of LOOKS s ago at most: to look costs a call of the system."""
        now = time.monotonic()
        if now - self._looked > LOOKS:
            self._looked, self._alive = now, self._process.is_alive()
        return self._alive

    @property
    def ready(self) -> bool:
        """Whether it has told anything yet."""
        return self.channel.hear()[0][READY] > 0

    def robot_state(self) -> RobotState:
        """The newest."""
        numbers = self.channel.hear()[0]
        joints, commands, measured, lengths, object, bodies = (numbers[place] for place in self._places)
        bodies = bodies.reshape(self.channel.bodies, POSE)
        return RobotState(numbers[TIME], numbers[HOLD_TIME], joints, commands, object, bodies, measured, lengths)

    def check(self, plan: Plan) -> str:
        now = self.robot_state()
        return PlanFollower(now.joints, now.commands, self._limits, self._package).check(plan)

    def start(self, plan: Plan, digest: str) -> str:
        """As `Executor.start`; what the robot's process finds besides is in its state."""
        if self.state().mode == "running":
            return "busy: another plan runs"
        if plan.digest() != digest:
            return f"digest: found {plan.digest()[:12]}, expected {digest[:12]}"
        if reason := self.check(plan):
            return reason
        self._begin(plan, digest)
        return ""

    def follow(self, following: Following) -> str:
        """Go after what `hear` is told, as long as it is permitted; why not, "" where it does."""
        if self.state().mode == "running":
            return "busy: another plan runs"
        self._begin(following, FOLLOWS)
        return ""

    def hear(self, age: float, axes: np.ndarray | None) -> None:
        """What targets asked for `age` s ago, (7 + K,); None for the last ones still."""
        goal = Goal(time.monotonic() - age, axes)
        self.channel.plans.put((self._serial, FOLLOWS, goal, self.channel.requests[STOPS]))
        self.channel.wake.release()

    def _begin(self, motion: Plan | Following, digest: str) -> None:
        self._serial, self._digest, self._begun = self._serial + 1, digest, time.monotonic()
        self.permit(bool(self.channel.requests[WAITS]))
        self.channel.plans.put((self._serial, digest, motion, self.channel.requests[STOPS]))
        self.channel.wake.release()

    def permit(self, waits: bool = False) -> None:
        """The robot may go on with what was started last, for another DEAD_MAN s; along a plan not while it `waits`."""
        requests = self.channel.requests
        requests[WAITS] = waits
        requests[PERMIT], requests[PERMITTED] = time.monotonic(), self._serial

    def stop(self) -> None:
        requests = self.channel.requests
        requests[PERMITTED] = requests[WAITS] = 0
        requests[STOPS] += 1
        self.channel.wake.release()

    def state(self) -> ExecutorReport:
        numbers, fault = self.channel.hear()
        silent = time.monotonic() - numbers[TIME]
        if not self.alive:
            return ExecutorReport("fault", self._digest, "its process has ended")
        if numbers[READY] > 0 and silent > STALE:
            return ExecutorReport("fault", self._digest, f"its process is silent for {silent:.2f} s")
        if numbers[SERIAL] < self._serial:  # the start is on its way
            return ExecutorReport("idle", "")
        mode = MODES[int(numbers[MODE])]
        return ExecutorReport(mode, self._digest, fault if mode == "fault" else "")  # type: ignore[arg-type]

    def close(self) -> None:
        """Bring it to rest, and end its process."""
        self.stop()
        until = time.monotonic() + RESTING
        while self.state().mode == "running" and time.monotonic() < until:
            time.sleep(LOOKS)
        self.channel.plans.cancel_join_thread()
        self._process.terminate()
        self._process.join(5.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
