"""The legs of a grasp and of a hand-over: what all ten axes do one after the other, each from rest to rest."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from trunkline.ar.hybrid.grasp_poses import GraspPose, Grip
from trunkline.ar.hybrid.objects import Shape
from trunkline.ar.teleop.alignment import base_quaternion
from trunkline.ar.teleop.messages import Targets, World, WorldObject
from trunkline.ar.teleop.object_shapes import below_grip, beneath, grip_of, way_of_grasping
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.vectors import DOWN, Vector, conjugate, rotate
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz
from trunkline.kinematics.panda.kinematics import mount_pose

UP = np.array([0.0, 0.0, 1.0])
LIFTS = 5  # that are tried, from the highest on
Seconds = Annotated[float, Field(ge=0, le=30)]
Metres = Annotated[float, Field(gt=0, le=1)]
Mass = Annotated[float, Field(ge=0, le=20)]


@dataclass
class Handling:
    """How objects are grasped and brought elsewhere.

    close: s, at least, for the cables to close. calm: s for which all waits before it and after it.
    lift: m, where the rigid robot reaches so high, else less, down to least_lift. carry: m/s, of the mount with
    something in the arm, on the average. above: m over its place from which a object comes down. open: s, at least, in
    which the arm opens while the mount rises. beneath: m, at most, that a object may fall as it is let go. payload: of
    each shape, rows of diameter, m, and the heaviest mass, kg, that is grasped, linear between.
    """

    close: Seconds
    calm: Seconds
    lift: Metres
    least_lift: Metres
    carry: Metres
    above: Metres
    open: Seconds
    beneath: Metres
    payload: dict[Shape, Annotated[list[tuple[Metres, Mass]], Field(min_length=1, max_length=50)]]

    def __post_init__(self):
        if self.least_lift > self.lift:
            raise ValueError(f"least_lift: found {self.least_lift} m, expected at most lift, {self.lift} m")
        for name, rows in self.payload.items():
            diameters = [diameter for diameter, _ in rows]
            if diameters != sorted(set(diameters)):
                raise ValueError(f"payload.{name}: found diameters {diameters}, expected them rising")

    def heaviest(self, shape: Shape, diameter: float) -> float:
        """kg, of an object of `diameter` m; none of a shape that is not told of, or wider than its last row, can be
        held."""
        diameters, masses = zip(*self.payload.get(shape, [(diameter, 0.0)]), strict=True)
        return float(np.interp(diameter, diameters, masses, right=0.0))


@dataclass(frozen=True)
class Leg:
    """To `joints` (7,), rad, and `commands` (K,), m, in `seconds` at least, then at rest for `calm` s; `gentle` with
    something in the arm, or before the tip.

    `gravity`: in the arm's base frame, for legs that are shaped so that the arm does not swing on; None for the others.
    `change` (K,): m, what swings it: a command's change, or zero, the mount's way.
    """

    phase: str
    joints: np.ndarray
    commands: np.ndarray
    gravity: np.ndarray | None = None
    change: np.ndarray | None = None
    seconds: float = 0.0
    calm: float = 0.0
    gentle: bool = False


@dataclass(frozen=True)
class Grasping:
    """grips: by the way of grasping. straight (K,): m, commands of the straight arm."""

    rigid: RigidIK
    mount_offset: float
    straight: np.ndarray
    grips: dict[str, Grip]
    handling: Handling

    def grasp(self, targets: Targets, object: WorldObject, joints: np.ndarray, beside: float = 0.0) -> list[Leg]:
        """Approach with the arm opened, close while the mount goes down, lift.

        Args:
            beside: m, by which the straight arm's tip is seen beside the bending plane, towards its base's y: the mount
                makes up for it, as a narrow coil must meet an object in its middle.

        Raises:
            InputError: the object is too heavy, nobody knows how to grasp it, or the rigid robot cannot be there.
        """
        h, name = self.handling, way_of_grasping(object)
        if name not in self.grips:
            raise InputError(f"grasp: {object.name} is {object.support}, expected {' or '.join(self.grips)}")
        most = h.heaviest(object.shape, object.diameter)
        if object.mass > most:
            raise InputError(
                f"payload: {object.name} weighs {object.mass:g} kg, expected at most {most:.3g} kg "
                f"at a diameter of {1e3 * object.diameter:.0f} mm"
            )
        placement = self.placement(targets, object)
        centre = np.array(grip_of(object)) - beside * placement.rotation[:, 1]
        opened = self.straight - placement.opened
        closed, still, gravity = self.straight - placement.closed, np.zeros(len(opened)), gravity_direction(targets)

        def at(start: np.ndarray, place: np.ndarray) -> np.ndarray:
            return self._solve(start, centre + place, targets)

        come = at(joints, placement.come)
        there = at(come, placement.mount)
        sunk = at(there, placement.mount - placement.sink * UP)
        lift, lifted = self._highest(lambda lift: at(sunk, placement.mount + lift * UP))
        return [
            Leg("approach", come, opened, gravity, still),
            Leg("approach", there, opened, gravity, still, calm=h.calm),
            Leg("curl", sunk, closed, seconds=h.close, calm=h.calm),
            Leg("lift", lifted, closed, seconds=(lift + placement.sink) / h.carry, gentle=True),
        ]

    def _highest(self, at: Callable[[float], np.ndarray]) -> tuple[float, np.ndarray]:
        """The highest of LIFTS lifts, m, that the rigid robot reaches, and its joints (7,), rad, there.

        Raises:
            InputError: of the lowest, if it reaches none.
        """
        *higher, least = np.linspace(self.handling.lift, self.handling.least_lift, LIFTS)
        for lift in higher:
            with suppress(InputError):
                return float(lift), at(lift)
        return float(least), at(least)

    def placement(self, targets: Targets, object: WorldObject) -> GraspPose:
        """Of the user's own targets."""
        centre = np.array(grip_of(object))
        rotation = rotation_from_wxyz(np.array(base_quaternion(targets.pointing, targets.heading))).as_matrix()
        return self.grips[way_of_grasping(object)].placed(rotation, np.array(targets.rigid.position) - centre)

    def bring(
        self, targets: Targets, object: WorldObject, world: World, joints: np.ndarray, commands: np.ndarray
    ) -> list[Leg]:
        """Transfer what is held to above its place, down, open and rise.

        Raises:
            InputError: nothing is beneath the place, or the rigid robot cannot be there.
        """
        h, place = self.handling, np.array(targets.rigid.position)
        _require_ground(object, targets.tip.position, world, h.beneath)
        opened, rise = np.maximum(commands, self.straight), self.grips[way_of_grasping(object)].rise
        above = self._solve(joints, place + h.above * UP, targets)
        there = self._solve(above, place, targets)
        away = np.linalg.norm(place + h.above * UP - mount_pose(joints[None], self.mount_offset)[0][0])
        return [
            Leg("transfer", above, commands, seconds=float(away) / h.carry, calm=h.calm, gentle=True),
            Leg("transfer", there, commands, seconds=h.above / h.carry, calm=h.calm, gentle=True),
            Leg("release", self._solve(there, place + rise * UP, targets), opened, seconds=h.open),
        ]

    def _solve(self, start: np.ndarray, mount: np.ndarray, targets: Targets) -> np.ndarray:
        x, y, z = (float(value) for value in mount)
        return self.rigid.solve(start, (x, y, z), targets.pointing, targets.heading)


def gravity_direction(targets: Targets) -> np.ndarray:
    """In the soft arm's base frame, as `targets` turn it. Shape (3,)."""
    return np.array(rotate(conjugate(base_quaternion(targets.pointing, targets.heading)), DOWN))


def _require_ground(object: WorldObject, place: Vector, world: World, most: float) -> None:
    """Refuse to release an object at `place`, m, where nothing is beneath it.

    Raises:
        InputError: telling what is missing.
    """
    x, y, z = place[0], place[1], place[2] - below_grip(object)
    obstacle = beneath((x, y, z), world)
    gap = np.inf if obstacle is None else z - obstacle.high[2]
    if gap > most:
        gap_text = "nothing" if obstacle is None else f"{1e3 * gap:.0f} mm"
        raise InputError(
            f"release: found {gap_text} between {object.name} and what is beneath it, "
            f"expected at most {1e3 * most:.0f} mm"
        )
