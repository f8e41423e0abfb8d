"""All settings of conf/execution/config.yaml."""

from trunkline.ar.drivers.driver_client import ArmSettings
from trunkline.ar.drivers.motors import MotorSettings
from trunkline.ar.drivers.ros_settings import RosSettings
from trunkline.settings import settings


@settings
class ExecutionConfig:
    """Of real machines: the robot's `arm`, or a controller of `ros`, the tendons' `motors`."""

    arm: ArmSettings
    ros: RosSettings
    motors: MotorSettings
