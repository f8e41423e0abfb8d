"""The arm as cameras see it, in the robot's base frame: markers along it, and its tip.

The tracker is a process of its own (`trunkline/ar/tracking`). What it says is looked at once a tick, without waiting.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from trunkline.ar.session.bodies import BodyPoses
from trunkline.ar.session.simulated import Simulation
from trunkline.ar.teleop.messages import Pose
from trunkline.ar.tracking.natnet import NatNetSettings, NatNetTracker
from trunkline.ar.tracking.qualisys import QualisysSettings, QualisysTracker
from trunkline.ar.tracking.ros_topics import RosTopicSettings, RosTracker
from trunkline.ar.tracking.simulated_cameras import CameraSettings, SimulatedTracker
from trunkline.ar.tracking.stream_checks import StreamLimits
from trunkline.ar.tracking.tracker import ExpectedBodies, Tracker
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.model.arm_model import CENTER
from trunkline.recordings.session.session import read_session

EVERY = 4  # units from one that the simulated cameras see to the next
MOUNT = "base"  # the arm's first body
Place = tuple[Annotated[float, Field(ge=-100, le=100)], Annotated[float, Field(ge=-100, le=100)],
              Annotated[float, Field(ge=-100, le=100)]]  # fmt: skip
Turn = tuple[Annotated[float, Field(ge=-1, le=1)], Annotated[float, Field(ge=-1, le=1)],
             Annotated[float, Field(ge=-1, le=1)], Annotated[float, Field(ge=-1, le=1)]]  # fmt: skip


@dataclass(frozen=True)
class ArmCameraSettings:
    """bodies: names of the rigid bodies in the stream, from the mount to the tip. apart: m from each of them to the
    next. tip: of the arm in the frame of the last, m. position, m, and quaternion, wxyz: of the cameras' frame in the
    robot's base frame. limits: of the stream, `distance` as a share of the first of `apart`: an arm that curls brings
    only neighbors no nearer to each other. natnet, ros, qualisys: where each system is. simulated: of the simulated
    robot's cameras, which need none of these but limits. mount: the arm's in the frame of the first body, m; None where
    no body is at the mount, as of a single one, and nothing shows then that the cameras' frame is elsewhere. markers:
    what the arm's model calls the bodies, in the same order; none where it calls them as the system does. session:
    folder of logs whose session.yaml says both, in its order; "" where `bodies` and `markers` do.
    """

    bodies: Annotated[tuple[Annotated[str, Field(min_length=1, max_length=64)], ...], Field(max_length=100)]
    apart: Annotated[tuple[Annotated[float, Field(gt=0, le=10)], ...], Field(max_length=100)]
    tip: Place
    position: Place
    quaternion: Turn
    limits: StreamLimits
    natnet: NatNetSettings
    ros: RosTopicSettings
    qualisys: QualisysSettings
    simulated: CameraSettings
    mount: Place | None = (0.0, 0.0, 0.0)
    markers: Annotated[tuple[Annotated[str, Field(min_length=1, max_length=64)], ...], Field(max_length=100)] = ()
    session: str = ""

    def __post_init__(self) -> None:
        if self.session and (self.bodies or self.markers):
            raise ValueError("session: found `bodies` or `markers` besides, expected neither: session.yaml says both")
        if not self.session and len(self.apart) != max(len(self.bodies) - 1, 0):
            counts = f"{len(self.bodies)} bodies and {len(self.apart)} distances"
            raise ValueError(f"bodies, apart: found {counts}, expected a distance from each to the next")
        if self.markers and (len(self.markers) != len(self.bodies) or len(set(self.markers)) < len(self.markers)):
            raise ValueError(f"markers: found {', '.join(self.markers)}, expected a name for each body, or none")
        norm = float(np.linalg.norm(self.quaternion))
        if abs(norm - 1) > 1e-3:
            raise ValueError(f"quaternion: found a length of {norm:.3g}, expected 1")


@dataclass(frozen=True)
class MeasuredArm:
    """The newest that is measured, in the base frame. stamp: s of this machine's monotonic clock. poses: of the bodies,
    m and wxyz, NaN where one is not tracked. Shape (B, 7). tip: m. Shape (3,). age, s, rate, Hz, loss, fault: as of
    `TrackedPoses`. mount: m, NaN where its body is not tracked, None where there is none. Shape (3,)."""

    stamp: float
    poses: np.ndarray
    tip: np.ndarray
    age: float
    rate: float
    loss: float
    fault: str
    mount: np.ndarray | None


class ArmCameras:
    """A tracker of the arm's bodies, from the mount to the tip. pose: of the cameras' frame in the base. tip: m, in the
    frame of the last body, mount: in that of the first, None where that is not there. Shapes (3,). names: of the
    bodies, in the arm's model where it has them."""

    def __init__(
        self, tracker: Tracker, names: Sequence[str], pose: Pose, tip: np.ndarray, mount: np.ndarray | None
    ) -> None:
        self.names, self._tracker, self._tip, self._mount = tuple(names), tracker, tip, mount
        self.align(pose)

    def align(self, pose: Pose) -> None:
        """The cameras' frame is there in the base from now on."""
        self.pose = pose
        self._turn, self._origin = rotation_from_wxyz(np.array(pose.quaternion)), np.array(pose.position)

    @property
    def sees_mount(self) -> bool:
        """Whether the first body is at the arm's mount."""
        return self._mount is not None

    def connect(self) -> None:
        """As of `Tracker`."""
        self._tracker.connect()

    def show(self, bodies: np.ndarray) -> None:
        """The robot's drawn bodies (N, 7) are there now: nothing to true cameras."""

    def latest(self) -> MeasuredArm:
        tracked = self._tracker.latest()
        visible = np.isfinite(np.hstack([tracked.positions, tracked.quaternions])).all(axis=1)
        poses = np.full((len(self.names), 7), np.nan)
        if visible.any():
            turns = self._turn * rotation_from_wxyz(tracked.quaternions[visible])
            poses[visible, :3] = self._turn.apply(tracked.positions[visible]) + self._origin
            poses[visible, 3:] = wxyz_from_rotation(turns)
        tip, mount = _place(poses[-1], self._tip), None if self._mount is None else _place(poses[0], self._mount)
        return MeasuredArm(tracked.stamp, poses, tip, tracked.age, tracked.rate, tracked.loss, tracked.fault, mount)

    def close(self) -> None:
        self._tracker.stop()


