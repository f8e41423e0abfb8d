"""Poses by DDS: a participant that hears topics of ROS 2, whether they are published reliably or by best effort."""

import math
import re
import struct
import time
from collections import deque
from collections.abc import Iterator, Sequence

import numpy as np
from cyclonedds.core import DDSException, InstanceState, Policy, Qos, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from trunkline.ar.tracking.body_frames import TOGETHER, BodyFrames, BodyPose
from trunkline.ar.tracking.ros_messages import TYPES
from trunkline.ar.tracking.ros_topics import BODY, PER_BODY, RosTopicSettings
from trunkline.ar.tracking.tracker import CameraFrame
from trunkline.errors import InputError, nearest
from trunkline.recordings.logs.messages import POSES, READING, DecodedPoses

COMES = 10.0  # s within which each body has to come once: a participant that was not heard announces itself every 8 s
NEWEST = 256  # messages of a topic that wait to be heard
# Of a sensor's data: a reader by best effort hears reliable publishers too, one that is reliable hears no others.
SENSOR_DATA = Qos(Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(NEWEST))
DAMAGED = (*READING, struct.error)  # what bytes of another layout raise


class RosSource:
    """A `PoseSource`.

    Raises:
        InputError: there is no DDS in the settings' domain, or a body is not published.
    """

    def __init__(self, settings: RosTopicSettings, names: Sequence[str]) -> None:
        self._settings, self._names, self._where = settings, tuple(names), f"ROS 2 topic {settings.topic}"
        self._read, self._frame = POSES[settings.message], settings.frame.strip("/")
        self._frames, self._complete = BodyFrames(names), deque[CameraFrame]()
        self._elsewhere = ""  # the first body in another frame: from then on nothing is received
        per_body = settings.message == PER_BODY
        if unnamed := next((name for name in names if per_body and not re.fullmatch(r"\w+", name, re.ASCII)), None):
            expected = f"letters, digits and _, as a part of the topic {settings.topic}"
            raise InputError(f"cameras.bodies: found {unnamed!r}, expected {expected}")
        topics = {name: settings.topic.replace(BODY, name) for name in names} if per_body else {None: settings.topic}
        try:
            self._participant = DomainParticipant(settings.domain)
            self._waits = WaitSet(self._participant)
            kind = TYPES[settings.message]
            self._readers = [
                (body, DataReader(self._participant, Topic(self._participant, f"rt{topic}", kind), SENSOR_DATA))
                for body, topic in topics.items()
            ]
            anything = SampleState.NotRead | ViewState.Any | InstanceState.Any
            self._conditions = [ReadCondition(reader, anything) for _, reader in self._readers]
            for condition in self._conditions:
                self._waits.attach(condition)
        except DDSException as error:
            where = f"{self._where}: cameras.ros.domain: found none to take part in"
            raise InputError(f"{where}, {settings.domain} ({error}), expected DDS there") from error
        self._await_bodies()

    def receive(self, seconds: float) -> CameraFrame | None:
        until = time.monotonic() + seconds
        if self._elsewhere:
            time.sleep(seconds)
            raise ValueError(self._elsewhere)
        while not self._complete:
            left = until - time.monotonic()
            if left <= 0:
                return None
            for poses in self._messages(left):
                self._complete.extend(self._frames.add(poses))
        return self._complete.popleft()

    def close(self) -> None:
        """Nothing: it ends with its process."""

    def _await_bodies(self) -> None:
        """Until each body came once, and two of them in one frame."""
        until, heard, together = time.monotonic() + COMES, set(), len(self._names) == 1
        while not (together and heard >= set(self._names)):
            left = until - time.monotonic()
            if left <= 0:
                raise InputError(f"{self._where}: {self._missing(heard)}")
            try:
                for poses in self._messages(left):
                    heard.update(pose.name for pose in poses)
                    together |= any(frame.tracked.sum() > 1 for frame in self._frames.add(poses))
            except ValueError as error:
                raise InputError(f"{self._where}: {error}") from error

    def _missing(self, heard: set[str]) -> str:
        """What is, where these bodies were heard."""
        missing = next((name for name in self._names if name not in heard), None)
        if missing is None:
            return f"found each body stamped by itself, expected two of them within {1e3 * TOGETHER:g} ms"
        came = f"the bodies {', '.join(sorted(heard))}" if heard else f"no {self._settings.message}"
        return f"found {came} within {COMES:g} s, expected {missing!r}{nearest(missing, sorted(heard))}"

    def _messages(self, seconds: float) -> Iterator[list[BodyPose]]:
        """The poses of each message that came, in the order in which they were published; waits for the first.

        Raises:
            ValueError: one cannot be read; once all others have come.
        """
        taken, wrong = [], ""
        try:
            self._waits.wait(math.ceil(1e9 * seconds))
            for body, reader in self._readers:
                taken += [(body, message) for message in reader.take(NEWEST) if _info(message).valid_data]
        except DAMAGED as error:
            wrong = self._damaged(error)
        except DDSException as error:
            wrong = f"DDS: {error}, expected messages"
        for body, message in sorted(taken, key=lambda pair: _info(pair[1]).source_timestamp):
            try:
                decoded = self._read(message)
            except DAMAGED as error:
                wrong = self._damaged(error)
                continue
            try:
                poses = self._poses(body, message, decoded)
            except ValueError as error:
                wrong = str(error)
                continue
            yield poses
        if wrong:
            raise ValueError(wrong)

    def _damaged(self, error: Exception) -> str:
        return f"found a message that is no {self._settings.message} ({error}), expected its layout"

    def _poses(self, body: str | None, message, decoded: DecodedPoses) -> list[BodyPose]:
        """Of a message and what was decoded of it; `body` of one that names none.

        Raises:
            ValueError: a body is in it twice, or is in another frame than others.
        """
        names = [body] if decoded.names is None else [str(name) for name in decoded.names]
        if repeated := next((name for name in names if name in self._names and names.count(name) > 1), None):
            raise ValueError(f"found {repeated!r} twice in a message, expected each name once")
        size = len(names)
        parents = decoded.parents or [message.header.frame_id] * size if size else []
        assert decoded.time is not None  # as all of TYPES have one
        assert decoded.orientations is not None
        stamps = 1e-9 * np.broadcast_to(decoded.time, (size,))
        number = None if decoded.frame is None else int(decoded.frame)
        poses = []
        for row, name in enumerate(names):
            if name in self._names:
                self._check_frame(name, parents[row].strip("/"))
            pose = BodyPose(str(name), float(stamps[row]), decoded.positions[row], decoded.orientations[row], number)
            poses.append(pose)
        return poses

    def _check_frame(self, name: str, frame: str) -> None:
        self._frame = self._frame or frame
        if frame != self._frame:
            self._elsewhere = f"found {name!r} in the frame {frame!r}, expected {self._frame!r}"
            raise ValueError(self._elsewhere)


def _info(message):
    """What DDS says of a message; the library adds it to each that it takes."""
    return message.sample_info
