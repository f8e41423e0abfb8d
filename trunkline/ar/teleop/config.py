"""All settings of conf/teleop/config.yaml: of the core (`conf/shared/core/`), of the motors, of what shapes a plan."""

from typing import Annotated

from pydantic import Field

from trunkline.ar.hybrid.grasp_poses import SideSettings
from trunkline.ar.teleop.grasping import Handling
from trunkline.ar.teleop.settings import Teleop
from trunkline.ar.teleop.shaping import Shaping
from trunkline.ar.teleop.trajectory import MotorLimits
from trunkline.settings import settings


@settings
class TeleoperationConfig:
    """`hanging`, `basket`: how what hangs and what has a handle is grasped. `mount_offset`: m, from the Panda's flange
    to the soft arm's mount. `advance`: m, the last part of a reach, along the tip's axis; 0 for none. `advance_speed`:
    m/s, of the mount there, at most: no more than ISO 10218-1 lets a robot move whose operator stands beside it."""

    core: Teleop
    motors: MotorLimits
    shaping: Shaping
    handling: Handling
    hanging: SideSettings
    basket: SideSettings
    mount_offset: Annotated[float, Field(ge=0, le=0.5)]
    advance: Annotated[float, Field(ge=0, le=0.3)]
    advance_speed: Annotated[float, Field(gt=0, le=0.25)]
