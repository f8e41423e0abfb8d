"""Does the physical robot's stand-in swing on after it has arrived, if ways are shaped for the twin's swings?

    python -m studies.shaping_stand_in [--mjcf artifacts/identify_control/arm.xml]

As `studies.shaping`, but what moves is the stranger on its Panda, of which the twin and so the shaper know nothing:
servos that lag, dead times, friction, an arm with swings of its own. Hanging straight down, tendon 1 is drawn in while
the others pay out, or the Panda carries the arm sideways. Time counts from when the last command is sent.
"""

import argparse
from pathlib import Path

import mujoco
import numpy as np

from demo.plants.choice import plant_of
from demo.plants.stranger import Stranger
from demo.rig import ROOT as LAB
from demo.rig import Config as Lab
from rehearsal import settings
from rehearsal.experiments.bench import FLOOR, START
from rehearsal.robot.scene import Object, Scene
from rehearsal.robot.stand_in import StandInRobot
from studies.shaping import MOVED, PULLS_MM, SECONDS, lasting, shaped_ways, tell
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.vectors import DOWN
from trunkline.ar.teleop.vibration import vibration_modes
from trunkline.errors import InputError
from trunkline.frames import gravity_in_base
from trunkline.pipeline.config import load_config
from trunkline.pipeline.inputs import read_model
from upkeep.results import recorded

BEFORE = 2.0  # s at rest before a way
FAR = Object("sphere", 0.05, 0.05, 0.1, [5.0, 5.0, FLOOR + 0.025])  # there has to be one
SEED = 1


@recorded("shaping_stand_in")
def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--mjcf", type=Path, default=Path("artifacts/identify_control/arm.xml"))
    model = read_model(parser.parse_args().mjcf)
    arm, gravity = plant_of(load_config(Lab, "record", LAB)), gravity_in_base(0.0)
    if not isinstance(arm, Stranger):
        raise InputError(f"{LAB}/params.yaml: record.plant: found another plant, expected stranger: the robot's arm")
    straight = model.tendon_length0[model.actuator_trnid[:, 0]]
    print("| what moves | shaper | way | tip off its rest at arrival, 0.5 s, 1.5 s later | within 3 mm after |")
    print("|---|---|---:|---:|---:|")
    here, there = _mounts()
    for pull in PULLS_MM:
        pulls = 1e-3 * pull * np.array([1.0, -0.85, -0.85])
        way = lasting(np.zeros(3), pulls, model.opt.timestep)
        ways = shaped_ways(model, way, vibration_modes(model, straight - pulls, -pulls, gravity))
        tips = [_moved(arm, np.tile(here, (len(rows), 1)), rows, model) for rows in ways]
        tell(f"tendons, {pull:.0f} mm", ways, tips, model.opt.timestep)
    for pull in (0.0, PULLS_MM[1]):
        pulls = 1e-3 * pull * np.array([1.0, -0.85, -0.85])
        way = lasting(here, there, model.opt.timestep)
        ways = shaped_ways(model, way, vibration_modes(model, straight - pulls, None, gravity))
        tips = [_moved(arm, rows, np.tile(pulls, (len(rows), 1)), model) for rows in ways]
        tell(f"Panda, {1e3 * MOVED:.0f} mm sideways, pull {pull:.0f} mm", ways, tips, model.opt.timestep)


def _mounts() -> tuple[np.ndarray, np.ndarray]:
    """The Panda's joints, (7,) rad, with the mount where the rehearsal begins, and MOVED beside it."""
    x, y, z = settings.free().mount_ready
    ik = RigidIK(settings.stand_in().panda.mount_offset)
    here = ik.solve(START, (x, y, z), DOWN, 0.0)
    return here, ik.solve(here, (x, y + MOVED, z), DOWN, 0.0)


def _moved(arm: Stranger, joints: np.ndarray, pulls: np.ndarray, model: mujoco.MjModel) -> np.ndarray:
    """The tip (T, 3), m, while the robot is sent rows (R, 7), rad, and (R, K), m, a step of the model apart, and the
    last of them for SECONDS more."""
    robot = StandInRobot(arm, Scene(FLOOR, FAR), settings.stand_in(), joints[0], SEED, pulls[0])
    robot.advance(BEFORE)
    step, tips = model.opt.timestep, []
    for row in range(len(joints) + round(SECONDS / step)):
        if row < len(joints):
            robot.send(joints[row], pulls[row])
        robot.advance(step)
        tips.append(robot.truth().tip)
    return np.array(tips)


if __name__ == "__main__":
    main()
