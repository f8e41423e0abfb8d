"""A robot that speaks Franka's protocol, moved there and back: how near it keeps to what it is sent, and how often.

    ROBOT_PYTHON=fr3/bin/python python -m benchmarks.franka ROBOT ADDRESS

**It moves whatever is at ADDRESS**, each joint by TURN rad: a simulator such as franka-sim. ROBOT: `fr3` or `panda`.
ROBOT_PYTHON: of the environment with the robot's library. docs/execution.md says how to start the simulator.
"""

import os
import sys
import time

import numpy as np

from trunkline.ar.drivers.driver import TICK
from trunkline.ar.drivers.driver_client import ArmSettings, DriverClient, panda
from trunkline.ar.drivers.driver_process import TELL
from trunkline.ar.drivers.robot import HardwareRobot
from trunkline.ar.drivers.setpoint_filter import LIMITS
from trunkline.ar.drivers.time_scaling import TimeScaledRobot
from trunkline.ar.teleop.config import Config as Teleop
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import gentle, limits_of
from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.config import PROJECT, load_folder
from upkeep.results import recorded

TURN, SECONDS = 0.3, 4.0  # rad and s of each way
RESTS = 2.0  # s
STRAIGHT = np.zeros(3)  # no motors


@in_one_line
def main(arguments: list[str]) -> int:
    robot, address = arguments
    with recorded("franka"):
        measure(robot, address)
    return 0


def measure(robot: str, address: str) -> None:
    arm = panda(ArmSettings(os.environ.get("ROBOT_PYTHON", ""), address, 0.1), robot)
    machine = HardwareRobot(arm, None, STRAIGHT)
    limits = limits_of(load_folder(Teleop, PROJECT / "conf/teleop").motors)
    try:
        joints = machine.begin(np.zeros(7))
        turned = joints + TURN * np.where(joints > 0, -1.0, 1.0)
        mover = TimeScaledRobot(
            joints, STRAIGHT, limits, "none", lambda q, c, _: machine.move(q, c), LIMITS[robot]
        )  # fmt: skip
        print("| way | ended | cycles a second | furthest from what it is sent | from the plan's end |")
        print("|---|---|---:|---:|---:|")
        for name, start, end in (("there", joints, turned), ("back", turned, joints), ("stopped", joints, turned)):
            plan = way(start, end, limits)
            print(f"| {name} | {moved(machine, arm, mover, plan, SECONDS / 2 if name == 'stopped' else np.inf)} |")
    finally:
        machine.close()


def way(start: np.ndarray, end: np.ndarray, limits) -> Plan:
    """Of the joints alone, from (7,) to (7,), rad."""
    rows = gentle(np.append(start, STRAIGHT), np.append(end, STRAIGHT), limits, 0.002, SECONDS)
    return Plan(0.002, rows[:, :7], rows[:, 7:], (("transfer", 0),), "none", "none")


def moved(machine: HardwareRobot, arm: DriverClient, mover: TimeScaledRobot, plan: Plan, stop: float) -> str:
    """A row of the table: `plan` run to its end, or stopped after `stop` s, and RESTS s of rest: a
    simulator that falls behind gets there later.

    Raises:
        InputError: the robot has a fault.
    """
    refused = mover.start(plan, plan.digest())
    times, off, begun = [], [], time.monotonic()
    due, rest = begun, 0.0
    while not refused and not machine.fault and rest < RESTS:
        time.sleep(max(due - time.monotonic(), 0.0))
        due += TICK
        if time.monotonic() - begun > stop:
            mover.stop()
        mover.advance(TICK)
        rest += TICK if mover.state().mode != "running" else 0.0
        told = arm.state
        if told is not None and (not times or told.time > times[-1]):
            times.append(told.time)
            off.append(np.abs(np.subtract(told.measured, told.sent)).max())
    if refused or machine.fault:
        raise InputError(refused or machine.fault)
    rate = TELL * (len(times) - 1) / (times[-1] - times[0])
    end = np.abs(arm.sent - mover.joints).max()
    return f"{mover.state().mode} | {rate:.0f} | {1e3 * max(off):.2f} mrad | {1e3 * end:.3f} mrad"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
