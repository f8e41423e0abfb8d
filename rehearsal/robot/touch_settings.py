"""How hard and how rough objects are: the settings of contacts, and what the kernels take of them."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from demo.plants.stranger_kernel import Links
from rehearsal.robot.rigid_object import RigidObject
from rehearsal.robot.scene import Friction, LabScene
from rehearsal.robot.touching import Contacts, ContactWorld, Discs
from trunkline.model.arm.geometry import ChainGeometry

LOWEST = 0.05  # of a coefficient's nominal value, below which scatter does not bring it

Stiffness = Annotated[float, Field(gt=0, le=1e9)]
Positive = Annotated[float, Field(ge=0, le=100)]
Relative = Annotated[float, Field(ge=0, lt=1)]


@dataclass
class Touch:
    """Contacts of the stand-in.

    hardness: k of the arm's widest unit, N/m^1.5; it goes with the root of a unit's width, as Hertz's does with a
    radius. stiffness: k_t of that unit, N/m; it goes with the width. damping_ratio: of a unit's mass on its bristle.
    loss: c, s/m, of the arm's contacts. world_hardness, world_stiffness, world_loss: of the object's with the world;
    world_damping_ratio: of the object's mass on one bristle.
    arm_object, arm_world, object_world: nominal friction. scatter: relative, standard deviation, drawn for each pair of
    bodies. unit_scatter: likewise, beside it, for each unit of the arm.
    """

    hardness: Stiffness
    stiffness: Stiffness
    damping_ratio: Positive
    loss: Positive
    world_hardness: Stiffness
    world_stiffness: Stiffness
    world_damping_ratio: Positive
    world_loss: Positive
    arm_object: Friction
    arm_world: Friction
    object_world: Friction
    scatter: Relative
    unit_scatter: Relative


def make_touch(
    chain: ChainGeometry, links: Links, scene: LabScene, object: RigidObject, touch: Touch, rng: np.random.Generator
) -> tuple[Discs, ContactWorld, Contacts]:
    """Discs, world and empty contacts; `rng` draws the friction, always as many numbers of it for the same scene.

    A unit is a double cone whose rim is as high as what its neighbours leave of it when they close on each other,
    l - (W + W') Δθ/4, W and W' its upper and lower widths. The disc's edge is half of that.
    """
    kind, half, edge, place = scene.shapes()
    units, solids, shapes = chain.units, len(object.kind), len(kind)
    width = chain.widths * (1 + chain.ratio) / 2
    rim = chain.lengths - chain.joint_range * chain.widths * (1 + chain.ratio) / 4
    round_edge = np.minimum(np.maximum(rim, 0.1 * chain.lengths), width) / 2
    share = chain.widths / chain.widths[0]
    stiffness = touch.stiffness * share
    masses = np.add.reduceat(links.masses, np.arange(0, len(links.masses), len(links.masses) // units))
    drawn = touch.scatter * rng.normal(size=1 + 2 * shapes)
    rough = touch.unit_scatter * rng.normal(size=units)
    on_object = touch.arm_object * np.maximum(1 + drawn[0] + rough, LOWEST)
    on_world = touch.arm_world * np.maximum(1 + drawn[1 : 1 + shapes] + rough[:, None], LOWEST)
    discs = Discs(
        link=links.hole_link, height=links.hole_height, radius=width / 2 - round_edge, edge=round_edge,
        hardness=touch.hardness * np.sqrt(share), stiffness=stiffness,
        damping=2 * touch.damping_ratio * np.sqrt(stiffness * masses), loss=touch.loss, on_object=on_object,
        on_world=on_world,
    )  # fmt: skip
    world = ContactWorld(
        kind=kind, half=half, edge=edge, place=place, hardness=touch.world_hardness, stiffness=touch.world_stiffness,
        damping=2 * touch.world_damping_ratio * float(np.sqrt(touch.world_stiffness * object.mass)),
        loss=touch.world_loss, friction=touch.object_world * np.maximum(1 + drawn[1 + shapes :], LOWEST),
    )  # fmt: skip
    contacts = Contacts(
        object=np.zeros((units, solids, 3)), world=np.zeros((units, shapes, 3)),
        lying=np.zeros((len(object.points), shapes, 3)), near=np.zeros((units, solids + shapes, 3)),
        arm_object=np.zeros((units, 3)), arm_world=np.zeros((units, shapes, 3)), object_world=np.zeros((shapes, 3)),
    )  # fmt: skip
    return discs, world, contacts
