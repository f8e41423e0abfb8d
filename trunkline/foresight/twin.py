"""The twin that plans are tried on: the identified arm on the Panda, the world as the client believes it, the thing."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.foresight.settings import Previewing
from trunkline.frames import STANDARD_GRAVITY
from trunkline.hybrid.compose import Placed, compose, panda_joints
from trunkline.hybrid.doubts import Contact, Doubts
from trunkline.hybrid.futures import Twin
from trunkline.hybrid.objects import Thing as Shaped
from trunkline.hybrid.robots import PandaRobot
from trunkline.hybrid.string import hang
from trunkline.hybrid.worlds import Surface
from trunkline.hybrid.worlds import World as Room
from trunkline.panda.kinematics import mount_pose
from trunkline.simulation.rest import settle
from trunkline.teleop.messages import Box, Thing, World
from trunkline.unity import unpacked


@dataclass(frozen=True)
class Believed:
    """What the package says. doubts: about the arm's parameters, contacts and places."""

    arm: mujoco.MjSpec
    doubts: Doubts
    robot: PandaRobot


def believed(settings: Previewing, files: dict[str, bytes]) -> Believed:
    """Out of the files of a package.

    Raises:
        InputError: it has nothing to preview with, or holds the arm by another robot.
    """
    x, y, z = settings.place
    contact = Contact(settings.friction, (x, y, z), float(np.radians(settings.turn_deg)))
    robot = unpacked.robot_of(files)
    if not isinstance(robot, PandaRobot):
        raise InputError(f"package: found a robot of kind {robot.kind}, expected panda: plans move that")
    return Believed(unpacked.arm_of(files), unpacked.doubts_of(files, contact), robot)


def compose_twin(
    known: Believed, world: World, thing: Thing | None, joints: np.ndarray, commands: np.ndarray, settings: Previewing
) -> Twin:
    """The twin at rest at `joints` (7,), rad, its motors at `commands` (K,), m, beside a thing that hangs or stands."""
    robot = replace(known.robot, ready=joints.tolist())
    room, placed = Room(None, {box.name: _surface(box) for box in world.boxes}, None), None
    if thing is not None:
        shaped = Shaped(thing.shape, thing.diameter, thing.height, thing.mass, settings.material)
        placed = Placed(shaped, np.array(thing.position), thing.quaternion)
    spec = compose(known.arm, robot, room, placed)
    if thing is not None and thing.support == "hanging":
        hang(spec, np.array(thing.position), thing.diameter / 2, settings.string)
    twin = Twin(spec.compile(), known.arm.copy().compile()).stepped(settings.step)
    return at_rest(twin, joints, commands, robot.mount_offset)


def at_rest(twin: Twin, joints: np.ndarray, commands: np.ndarray, mount_offset: float) -> Twin:
    """The same twin, its arm at rest at other `joints` (7,), rad, and `commands` (K,), m."""
    return replace(twin, start=_start(twin.model, twin.arm, joints, commands, mount_offset))


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
