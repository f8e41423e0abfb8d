"""Poses of single bodies put together to frames of the cameras, by their stamps.

Topics of ROS 2 have a message for each body, or several, and number none of them: what has one stamp is one frame. It
is complete once all bodies have come, or where one of a later frame comes; who is missing then was not tracked. A body
of an earlier stamp is a frame of its own, so that the stream's checks see that stamps do not grow.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trunkline.ar.tracking.tracker import CameraFrame

TOGETHER = 1e-3  # s between stamps of one frame: a driver may stamp each body by itself, one after the other


@dataclass(frozen=True)
class BodyPose:
    """stamp: s. position: m. Shape (3,). quaternion: wxyz. Shape (4,). number: of the cameras' frame, None where the
    message has none."""

    name: str
    stamp: float
    position: np.ndarray
    quaternion: np.ndarray
    number: int | None = None


class BodyFrames:
    """Of the bodies `names`; others are left out."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = tuple(names)
        self._pending: dict[str, BodyPose] = {}
        self._count = 0

    def add(self, poses: Sequence[BodyPose]) -> list[CameraFrame]:
        """The frames that are complete by what one message holds, the oldest first."""
        frames = []
        for pose in poses:
            if pose.name not in self._names:
                continue
            first = next(iter(self._pending.values()), pose)
            if pose.name in self._pending or abs(pose.stamp - first.stamp) > TOGETHER:
                frames.append(self._frame())
            self._pending[pose.name] = pose
            if len(self._pending) == len(self._names):
                frames.append(self._frame())
        return frames

    def _frame(self) -> CameraFrame:
        """What is pending, which begins anew."""
        pending, self._pending = self._pending, {}
        self._count += 1
        first = next(iter(pending.values()))
        number = self._count if first.number is None else first.number
        stamp = max(pose.stamp for pose in pending.values())
        tracked = np.array([name in pending for name in self._names])
        poses = [pending.get(name) for name in self._names]
        positions = np.array([np.full(3, np.nan) if pose is None else pose.position for pose in poses])
        quaternions = np.array([np.full(4, np.nan) if pose is None else pose.quaternion for pose in poses])
        return CameraFrame(number, stamp, stamp, tracked, positions, quaternions)
