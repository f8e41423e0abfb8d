"""Where a controller of ROS 2 is found, and what is heard of it."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

Name = Annotated[str, Field(pattern=r"^(/\w+)+$", max_length=255)]
JointReading = tuple[list[str], list[float]]  # names of joints, and where each is, rad
NEWEST = 10  # states that wait to be heard
NANO = 1_000_000_000


@dataclass(frozen=True)
class RosSettings:
    """link: "dds", or "rclpy" where ROS 2 is. domain: ROS_DOMAIN_ID. trajectory, states: topics. names: of the joints,
    in their order. astray: rad that a joint may be from where it is sent."""

    link: Literal["dds", "rclpy"]
    domain: Annotated[int, Field(ge=0, le=232)]
    trajectory: Name
    states: Name
    names: tuple[str, str, str, str, str, str, str]
    astray: Annotated[float, Field(gt=0, le=0.5)]

    @property
    def axes(self) -> int:
        """How many joints."""
        return len(self.names)
