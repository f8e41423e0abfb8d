"""What stands around the robot, in the Panda's base frame: floor, surfaces, a hook, and one object to grasp."""

from dataclasses import dataclass, field
from itertools import product
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from rehearsal.robot.rigid_object import Motion, RigidObject
from rehearsal.robot.shapes import BOX, CYLINDER, distance
from trunkline.ar.hybrid.basket import Part, unit_inertia
from trunkline.ar.hybrid.objects import ObjectShape
from trunkline.ar.hybrid.worlds import HOOK_LENGTH, HOOK_RADIUS, Metres, SupportSurface
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation

Place = Annotated[list[Metres], Field(min_length=3, max_length=3)]
Quaternion = Annotated[list[Annotated[float, Field(ge=-1, le=1)]], Field(min_length=4, max_length=4)]
Friction = Annotated[float, Field(ge=0, le=5)]

RIM = 12  # points on each rim of a cylinder: it stands on these
TOY_EDGE = 0.25  # radius of a toy's edges over its width
DEEP = 1.0  # m, of the floor
KINDS = {"box": BOX, "cylinder": CYLINDER}
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


@dataclass
class SceneObject(ObjectShape):
    """position: of its centre of mass, m. quaternion: w first; (1, 0, 0, 0) stands upright. hanging: by a string, from
    the hook above it; a basket by its bar."""

    position: Place
    quaternion: Quaternion = field(default_factory=lambda: [1.0, 0.0, 0.0, 0.0])
    hanging: bool = False


@dataclass
class LabScene:
    """floor: its height, m, or null. hook: its end, m, or null."""

    floor: Metres | None
    object: SceneObject
    surfaces: dict[str, SupportSurface] = field(default_factory=dict)
    hook: Place | None = None

    def names(self) -> list[str]:
        """The fixed shapes, in the order of `shapes`."""
        floor, hook = ["floor"] * (self.floor is not None), ["hook"] * (self.hook is not None)
        return [*floor, *self.surfaces, *hook]

    def shapes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """kind (W,), half (W, 3), edge (W,), place (W, 3) of the fixed shapes."""
        rows = []
        if self.floor is not None:
            rows.append(([5.0, 5.0, DEEP / 2], 0.0, [0.0, 0.0, self.floor - DEEP / 2]))
        for surface in self.surfaces.values():
            half = np.array(surface.size) / 2
            rows.append((half, 0.0, np.array(surface.top) - [0, 0, half[2]]))
        if self.hook is not None:
            rows.append(([0.0, 0.0, HOOK_LENGTH / 2], HOOK_RADIUS, np.array(self.hook) + [0, 0, HOOK_LENGTH / 2]))
        halves, edges, places = (np.array([row[k] for row in rows], dtype=float) for k in range(3))
        return np.full(len(rows), BOX), halves.reshape(-1, 3), edges, places.reshape(-1, 3)


@dataclass
class String:
    """By which an object hangs. tautness: N/m. loss: N s/m. lip: m by which it must be slack to come off the hook."""

    tautness: Annotated[float, Field(gt=0, le=1e6)] = 2000.0
    loss: Annotated[float, Field(ge=0, le=1e4)] = 1.0
    lip: Annotated[float, Field(gt=0, le=1)] = 0.01


def make_rigid_object(object: SceneObject, hook: list[float] | None, string: String) -> tuple[RigidObject, Motion]:
    """The object as a rigid body, and where it is at first.

    Raises:
        InputError: it hangs where there is no hook, or where the hook is not above it.
    """
    solids, points, radius = _basket(object.parts()) if object.shape == "basket" else _single(object)
    turn, first = rotation_from_wxyz(np.array(object.quaternion, dtype=float)), solids[0]
    up = turn.inv().apply([0.0, 0.0, 1.0]) @ first.turn
    eye, end, length = first.place + first.turn @ _above(first.kind, first.half, first.edge, up), np.zeros(3), 0.0
    if object.hanging:
        tied = np.array(object.position) + turn.apply(eye)
        if hook is None or hook[2] <= tied[2]:
            raise InputError(f"object.hanging: found a hook at {hook}, expected one above {tied.tolist()}")
        end = np.array(hook, dtype=float)
        length = float(np.linalg.norm(end - tied))
    kind, half, edge, place, turns = (np.array(column) for column in zip(*solids, strict=True))
    body = RigidObject(
        kind=kind, half=half, edge=edge, shift=place, turn=turns, mass=object.mass,
        inertia=object.mass * _inertia(object), points=points, radius=radius, eye=eye, hook=end, string=length,
        tautness=string.tautness, loss=string.loss, lip=string.lip,
    )  # fmt: skip
    return body, Motion(
        np.array(object.position, dtype=float), wxyz_from_rotation(turn), np.zeros(3), np.zeros(3),
        np.array([float(object.hanging)]),
    )  # fmt: skip


class Solid(NamedTuple):
    """A shape in the object's frame; see `RigidObject`."""

    kind: int
    half: np.ndarray
    edge: float
    place: np.ndarray = np.zeros(3)
    turn: np.ndarray = np.eye(3)


def _single(object: SceneObject) -> tuple[list[Solid], np.ndarray, float]:
    """The shape of an object that has one, the points by which it lies on the world (P, 3), m, and their radius, m."""
    radius, half_height = object.diameter / 2, object.height / 2
    if object.shape == "sphere":
        return [Solid(BOX, np.zeros(3), radius)], np.zeros((1, 3)), radius
    if object.shape == "cylinder":
        half = np.array([radius, radius, half_height])
        return [Solid(CYLINDER, half, 0.0)], _rims(half), 0.0
    edge = TOY_EDGE * object.diameter if object.shape == "toy" else 0.0
    half = np.maximum([radius - edge, radius - edge, half_height - edge], 0.0)
    return [Solid(BOX, half, edge)], CORNERS * half, edge


def _basket(parts: dict[str, Part]) -> tuple[list[Solid], np.ndarray, float]:
    """As of `_single`: the bar first. It lies on the corners of its box, and tipped over on the rims of its bar."""
    solids = [Solid(KINDS[part.shape], part.half, 0.0, part.place, part.turn) for part in parts.values()]
    box, bar = parts["box"], parts["bar"]
    corners = CORNERS * box.half @ box.turn.T + box.place
    return solids, np.concatenate([corners, _rims(bar.half) @ bar.turn.T + bar.place]), 0.0


def _rims(half: np.ndarray) -> np.ndarray:
    """Points on the two rims of a cylinder, m. Shape (2 RIM, 3)."""
    angle = 2 * np.pi * np.arange(RIM) / RIM
    rim = half[0] * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(RIM)])
    return np.concatenate([rim + [0, 0, z] for z in (-half[2], half[2])])


def _above(kind: int, half: np.ndarray, edge: float, up: np.ndarray) -> np.ndarray:
    """Where a ray from the centre along `up` leaves the shape, m; as far each time as the surface is away."""
    out = 0.0
    for _ in range(200):
        out -= distance(kind, half, edge, tuple(out * up))[0]
    return out * up


def _inertia(object: SceneObject) -> np.ndarray:
    """Moments of inertia of 1 kg about its axes, m². Shape (3,). A toy's round edges are left out."""
    width, height = object.diameter, object.height
    if object.shape == "basket":
        return unit_inertia(object.parts())
    if object.shape == "sphere":
        return np.full(3, width**2 / 10)
    if object.shape == "cylinder":
        return np.array([*[width**2 / 16 + height**2 / 12] * 2, width**2 / 8])
    return np.array([*[(width**2 + height**2) / 12] * 2, width**2 / 6])
