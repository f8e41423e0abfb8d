"""All that a client has: the Unity package, and nothing else. Network, maps and model come out of its files."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from trunkline.ar.hybrid.grasp_poses import Grip, SideGrip
from trunkline.ar.preview import contents
from trunkline.ar.teleop.alignment import base_quaternion
from trunkline.ar.teleop.config import TeleoperationConfig
from trunkline.ar.teleop.grasping import Grasping
from trunkline.ar.teleop.messages import Targets
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.reach import MapReach
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.tendons import Network
from trunkline.ar.teleop.trajectory import limits_of
from trunkline.ar.teleop.vectors import DOWN, Vector, conjugate, rotate
from trunkline.ar.teleop.vibration import shaper_for, slowest, vibration_modes
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses
from trunkline.model.arm.contact_geometry import read_geometry
from trunkline.model.arm.geometry import ChainGeometry
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import Chain, read_chain
from trunkline.model.statics.equilibria import actuated
from trunkline.twin import package
from trunkline.twin.twin import package_lacking
from trunkline.unity import unpacked
from trunkline.unity.upm_package import MODEL

PACKAGES = Path("artifacts/package_unity")


@dataclass(frozen=True)
class Package:
    """`straight`: the motors' commands (K,), m, that leave the arm straight; a command is a path length, so a pull is
    `straight` less the command. `rate_limit`: m/s, of the winches, 0 for none. `residual_map`: by how far
    the arm's tip rests beside its twin's, None where too few poses tell. `files`: contents by path."""

    digest: str
    reach: MapReach
    network: Network
    model: mujoco.MjModel
    chain: Chain
    geometry: ChainGeometry
    straight: np.ndarray
    rate_limit: float
    residual_map: ResidualMap | None
    files: dict[str, bytes] = field(repr=False)

    def planner(self, config: TeleoperationConfig) -> Planner:
        """The planner that this package and the settings of teleoperation make."""
        limits = limits_of(config.motors, self.rate_limit, len(self.straight))
        shaper, rigid = shaper_for(self.model, config.shaping), RigidIK(config.mount_offset)
        grasping = Grasping(rigid, config.mount_offset, self.straight, self.grips(config), config.handling)
        return Planner(
            rigid, self.network, self.straight, limits, config.mount_offset, shaper=shaper, chain=self.chain,
            grasping=grasping, advance=config.advance, advance_speed=config.advance_speed,
            residual_map=self.residual_map,
        )  # fmt: skip

    def grips(self, config: TeleoperationConfig) -> dict[str, Grip]:
        """The ways of grasping objects, by their names."""
        return {"hanging": SideGrip(config.hanging, self.geometry), "basket": SideGrip(config.basket, self.geometry)}

    @cached_property
    def period(self) -> float:
        """s, of the slowest swing of the straight arm that a moved mount gives its tip; 0 where there is none."""
        gravity = np.array([0.0, 0.0, -STANDARD_GRAVITY])
        return float(max(slowest(vibration_modes(self.model, self.straight, None, gravity), 1).periods, default=0.0))

    def tip(self, mount: Vector, targets: Targets, commands: np.ndarray) -> np.ndarray:
        """Where the tip comes to rest, base frame, m (3,): the arm at `mount` as `targets` turn it, its motors at
        `commands` (K,). That is the twin's tip, moved by the residual map."""
        turn = base_quaternion(targets.pointing, targets.heading)
        gravity = STANDARD_GRAVITY * np.array(rotate(conjugate(turn), DOWN))
        tip = settle(self.model, commands[None], gravity).position[0]
        if self.residual_map is not None:
            rest = actuated(self.chain, commands[None], gravity)
            tip = tip + self.residual_map.mean(RestingPoses.of(self.chain, rest, gravity[None]))[0]
        x, y, z = (float(value) for value in tip)
        return np.array(mount) + np.array(rotate(turn, (x, y, z)))


def only_package(folder: Path = PACKAGES) -> Path:
    """The package that the pipeline made.

    Raises:
        InputError: there is none, or more than one.
    """
    packages = sorted(folder.glob("*.tgz"))
    if len(packages) != 1:
        raise InputError(f"{folder}: found {len(packages)} packages (*.tgz), expected one: `make demo` makes it")
    return packages[0]


def read_package(path: Path) -> Package:
    """From a package's folder, or its .tgz.

    Raises:
        InputError: there is none, or a file of it, its network too, is not what its manifest says.
    """
    files = package.read_package(path)
    digest = package.package_digest(files)
    manifest = package.manifest_of(files)
    network, model = manifest["network"], manifest["model"]
    compiled, lacking = unpacked.model_of(files), package_lacking(files)
    return Package(
        digest,
        MapReach.from_arrays(unpacked.maps_of(files)),
        contents.network_of(files),
        compiled,
        read_chain(compiled).smooth,
        read_geometry(package.spec_of(files, MODEL)),
        np.array([compiled.tendon_length0[compiled.tendon(name).id] for name in network["output_order"]]),
        float(model["rate_limit"]),
        lacking and lacking.residual_map,
        files,
    )
