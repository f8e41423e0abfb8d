"""What executes plans: four calls that every robot answers alike, simulated or real."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from trunkline.ar.teleop.following import Follower, Following
from trunkline.ar.teleop.messages import ExecutorReport
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import JOINTS, MotionLimits
from trunkline.errors import InputError
from trunkline.kinematics.panda.kinematics import within_limits

AT_START = 1e-3  # rad and m, by which the robot may be off a plan's first row
ROUNDING = 1.02  # share of a limit that differences of rows may show of a way that keeps it
BRAKE = 0.1  # s in which a stop brings the robot to rest, on its way
FOLLOWS = "follow"  # in place of a digest, of a robot that follows


class Executor(Protocol):
    """A robot. Nothing but `start` moves it; `stop` may be called at any time, also twice."""

    def check(self, plan: Plan) -> str:
        """Why the robot will not run `plan`, in one line; "" where it would.

        It is the second gate before a start. The first is the planner's (`ar/teleop/plan_checks.py`), which knows
        the obstacles; this one trusts no planner, and knows where the robot is now.
        """
        ...

    def start(self, plan: Plan, digest: str) -> str:
        """Run `plan` if it is the one of that `digest`; why not, in one line, "" once it runs."""
        ...

    def state(self) -> ExecutorReport:
        """What it does."""
        ...

    def stop(self) -> None:
        """Come to rest and hold; what was running is over."""
        ...


class PlanFollower:
    """Setpoints along a plan, or after targets: an `Executor` whose time passes by `advance`, for simulated robots and,
    as `TimeScaledRobot`, for real ones.

    At every `advance`, `move(joints, commands, dt)` is called with what the axes shall be: rad (7,), m (K,), s. Without
    `move`, the robot is where its plan says.

    A stop slows time down along the plan, to 0 within BRAKE s, so that it ends on the way that was checked. While it
    `waits`, time slows down likewise, and goes on from there once it does not. A robot that follows has no such way: it
    brakes as hard as its limits allow, and waits for nothing.
    """

    def __init__(
        self,
        joints: np.ndarray,
        commands: np.ndarray,
        limits: MotionLimits,
        package: str,
        move: Callable[[np.ndarray, np.ndarray, float], None] | None = None,
    ) -> None:
        self.joints, self.commands = np.array(joints, dtype=float), np.array(commands, dtype=float)
        self._limits, self._package, self._move = limits, package, move
        self._plan: Plan | None = None
        self._follower: Follower | None = None
        self._fault = ""
        self._time, self._pace, self._braking, self.waits = 0.0, 1.0, False, False
        self._report = ExecutorReport()

    def check(self, plan: Plan) -> str:
        rows = np.column_stack([plan.joints, plan.commands])
        if plan.package != self._package:
            return f"package: found digest {plan.package[:12]}, expected {self._package[:12]}"
        if not np.isfinite(rows).all():
            return "plan: found values that are not finite"
        if not (np.isfinite(plan.step) and plan.step > 0):
            return f"plan: found a step of {plan.step:g} s, expected a positive time"
        if not within_limits(plan.joints).all():
            return "plan: a joint leaves its range"
        speed = np.abs(np.diff(rows, axis=0)).max(axis=0, initial=0.0) / plan.step
        if (speed > ROUNDING * self._limits.velocity).any():
            axis = int(np.argmax(speed / self._limits.velocity))
            name = f"joint {axis + 1}" if axis < JOINTS else f"tendon {axis + 1 - JOINTS}"
            return f"plan: {name} moves at {speed[axis]:.3g}, expected at most {self._limits.velocity[axis]:.3g}"
        off = np.abs(rows[0] - np.append(self.joints, self.commands)).max()
        return "" if off <= AT_START else f"plan: starts {off:.3g} away from where the robot is"  # or no number

    def start(self, plan: Plan, digest: str) -> str:
        if self._report.mode == "running":
            return "busy: another plan runs"
        if plan.digest() != digest:
            return f"digest: found {plan.digest()[:12]}, expected {digest[:12]}"
        if reason := self.check(plan):
            return reason
        self._plan, self._time, self._pace, self._braking = plan, 0.0, 1.0, False
        self._report = ExecutorReport("running", digest)
        return ""

    def follow(self, following: Following, tick: float) -> str:
        """Go after the targets that it hears of, at every `advance` of `tick` s; why not, "" where it does."""
        if self._report.mode == "running":
            return "busy: another plan runs"
        self._follower = Follower(self._limits, following, self.joints, self.commands, tick)
        self._time, self._braking, self._fault = 0.0, False, ""
        self._report = ExecutorReport("running", FOLLOWS)
        return ""

    def hear(self, age: float, axes: np.ndarray | None) -> None:
        """What targets asked for `age` s ago, as `Follower.hear`."""
        if self._follower is not None:
            self._follower.hear(self._time - age, axes)

    def state(self) -> ExecutorReport:
        return self._report

    def stop(self) -> None:
        if self._report.mode == "running" and not self._braking:
            self._braking = True
            if self._follower is not None:
                self._follower.brake()

    def advance(self, dt: float) -> None:
        """Let `dt` s pass."""
        if self._follower is not None:
            self._go_after(self._follower, dt)
        elif self._plan is not None and self._report.mode == "running":
            if self.waits and self._time == 0.0:
                self._pace = 0.0  # it has not begun
            before = self._pace
            if self._braking or self.waits:
                self._pace = max(before - self._slowed(dt), 0.0)
            elif before < 1.0:
                self._pace = min(before + self._slowed(dt), 1.0)
            self._time += dt * (before + self._pace) / 2
            self.joints, self.commands = self._plan.at(self._time)
            if self._braking and self._pace == 0.0:
                self._report = ExecutorReport("idle", self._report.digest)
            elif self._time >= self._plan.duration:
                self._report = ExecutorReport("done", self._report.digest)
        if self._move is not None:
            self._move(self.joints, self.commands, dt)

    def _go_after(self, follower: Follower, dt: float) -> None:
        self._time += dt
        try:
            self.joints, self.commands = follower.tick(self._time)
        except InputError as error:
            self._fault, no_profile = str(error), self._braking
            self.stop()
            if no_profile:  # it finds no way to brake either
                follower.rests = True
        if follower.refused:
            self._fault, self._braking = self._fault or follower.refused, True
        if follower.rests:
            self._follower = None
            self._report = ExecutorReport("fault" if self._fault else "idle", FOLLOWS, self._fault)

    def _slowed(self, dt: float) -> float:
        """By how much the pace changes at most in `dt` s."""
        return dt / BRAKE
