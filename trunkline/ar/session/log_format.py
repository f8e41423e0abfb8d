"""An MCAP file of ROS 2 messages, as `ingest` and the tools of ROS 2 read them, and the process that writes it.

It imports little, so that the process is there soon.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

from trunkline.compute.processes import leave_signals_to_parent

POSES, STATIC = "/tf", "/tf_static"
TWIN = "/tf_twin"  # poses of the twin of a real robot: not measured
MEASURED = "/rigid_bodies"  # what cameras see of the arm
JOINTS_SENT, JOINTS = "/joints/command", "/joint_states"  # the latter: ROS's name for what is measured
TENDONS_SENT, TENDONS = "/tendons/command", "/tendons/state"
HEADSET, PARTS = "/headset/", ("left", "right", "view")
EVENTS, INPUT, INTENT = "/events", "/core/input", "/core/intent"
BASE, REFERENCE = "rigid_base", "reference"  # frames
SIMULATED = "simulated"  # the hardware of a session in which nothing is real
WRIST = "link_7"  # the rigid robot's last body, which carries the mount
TEXT = 240  # bytes of a fault
TEXTS = (EVENTS, INPUT, INTENT)
GEOMETRY = ("Vector3", "Point", "Quaternion", "Pose", "Transform", "TransformStamped")
TYPES = {
    **dict.fromkeys((POSES, TWIN, MEASURED), "tf2_msgs/msg/TFMessage"),
    STATIC: "tf2_msgs/msg/TFMessage",
    **dict.fromkeys((JOINTS_SENT, JOINTS, TENDONS_SENT, TENDONS), "sensor_msgs/msg/JointState"),
    **{HEADSET + part: "geometry_msgs/msg/PoseStamped" for part in PARTS},
    **dict.fromkeys(TEXTS, "std_msgs/msg/String"),
}


class Record(NamedTuple):
    """What is to be written to `topic`: text, or numbers as `LogWriter` has them, of a time `stamp`, s, logged at
    `logged`, s. frame: that poses are in."""

    topic: str
    stamp: float
    logged: float
    content: bytes | np.ndarray
    frame: str = ""


@dataclass(frozen=True)
class Subject:
    """Whose session it is: names of the bodies (N), of the rigid robot's joints and of the cables (K), whose lengths
    are `straight` (K,), m, in the straight arm; a pull is that less the length. tip: the body of the arm's tip, and
    where it is in that, m. hardware: what of it is real, in words. measured: names of the bodies that cameras see (B).
    markers: the body of the arm that each of these is on, and where in that, m; None where its model has none of the
    name. mount: name of that of them which is at the arm's mount, "" without."""

    bodies: tuple[str, ...]
    joints: tuple[str, ...]
    tendons: tuple[str, ...]
    straight: np.ndarray
    tip: tuple[str, tuple[float, float, float]]
    hardware: str = SIMULATED
    measured: tuple[str, ...] = ()
    markers: tuple[tuple[str, tuple[float, float, float]] | None, ...] = ()
    mount: str = ""

    @property
    def poses(self) -> str:
        """The topic of the bodies' poses."""
        return POSES if self.hardware == SIMULATED else TWIN

    @property
    def absent(self) -> tuple[str, ...]:
        """Topics that its log does not have."""
        return (POSES if self.poses == TWIN else TWIN, *(() if self.measured else (MEASURED,)))


NOTHING = Subject((), (), (), np.empty(0), ("", (0.0, 0.0, 0.0)))


