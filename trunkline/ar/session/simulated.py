"""The simulated robot's process: the twin on the Panda, moved in real time by what the axes are sent.

It steps as a preview does (`trunkline/ar/hybrid/rollouts.py`): the same model, winches, friction of the cables and
servos that bear the arm. So what was previewed is what happens.
"""

import math
import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from queue import Empty
from typing import Protocol

import mujoco
import numpy as np
from threadpoolctl import threadpool_limits

from trunkline.ar.hybrid.compose import panda_joints
from trunkline.ar.hybrid.rollouts import ComposedTwin
from trunkline.ar.hybrid.torques import bare, servo_commands
from trunkline.ar.session.bodies import BodyPoses
from trunkline.ar.session.robot_process import (
    DEAD_MAN,
    MODES,
    PERMIT,
    PERMITTED,
    STOPS,
    TELLS,
    WAITS,
    Goal,
    RobotChannel,
)
from trunkline.ar.teleop.executor import FOLLOWS, PlanFollower
from trunkline.ar.teleop.following import Following
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import MotionLimits
from trunkline.compute.processes import leave_signals_to_parent, parent_pid
from trunkline.kinematics.panda.maker_model import JOINTS
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.capstan import REFRESH, capstan_friction_of
from trunkline.model.simulation.motion import batch_of, hold
from trunkline.model.simulation.winch import Winches

LISTENS = 0.2  # s from being woken within which a plan comes: a thread of the server's sends it
SETTLES = 0.1  # s for which it goes on after a motion whose server is gone: a machine is that far behind, and less
BEHIND = 0.25  # s that real time may run ahead of the simulation before it is let go
NICE = -5  # asked for; without the right to it, none


@dataclass(frozen=True)
class Simulation:
    """`twin`: at rest where all begins, its motors at `commands` (K,), m, the Panda at `joints` (7,), rad. `bodies`:
    names of those whose poses are told. `mount_offset`: m."""

    twin: ComposedTwin
    joints: np.ndarray
    commands: np.ndarray
    bodies: tuple[str, ...]
    limits: MotionLimits
    package: str
    mount_offset: float


class TwinPlant:
    """The twin moved by axes, a tick at a time."""

    def __init__(self, simulation: Simulation) -> None:
        model = simulation.twin.model
        self.model, self.batch, self._world = model, batch_of(model, 1), np.zeros(1, dtype=np.int32)
        friction = max(round(REFRESH / model.opt.timestep), 1)  # steps from one to the next new friction
        self._refresh = next((n for n in range(2, friction) if friction % n == 0), friction)  # the same, in ticks
        self._ticks, self.steps = 0, friction // self._refresh
        self.tick = self.steps * model.opt.timestep
        if simulation.twin.start is not None:
            self.batch.bind("qpos")[:] = simulation.twin.start
        self._joints, self._motors = panda_joints(model), ArmModel(model).actuators
        self._servos = [model.actuator(f"{name}_position").id for name in JOINTS]
        self._ratio = -model.actuator_biasprm[self._servos, 2] / model.actuator_gainprm[self._servos, 0]
        self._bare = bare(model)
        self._data = mujoco.MjData(self._bare)
        self._poses, self._object = BodyPoses(model, simulation.bodies), BodyPoses(model, ("object",))
        self._last = np.tile(simulation.joints, (2, 1))
        controls = np.zeros((1, model.nu))
        controls[:, self._motors] = self._commands = simulation.commands
        controls[:, self._servos] = self._servo = self._sent(simulation.joints)
        hold(self.batch, model, controls)
        self._winches, self._rub = Winches(self.batch, controls[:, self._motors]), capstan_friction_of(self.batch)
        if self._rub is not None:
            self._rub.begin(self._world)

    def move(self, joints: np.ndarray, commands: np.ndarray, smooth: bool = False) -> None:
        """One tick with the axes on their way to `joints` (7,), rad, and `commands` (K,), m: each step is sent where
        they are as it begins. smooth: they go as a plan does, so that the servos can be sent the speed at the tick's
        end, not its mean; of axes that follow, or are heard late, that would be noise."""
        servo, share = self._sent(joints, smooth), (np.arange(self.steps) / self.steps)[:, None]
        controls = np.zeros((1, self.steps, self.model.nu))
        controls[0][:, self._servos] = self._servo + share * (servo - self._servo)
        sent = (self._commands + share * (commands - self._commands))[None]
        controls[:, :, self._motors] = self._winches.deliver(sent, self._world)
        self._servo, self._commands = servo, np.array(commands)
        if self._rub is not None and self._ticks % self._refresh == 0:
            self._rub.refresh(self._world)
        self._ticks += 1
        self.batch.rollout(self.steps, control=controls)

    @property
    def fault(self) -> str:
        """That MuJoCo has warned, "" while it has not."""
        return "the simulation is not sound" if self.batch.warning.any() else ""

    def poses(self) -> np.ndarray:
        """Of the bodies, (N, 7)."""
        return self._poses.of(self.batch.bind("qpos")[0])

    def object(self) -> np.ndarray:
        """Of what may be grasped, (7,); NaN where there is none."""
        return self._object.of(self.batch.bind("qpos")[0])[0]

    def measured(self) -> np.ndarray:
        """The Panda's joints, rad (7,)."""
        return self.batch.bind("qpos")[0, self.model.jnt_qposadr[self._joints]]

    def lengths(self) -> np.ndarray:
        """Of the cables as the last tick began, m (K,)."""
        return self._data.ten_length[self.model.actuator_trnid[self._motors, 0]]

    def _sent(self, joints: np.ndarray, smooth: bool = False) -> np.ndarray:
        """What the servos are sent so that they are at `joints`, bearing the arm as it hangs now. Shape (7,)."""
        before, now = self._last
        gain = (joints - 2 * now + before) / self.tick**2
        speed = (joints - now) / self.tick + (gain * self.tick / 2 if smooth else 0.0)
        self._last = np.stack([now, joints])
        data, dofs = self._data, self.model.jnt_dofadr[self._joints]
        data.qpos[:] = self.batch.bind("qpos")[0]
        data.qpos[self.model.jnt_qposadr[self._joints]] = joints
        data.qvel[:], data.qacc[:] = 0.0, 0.0
        data.qvel[dofs], data.qacc[dofs] = speed, gain
        mujoco.mj_inverse(self._bare, data)
        return servo_commands(self.model, joints, data.qfrc_inverse[dofs]) + self._ratio * speed


