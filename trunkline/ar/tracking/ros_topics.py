"""Topics of ROS 2 as a source of poses: those that `ingest` reads from logs, heard live.

By DDS, without ROS on this side (the extra `ros2`); a node of rclpy is not built. Stamps are those of headers, so that
a pose's age counts from the publisher's clock; when it was sent, no message says.
"""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from pydantic import Field

from trunkline.ar.tracking.stream_checks import StreamLimits
from trunkline.ar.tracking.tracker import ExpectedBodies, PoseSource
from trunkline.ar.tracking.tracking_process import TrackingProcess
from trunkline.errors import InputError

BODY = "{body}"  # in a topic: the body's name
PER_BODY = "geometry_msgs/PoseStamped"
Message = Literal[
    "geometry_msgs/PoseStamped",
    "motion_capture_tracking_interfaces/NamedPoseArray",
    "motion_capture_tracking_interfaces/NamedPoseArrayV2",
    "mocap4r2_msgs/RigidBodies",
    "mocap_msgs/RigidBodies",
    "tf2_msgs/TFMessage",
]


@dataclass(frozen=True)
class RosTopicSettings:
    """domain: ROS_DOMAIN_ID. topic: where poses are; of a message with a single pose, with `{body}` in place of the
    body's name. message: its type. frame: in which poses are, as headers name it; "" for any, the same of all."""

    domain: Annotated[int, Field(ge=0, le=232)] = 0
    topic: Annotated[str, Field(pattern=r"^(/[\w{}]+)+$", max_length=255)] = "/rigid_bodies"
    message: Message = "mocap4r2_msgs/RigidBodies"
    frame: Annotated[str, Field(max_length=255)] = ""

    def __post_init__(self) -> None:
        wanted, rest = int(self.message == PER_BODY), self.topic.replace(BODY, "", 1)
        if self.topic.count(BODY) != wanted or "{" in rest or "}" in rest:
            expected = f"{BODY} in it once, as in /poses/{BODY}" if wanted else f"no {BODY}: a message names its bodies"
            raise ValueError(f"topic: found {self.topic!r} for {self.message}, expected {expected}")


def open_topics(settings: RosTopicSettings, names: tuple[str, ...]) -> PoseSource:
    """
    Raises:
        InputError: there is no DDS, or a body is not published.
    """
    try:
        from trunkline.ar.tracking.ros_source import RosSource  # with what it needs installed
    except ImportError as error:
        raise InputError(f"cameras.ros: found no DDS ({error}), expected the extra `ros2` to be installed") from error
    return RosSource(settings, names)


class RosTracker(TrackingProcess):
    """A `Tracker` of what topics of ROS 2 hold."""

    def __init__(self, settings: RosTopicSettings, expected: ExpectedBodies, limits: StreamLimits | None = None):
        super().__init__(partial(open_topics, settings), expected, limits)
