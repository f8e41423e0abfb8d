"""Where a controller of ROS 2 is found."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

Name = Annotated[str, Field(pattern=r"^(/\w+)+$", max_length=255)]


@dataclass(frozen=True)
class RosSettings:
    """domain: ROS_DOMAIN_ID. trajectory, states: topics. names: of the joints, in their order. astray: rad that a joint
    may be from where it is sent."""

    domain: Annotated[int, Field(ge=0, le=232)]
    trajectory: Name
    states: Name
    names: tuple[str, str, str, str, str, str, str]
    astray: Annotated[float, Field(gt=0, le=0.5)]
