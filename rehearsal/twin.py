"""The twin that plans are tried on: the identified arm on the Panda, the world as the client believes it, the thing."""

import json
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from rehearsal.settings import Previewing
from trunkline.errors import existing
from trunkline.frames import STANDARD_GRAVITY
from trunkline.hybrid.compose import Placed, compose, panda_joints
from trunkline.hybrid.doubts import Contact, Doubts, doubts_of
from trunkline.hybrid.futures import Twin
from trunkline.hybrid.objects import Thing as Shaped
from trunkline.hybrid.robots import PandaRobot
from trunkline.hybrid.string import hang
from trunkline.hybrid.worlds import Surface
from trunkline.hybrid.worlds import World as Room
from trunkline.panda.kinematics import mount_pose
from trunkline.simulation.rest import settle
from trunkline.teleop.messages import Box, Thing, World

STAGES = ("identify_stiffness", "identify_damping", "identify_control")


@dataclass(frozen=True)
class Believed:
    """arm: as identified. doubts: about its parameters, contacts and places. mount_offset: m. mount_mass: kg."""

    arm: mujoco.MjSpec
    doubts: Doubts
    mount_offset: float
    mount_mass: float


def believed(settings: Previewing, mount_offset: float, artifacts: Path = Path("artifacts")) -> Believed:
    """What the pipeline has identified. It is not all in the package yet, so it is read from the artifacts."""
    stages = [json.loads(existing(artifacts / stage / "parameters.json").read_text()) for stage in STAGES]
    x, y, z = settings.place
    contact = Contact(settings.friction, (x, y, z), float(np.radians(settings.turn_deg)))
    arm = mujoco.MjSpec.from_file(str(existing(artifacts / STAGES[-1] / "arm.xml")))
    return Believed(arm, doubts_of(stages, contact), mount_offset, settings.mount_mass)


def compose_twin(
    known: Believed, world: World, thing: Thing, joints: np.ndarray, commands: np.ndarray, settings: Previewing
) -> Twin:
    """The twin at rest at `joints` (7,), rad, its motors at `commands` (K,), m, beside a thing that hangs or stands."""
    robot = PandaRobot("panda", known.mount_offset, known.mount_mass, 0.0, joints.tolist())
    place = np.array(thing.position)
    room = Room(None, {box.name: _surface(box) for box in world.boxes}, None)
    shaped = Shaped(thing.shape, thing.diameter, thing.height, thing.mass, settings.material)
    spec = compose(known.arm, robot, room, Placed(shaped, place, thing.quaternion))
    if thing.support == "hanging":
        hang(spec, place, thing.diameter / 2, settings.string)
    model, arm = spec.compile(), known.arm.copy().compile()
    return Twin(model, arm, _start(model, arm, joints, commands, known.mount_offset)).stepped(settings.step)


def _start(
    model: mujoco.MjModel, arm: mujoco.MjModel, joints: np.ndarray, commands: np.ndarray, mount_offset: float
) -> np.ndarray:
    """The composed model's pose (nq,) with the arm at rest."""
    flange = mount_pose(joints[None], mount_offset)[1][0]
    gravity = (flange @ np.diag([1.0, -1.0, -1.0])).T @ [0.0, 0.0, -STANDARD_GRAVITY]
    rest = settle(arm, commands[None], gravity).qpos[0]
    pose = model.qpos0.copy()
    pose[model.jnt_qposadr[panda_joints(model)]] = joints
    for number in range(arm.njnt):
        name = arm.joint(number).name
        if name:
            pose[model.joint(name).qposadr[0]] = rest[arm.jnt_qposadr[number]]
    return pose


def _surface(box: Box) -> Surface:
    low, high = np.array(box.low), np.array(box.high)
    return Surface([*((low + high) / 2)[:2].tolist(), float(high[2])], (high - low).tolist(), "wood")
