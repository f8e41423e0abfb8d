"""Who tracks bodies live: three calls, the same for every motion-capture system.

A `Tracker` runs in a process of its own what a `PoseSource` receives, past the checks of `stream_checks.py`. There are
sources for OptiTrack (`natnet.py`), topics of ROS 2 (`ros_topics.py`), Qualisys (`qualisys.py`) and simulated cameras
(`simulated_cameras.py`). Vicon's would be another: a class with `receive` and `close`, and a function of names that
opens it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from trunkline.errors import InputError


@dataclass(frozen=True)
class CameraFrame:
    """What a source received of B bodies.

    number: of the frame, counted by the cameras. stamp, sent: s of the cameras' clock at which they exposed it and the
    system sent it. tracked: which bodies the system says that it tracks. Shape (B,). positions: m. Shape (B, 3).
    quaternions: wxyz. Shape (B, 4). Both in the cameras' frame; anything where not tracked.
    """

    number: int
    stamp: float
    sent: float
    tracked: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray


@dataclass(frozen=True)
class TrackedPoses:
    """The newest poses of B bodies, in the cameras' frame, as of a call of `latest`.

    names: of the bodies, as session.yaml has them. stamp: s of this machine's monotonic clock at which the cameras
    exposed them. positions (B, 3), m, and quaternions (B, 4), wxyz: NaN where a body is not seen, or what was received
    is no measurement of it. age: s since then, without the shortest delay of the network, which nothing
    measures. rate: Hz of the frames that came within the last second. loss: share of that second's frames that did not
    come. fault: the first that a check has objected to since `connect`, one line; "" while there is none. One of a
    stream that was late ends by itself (`stream_checks.py`), any other persists.
    """

    names: tuple[str, ...]
    stamp: float
    positions: np.ndarray
    quaternions: np.ndarray
    age: float
    rate: float
    loss: float
    fault: str

    @property
    def sound(self) -> bool:
        """Whether these poses may be relied on. Once it is False it remains so until `connect` is called anew, but for
        a stream that was late and is on time again."""
        return not self.fault


class PoseSource(Protocol):
    """What a motion-capture system sends, in the process that receives it."""

    def receive(self, seconds: float) -> CameraFrame | None:
        """The next frame; None where none comes within `seconds`.

        Raises:
            ValueError: what came is no frame of this system, in one line.
        """
        ...

    def close(self) -> None: ...


# Opens a source of bodies by their names, in the process that receives it: picklable. InputError: nothing answers, or a
# body is not streamed.
OpenSource = Callable[[tuple[str, ...]], PoseSource]


class Tracker(Protocol):
    """Tracks named bodies."""

    def connect(self) -> None:
        """Begin, or anew, which also forgets a fault. Returns once a frame has come; InputError where none comes."""
        ...

    def latest(self) -> TrackedPoses:
        """The newest poses. Does not wait. InputError where it is not connected."""
        ...

    def stop(self) -> None:
        """End, at any time, also twice."""
        ...


@dataclass(frozen=True)
class ExpectedBodies:
    """What is tracked, and what is usual of it.

    names: of the bodies in the stream: the base, where one marks it, then the markers. mount: where no body marks the
    base, its position in the cameras' frame, m, (3,). distances: usual ones between the base and the markers, m,
    (1 + S, 1 + S), NaN where unknown; None where nothing is known, and then neither exchanged labels nor bodies in
    another place show.
    """

    names: tuple[str, ...]
    marked_base: bool
    mount: np.ndarray | None = None
    distances: np.ndarray | None = None

    def __post_init__(self) -> None:
        if repeated := [name for name in self.names if self.names.count(name) > 1]:
            raise InputError(f"bodies: found {repeated[0]!r} twice, expected each name once")
        rows = len(self.names) + (not self.marked_base)
        if self.distances is not None and self.distances.shape != (rows, rows):
            raise InputError(f"distances: found shape {self.distances.shape}, expected {(rows, rows)}, the base first")
        if self.distances is not None and not self.marked_base and self.mount is None:
            raise InputError("mount: missing, expected the base's position, as no body marks it")

    def with_base(self, positions: np.ndarray) -> np.ndarray:
        """Positions (..., B, 3) m with the base first, (..., 1 + S, 3), as `distances` has them."""
        return positions if self.marked_base or self.mount is None else np.insert(positions, 0, self.mount, axis=-2)
