"""Following: a robot that runs after targets that go on moving, a set delay behind, within the same limits as a plan.

What the targets ask for is heard at once and done `delay` s later, so that the robot knows its way for so long ahead:

    x(t) = mean of g(s) over |s - (t - delay)| <= width / 2,    width <= 2 (delay - KNOT)

with g the axes that the targets of time s ask for. A mean about its own middle does not lag, and one over a period of
a swing leaves nothing of it. Ruckig takes the axes there, with the velocity of x; so the first way, to where following
begins, is as quick as the limits allow. That is meant: with a mean of it, too, the stand-in's tip stayed further from
the twin's; an arm that comes slowly keeps more of its cables' friction (`studies.approach`). Without targets, or where
they are refused, the last that were not hold: the robot comes to rest there.
"""

from bisect import bisect_left

import numpy as np
import ruckig

from trunkline.errors import InputError
from trunkline.panda.collision import clearance
from trunkline.teleop.messages import Targets
from trunkline.teleop.planner import Planner
from trunkline.teleop.trajectory import JOINTS

KNOT = 0.1  # s between targets that are looked at, linear between: a hand that aims moves evenly for so long
SAMPLES = 24  # of a mean


class Follower:
    """From rest at `joints` (7,), rad, and `commands` (K,), m, in ticks of `dt` s, `delay` s behind the targets.
    `period`: s, of the arm's slowest swing, 0 for an arm that does not swing. `refused` says why the newest targets are
    not followed, "" where they are."""

    def __init__(
        self, planner: Planner, joints: np.ndarray, commands: np.ndarray, dt: float, delay: float, period: float = 0.0
    ) -> None:
        here, limits = np.append(joints, commands), planner.limits
        self._planner, self._dt, self._delay, self.refused = planner, dt, delay, ""
        self._width = min(period, max(2 * (delay - KNOT), 0.0))
        self._times: list[float] = []
        self._goals = [here]  # of `_times`, and before these where it began
        self._velocity = 0.999 * limits.velocity  # that Ruckig takes as one within the limits
        self._ruckig, self._next = ruckig.Ruckig(len(here), dt), ruckig.OutputParameter(len(here))
        self._now = ruckig.InputParameter(len(here))
        self._now.current_position = self._now.target_position = here.tolist()
        self._now.max_velocity, self._now.max_acceleration = limits.velocity.tolist(), limits.acceleration.tolist()
        self._now.max_jerk = limits.jerk.tolist()
        self._now.minimum_duration = dt  # sooner there, it would run ahead

    def hear(self, now: float, targets: Targets | None) -> None:
        """The targets at `now`, s; None where there are none that the robot may follow."""
        if self._times and now < self._times[-1] + KNOT - 1e-6:
            return
        goal = self._goals[-1]
        if targets is not None:
            try:
                goal, self.refused = np.concatenate(self._planner.goal(targets, goal[:JOINTS])), ""
            except InputError as error:
                self.refused = str(error)
        self._times.append(now)
        self._goals.append(goal)
        since = bisect_left(self._times, now - self._delay - self._width) - 1
        if since > 0:
            del self._times[:since], self._goals[:since]

    def tick(self, now: float) -> tuple[np.ndarray, np.ndarray]:
        """Joints (7,), rad, and commands (K,), m, that the robot is sent at `now`, s: one tick after the last ones.

        Raises:
            InputError: Ruckig finds no way, or the next pose would touch itself; the robot is to be stopped.
        """
        here, next_one = self._way(now), self._way(now + self._dt)
        velocity = np.clip((next_one - here) / self._dt, -self._velocity, self._velocity)
        self._now.target_position, self._now.target_velocity = next_one.tolist(), velocity.tolist()
        result = self._ruckig.update(self._now, self._next)
        if result < 0:
            raise InputError(f"following: Ruckig found {result}, expected a way to the targets")
        found = np.array(self._next.new_position)
        if clearance(found[None, :JOINTS], self._planner.mount_offset)[0] <= 0:
            raise InputError("self-collision: the robot would touch itself as it follows")
        self._next.pass_to_input(self._now)
        return found[:JOINTS], found[JOINTS:]

    def _way(self, now: float) -> np.ndarray:
        """Where the axes shall be at `now`, (7 + K,), rad and m."""
        if not self._times:
            return self._goals[-1]
        at = now - self._delay + self._width * ((np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5)
        goals = np.array(self._goals[-len(self._times) :])
        return np.array([np.interp(at, self._times, axis).mean() for axis in goals.T])
