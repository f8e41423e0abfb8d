"""Following: a robot that runs after targets that go on moving, within the same limits as a plan.

At every tick the goal is that of the targets given, and Ruckig takes the axes one tick further towards it from whatever
position, velocity and acceleration they have. Without targets, or where they are refused, the last goal holds: the
robot comes to rest there.
"""

import numpy as np
import ruckig

from trunkline.errors import InputError
from trunkline.panda.collision import clearance
from trunkline.teleop.messages import Targets
from trunkline.teleop.planner import Planner
from trunkline.teleop.trajectory import JOINTS


class Follower:
    """From rest at `joints` (7,), rad, and `commands` (K,), m, in ticks of `dt` s. `refused` says why the newest
    targets are not followed, "" where they are."""

    def __init__(self, planner: Planner, joints: np.ndarray, commands: np.ndarray, dt: float) -> None:
        here, limits = np.append(joints, commands).tolist(), planner.limits
        self._planner, self._targets, self.refused = planner, None, ""
        self._ruckig, self._next = ruckig.Ruckig(len(here), dt), ruckig.OutputParameter(len(here))
        self._now = ruckig.InputParameter(len(here))
        self._now.current_position = self._now.target_position = here
        self._now.max_velocity, self._now.max_acceleration = limits.velocity.tolist(), limits.acceleration.tolist()
        self._now.max_jerk = limits.jerk.tolist()

    def tick(self, targets: Targets | None) -> tuple[np.ndarray, np.ndarray]:
        """Joints (7,), rad, and commands (K,), m, a tick later.

        Raises:
            InputError: Ruckig finds no way, or the next pose would touch itself; the robot is to be stopped.
        """
        if targets is not None and targets != self._targets:
            self._targets = targets
            try:
                joints, commands = self._planner.goal(targets, np.array(self._now.target_position[:JOINTS]))
                self._now.target_position, self.refused = [*joints.tolist(), *commands.tolist()], ""
            except InputError as error:
                self.refused = str(error)
        result = self._ruckig.update(self._now, self._next)
        if result < 0:
            raise InputError(f"following: Ruckig found {result}, expected a way to the targets")
        found = np.array(self._next.new_position)
        if clearance(found[None, :JOINTS], self._planner.mount_offset)[0] <= 0:
            raise InputError("self-collision: the robot would touch itself as it follows")
        self._next.pass_to_input(self._now)
        return found[:JOINTS], found[JOINTS:]
