"""What the core is set by: see conf/shared/core/two_rays.yaml for what each number means to a user."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from trunkline.ar.teleop.one_euro import OneEuro

Seconds = Annotated[float, Field(ge=0.0, le=60.0)]
Metres = Annotated[float, Field(ge=0.0, le=5.0)]
Degrees = Annotated[float, Field(ge=0.0, le=180.0)]


@dataclass(frozen=True)
class RaySettings:
    """Length of the rays, m, and its `rate` at full deflection, m/s; `dead_zone` of the stick, share of its way."""

    start: Metres
    shortest: Metres
    longest: Metres
    rate: Annotated[float, Field(gt=0, le=10)]
    dead_zone: Annotated[float, Field(ge=0, lt=1)]

    def __post_init__(self):
        if not self.shortest <= self.start <= self.longest:
            raise ValueError(
                f"rays.start: found {self.start}, expected from shortest {self.shortest} to {self.longest}"
            )


@dataclass(frozen=True)
class Orientation:
    """How far the end effector may be off straight down, and how fast it follows the tilted controller."""

    most_tilt_deg: Annotated[float, Field(ge=0, le=120)]
    rate_deg: Annotated[float, Field(gt=0, le=720)]

    @property
    def most_tilt(self) -> float:
        return float(np.radians(self.most_tilt_deg))

    @property
    def rate(self) -> float:
        return float(np.radians(self.rate_deg))


@dataclass(frozen=True)
class BendingPlane:
    """Half-planes in which the arm bends, from tendon 1 about the arm's axis. `hysteresis_deg`: by how much less the
    wrist must turn for another half-plane than for the one in use. `axis`: m from the arm's axis within which the tip
    target has no direction."""

    half_planes_deg: Annotated[tuple[Annotated[float, Field(ge=-180, le=360)], ...], Field(min_length=1, max_length=12)]
    hysteresis_deg: Degrees
    axis: Metres

    @property
    def half_planes(self) -> tuple[float, ...]:
        return tuple(float(np.radians(angle)) for angle in self.half_planes_deg)

    @property
    def hysteresis(self) -> float:
        return float(np.radians(self.hysteresis_deg))


@dataclass(frozen=True)
class Safety:
    """When the robot holds. `grace`: a controller may be lost so long. `silence`: a client may be silent so long.
    `settle`: all must be sound so long before aiming begins. `swap`: m, how near each controller must appear to where
    the other was to count as swapped. `plan_wait`, `start_wait`: for a plan, and for the robot to start."""

    grace: Seconds
    silence: Annotated[float, Field(gt=0, le=10)]
    settle: Seconds
    swap: Metres
    plan_wait: Seconds
    start_wait: Seconds


@dataclass(frozen=True)
class Teleop:
    """Settings of the core. `look_back`: s before a press from which the targets are taken. `delay`: s from a
    confirmation to its execution. `follow_delay`: s by which the robot follows. `moved`: m by which a ray must move
    with its grip held to aim anew while a plan is shown. `rigid_hand`: whose ray holds the rigid target. `mark`: m from
    an object's centre within which the tip target marks it."""

    rigid_hand: Literal["left", "right"]
    rays: RaySettings
    orientation: Orientation
    bending_plane: BendingPlane
    position_filter: OneEuro
    orientation_filter: OneEuro
    look_back: Annotated[float, Field(ge=0, le=1)]
    delay: Seconds
    follow_delay: Annotated[float, Field(ge=0, le=5)]
    moved: Metres
    mark: Metres
    safety: Safety