class MovingPlant(Protocol):
    """What a process moves, a tick at a time."""

    @property
    def tick(self) -> float: ...
    @property
    def fault(self) -> str: ...
    def poses(self) -> np.ndarray: ...
    def object(self) -> np.ndarray: ...
    def measured(self) -> np.ndarray: ...
    def lengths(self) -> np.ndarray: ...


class Loop:
    """Plans in, motion out; what the process does at each turn. `robot` moves the `plant`."""

    def __init__(self, channel: RobotChannel, robot: PlanFollower, plant: MovingPlant) -> None:
        self.channel, self.robot, self.plant = channel, robot, plant
        self.serial, self.fault, self.hold_time = 0, "", 0.0
        self._stops, self._holds, self._listens = channel.requests[STOPS], False, 0.0

    @property
    def moves(self) -> bool:
        """Whether a motion goes on."""
        return self.robot.state().mode == "running"

    def turn(self, now: float, woken: bool = True) -> None:
        """Obey what was asked since; plans are looked for where it was `woken` of late."""
        requests = self.channel.requests
        stopped = requests[STOPS] != self._stops
        permitted = requests[PERMITTED] == self.serial and now - requests[PERMIT] <= DEAD_MAN
        holds = stopped or (self.moves and not permitted)
        if holds:
            self._stops = requests[STOPS]
            self.robot.stop()
        if stopped or (holds and not self._holds):
            self.hold_time = now
        self._holds = holds
        self.robot.waits = bool(requests[WAITS])
        if woken:
            self._listens = now + LISTENS
        if now <= self._listens:
            self._hear(now)

    def advance(self) -> None:
        """One tick."""
        self.robot.advance(self.plant.tick)
        if self.plant.fault and not self.fault:
            self.fault, self.hold_time = self.plant.fault, time.monotonic()
            self.robot.stop()

    def tell(self, now: float) -> None:
        """All that the server shall know."""
        state = self.robot.state()
        self.fault = self.fault or state.fault
        mode = "fault" if self.fault else state.mode
        head = [now, MODES.index(mode), self.serial, self.hold_time, 1.0]
        poses = [self.plant.object(), self.plant.poses().ravel()]
        axes = [self.robot.joints, self.robot.commands, self.plant.measured(), self.plant.lengths()]
        self.channel.tell(np.concatenate([head, *axes, *poses]), self.fault)

    def _hear(self, now: float) -> None:
        try:
            serial, digest, motion, stops = self.channel.plans.get_nowait()
        except Empty:
            return
        if isinstance(motion, Goal):
            if serial == self.serial:
                self.robot.hear(now - motion.time, motion.axes)
            return
        self.serial = serial
        overtaken = "a stop came before it began" if stops != self.channel.requests[STOPS] else ""
        self.fault = overtaken or self.plant.fault or self._begin(motion, digest)

    def _begin(self, motion: Plan | Following, digest: str) -> str:
        """Why it does not begin, "" where it does."""
        robot = self.robot
        if isinstance(motion, Plan):
            return robot.start(motion, digest)
        return robot.follow(motion, self.plant.tick)


def drive(loop: Loop, parent: int, behind: Callable[[], float] = lambda: BEHIND) -> None:
    """Turn by turn, in real time, until the process `parent` is gone, and a motion that went on has come to rest.

    behind: s that real time may run ahead of what is moved before it is let go, asked for after each tick.
    """
    now = due = reported = time.monotonic()
    moved = now if loop.moves else -math.inf
    while os.getppid() == parent or now - moved < SETTLES:
        woken = loop.channel.wake.acquire(timeout=max(due - time.monotonic(), 0.0))
        now = time.monotonic()
        moved = now if loop.moves else moved
        loop.turn(now, woken)
        if now >= due:
            loop.advance()
            due += loop.plant.tick
            if now - due > behind():
                due = now
        if woken or now >= reported + TELLS - loop.plant.tick / 2:
            reported = now
            loop.tell(time.monotonic())


def run(channel: RobotChannel, simulation: Simulation) -> None:
    """The process: until its parent is gone."""
    leave_signals_to_parent()
    os.environ["TRUNKLINE_THREADS"] = "1"
    with suppress(OSError):
        os.nice(NICE)
    threadpool_limits(1)
    parent = parent_pid()
    plant = TwinPlant(simulation)
    robot = PlanFollower(
        simulation.joints, simulation.commands, simulation.limits, simulation.package,
        lambda joints, commands, _: plant.move(joints, commands, robot.state().digest != FOLLOWS),
    )  # fmt: skip
    drive(Loop(channel, robot, plant), parent)