class SimulatedArmCameras(ArmCameras):
    """Of the simulated robot."""

    def __init__(self, simulation: Simulation, tip: tuple[str, Sequence[float]], settings: ArmCameraSettings) -> None:
        """tip: body of the arm's tip, and where it is in that, m."""
        units = [name for name in simulation.bodies if name.startswith("unit_")]
        last = units.index(tip[0])
        names = [MOUNT, *units[last % EVERY : last + 1 : EVERY]]
        poses = BodyPoses(simulation.twin.model, simulation.bodies).of(_start(simulation))
        self._rows = [simulation.bodies.index(name) for name in names]
        marked = markers_of(simulation.twin.model, names)
        self._places = np.array([np.zeros(3) if marker is None else marker[1] for marker in marked])
        apart = np.linalg.norm(np.diff(self._markers(poses), axis=0), axis=1)
        cameras = settings.simulated
        turn = rotation_from_wxyz(np.array(cameras.quaternion)).inv()
        pose = _pose(turn, -turn.apply(np.array(cameras.origin)))
        self._simulated = SimulatedTracker(cameras, expected_bodies(names, apart), settings.limits)
        super().__init__(self._simulated, names, pose, np.array(tip[1], float) - self._places[-1], np.zeros(3))
        self.show(poses)

    def show(self, bodies: np.ndarray) -> None:
        self._simulated.show(self._markers(bodies), bodies[self._rows, 3:])

    def _markers(self, bodies: np.ndarray) -> np.ndarray:
        """Where the markers are, m, of drawn bodies (N, 7). Shape (B, 3)."""
        return marker_positions(bodies[self._rows], self._places)


