"""What moving targets ask of a robot that follows them: sought by the process that plans, heard by the robot."""

from collections.abc import Callable

import numpy as np

from trunkline.ar.session.previewer import FollowAnswer, FollowRequest
from trunkline.ar.teleop.following import KNOT
from trunkline.ar.teleop.messages import Targets, World
from trunkline.ar.teleop.targets import why_not
from trunkline.ar.teleop.trajectory import JOINTS

PLANNER_TIMEOUT = 1.0  # s without an answer of the process that plans; a busy machine answers within 0.5
ROUNDING = 1e-6  # s, of a sum of ticks


class FollowControl:
    """`order` asks for axes; `hear` takes them, with the s since their targets. refused: why the newest targets are
    not followed, "" where they are."""

    def __init__(
        self, order: Callable[[FollowRequest], None], hear: Callable[[float, np.ndarray | None], None]
    ) -> None:
        self._order, self._hear = order, hear
        self._now, self._serial = 0.0, 0
        self.end()

    def end(self) -> None:
        """Nothing is followed; what is still being sought counts no more."""
        self.refused, self._begun, self._last = "", False, -np.inf
        self._times: dict[int, float] = {}  # of what is being sought
        self._pending: list[tuple[float, np.ndarray | None]] = []  # before the robot may follow
        self._near: np.ndarray | None = None

    @property
    def fault(self) -> str:
        """Why the robot must not go on following, "" where it may: a process that plans and comes back after a while
        would send it to where the targets are by then."""
        silent = self._now - min(self._times.values(), default=self._now)
        return f"the process that plans has not answered for {silent:.2f} s" if silent > PLANNER_TIMEOUT else ""

    def advance(self, dt: float) -> None:
        """Let `dt` s pass."""
        self._now += dt

    def seek(self, targets: Targets | None, joints: np.ndarray, world: World, hangs: np.ndarray | None = None) -> None:
        """Every KNOT s, what `targets` ask for, near what was found last, at first near `joints` (7,), rad. hangs: as
        of an `Order`."""
        if self._now < self._last + KNOT - ROUNDING:
            return
        self._serial, self._last = self._serial + 1, self._now
        self._times[self._serial] = self._now
        near = joints if self._near is None else self._near
        self._order(FollowRequest(self._serial, None if why_not(targets) else targets, near, world, hangs))

    def begin(self) -> None:
        """The robot follows from now on, and hears what was found so far."""
        self._begun = True
        while self._pending:
            self._tell(*self._pending.pop(0))

    def answer(self, answer: FollowAnswer) -> None:
        """What was sought; of an older following it is nothing."""
        time = self._times.pop(answer.serial, None)
        if time is None:
            return
        self._times = {serial: at for serial, at in self._times.items() if serial > answer.serial}
        self.refused = answer.refused
        self._near = self._near if answer.axes is None else answer.axes[:JOINTS]
        if self._begun:
            self._tell(time, answer.axes)
        else:
            self._pending.append((time, answer.axes))

    def _tell(self, time: float, axes: np.ndarray | None) -> None:
        self._hear(self._now - time, axes)
