"""A real robot's process, and what is drawn of it: the calls are those of the simulated robot.

The robot's process turns 1000 times a second and simulates nothing. What is drawn is the twin, moved in a process of
its own by what the axes are sent: nothing measures the soft arm's shape here, nor where an object is.
"""

import gc
import multiprocessing
import os
import signal
import sys
import time
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from trunkline.ar.drivers.driver import Driver
from trunkline.ar.drivers.driver_client import panda
from trunkline.ar.drivers.hardware_robot import HardwareRobot
from trunkline.ar.drivers.local_driver_process import start_driver
from trunkline.ar.drivers.motors import MotorsOnBus
from trunkline.ar.drivers.realtime_priority import raise_priority
from trunkline.ar.drivers.time_scaling import TimeScaledRobot
from trunkline.ar.session.hardware import Hardware
from trunkline.ar.session.robot_process import POSE, READY, TIME, RobotChannel, RobotProcess, RobotState
from trunkline.ar.session.simulated import Loop, Simulation, TwinPlant, drive
from trunkline.ar.teleop.following import Follower, Following
from trunkline.ar.teleop.messages import ExecutorReport
from trunkline.ar.teleop.trajectory import MotionLimits
from trunkline.compute.processes import end_with_parent, leave_signals_to_parent, parent_pid
from trunkline.errors import InputError
from trunkline.kinematics.panda.maker_model import JOINTS

DELAY, MEAN = 0.15, 0.1  # s that the twin is behind the machine, and over which it takes the mean of what it hears
RESTS, STILL, LEAST = 2.0, 2e-4, 1e-9  # s in which no pose (m) and no axis (rad, m) changes by more: the twin rests
NICE = 5  # of the twin: a picture may wait
UNSEEN = 0.5  # s without a picture, after which nobody sees what moves


@dataclass(frozen=True)
class Beginning:
    """Where the twin begins: `joints` (7,), rad, and `commands` (K,), m, of the straight arm."""

    joints: np.ndarray
    commands: np.ndarray
    limits: MotionLimits
    package: str


class HardwarePlant(HardwareRobot):
    """A real robot as `Loop` turns it, without poses."""

    def poses(self) -> np.ndarray:
        return np.empty((0, POSE))

    def object(self) -> np.ndarray:
        return np.full(POSE, np.nan)


class RealRobot(RobotProcess):
    """An `Executor` whose robot is real."""

    def __init__(self, hardware: Hardware, simulation: Simulation) -> None:
        begins = Beginning(simulation.joints, simulation.commands, simulation.limits, simulation.package)
        tendons = len(simulation.commands)
        if hardware.bus and len(hardware.motors.numbers) != tendons:
            raise InputError(f"motors.numbers: found {len(hardware.motors.numbers)}, expected {tendons}, one a tendon")
        super().__init__(run, (hardware, begins), tendons, 0, simulation.limits, simulation.package)
        context = multiprocessing.get_context("spawn")
        self._drawn = RobotChannel(context, tendons, len(simulation.bodies))
        self._twin = context.Process(
            target=draw, args=(self._drawn, self.channel, simulation), daemon=True, name="twin"
        )
        self._twin.start()

    @property
    def alive(self) -> bool:
        return super().alive and self._twin.is_alive()

    @property
    def ready(self) -> bool:
        return super().ready and self._drawn.hear()[0][READY] > 0

    def robot_state(self) -> RobotState:
        poses = self._drawn.hear()[0][-POSE * (1 + self._drawn.bodies) :].reshape(-1, POSE)
        return replace(super().robot_state(), object=poses[0], bodies=poses[1:])

    def state(self) -> ExecutorReport:
        report, (drawn, fault) = super().state(), self._drawn.hear()
        silent = time.monotonic() - drawn[TIME]
        if drawn[READY] > 0 and silent > UNSEEN:
            fault = f"silent for {silent:.2f} s"
        if fault and report.mode != "fault":
            return ExecutorReport("fault", report.digest, f"the twin that is drawn: {fault}")
        return report

    def close(self) -> None:
        super().close()
        self._twin.kill()
        self._twin.join()


