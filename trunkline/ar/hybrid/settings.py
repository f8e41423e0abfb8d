"""What a hybrid robot is set by: the groups of `conf/hybrid/`, and the robot of `conf/shared/`."""

from trunkline.ar.hybrid.objects import GraspObject
from trunkline.ar.hybrid.worlds import WorldGeometry
from trunkline.kinematics.panda.mounts import Robot
from trunkline.settings import settings


@settings
class HybridModelSettings:
    """robot: what holds the arm. world: where it works. object: what it grasps."""

    robot: Robot
    world: WorldGeometry
    object: GraspObject
