"""How an arm is placed to grasp something: where the mount is, whence it comes, what the cables do before and to close.

A `Grip` knows that for one way of grasping. The mount's own place is the user's: a grip says what belongs to it, and
which places nearby may hold more surely. Places are about what the arm wraps: an object's centre, or a basket's bar.
"""

from dataclasses import dataclass
from typing import Annotated, Protocol

import numpy as np
from pydantic import Field

from trunkline.ar.hybrid.grasps import Grasp, object_in_base, pulls_of
from trunkline.model.arm.geometry import ChainGeometry

Metres = Annotated[float, Field(ge=0, le=1)]
Offset = Annotated[float, Field(ge=-0.2, le=0.2)]


@dataclass(frozen=True)
class GraspPose:
    """Positions are in the world, less that of what the arm wraps, m.

    Attributes:
        rotation: of the arm's base frame in the world. Shape (3, 3).
        mount: origin of the base frame. Shape (3,).
        come: where the mount is before, its rotation the same. Shape (3,).
        opened, closed: how much shorter than in the straight arm each cable is commanded before and after closing, m;
            negative is paid out. Shape (K,).
        sink: m, by which the mount goes down as the cables close.
    """

    rotation: np.ndarray
    mount: np.ndarray
    come: np.ndarray
    opened: np.ndarray
    closed: np.ndarray
    sink: float


class Grip(Protocol):
    """A way of grasping."""

    @property
    def rise(self) -> float:
        """m, by which the mount rises as the arm opens again, to let go."""
        ...

    def placed(self, rotation: np.ndarray, mount: np.ndarray) -> GraspPose:
        """With the mount where the user has it."""
        ...

    def near(self, rotation: np.ndarray, mount: np.ndarray, diameter: float) -> np.ndarray:
        """Places of the mount of the same rotation that may hold an object of `diameter` m more surely, less what
        the arm wraps of it, m. Shape (P, 3)."""
        ...


@dataclass
class SideSettings:
    """grasp: the grasp frame. pull: m, of the cables that close; the motors' force ends it sooner. loose: m, by which
    the others are paid out. sink: m, by which the mount goes down meanwhile, as a coil that closes rises, so that what
    supports an object bears it until the end. rise: m, by which the mount rises as the arm opens again, to let it go.
    aside: m, from which the mount comes. along, beside: m, places that the
    assistant tries about the grasp frame, along the arm and away from the object."""

    grasp: Grasp
    pull: Metres
    loose: Metres
    sink: Metres
    rise: Metres
    aside: Metres
    along: Annotated[list[Offset], Field(min_length=1, max_length=9)]
    beside: Annotated[list[Offset], Field(min_length=1, max_length=9)]


@dataclass(frozen=True)
class SideGrip:
    """Of what hangs, and of a basket by its bar: the straight arm comes from the side, towards the object, so that what
    it may push aside it does not turn, and curls round it."""

    settings: SideSettings
    geometry: ChainGeometry

    @property
    def rise(self) -> float:
        return self.settings.rise

    def placed(self, rotation: np.ndarray, mount: np.ndarray) -> GraspPose:
        front = _in_front(rotation, mount)
        towards = rotation[:, 0] if front else -rotation[:, 0]
        closed = pulls_of("dorsal" if front else "ventral", self.settings.pull)
        loose = -self.settings.loose
        opened, closed = np.where(closed > 0, 0.0, loose), np.where(closed > 0, closed, loose)
        return GraspPose(rotation, mount, mount - self.settings.aside * towards, opened, closed, self.settings.sink)

    def near(self, rotation: np.ndarray, mount: np.ndarray, diameter: float) -> np.ndarray:
        s = self.settings
        pull = "dorsal" if _in_front(rotation, mount) else "ventral"
        centre = object_in_base(self.geometry, diameter, s.grasp, pull)
        side = np.sign(centre[0])
        places = [centre + [side * away, 0.0, along] for along in s.along for away in s.beside]
        return -np.array(places) @ rotation.T


def _in_front(rotation: np.ndarray, mount: np.ndarray) -> bool:
    """Whether the object is on the side of tendon 1."""
    return bool(-mount @ rotation[:, 0] >= 0)
