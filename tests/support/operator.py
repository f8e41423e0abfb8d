"""An operator at the core: controllers that are held, moved and pressed, and a room in which all is reachable."""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.ar.teleop.config import TeleoperationConfig
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.messages import Controller, Input, Obstacle, Pose, World
from trunkline.ar.teleop.reach import Reading
from trunkline.ar.teleop.recorder import Recorder
from trunkline.frames import wxyz_from_rotation
from trunkline.pipeline.config import PROJECT, load_folder

PACKAGE, DT = "a" * 64, 1 / 60
READY_JOINTS = (0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785)  # the end effector straight down, in front of the base
FORWARD = (1.0, 0.0, 0.0, 0.0)  # the ray along the reference frame's -z
_TURN = Rotation.from_euler("xz", [90, -90], degrees=True)  # the reference's y is up, its -z forward
REFERENCE = Pose(
    (0.2, 0.0, 1.0), tuple(map(float, wxyz_from_rotation(Rotation.from_euler("xz", [90, -90], degrees=True))))
)


@cache
def config() -> TeleoperationConfig:
    return load_folder(TeleoperationConfig, PROJECT / "conf/teleop")


class Everywhere:
    """Reach of a robot that can reach all but what is further than `most` m from the base."""

    def __init__(self, most: float = np.inf):
        self.most = most

    def rigid(self, mount, pointing):
        length = float(np.linalg.norm(mount))
        if length <= self.most:
            return Reading("inside")
        return Reading("outside", length - self.most, tuple(float(x) * (1 - 1e-9) * self.most / length for x in mount))

    def soft(self, tip, gravity):
        return Reading("inside")


class Operator(Recorder):
    """At a core of its own, 60 times a second."""

    def __init__(self, reach=None, **changes):
        settings = replace(config().core, **changes)
        core_input = Input(
            stamp=100.0,
            left=Controller((0.0, 0.0, 0.0), FORWARD),
            right=Controller((0.3, -0.3, 0.0), FORWARD),
            alignment=REFERENCE,
            joints=READY_JOINTS,
            world=World("world"),
            package=PACKAGE,
        )
        super().__init__(Teleoperation(settings, reach or Everywhere(), PACKAGE, 0.05), core_input, DT)


TABLE = Obstacle("the table", (-2.0, -2.0, -1.0), (2.0, 2.0, 0.0))
