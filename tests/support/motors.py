"""The tendons' motors and a bank of simulated ones, joined frame by frame, on a clock that a test turns."""

import copy
import math
import random
from dataclasses import replace
from functools import cache

import numpy as np

from trunkline.ar.drivers.gm6020 import command_frames, feedback_of
from trunkline.ar.drivers.motors import MotorGroup, MotorSettings
from trunkline.ar.drivers.settings import ExecutionConfig
from trunkline.ar.drivers.simulated_motors import MotorParameters, SimulatedMotors
from trunkline.pipeline.config import PROJECT, load_folder

TICK = 0.001  # s
PLANTS = (
    MotorParameters(),
    MotorParameters(side=-1, begins=8100, stiffness=300.0),
    MotorParameters(slack=0.03, begins=4000, stiffness=500.0),
)


def motor_settings() -> MotorSettings:
    """Of the project, the second motor on the other side."""
    return replace(load_folder(ExecutionConfig, PROJECT / "conf/execution").motors, sides=(1, -1, 1))


class Workbench:
    """`lost`: share of frames that get lost, either way."""

    def __init__(self, plants=PLANTS, settings=None, lost=0.0, seed=0):
        self.now, self.lost, self._random = 100.0, lost, random.Random(seed)
        self.simulated = SimulatedMotors(plants, self.now)
        self.motors = MotorGroup(settings or motor_settings(), self.now)
        self.zeros = np.zeros(len(plants))

    @property
    def currents(self):
        return [motor.current for motor in self.simulated.motors]

    @property
    def pulls(self):
        """True ones, (K,), m, once it is homed."""
        return np.array([motor.reeled for motor in self.simulated.motors]) - self.zeros

    def hear(self, frame):
        if self._random.random() >= self.lost:
            self.motors.hear(feedback_of(*frame), self.now)

    def drive(self, pulls, speeds, now):
        for frame in command_frames(self.motors.currents(pulls, speeds, now)):
            if self._random.random() >= self.lost:
                self.simulated.hear(*frame, now)

    def tick(self, pull=0.0, speed=0.0, commanding=True):
        self.now += TICK
        for frame in self.simulated.advance(self.now):
            self.hear(frame)
        if commanding:
            count = len(self.simulated.motors)
            self.drive([pull] * count, [speed] * count, self.now)

    def rest(self, seconds, **how):
        for _ in range(round(seconds / TICK)):
            self.tick(**how)

    def home(self):
        end = self.now + 20.0
        while not self.motors.homed and not self.motors.fault and self.now < end:
            self.tick()
        self.zeros = np.array([motor.reeled for motor in self.simulated.motors]) - self.motors.pulls
        return self

    def pull(self, depth=0.09, seconds=2.0):
        """A cosine in and out again; how far each cable was off, (T, K), m, and what had been counted, (T, K), m."""
        off, counted = [], []
        for step in range(1, round(2 * seconds / TICK) + 1):
            phase = math.pi * step * TICK / seconds
            wanted = depth / 2 * (1 - math.cos(phase))
            self.tick(wanted, depth / 2 * math.pi / seconds * math.sin(phase))
            off.append(self.pulls - wanted)
            counted.append(list(self.motors.pulls))
        return np.array(off), np.array(counted)


class PlayedMotors:
    """The motors of a bench, which a test turns."""

    def __init__(self, bench):
        self._bench, self.motors = bench, bench.motors
        self.wanted = [0.0] * 3, [0.0] * 3

    @property
    def fault(self):
        return self.motors.fault

    def turn(self, pulls, speeds):
        self.wanted = pulls, speeds


def homed():
    """A workbench of its own, its motors homed."""
    return copy.deepcopy(_homed())


@cache
def _homed():
    return Workbench().home()
