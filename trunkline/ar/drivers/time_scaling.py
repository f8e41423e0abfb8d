"""A robot's clock along its plan, and the smoothing of what it is sent."""

from collections import deque
from collections.abc import Callable

import numpy as np

from trunkline.ar.drivers.setpoint_filter import RobotLimits
from trunkline.ar.teleop.executor import BRAKE, PlanFollower
from trunkline.ar.teleop.following import Follower, Following
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import JOINTS, MotionLimits

SHARE = 0.95  # of the Panda's accelerations that a stop makes use of
LEAST = 0.3  # of them, whatever the plan itself accelerates there
STRIDE = 0.005  # s between the places that a robot seeks as it follows; it goes evenly from one to the next


class TimeScaledRobot(PlanFollower):
    """A `PlanFollower` that keeps the limits of `robot`: no plan leaves its range, no stop its accelerations.

    Along the plan q(s), time slows as ds/dt = p. The joints accelerate by q'' p² + q' dp/dt, so

        -dp/dt = min(1 / BRAKE, min over joints of (SHARE a - |q''| p²) / |q'|)

    and a plan that is fast where it is stopped takes longer than BRAKE s to come to rest. As it follows, targets beyond
    its range count as none.
    """

    def __init__(
        self,
        joints: np.ndarray,
        commands: np.ndarray,
        limits: MotionLimits,
        package: str,
        move: Callable[[np.ndarray, np.ndarray, float], None],
        robot: RobotLimits,
    ) -> None:
        super().__init__(joints, commands, limits, package, move)
        self._robot, self._most = robot, robot.acceleration

    def check(self, plan: Plan) -> str:
        outside = self._outside(plan.joints)
        if outside.max() > 0:
            row, joint = np.unravel_index(int(outside.argmax()), outside.shape)
            return f"plan: joint {joint + 1} leaves this robot's range at {plan.joints[row, joint]:.3f} rad"
        return super().check(plan)

    def follow(self, following: Following, tick: float) -> str:
        self._before = self._after = np.append(self.joints, self.commands)
        self._strode = STRIDE  # the first stride begins at once
        return super().follow(following, STRIDE)

    def hear(self, age: float, axes: np.ndarray | None) -> None:
        if axes is not None and self._outside(axes[None, :JOINTS]).max() > 0:
            axes = None
        super().hear(age, axes)

    def _go_after(self, follower: Follower, dt: float) -> None:
        self._strode += dt
        if self._strode > STRIDE + dt / 2:
            self._before, self._strode = self._after, dt
            super()._go_after(follower, STRIDE)
            self._after = np.append(self.joints, self.commands)
        if self._follower is not None:
            share = min(self._strode / STRIDE, 1.0)
            self.joints, self.commands = np.split(self._before + share * (self._after - self._before), [JOINTS])

    def _outside(self, joints: np.ndarray) -> np.ndarray:
        """By how much each of `joints` (T, 7), rad, leaves its range, (T, 7); less than zero for one that does not."""
        return np.maximum(self._robot.low - joints, joints - self._robot.high)

    def _slowed(self, dt: float) -> float:
        return dt * self._slowing()

    def _slowing(self) -> float:
        """-dp/dt, 1/s."""
        assert self._plan is not None
        step = self._plan.step
        before, here, after = (self._plan.at(self._time + shift)[0][:JOINTS] for shift in (-step, 0.0, step))
        speed, gain = np.abs(after - before) / (2 * step), np.abs(after - 2 * here + before) / step**2
        left = np.maximum(SHARE * self._most - gain * self._pace**2, LEAST * self._most)
        return float(min(1 / BRAKE, np.min(left / np.maximum(speed, 1e-9))))


class Smoother:
    """Two means, each over the last `count` values, of `first` (n,) and what follows: rows of a plan, linear between,
    become a way of continuous acceleration, (count - 1) ticks late."""

    def __init__(self, first: np.ndarray, count: int) -> None:
        self._stages = [deque([np.array(first, dtype=float)] * count, maxlen=count) for _ in range(2)]
        self._sums = [count * np.array(first, dtype=float) for _ in range(2)]

    def next(self, value: np.ndarray) -> np.ndarray:
        """What is sent once `value` (n,) is wanted, (n,)."""
        for stage, total in zip(self._stages, self._sums, strict=True):
            total += value - stage[0]
            stage.append(np.array(value, dtype=float))
            value = total / len(stage)
        return value
