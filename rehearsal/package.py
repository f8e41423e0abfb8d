"""All that a client has: the Unity package, and nothing else. Network, maps and model come out of its files."""

import json
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import onnxruntime

from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.ik.ask import ask
from trunkline.simulation.rest import settle
from trunkline.teleop.alignment import base_quaternion
from trunkline.teleop.config import Config
from trunkline.teleop.messages import Targets
from trunkline.teleop.planner import Planner
from trunkline.teleop.reach import MapReach
from trunkline.teleop.rigid_ik import RigidIK
from trunkline.teleop.swing import shaper_for
from trunkline.teleop.tendons import Ask
from trunkline.teleop.trajectory import limits_of
from trunkline.teleop.vectors import DOWN, Vector, conjugate, rotate
from trunkline.unity.package import read_tarball
from trunkline.unity.twin import MANIFEST
from trunkline.unity.unpacked import maps_of, package_digest


@dataclass(frozen=True)
class Package:
    """`straight`: the motors' commands (K,), m, that leave the arm straight; a command is a path length, so a pull is
    `straight` less the command. `rate_limit`: m/s, of the winches, 0 for none."""

    digest: str
    reach: MapReach
    ask: Ask
    model: mujoco.MjModel
    straight: np.ndarray
    rate_limit: float

    def planner(self, config: Config) -> Planner:
        """The planner that this package and the settings of teleoperation make."""
        limits = limits_of(config.motors, self.rate_limit, len(self.straight))
        shaper = shaper_for(self.model, config.shaping)
        return Planner(
            RigidIK(config.mount_offset), self.ask, self.straight, limits, config.mount_offset, shaper=shaper
        )

    def tip(self, mount: Vector, targets: Targets, commands: np.ndarray) -> np.ndarray:
        """Where the twin's tip comes to rest, base frame, m (3,): the arm at `mount` as `targets` turn it, its motors
        at `commands` (K,)."""
        turn = base_quaternion(targets.pointing, targets.heading)
        gravity = STANDARD_GRAVITY * np.array(rotate(conjugate(turn), DOWN))
        x, y, z = (float(value) for value in settle(self.model, commands[None], gravity).position[0])
        return np.array(mount) + np.array(rotate(turn, (x, y, z)))


def read_package(path: Path) -> Package:
    """From a package's folder, or its .tgz.

    Raises:
        InputError: there is none, or a file of it is not what its manifest says.
    """
    if path.is_dir():
        files = {file.relative_to(path).as_posix(): file.read_bytes() for file in path.rglob("*") if file.is_file()}
    elif path.is_file():
        files = read_tarball(path)
    else:
        raise InputError(f"{path}: found nothing, expected a package's folder or .tgz")
    digest = package_digest(files)
    manifest = json.loads(files[MANIFEST])
    network, model = manifest["network"], manifest["model"]
    runtime = onnxruntime.InferenceSession(files[network["file"]], providers=["CPUExecutionProvider"])
    return Package(
        digest,
        MapReach.from_arrays(maps_of(files)),
        partial(ask, runtime),
        mujoco.MjModel.from_xml_string(files[model["file"]].decode()),
        np.array([model["rest_lengths"][name] for name in network["output_order"]]),
        float(model["rate_limit"]),
    )
