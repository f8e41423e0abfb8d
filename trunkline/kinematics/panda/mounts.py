"""What holds the arm: the Panda, or a mount that stands still. A config group each in `conf/shared/robot/`.

The arm's base frame has the straight arm along -z and tendon 1 over +x; a mount has z out of the flange. So the base
is the mount turned by half a turn about its x, and then by `azimuth` about the arm's axis.
"""

from dataclasses import dataclass, field
from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.kinematics.panda.collision import MOUNT_RADIUS
from trunkline.kinematics.panda.kinematics import FLANGE, Q_MAX, Q_MIN
from trunkline.kinematics.panda.limits import TORQUE
from trunkline.kinematics.panda.maker_model import JOINTS, shipped_panda
from trunkline.model.arm.contact_geometry import ARM, ROBOT, WORLD

Metres = Annotated[float, Field(ge=-10, le=10)]
Turn = Annotated[float, Field(ge=-7, le=7)]  # rad
THINNEST = 0.01  # m, of the cylinder that stands for the motors

# Gains of the actuators in MuJoCo Menagerie (Google DeepMind), `franka_emika_panda/panda.xml`, whose joints have an
# armature of 0.1 kg m² and a damping of 1 N m s/rad besides: stand-ins for the maker's joint controller, which is not
# published. N m/rad and N m s/rad.
KP = (4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0)
KV = (450.0, 450.0, 350.0, 350.0, 200.0, 200.0, 200.0)


@dataclass
class PandaRobot:
    """The Panda on the world's origin.

    Attributes:
        mount_offset: from the flange to the mount along the flange's z, m.
        mount_mass: of motors, winches and adapter, kg, spread over a cylinder between flange and mount.
        azimuth: of the arm about its axis, rad.
        ready: joint angles to begin with, rad. Shape (7,).
    """

    kind: Literal["panda"]
    mount_offset: Annotated[float, Field(ge=0, le=1)]
    mount_mass: Annotated[float, Field(gt=0, le=20)]
    azimuth: Turn
    ready: Annotated[list[Turn], Field(min_length=7, max_length=7)]

    def __post_init__(self):
        for name, angle, low, high in zip(JOINTS, self.ready, Q_MIN, Q_MAX, strict=True):
            if not low <= angle <= high:
                raise ValueError(f"ready: {name}: found {angle} rad, expected {low} to {high} rad")

    def build(self) -> mujoco.MjSpec:
        """The Panda with a servo `joint_1_position`… a joint, limited to its torque, and the site `mount`."""
        spec = shipped_panda(self.mount_offset)
        for number in range(8):
            geom = spec.geom(f"link_{number}_geom")
            geom.contype, geom.conaffinity, geom.group = ROBOT, WORLD | ARM if number < 7 else WORLD, 2
        for name, kp, kv, torque in zip(JOINTS, KP, KV, TORQUE, strict=True):
            servo = spec.add_actuator(name=f"{name}_position", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            servo.set_to_position(kp=kp, kv=kv)
            servo.forcelimited, servo.forcerange = True, [-torque, torque]
        self._add_motors(spec)
        return spec

    def _add_motors(self, spec: mujoco.MjSpec) -> None:
        half = max(self.mount_offset, THINNEST) / 2
        block = spec.body("link_7").add_body(name="motors", pos=[0, 0, FLANGE + self.mount_offset - half])
        across, along = MOUNT_RADIUS**2 / 4 + half**2 / 3, MOUNT_RADIUS**2 / 2  # m², of a cylinder
        block.explicitinertial, block.mass, block.ipos = True, self.mount_mass, [0, 0, 0]
        block.inertia = self.mount_mass * np.array([across, across, along])
        block.add_geom(name="motors_geom", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[MOUNT_RADIUS, half, 0], mass=0,
                       contype=ROBOT, conaffinity=WORLD, group=2, rgba=(0.25, 0.26, 0.28, 1))  # fmt: skip

    def mount(self, spec: mujoco.MjSpec) -> mujoco.MjsFrame:
        """The frame, on the flange, that the arm's base is put into."""
        turn = Rotation.from_euler("x", np.pi) * Rotation.from_euler("z", self.azimuth)
        link = spec.body("link_7")
        return link.add_frame(pos=spec.site("mount").pos, quat=wxyz_from_rotation(turn))


@dataclass
class FixedMount:
    """A mount that stands still in the world.

    Attributes:
        position: of the arm's base, m. Shape (3,).
        quaternion: of the arm's base frame in the world, w first.
    """

    kind: Literal["fixed"]
    position: Annotated[list[Metres], Field(min_length=3, max_length=3)] = field(default_factory=lambda: [0, 0, 0])
    quaternion: Annotated[list[Metres], Field(min_length=4, max_length=4)] = field(default_factory=lambda: [1, 0, 0, 0])

    def build(self) -> mujoco.MjSpec:
        """An empty model."""
        return mujoco.MjSpec()

    def mount(self, spec: mujoco.MjSpec) -> mujoco.MjsFrame:
        """The frame that the arm's base is put into."""
        return spec.worldbody.add_frame(
            pos=self.position, quat=wxyz_from_rotation(rotation_from_wxyz(np.array(self.quaternion, dtype=float)))
        )


Robot = Annotated[PandaRobot | FixedMount, Field(discriminator="kind")]
