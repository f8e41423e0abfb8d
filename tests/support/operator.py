"""An operator at the core: controllers that are held, moved and pressed, and a room in which all is reachable."""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.frames import wxyz_from_rotation
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.teleop.config import Config
from trunkline.teleop.core import Teleoperation
from trunkline.teleop.messages import Box, Controller, ExecutorReport, Input, PlanReport, Pose, World
from trunkline.teleop.reach import Reading

PACKAGE, DT = "a" * 64, 1 / 60
READY_JOINTS = (0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785)  # the end effector straight down, in front of the base
FORWARD = (1.0, 0.0, 0.0, 0.0)  # the ray along the reference frame's -z
_TURN = Rotation.from_euler("xz", [90, -90], degrees=True)  # the reference's y is up, its -z forward
REFERENCE = Pose(
    (0.2, 0.0, 1.0), tuple(map(float, wxyz_from_rotation(Rotation.from_euler("xz", [90, -90], degrees=True))))
)


@cache
def config() -> Config:
    return load_folder(Config, PROJECT / "conf/teleop")


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


class Operator:
    """Drives the core step by step; each call of `step` may change what the operator does and what is reported."""

    def __init__(self, reach=None, **changes):
        settings = replace(config().core, **changes)
        self.core = Teleoperation(settings, reach or Everywhere(), PACKAGE, 0.05)
        self.state = self.core.start()
        self.given = Input(
            stamp=100.0,
            left=Controller((0.0, 0.0, 0.0), FORWARD),
            right=Controller((0.3, -0.3, 0.0), FORWARD),
            alignment=REFERENCE,
            joints=READY_JOINTS,
            world=World("world"),
            package=PACKAGE,
        )
        self.inputs, self.intents = [], []

    def step(self, seconds: float = DT, dt: float | None = None, left=None, right=None, **changes):
        """One step: the stamp goes on by `seconds`; `left` and `right` are changes of the controllers."""
        given = replace(self.given, stamp=self.given.stamp + seconds, **changes)
        self.given = replace(
            given, left=replace(given.left, **(left or {})), right=replace(given.right, **(right or {}))
        )
        self.state, intent = self.core.step(self.state, self.given, DT if dt is None else dt)
        self.inputs.append(self.given)
        self.intents.append(intent)
        return intent

    def wait(self, duration: float, **changes):
        """Steps for so long; the last intent."""
        for _ in range(max(round(duration / DT), 1)):
            intent = self.step(**changes)
        return intent

    def to(self, mode: str):
        """Do what brings the core from its start to `mode`; the last intent."""
        intent = self.wait(0.5)
        if mode == "hold":
            return self.step(left={"tracked": False}, seconds=0.2)
        if mode == "aim":
            return intent
        if mode == "stopped":
            self.step(left={"secondary": True})
            return self.step(left={"secondary": False})
        self.wait(0.3, left={"grip": True}, right={"grip": True})
        if mode == "follow":
            self.step(left={"stick_pressed": True})
            return self.wait(0.7, left={"stick_pressed": False})
        intent = self.step(right={"trigger": True})
        assert intent.request is not None
        if mode == "plan":
            return intent
        report = PlanReport(intent.request.serial, "d" * 64, "", PACKAGE, self.given.world.digest)
        intent = self.step(plan=report, right={"trigger": False})
        if mode == "preview":
            return intent
        intent = self.step(shown="d" * 64)
        if mode == "ready":
            return intent
        self.wait(0.1)
        intent = self.step(right={"trigger": True})
        if mode == "delay":
            return intent
        self.wait(0.55, right={"trigger": False})
        return self.wait(0.1, executor=ExecutorReport("running", "d" * 64))


TABLE = Box("the table", (-2.0, -2.0, -1.0), (2.0, 2.0, 0.0))
