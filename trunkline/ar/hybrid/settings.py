"""What a hybrid robot is set by: the groups of `conf/hybrid/`, and the robot of `conf/shared/`."""

from trunkline.ar.hybrid.objects import Thing
from trunkline.ar.hybrid.worlds import World
from trunkline.kinematics.panda.mounts import Robot
from trunkline.settings import settings


@settings
class HybridSettings:
    """robot: what holds the arm. world: where it works. object: what it grasps."""

    robot: Robot
    world: World
    object: Thing
