"""Where the straight arm hangs as cameras see it before the robot first moves: the twin of previews leans likewise.

It is kept in the cameras' frame, and means something once that is aligned by the mount: a frame that is turned by half
a degree would lean the twin by as much.
"""

import numpy as np

from trunkline.ar.correction.rest import RestWatch
from trunkline.ar.session.arm_cameras import ArmCameras, MeasuredArm
from trunkline.ar.session.registration import in_base, inverse
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.teleop.base_frames import base_frames

UPRIGHT = np.cos(np.radians(2.0))  # of the base's axis with the vertical: the twin's arm hangs straight down
PULLED = 1e-4  # m by which a cable may be shorter than the straight arm's


class HangingWatch:
    """Of `cameras` that see the body at the mount. straight: commands of the straight arm, m (K,). twin: where the
    twin's tip hangs, in its base frame, m (3,). mount_offset: m, from the flange to the mount. limit: m, from there to
    the arm's tip, above which something else is wrong."""

    def __init__(
        self, cameras: ArmCameras, straight: np.ndarray, twin: np.ndarray, mount_offset: float, limit: float
    ) -> None:
        self._cameras, self._straight, self._twin = cameras, straight, twin
        self._mount_offset, self._limit = mount_offset, limit
        self._over, self._stamp, self._rests = False, -np.inf, (RestWatch(), RestWatch())
        self._joints: np.ndarray | None = None  # of the robot as it hung, (7,); None before
        self._places = np.full((2, 3), np.nan)  # of tip and mount, m, in the cameras' frame

    def end(self) -> None:
        """The robot is to move: where its arm is from now on says nothing of how it hangs."""
        self._over = True

    def observe(self, robot: RobotState, arm: MeasuredArm) -> None:
        """What the robot does and cameras see now."""
        if self._over or self._joints is not None or arm.stamp <= self._stamp:
            return
        self._stamp = arm.stamp
        joints = robot.joints_now
        upright = base_frames(joints, self._mount_offset)[1][2, 2] >= UPRIGHT
        slack = (robot.commands >= self._straight - PULLED).all()
        if arm.fault or arm.mount is None or not upright or not slack:
            self._rests = RestWatch(), RestWatch()
            return
        if all([rest.observe(arm.stamp, at) for rest, at in zip(self._rests, (arm.tip, arm.mount), strict=True)]):
            self._joints = joints
            self._places = in_base(inverse(self._cameras.pose), np.array([rest.tip for rest in self._rests]))

    @property
    def place(self) -> np.ndarray | None:
        """Of the tip, in the arm's base frame, by where the cameras' frame is now, m (3,). None where it was not seen,
        or is too far from the twin's."""
        return self._place if self._joints is not None and self._apart <= self._limit else None

    @property
    def words(self) -> str:
        """What a page says of it, "" before it was seen."""
        if self._joints is None:
            return ""
        far = f", not used: expected at most {1e3 * self._limit:g} mm" if self._apart > self._limit else ""
        return f"the straight arm hangs {1e3 * self._apart:.1f} mm from the twin's{far}"

    @property
    def _place(self) -> np.ndarray:
        assert self._joints is not None
        tip, mount = in_base(self._cameras.pose, self._places)
        return (tip - mount) @ base_frames(self._joints, self._mount_offset)[1]

    @property
    def _apart(self) -> float:
        return float(np.linalg.norm(self._place - self._twin))
