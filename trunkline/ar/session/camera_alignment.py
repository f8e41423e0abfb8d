"""Where the cameras' frame stands in the robot's base, and how the body at the mount is turned to the arm, without
touching: by the mount's places as cameras see them and as the joints have them, of a robot that works anyway.

    min over (R, t) of Σ |R c_i + t - b_i|²        c_i: place i in the cameras' frame, b_i: by the joints

It is looked at while the robot rests, and used from the next plan on.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.ar.session.arm_cameras import ArmCameras, MeasuredArm
from trunkline.ar.session.registration import expected_error, fit, in_base, inverse, residuals, suspect
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.ar.teleop.messages import Pose
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz

PLACES, APART = 6, 0.05  # of the mount, at least, and m between them
SETTLES, LOOKS = 1.0, 1.0  # s that joints have been still for before the mount is looked at, and for how long then
STILL = 2e-4  # rad by which joints at rest differ
VISIBLE = 0.8  # share of looks at which the mount is visible


@dataclass(frozen=True)
class CamerasAligned:
    """pose: of the cameras' frame in the base, by `places` of the mount. expected: error of it at the arm's tip, m,
    root mean square. residual: of the places, m, likewise. apart: m at the tip, from there to where the pose before has
    it. tilt_deg: of the body at the mount from the arm's axis; tilt_error_deg: of that, standard deviation. unused: why
    the pose is not to be used, "" where it is."""

    pose: Pose
    places: int
    expected: float
    residual: float
    apart: float
    tilt_deg: float
    tilt_error_deg: float
    unused: str

    @property
    def words(self) -> str:
        """In one line."""
        error = f"{self.places} places of the mount, expected error {1e3 * self.expected:.1f} mm at the tip"
        apart = f"{1e3 * self.apart:.1f} mm there from the pose before"
        tilt = f"the mount's body tilted by {self.tilt_deg:.2f} ± {self.tilt_error_deg:.2f}°"
        used = f"not used: {self.unused}" if self.unused else "used from the next plan on"
        return f"cameras aligned by {error}, {apart}; {tilt}; {used}"

    @property
    def frame_words(self) -> str:
        """What a page says of the frame where this is used."""
        error, apart = f"±{1e3 * self.expected:.1f} mm at the tip", f"{1e3 * self.apart:.1f} mm from the pose before"
        return f"frame by {self.places} places of the mount, {error}, {apart}"


class CameraAlignment:
    """Of `cameras` that see the body at the mount. limit: m, of the expected error and of each place, above which an
    alignment is not used."""

    def __init__(self, cameras: ArmCameras, mount_offset: float, limit: float) -> None:
        self._cameras, self._mount_offset, self._limit = cameras, mount_offset, limit
        self._joints, self._since = np.full(7, np.nan), 0.0  # of the robot at rest, and since when, s
        self._looks: list[np.ndarray] = []  # poses of the mount at the rest that goes on, (7,)
        self._seconds: list[np.ndarray] = []  # joints meanwhile
        self._stamp, self._looked = -np.inf, False
        self._reference: list[np.ndarray] = []  # places in the cameras' frame
        self._turns: list[Rotation] = []  # of the body there, in the cameras' frame
        self._base: list[np.ndarray] = []  # places by the joints
        self._frames: list[Rotation] = []  # of the arm's base by the joints
        self._pending: Pose | None = None

    def observe(self, robot: RobotState, arm: MeasuredArm) -> CamerasAligned | None:
        """What the robot does and cameras see now; the alignment, where another place of the mount has come to it."""
        joints = robot.joints_now
        if not np.abs(joints - self._joints).max() <= STILL or arm.fault or arm.mount is None:
            self._joints, self._since, self._looks, self._seconds = joints, robot.time, [], []
            self._looked = False
            return None
        if self._looked or arm.stamp <= max(self._stamp, self._since + SETTLES):
            return None
        self._stamp = arm.stamp
        self._looks.append(np.concatenate([arm.mount, arm.poses[0, 3:]]))
        self._seconds.append(joints)
        if arm.stamp < self._since + SETTLES + LOOKS:
            return None
        self._looked = True
        return self._place(np.array(self._looks), np.mean(self._seconds, axis=0), arm)

    def take(self) -> Pose | None:
        """The pose that is to be used from now on, once."""
        pose, self._pending = self._pending, None
        return pose

    def _place(self, looks: np.ndarray, joints: np.ndarray, arm: MeasuredArm) -> CamerasAligned | None:
        visible = np.isfinite(looks).all(axis=1)
        place, frame = base_frames(joints, self._mount_offset)
        near = any(np.linalg.norm(place - other) < APART for other in self._base)
        if visible.mean() < VISIBLE or near:
            return None
        before = inverse(self._cameras.pose)
        self._reference.append(in_base(before, np.median(looks[visible, :3], axis=0)))
        self._turns.append(
            rotation_from_wxyz(np.array(before.quaternion)) * rotation_from_wxyz(looks[visible, 3:]).mean()
        )
        self._base.append(place)
        self._frames.append(Rotation.from_matrix(frame))
        while len(self._base) > PLACES and (wrong := suspect(np.array(self._reference), np.array(self._base))):
            for values in (self._reference, self._turns, self._base, self._frames):
                del values[wrong.index]
        if len(self._base) < PLACES:
            return None
        reference, base = np.array(self._reference), np.array(self._base)
        try:
            pose = fit(reference, base)
        except InputError:  # too near to a plane yet
            return None
        tip = arm.tip if np.isfinite(arm.tip).all() else place
        tip = in_base(pose, in_base(before, tip))
        missed, expected = residuals(pose, reference, base), expected_error(pose, reference, base, tip)
        apart = float(np.linalg.norm(in_base(self._cameras.pose, in_base(inverse(pose), tip)) - tip))
        unused = ""
        if max(expected, worst := float(missed.max())) > self._limit:
            figures = f"error {1e3 * expected:.1f} mm, a place {1e3 * worst:.1f} mm off"
            unused = f"found {figures}, expected at most {1e3 * self._limit:g} mm"
        self._pending = None if unused else pose
        rms = float(np.sqrt(np.mean(missed**2)))
        tilt = self._tilt(pose, _turn_error(pose, reference, base))
        return CamerasAligned(pose, len(base), expected, rms, apart, *tilt, unused)

    def _tilt(self, pose: Pose, turn_error: float) -> tuple[float, float]:
        """Of the body at the mount from the arm's axis, and its error, in degrees."""
        turn = rotation_from_wxyz(np.array(pose.quaternion))
        off = np.array(
            [(frame.inv() * turn * body).as_rotvec()[:2] for body, frame in zip(self._turns, self._frames, strict=True)]
        )
        mean, scatter = off.mean(axis=0), off.var(axis=0, ddof=1).sum() / len(off)
        return float(np.degrees(np.linalg.norm(mean))), float(np.degrees(np.sqrt(scatter + turn_error**2)))


def _turn_error(pose: Pose, reference: np.ndarray, base: np.ndarray) -> float:
    """Of the fit, rad: by how much farther off it is 1 m below the places' middle than there."""
    middle = base.mean(axis=0)
    far, near = (expected_error(pose, reference, base, middle - [0.0, 0.0, away]) for away in (1.0, 0.0))
    return float(np.sqrt(far**2 - near**2))


def camera_mark(arm: MeasuredArm, mark: Sequence[float], mount_offset: float) -> np.ndarray | None:
    """Where cameras have `mark` of the flange's frame in the base, m (3,); None where they do not see the mount."""
    if arm.fault or arm.mount is None or not np.isfinite(arm.poses[0]).all():
        return None
    flange = rotation_from_wxyz(arm.poses[0, 3:]) * Rotation.from_euler("x", np.pi)
    return arm.mount + flange.apply(np.array(mark) - [0.0, 0.0, mount_offset])
