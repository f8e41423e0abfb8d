"""A robot that has rested for a while is told of seldom: which of its standings a log keeps."""

from collections import deque

import numpy as np

from trunkline.ar.session.robot_process import RobotState

SELDOM = 0.25  # s between two that are kept then
AFTER = 10.0  # s of rest that are kept whole: shapes at rest are identified from them
BEFORE = 0.3  # s before a motion that are kept whole, so that a spline through all of it bends only there
STILL = 3e-4  # m, rad, of quaternions: what nothing moves by within SELDOM; an object bounces on its string by 1.7e-4
NOWHERE = -1e3  # in place of what is not seen: it has moved once it is


class LogDecimation:
    """Keeps all standings of a robot that moves; those at rest it keeps so late that a motion could still follow."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[RobotState, float]] = deque()
        self._sent, self._measured, self._since = np.empty(0), np.empty(0), -np.inf
        self._whole, self._last_time = -np.inf, -np.inf  # s until which all is kept, of the last that was

    def take(self, robot: RobotState, now: float) -> list[tuple[RobotState, float]]:
        """What is to be kept now, each with the s at which it was told, in their order."""
        self._waiting.append((robot, now))
        self._look(robot)
        if robot.time < self._whole:
            return self.rest()
        first, _ = oldest = self._waiting[0]
        if robot.time - first.time < BEFORE:
            return []
        self._waiting.popleft()
        if first.time - self._last_time < SELDOM:
            return []
        self._last_time = first.time
        return [oldest]

    def rest(self) -> list[tuple[RobotState, float]]:
        """What waits."""
        waiting = list(self._waiting)
        self._waiting.clear()
        if waiting:
            self._last_time = waiting[-1][0].time
        return waiting

    def _look(self, robot: RobotState) -> None:
        """Whether it moves: it is sent anything new, or is seen elsewhere than shortly before."""
        measured = [axes for axes in (robot.measured, robot.lengths) if axes is not None]
        sent = np.concatenate([robot.joints, robot.commands])
        measured_now = np.concatenate([*measured, robot.bodies.ravel()])
        measured_now[np.isnan(measured_now)] = NOWHERE
        rests = np.array_equal(sent, self._sent) and measured_now.shape == self._measured.shape
        rests = rests and np.abs(measured_now - self._measured).max(initial=0.0) <= STILL
        if not rests:
            self._whole = robot.time + AFTER
        if not rests or robot.time - self._since >= SELDOM:
            self._sent, self._measured, self._since = sent, measured_now, robot.time