def real_cameras(kind: str, settings: ArmCameraSettings) -> ArmCameras:
    """By the stream of a system, "natnet", "ros2" or "qualisys".

    Raises:
        InputError: the settings name no bodies.
    """
    settings = with_session(settings)
    if not settings.bodies:
        raise InputError("cameras.bodies: found none, expected the names of the arm's rigid bodies in the stream")
    expected, limits = expected_bodies(settings.bodies, np.array(settings.apart)), settings.limits
    if kind == "natnet":
        tracker: Tracker = NatNetTracker(settings.natnet, expected, limits)
    elif kind == "ros2":
        tracker = RosTracker(settings.ros, expected, limits)
    else:
        tracker = QualisysTracker(settings.qualisys, expected, limits)
    alone = settings.mount is None or len(settings.bodies) == 1
    pose, mount = Pose(settings.position, settings.quaternion), None if alone else np.array(settings.mount)
    return ArmCameras(tracker, settings.markers or settings.bodies, pose, np.array(settings.tip), mount)


def with_session(settings: ArmCameraSettings) -> ArmCameraSettings:
    """With the names of the session.yaml that the settings name, if any: its base, then its markers, in its order.

    Raises:
        InputError: there is none, it names no markers, or as many as `apart` does not fit; no body marks its base.
    """
    if not settings.session:
        return settings
    try:
        session = read_session(Path(settings.session))
    except InputError as error:
        raise InputError(f"cameras.session: {error}") from error
    where = f"cameras.session: {settings.session}/session.yaml"
    if not isinstance(session.base, str):
        raise InputError(f"{where}: found a fixed base, expected the name of the body at the mount")
    if session.markers is None:
        raise InputError(f"{where}: found no `markers`, expected them, from the mount to the tip")
    bodies, markers = (session.base, *session.markers), (MOUNT, *session.markers.values())
    try:
        return replace(settings, session="", bodies=bodies, markers=markers)
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error


def markers_of(
    model: mujoco.MjModel, names: Sequence[str]
) -> tuple[tuple[str, tuple[float, float, float]] | None, ...]:
    """Of each marker of an arm the body that it is on, and where in that, m; None where the model lacks it."""
    markers = []
    for name in names:
        site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, f"{name}{CENTER}")
        x, y, z = (float(value) for value in model.site_pos[site])
        markers.append(None if site < 0 else (model.body(model.site_bodyid[site]).name, (x, y, z)))
    return tuple(markers)


def marker_positions(poses: np.ndarray, places: np.ndarray) -> np.ndarray:
    """m, of what is at `places` (B, 3), m, in bodies at `poses` (B, 7); NaN where these are. Shape (B, 3)."""
    return np.array([_place(pose, place) for pose, place in zip(poses, places, strict=True)])


def expected_bodies(names: Sequence[str], apart: np.ndarray) -> ExpectedBodies:
    """Bodies from the mount on, of which neighbors are `apart`, m. Shape (B - 1,). A single one has no distances."""
    if len(names) < 2:
        return ExpectedBodies(tuple(names), True)
    distances, rows = np.full((len(names), len(names)), np.nan), np.arange(len(apart))
    distances[rows, rows + 1] = distances[rows + 1, rows] = apart
    return ExpectedBodies(tuple(names), True, None, distances)


def _place(pose: np.ndarray, within: np.ndarray) -> np.ndarray:
    """m, of what is `within` (3,), m, the frame of a body at `pose` (7,); NaN where that is. Shape (3,)."""
    if not np.isfinite(pose).all():
        return np.full(3, np.nan)
    return pose[:3] + rotation_from_wxyz(pose[3:]).apply(within)


def _start(simulation: Simulation) -> np.ndarray:
    start = simulation.twin.start
    return simulation.twin.model.qpos0 if start is None else start


def _pose(turn: Rotation, position: np.ndarray) -> Pose:
    x, y, z = (float(value) for value in position)
    a, b, c, d = (float(value) for value in wxyz_from_rotation(turn))
    return Pose((x, y, z), (a, b, c, d))
