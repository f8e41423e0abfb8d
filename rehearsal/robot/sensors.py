"""What the robot's encoders and the tracking of poses tell: late, noisy, and in a frame that is a little off."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from rehearsal.robot.kernel import JOINTS, OBJECT, TIP, TIP_AXES, WOUND
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation

Delay = Annotated[float, Field(ge=0, le=10)]
Noise = Annotated[float, Field(ge=0, le=1000)]


@dataclass
class Sensors:
    """pose_delay, joint_delay: s, from an instant to when it is seen, of tracked poses and of encoders.
    joint_noise: rad. wound_noise_mm, position_noise_mm, orientation_noise_deg: standard deviations, per axis.
    alignment_mm, alignment_deg: by how much the frame that poses are seen in lies beside the robot's base, towards a
    side and about an axis that are drawn."""

    pose_delay: Delay
    joint_delay: Delay
    joint_noise: Noise
    wound_noise_mm: Noise
    position_noise_mm: Noise
    orientation_noise_deg: Noise
    alignment_mm: Noise
    alignment_deg: Annotated[float, Field(ge=0, le=180)]


@dataclass
class Readings:
    """What a client knows of the robot. Poses are in the frame that the client takes for the Panda's base.

    time, pose_time: s, of the instants that encoders and poses are of. joints (7,): rad. wound (K,): m of pull.
    tip (3,), object (3,): m, of the arm's tip and the object's centre. tip_quaternion, object_quaternion (4,): w first.
    """

    time: float
    pose_time: float
    joints: np.ndarray
    wound: np.ndarray
    tip: np.ndarray
    tip_quaternion: np.ndarray
    object: np.ndarray
    object_quaternion: np.ndarray


class Instruments:
    """The sensors with what was drawn of them. `turn`, `shift`: the client's frame ← the Panda's base frame."""

    def __init__(self, sensors: Sensors, rng: np.random.Generator) -> None:
        self.sensors, self.rng = sensors, rng
        axis, side = rng.normal(size=(2, 3))
        self.turn = Rotation.from_rotvec(np.radians(sensors.alignment_deg) * axis / np.linalg.norm(axis))
        self.shift = sensors.alignment_mm / 1000 * side / np.linalg.norm(side)

    def read(self, encoders: np.ndarray, poses: np.ndarray, time: float, pose_time: float) -> Readings:
        """What is told of two rows (`kernel.COLUMNS`,) of the past. Each reading draws noise of its own."""
        s, rng = self.sensors, self.rng
        tip, tip_turn = self._pose(poses[TIP], Rotation.from_matrix(poses[TIP_AXES].reshape(3, 3)))
        object, object_turn = self._pose(poses[OBJECT][:3], rotation_from_wxyz(poses[OBJECT][3:]))
        return Readings(
            time, pose_time, encoders[JOINTS] + s.joint_noise * rng.normal(size=7),
            encoders[WOUND] + s.wound_noise_mm / 1000 * rng.normal(size=3), tip, tip_turn, object, object_turn,
        )  # fmt: skip

    def _pose(self, place: np.ndarray, turn: Rotation) -> tuple[np.ndarray, np.ndarray]:
        s = self.sensors
        off = s.position_noise_mm / 1000 * self.rng.normal(size=3)
        lean = Rotation.from_rotvec(np.radians(s.orientation_noise_deg) * self.rng.normal(size=3))
        return self.turn.apply(place) + self.shift + off, wxyz_from_rotation(self.turn * lean * turn)
