"""A robot's clock along its plan, and the smoothing of what it is sent."""

from collections import deque
from collections.abc import Callable

import numpy as np

from trunkline.execution.stream import RobotLimits
from trunkline.teleop.executor import BRAKE, SimulatedRobot
from trunkline.teleop.plan import Plan
from trunkline.teleop.trajectory import JOINTS, Limits

SHARE = 0.95  # of the Panda's accelerations that a stop makes use of
LEAST = 0.3  # of them, whatever the plan itself accelerates there


class PacedRobot(SimulatedRobot):
    """A `SimulatedRobot` that keeps the limits of `robot`: no plan leaves its range, no stop its accelerations.

    Along the plan q(s), time slows as ds/dt = p. The joints accelerate by q'' p² + q' dp/dt, so

        -dp/dt = min(1 / BRAKE, min over joints of (SHARE a - |q''| p²) / |q'|)

    and a plan that is fast where it is stopped takes longer than BRAKE s to come to rest.
    """

    def __init__(
        self,
        joints: np.ndarray,
        commands: np.ndarray,
        limits: Limits,
        package: str,
        move: Callable[[np.ndarray, np.ndarray, float], None],
        robot: RobotLimits,
    ) -> None:
        super().__init__(joints, commands, limits, package, move)
        self._robot, self._most = robot, robot.acceleration

    def check(self, plan: Plan) -> str:
        outside = np.maximum(self._robot.low - plan.joints, plan.joints - self._robot.high)
        if outside.max() > 0:
            row, joint = np.unravel_index(int(outside.argmax()), outside.shape)
            return f"plan: joint {joint + 1} leaves this robot's range at {plan.joints[row, joint]:.3f} rad"
        return super().check(plan)

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
