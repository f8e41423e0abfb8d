"""All settings of conf/execution/config.yaml."""

from trunkline.execution.adapted import ArmSettings
from trunkline.execution.motors import MotorSettings
from trunkline.execution.ros_settings import RosSettings
from trunkline.settings import settings


@settings
class Config:
    """Of real machines: the robot's `arm`, or a controller of `ros`, the tendons' `motors`."""

    arm: ArmSettings
    ros: RosSettings
    motors: MotorSettings