def run(channel: RobotChannel, hardware: Hardware, begins: Beginning) -> None:
    """The machine's process: until its parent is gone, or it is ended."""
    leave_signals_to_parent()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    parent = parent_pid()
    threadpool_limits(1)
    machine = None
    try:
        panda_driver = panda_of(hardware)
        machine = HardwarePlant(panda_driver, motors_of(hardware), begins.commands)
        joints = machine.begin(begins.joints, lambda: os.getppid() != parent)
        moved = machine
        robot = TimeScaledRobot(
            joints, begins.commands, begins.limits, begins.package, lambda q, c, _: moved.move(q, c), hardware.limits
        )  # fmt: skip
        gc.freeze()
        raise_priority()
        drive(Loop(channel, robot, machine), parent, lambda: moved.behind)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        sys.exit(1)
    finally:
        if machine is not None:
            machine.close()


def panda_of(hardware: Hardware) -> Driver | None:
    """The robot, None where none is named."""
    if hardware.robot == "ros2":
        return start_driver(hardware.ros)
    return panda(hardware.panda, hardware.robot) if hardware.robot else None


def motors_of(hardware: Hardware) -> Driver | None:
    """The tendons' motors, None where none are named."""
    if not hardware.bus:
        return None
    return start_driver(MotorsOnBus(hardware.motors, hardware.bus, hardware.interface))


class Pursuit:
    """After the axes of a machine, DELAY s later, within the limits of a plan. `here`: where the twin's axes are sent,
    (7 + K,), rad and m."""

    def __init__(self, simulation: Simulation, tick: float) -> None:
        self._simulation, self._tick = simulation, tick
        self._begin(np.append(simulation.joints, simulation.commands))

    @property
    def there(self) -> bool:
        """Whether `here` is where the machine was last heard of."""
        return bool(np.abs(self._follower.goal - self.here).max() <= LEAST)

    def hear(self, now: float, axes: np.ndarray) -> None:
        """That the machine's axes, rad and m, are at (7 + K,) at `now`, s."""
        self._follower.hear(now, axes)

    def go(self, now: float) -> None:
        """A tick on, at `now`, s."""
        try:
            self.here = np.append(*self._follower.tick(now))
            lost = self._follower.rests  # it braked, as it would have touched itself
        except InputError:  # there is no way that keeps the limits
            lost = True
        if lost:
            self._begin(self.here)  # on from here, at rest

    def _begin(self, here: np.ndarray) -> None:
        following = Following(DELAY, MEAN, self._simulation.mount_offset)
        joints, commands = np.split(here, [len(JOINTS)])
        self.here, limits = here, self._simulation.limits
        self._follower = Follower(limits, following, joints, commands, self._tick)


def draw(channel: RobotChannel, machine: RobotChannel, simulation: Simulation) -> None:
    """The twin's process: it follows what the machine's axes are sent, DELAY s later, as a robot follows targets: this
    process hears of them unevenly, and a jump from one to the next would throw the twin about. Once it rests where they
    rest, it is left alone: a preview needs the processor more."""
    leave_signals_to_parent()
    os.environ["TRUNKLINE_THREADS"] = "1"
    os.nice(NICE)
    threadpool_limits(1)
    end_with_parent()
    plant = TwinPlant(simulation)
    pursuit = Pursuit(simulation, plant.tick)
    due, poses, since = time.monotonic(), np.append(plant.object(), plant.poses()), 0.0
    while True:
        numbers, before = machine.hear()[0], pursuit.here
        if numbers[READY] > 0:
            pursuit.hear(time.monotonic(), numbers[5 : 5 + len(before)])
        if pursuit.there and due - since > RESTS:
            time.sleep(plant.tick)
        else:
            pursuit.go(due)
            here = pursuit.here
            plant.move(here[: len(JOINTS)], here[len(JOINTS) :])
            now = np.append(plant.object(), plant.poses())
            if np.abs(here - before).max() > LEAST or np.nanmax(np.abs(now - poses)) > STILL:
                poses, since = now, due
        numbers_out = np.zeros(channel.size)
        numbers_out[TIME], numbers_out[READY] = time.monotonic(), 1.0
        numbers_out[-POSE * (1 + channel.bodies) :] = poses
        channel.tell(numbers_out, plant.fault)
        due = max(due + plant.tick, time.monotonic() - plant.tick)
        time.sleep(max(due - time.monotonic(), 0.0))
