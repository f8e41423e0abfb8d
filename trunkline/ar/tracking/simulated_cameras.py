"""Cameras of a simulated lab, for everybody without a motion-capture system: noise, gaps, swaps, delay.

`SimulatedTracker.show` tells where the bodies are; its process sees them as cameras would, in a frame and on a clock of
their own. The numbers are those of the simulated lab's cameras (`demo/conf/record/config.yaml`), which record logs.
"""

import multiprocessing
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from trunkline.ar.tracking.pose_channel import PoseChannel
from trunkline.ar.tracking.stream_checks import StreamLimits
from trunkline.ar.tracking.tracker import CameraFrame, ExpectedBodies
from trunkline.ar.tracking.tracking_process import TrackingProcess
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.settings import Seed

Share = Annotated[float, Field(ge=0, lt=1)]
Milliseconds = Annotated[float, Field(ge=0, le=10_000)]
Coordinate = Annotated[float, Field(ge=-100, le=100)]
EPOCH = 1000.0  # s that the cameras' clock is ahead


@dataclass(frozen=True)
class CameraSettings:
    """rate: Hz. position_noise, mm, orientation_noise, deg: standard deviation, white, per axis; not 0, as what repeats
    to the last bit counts as stale. gaps, swaps: 1/s, how often a body vanishes, and neighbors' labels are exchanged.
    gap, swap: for how long, ms, shortest and longest. dropped, outliers: share of frames, and of samples. outlier: mm,
    at most. delay: ms from the exposure until the frame comes. origin, m, and quaternion, wxyz: of the bodies' world in
    the cameras' frame, whose y is up. seed: of all that is drawn.
    """

    rate: Annotated[float, Field(ge=1, le=2000)] = 120.0
    position_noise: Annotated[float, Field(gt=0, le=1000)] = 0.3
    orientation_noise: Annotated[float, Field(gt=0, le=180)] = 0.3
    gaps: Annotated[float, Field(ge=0, le=1000)] = 0.05
    gap: tuple[Milliseconds, Milliseconds] = (50.0, 300.0)
    swaps: Annotated[float, Field(ge=0, le=1000)] = 0.0
    swap: tuple[Milliseconds, Milliseconds] = (50.0, 300.0)
    dropped: Share = 0.005
    outliers: Share = 0.0005
    outlier: Annotated[float, Field(ge=0, le=10_000)] = 40.0
    delay: Milliseconds = 8.0
    origin: tuple[Coordinate, Coordinate, Coordinate] = (0.4, 1.1, -0.3)
    quaternion: tuple[Coordinate, Coordinate, Coordinate, Coordinate] = (0.5**0.5, -(0.5**0.5), 0.0, 0.0)
    seed: Seed = 0


class SimulatedCameras:
    """A `PoseSource` of what `shown` says: positions (B, 3), m, and quaternions (B, 4), wxyz, in the world."""

    def __init__(self, settings: CameraSettings, shown: PoseChannel, names: Sequence[str]) -> None:
        self._settings, self._shown, self._bodies = settings, shown, len(names)
        self._rng = np.random.default_rng(settings.seed)
        self._turn = rotation_from_wxyz(np.array(settings.quaternion))
        self._hidden, self._swap, self._swapped = np.zeros(self._bodies), 0, 0.0  # until when, s
        self._begun = time.monotonic()
        self._number = 0
        self._waiting: deque[tuple[float, CameraFrame]] = deque()  # exposed, with when they come

    def receive(self, seconds: float) -> CameraFrame | None:
        until = time.monotonic() + seconds
        while True:
            due = self._begun + (self._number + 1) / self._settings.rate
            comes = self._waiting[0][0] if self._waiting else np.inf
            if min(due, comes) > until:
                time.sleep(max(until - time.monotonic(), 0.0))
                return None
            time.sleep(max(min(due, comes) - time.monotonic(), 0.0))
            if comes <= due:
                return self._waiting.popleft()[1]
            self._number += 1
            if self._rng.random() >= self._settings.dropped:
                self._waiting.append((due + 1e-3 * self._settings.delay, self._exposed(due)))

    def close(self) -> None:
        self._waiting.clear()

    def _exposed(self, now: float) -> CameraFrame:
        settings, rng, count = self._settings, self._rng, self._bodies
        positions, quaternions = (part.reshape(count, -1) for part in np.split(self._shown.hear()[0], [3 * count]))
        noise = 1e-3 * settings.position_noise * rng.standard_normal((count, 3))
        positions = self._turn.apply(positions) + np.array(settings.origin) + noise
        turns = Rotation.from_rotvec(np.radians(settings.orientation_noise) * rng.standard_normal((count, 3)))
        quaternions = wxyz_from_rotation(turns * self._turn * rotation_from_wxyz(quaternions))
        off, way = rng.random(count) < settings.outliers, rng.standard_normal((count, 3))
        way *= 1e-3 * settings.outlier * rng.uniform(0.5, 1.0, (count, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
        positions[off] += way[off]
        begins = rng.random(count) < settings.gaps / settings.rate
        self._hidden[begins] = now + 1e-3 * rng.uniform(*settings.gap, count)[begins]
        if count > 1 and now > self._swapped and rng.random() < settings.swaps / settings.rate:
            self._swap, self._swapped = int(rng.integers(count - 1)), now + 1e-3 * rng.uniform(*settings.swap)
        order = np.arange(count)
        if now <= self._swapped:
            order[self._swap], order[self._swap + 1] = self._swap + 1, self._swap
        stamp, tracked = EPOCH + now, (self._hidden < now)[order]
        sent = stamp + 1e-3 * settings.delay
        return CameraFrame(self._number, stamp, sent, tracked, positions[order], quaternions[order])


class SimulatedTracker(TrackingProcess):
    """A `Tracker` of simulated cameras."""

    def __init__(self, settings: CameraSettings, expected: ExpectedBodies, limits: StreamLimits | None = None) -> None:
        self._shown = PoseChannel(multiprocessing.get_context("spawn"), 7 * len(expected.names))
        super().__init__(partial(SimulatedCameras, settings, self._shown), expected, limits)

    def show(self, positions: np.ndarray, quaternions: np.ndarray) -> None:
        """Where the bodies are now, in the world: m (B, 3), wxyz (B, 4).

        Raises:
            InputError: of other shapes.
        """
        count = len(self._expected.names)
        if positions.shape != (count, 3) or quaternions.shape != (count, 4):
            raise InputError(f"found shapes {positions.shape} and {quaternions.shape}, expected {count} bodies")
        self._shown.tell(np.concatenate([positions.ravel(), quaternions.ravel()]))

    def connect(self) -> None:
        if not self._shown.hear()[0].any():
            raise InputError("simulated cameras: found nothing to see, expected `show` before `connect`")
        super().connect()
