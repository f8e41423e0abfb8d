"""What a package answers to questions about teleoperation: its maps and network, by the core's own functions."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import onnxruntime
from pydantic import TypeAdapter

from trunkline.ar.teleop.alignment import Aligned, align, wrist_of
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.messages import Obstacle, Targets, World
from trunkline.ar.teleop.reach import MapReach
from trunkline.ar.teleop.settings import Teleop
from trunkline.ar.teleop.targets import place
from trunkline.kinematics.ik.inference import ask
from trunkline.unity.unpacked import maps_of
from trunkline.unity.upm_package import NETWORK

PACKAGE = "a" * 64  # stands for the package's digest, which depends on the shared vectors
DIGITS = 7  # after the point, of the network's answers: its numbers are of 32 bits

Case = dict[str, Any]
TARGETS = TypeAdapter(Targets)


@dataclass(frozen=True)
class Answers:
    """Those of the `core` and its parts, and of a network, its ONNX file's contents. Vectors may be lists."""

    core: Teleoperation
    network_file: bytes

    def alignment(self, tip, mount, pointing, joints, last) -> Case:
        """The wrist of the robot's `joints`, and how `align` turns it."""
        wrist = wrist_of(tuple(joints), self.core.mount_offset)
        plane = self.core.settings.bending_plane
        aligned = align(tuple(tip), tuple(mount), tuple(pointing), wrist, Aligned(**last), plane)
        return {"wrist": wrist._asdict(), "aligned": aligned._asdict()}

    def rigid_reach(self, mount, pointing) -> Case:
        return self.core.reach.rigid(tuple(mount), tuple(pointing))._asdict()

    def soft_reach(self, tip, gravity) -> Case:
        return self.core.reach.soft(tuple(tip), tuple(gravity))._asdict()

    def targets(self, rigid, tip, pointing, joints, last, boxes) -> Case:
        """Both targets as `place` has them in a world of `boxes`."""
        wrist = wrist_of(tuple(joints), self.core.mount_offset)
        world = World("world", tuple(Obstacle(box["name"], tuple(box["low"]), tuple(box["high"])) for box in boxes))
        targets = place(
            tuple(rigid), tuple(tip), tuple(pointing), False, wrist, Aligned(**last), world, self.core.reach,
            self.core.settings,
        )  # fmt: skip
        return TARGETS.dump_python(targets, mode="json")

    def network(self, pose) -> Case:
        """Its outputs, and the warnings with them."""
        outputs = {name: values[0] for name, values in ask(self._session, np.array([pose])).items()}
        warnings = {name: bool(outputs.pop(name)) for name in ("doubtful", "unsure")}
        rounded = {name: np.round(values.astype(float), DIGITS).tolist() for name, values in outputs.items()}
        return rounded | warnings

    @property
    def inputs(self) -> int:
        """How many numbers the network takes."""
        return self._session.get_inputs()[0].shape[1]

    @cached_property
    def _session(self) -> onnxruntime.InferenceSession:
        return onnxruntime.InferenceSession(self.network_file, providers=["CPUExecutionProvider"])


def answers_of(files: dict[str, bytes], core: Teleop, mount_offset: float) -> Answers:
    """What a package's files answer with these settings of the core, the mount so far from the flange, m."""
    reach = MapReach.from_arrays(maps_of(files))
    return Answers(Teleoperation(core, reach, PACKAGE, mount_offset), files[NETWORK])
