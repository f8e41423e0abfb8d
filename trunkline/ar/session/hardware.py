"""What of a session's robot is real: nothing, unless it is named."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from trunkline.ar.drivers.driver_client import PandaSettings
from trunkline.ar.drivers.motors import MotorSettings
from trunkline.ar.drivers.ros_settings import RosSettings
from trunkline.ar.drivers.setpoint_filter import LIMITS, RobotLimits
from trunkline.ar.drivers.simulated_motors import SIMULATED
from trunkline.ar.teleop.config import TeleoperationConfig as Teleop
from trunkline.errors import InputError

if TYPE_CHECKING:
    from trunkline.ar.drivers.settings import ExecutionConfig  # composes settings, which no robot's process does

ROBOTS = ("simulated", "panda", "fr3", "ros2")
MOTORS = ("simulated", "gm6020")
CAMERAS = ("simulated", "natnet", "ros2", "qualisys")
MARGIN = 0.8  # share of a robot's own limits that plans may come to; the rest is for what bridges lost commands


@dataclass(frozen=True)
class Hardware:
    """What is real. robot: "panda", "fr3", "ros2" or "fake", "" for none. bus: its channel, "" for no motors;
    `SIMULATED` for simulated ones. interface: of python-can."""

    robot: str
    panda: PandaSettings
    ros: RosSettings
    bus: str
    interface: str
    motors: MotorSettings

    @property
    def real(self) -> bool:
        """Whether anything but simulations would move."""
        return self.robot not in ("", "fake") or self.real_motors

    @property
    def real_motors(self) -> bool:
        """Whether the motors are."""
        return self.bus not in ("", SIMULATED)

    @property
    def limits(self) -> RobotLimits:
        """Of the robot, a Panda's where none is named."""
        return LIMITS["fr3" if self.robot == "fr3" else "panda"]

    def slow_enough(self, teleop: Teleop) -> Teleop:
        """`teleop` with plans that are slow enough for the robot: some of an FR3's limits are half of a Panda's."""
        limits, panda = self.limits, LIMITS["panda"]
        most = min(
            np.min(getattr(limits, what) / getattr(panda, what)) for what in ("velocity", "acceleration", "jerk")
        )
        share = min(teleop.motors.share, MARGIN * float(most))
        return replace(teleop, motors=replace(teleop.motors, share=share))

    def words(self) -> str:
        """What will move."""
        where = self.ros.trajectory if self.robot == "ros2" else self.panda.address
        robot = f"the robot {self.robot} at {where}" if self.robot else "no real robot"
        numbers = ", ".join(map(str, self.motors.numbers))
        motors = f"motors {numbers} on the bus {self.bus}" if self.real_motors else "no real motors"
        return f"{robot}, {motors}"


def hardware_of(robot: str, motors: str, bus: str, interface: str, config: "ExecutionConfig") -> Hardware | None:
    """What the options name; None where all is simulated. interface: of python-can, "" for the usual one.

    Raises:
        InputError: motors without a bus, or a bus without motors.
    """
    if (motors == "gm6020") != bool(bus):
        raise InputError("--motors, --bus: found one of them, expected both: --motors gm6020 --bus can0")
    if robot == "simulated" and not bus:
        return None
    interface = interface or ("virtual" if bus == SIMULATED else "socketcan")
    return Hardware("" if robot == "simulated" else robot, config.panda, config.ros, bus, interface, config.motors)
