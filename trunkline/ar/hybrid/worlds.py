"""Where the robot works: floor, surfaces, a hook. A config group in `conf/hybrid/world/`."""

from dataclasses import dataclass
from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from trunkline.ar.hybrid.friction import CONDIM, SOLIMP, SOLREF, coefficients
from trunkline.model.arm.contact_geometry import WORLD

Metres = Annotated[float, Field(ge=-10, le=10)]
Size = Annotated[float, Field(gt=0, le=10)]
Material = Literal["wood", "plastic", "paper", "fabric", "slippery"]
HOOK_RADIUS, HOOK_LENGTH = 0.004, 0.3  # m, of the rod at whose lower end objects hang
RGBA = {"wood": (0.72, 0.55, 0.36, 1), "plastic": (0.75, 0.77, 0.8, 1), "paper": (0.95, 0.93, 0.88, 1),
        "fabric": (0.35, 0.5, 0.65, 1), "slippery": (0.85, 0.85, 0.9, 1)}  # fmt: skip


@dataclass
class SupportSurface:
    """A level board on which objects stand. top: the middle of its upper side, m. size: along x, y and z, m."""

    top: Annotated[list[Metres], Field(min_length=3, max_length=3)]
    size: Annotated[list[Size], Field(min_length=3, max_length=3)]
    material: Material


@dataclass
class WorldGeometry:
    """floor: its height, m, or null. surfaces: by name. hook: where objects hang, m, or null."""

    floor: Metres | None
    surfaces: dict[str, SupportSurface]
    hook: Annotated[list[Metres], Field(min_length=3, max_length=3)] | None

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Add geoms `floor`, `<surface>`, `hook` and the site `hook_end`, in place; none of them moves."""
        touch = {"contype": WORLD, "conaffinity": 0, "condim": CONDIM, "solref": SOLREF, "solimp": SOLIMP}
        world = spec.worldbody
        if self.floor is not None:
            world.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[3, 3, 0.1], pos=[0, 0, self.floor],
                           friction=coefficients("wood"), rgba=(0.9, 0.9, 0.88, 1), **touch)  # fmt: skip
        for name, surface in self.surfaces.items():
            half = np.array(surface.size) / 2
            world.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, size=half, rgba=RGBA[surface.material],
                           pos=np.array(surface.top) - [0, 0, half[2]],
                           friction=coefficients(surface.material), **touch)  # fmt: skip
        if self.hook is not None:
            end = np.array(self.hook, dtype=float)
            world.add_geom(name="hook", type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[HOOK_RADIUS, 0, 0],
                           fromto=[*end, *(end + [0, 0, HOOK_LENGTH])], friction=coefficients("plastic"),
                           rgba=(0.3, 0.3, 0.32, 1), **touch)  # fmt: skip
            world.add_site(name="hook_end", pos=end)