class LogFormat:
    """Writes to `file`. `zero`: ns since 1970 at 0 s of the records' clock."""

    def __init__(self, file: BinaryIO, subject: Subject, zero: int) -> None:
        self._subject, self._zero = subject, zero
        self._writer = Writer(file)
        self._writer.start(profile="ros2", library="trunkline")
        schemas = {name: self._schema(name) for name in sorted(set(TYPES.values()))}
        self._channels = {
            topic: self._writer.register_channel(topic, "cdr", schemas[name])
            for topic, name in TYPES.items()
            if topic not in subject.absent
        }
        self._posed = -np.inf

    def write(self, record: Record) -> None:
        """Poses that are not newer than the last are left out."""
        if record.topic == self._subject.poses:
            if record.stamp <= self._posed:
                return
            self._posed = record.stamp
        message = self._store.serialize_cdr(self._message(record), TYPES[record.topic])
        stamp, logged = self._ns(record.stamp), self._ns(record.logged)
        self._writer.add_message(self._channels[record.topic], logged, bytes(message), stamp)

    def flush(self) -> None:
        """A chunk of what was written since."""
        self._writer.flush()

    def finish(self) -> None:
        """The file's end; it is not closed."""
        self._writer.finish()

    @cached_property
    def _store(self):
        return get_typestore(Stores.ROS2_JAZZY)

    def _schema(self, name: str) -> int:
        text, _ = self._store.generate_msgdef(name, ros_version=2)
        return self._writer.register_schema(name, "ros2msg", text.encode())

    def _ns(self, seconds: float) -> int:
        return self._zero + round(1e9 * seconds)

    def _message(self, record: Record):
        types, content, subject = self._store.types, record.content, self._subject
        if record.topic in TEXTS:
            assert isinstance(content, bytes)
            return types["std_msgs/msg/String"](content.decode())
        assert isinstance(content, np.ndarray)
        seconds, rest = divmod(self._ns(record.stamp), 1_000_000_000)
        header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](seconds, rest), record.frame)
        if record.topic in (JOINTS_SENT, JOINTS):
            return self._joints(header, list(subject.joints), content)
        if record.topic in (TENDONS_SENT, TENDONS):
            return self._joints(header, list(subject.tendons), subject.straight - content)
        vector, point, turn, pose, transform, stamped = (types[f"geometry_msgs/msg/{name}"] for name in GEOMETRY)
        if record.topic.startswith(HEADSET):
            x, y, z, qw, qx, qy, qz = (float(value) for value in content)
            return types["geometry_msgs/msg/PoseStamped"](header, pose(point(x, y, z), turn(qx, qy, qz, qw)))
        names = {STATIC: (REFERENCE,), MEASURED: subject.measured}.get(record.topic, subject.bodies)
        return types["tf2_msgs/msg/TFMessage"]([
            stamped(header, name, transform(vector(x, y, z), turn(qx, qy, qz, qw)))
            for name, (x, y, z, qw, qx, qy, qz) in zip(names, np.atleast_2d(content).tolist(), strict=True)
            if np.isfinite(x)  # what is not there is NaN
        ])  # fmt: skip

    def _joints(self, header, names: list[str], positions: np.ndarray):
        none = np.empty(0)
        return self._store.types["sensor_msgs/msg/JointState"](header, names, np.array(positions, float), none, none)


def new_file(path: Path) -> BinaryIO:
    return open(path, "xb")


def run(
    pipe, fault, written, path: Path, subject: Subject, zero: int, period: float, opened: Callable[[Path], BinaryIO]
) -> None:  # fmt: skip
    """The process: until nobody holds the pipe's other end, be it that the server was killed. `fault`: why it cannot
    write; `written`: how many of the pipe's messages are in the file, from 0 on once it is open."""
    leave_signals_to_parent()
    try:
        with opened(path) as file:
            log = LogFormat(file, subject, zero)
            write(log, pipe, written, period)
            log.finish()
    except OSError as error:
        text = f"log: {path.name}: {(error.strerror or str(error)).lower()}; nothing is executed"
        fault.value = text.encode()[: TEXT - 1]


def write(log: LogFormat, pipe, written, period: float) -> None:
    """All that comes, on the disk every `period` s."""
    due, received = time.monotonic() + period, 0
    written.value = received
    while True:
        if pipe.poll(max(due - time.monotonic(), 0.0)):
            try:
                records = pipe.recv()
            except (EOFError, OSError):
                return
            for record in records:
                log.write(record)
            received += 1
        if time.monotonic() >= due:
            log.flush()
            written.value = received
            due = time.monotonic() + period
