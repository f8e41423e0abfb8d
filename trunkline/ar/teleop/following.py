"""Following: a robot that runs after targets that go on moving, a set delay behind, within the same limits as a plan.

What the targets ask for is heard at once and done `delay` s later, so that the robot knows its way for so long ahead:

    x(t) = mean of g(s) over |s - (t - delay)| <= width / 2,    width <= 2 (delay - KNOT)

with g the axes that the targets of time s ask for. A mean about its own middle does not lag, and one over a period of
a swing leaves nothing of it. Ruckig takes the axes there, with the velocity of x; so the first way, to where following
begins, is as quick as the limits allow. That is meant: with a mean of it, too, the stand-in's tip stayed further from
the twin's; an arm that comes slowly keeps more of its cables' friction (docs/results/approach.md). Without targets, or
where they are refused, the last that were not hold: the robot comes to rest there.
"""

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np
import ruckig

from trunkline.ar.teleop.messages import Targets, World
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.plan_checks import check_plan
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.trajectory import JOINTS, MotionLimits
from trunkline.errors import InputError
from trunkline.kinematics.panda.collision import clearance

KNOT = 0.1  # s between targets that are looked at, linear between: a hand that aims moves evenly for so long
SAMPLES = 24  # of a mean
LOOKS = np.array([0.25, 0.5, 0.75, 1.0])  # shares of the time to rest at which it is looked whether it touches itself


def sought(
    planner: Planner, targets: Targets | None, joints: np.ndarray, world: World
) -> tuple[np.ndarray | None, str]:
    """Axes (7 + K,), rad and m, that `targets` ask for, the nearest to `joints` (7,), rad; None where there are none
    that the robot may follow, and why they are refused, "" where they are not."""
    if targets is None:
        return None, ""
    try:
        there, commands = planner.goal(targets, joints)
        check_plan(Plan(KNOT, there[None], commands[None], (), "", ""), world, planner.mount_offset, planner.chain)
    except InputError as error:
        return None, str(error)
    return np.append(there, commands), ""


@dataclass(frozen=True)
class Following:
    """How targets are followed. delay: s behind them. period: s, of the arm's slowest swing, 0 for an arm that does not
    swing. mount_offset: m."""

    delay: float
    period: float
    mount_offset: float


class Follower:
    """From rest at `joints` (7,), rad, and `commands` (K,), m, in ticks of `dt` s. `rests`: whether it has come to
    rest, once it brakes. `refused`: why it brakes of itself, "" while it does not.

    No tick leads to where braking would end, or come by, with the robot touching itself: braking begins one tick
    before, from where that was looked at.
    """

    def __init__(
        self, limits: MotionLimits, following: Following, joints: np.ndarray, commands: np.ndarray, dt: float
    ) -> None:
        here = np.append(joints, commands)
        self._mount_offset, self._dt, self._delay = following.mount_offset, dt, following.delay
        self._braking, self.rests, self.refused = False, False, ""
        self._width = min(following.period, max(2 * (self._delay - KNOT), 0.0))
        self._times: list[float] = []
        self._goals = [here]  # of `_times`, and before these where it began
        self._velocity = 0.999 * limits.velocity  # that Ruckig takes as one within the limits
        self._ruckig, self._next = ruckig.Ruckig(len(here), dt), ruckig.OutputParameter(len(here))
        self._now = ruckig.InputParameter(len(here))
        self._now.current_position = self._now.target_position = here.tolist()
        self._now.max_velocity, self._now.max_acceleration = limits.velocity.tolist(), limits.acceleration.tolist()
        self._now.max_jerk = limits.jerk.tolist()
        self._now.minimum_duration = dt  # sooner there, it would run ahead

    @property
    def goal(self) -> np.ndarray:
        """The newest, (7 + K,), rad and m."""
        return self._goals[-1]

    def hear(self, now: float, goal: np.ndarray | None) -> None:
        """Axes that the targets at `now`, s, ask for, (7 + K,); None: the last ones still."""
        self._goals.append(self.goal if goal is None else goal)
        self._times.append(now)
        since = bisect_left(self._times, now - self._delay - self._width) - 1
        if since > 0:
            del self._times[:since], self._goals[:since]

    def brake(self) -> None:
        """To rest, as soon as the limits allow; ticks bring it there, wherever the targets are."""
        self._braking = True
        _to_rest(self._now, self._now)

    def tick(self, now: float) -> tuple[np.ndarray, np.ndarray]:
        """Joints (7,), rad, and commands (K,), m, that the robot is sent at `now`, s: one tick after the last ones.

        Raises:
            InputError: Ruckig finds no way; the robot is to be stopped.
        """
        if not self._braking:
            here, ahead = self._way(now), self._way(now + self._dt)
            velocity = np.clip((ahead - here) / self._dt, -self._velocity, self._velocity)
            self._now.target_position, self._now.target_velocity = ahead.tolist(), velocity.tolist()
        result = self._update()
        if not self._braking and self._touches():
            self.refused = "self-collision: the robot would touch itself as it follows"
            self.brake()
            result = self._update()
        position = np.array(self._next.new_position)
        self._next.pass_to_input(self._now)
        self.rests = self._braking and result == ruckig.Result.Finished
        return position[:JOINTS], position[JOINTS:]

    def _update(self) -> ruckig.Result:
        result = self._ruckig.update(self._now, self._next)
        if result < 0:
            raise InputError(f"following: Ruckig found {result}, expected a way to the targets")
        return result

    def _touches(self) -> bool:
        """Whether the robot would touch itself where it brakes from the next tick on."""
        brake, way = _to_rest(ruckig.InputParameter(len(self.goal)), self._now), ruckig.Trajectory(len(self.goal))
        brake.current_position, brake.current_velocity = self._next.new_position, self._next.new_velocity
        brake.current_acceleration = self._next.new_acceleration
        if ruckig.Ruckig(len(self.goal)).calculate(brake, way) < 0:
            return True
        places = [way.at_time(share * way.duration)[0][:JOINTS] for share in LOOKS]
        return bool(clearance(np.array(places), self._mount_offset).min() <= 0)

    def _way(self, now: float) -> np.ndarray:
        """Where the axes shall be at `now`, (7 + K,), rad and m."""
        if not self._times:
            return self._goals[-1]
        at = now - self._delay + self._width * ((np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5)
        goals = np.array(self._goals[-len(self._times) :])
        return np.array([np.interp(at, self._times, axis).mean() for axis in goals.T])


def _to_rest(parameters: ruckig.InputParameter, limits: ruckig.InputParameter) -> ruckig.InputParameter:
    """`parameters`, which asks for rest wherever that is, as soon as `limits` allow."""
    parameters.control_interface, parameters.minimum_duration = ruckig.ControlInterface.Velocity, None
    parameters.max_velocity, parameters.max_acceleration, parameters.max_jerk = (
        limits.max_velocity, limits.max_acceleration, limits.max_jerk,
    )  # fmt: skip
    parameters.target_velocity = parameters.target_acceleration = [0.0] * parameters.degrees_of_freedom
    return parameters
