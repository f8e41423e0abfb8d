"""What the robot grasps: one body of one shape. A config group in `conf/hybrid/object/`.

Its mass is spread evenly. A soft toy is a box whose edges are rounded by a quarter of its width and whose contacts
give way four times as slowly: it does not change its shape.
"""

from dataclasses import dataclass
from itertools import product
from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from trunkline.hybrid.friction import CONDIM, SOLIMP, SOLREF, coefficients
from trunkline.hybrid.touch import ARM, OBJECT, ROBOT, WORLD
from trunkline.hybrid.worlds import RGBA, Material

TOY_ROUNDING, TOY_SOFTNESS = 0.25, 4.0  # radius of its edges over its width; of contacts' time constants
HOLDS = 1  # MuJoCo's priority: the object's friction, of its material on TPU, counts for every contact that it makes

Shape = Literal["cylinder", "box", "sphere", "toy"]


@dataclass
class Thing:
    """An object.

    Attributes:
        diameter: m; of a box or toy, its width along x and y.
        height: m, along z; of a sphere, idle.
        mass: kg.
    """

    shape: Shape
    diameter: Annotated[float, Field(ge=0.005, le=0.5)]
    height: Annotated[float, Field(ge=0.005, le=1)]
    mass: Annotated[float, Field(gt=0, le=20)]
    material: Material

    @property
    def half_height(self) -> float:
        """From its centre to what it stands on, m."""
        return self.diameter / 2 if self.shape == "sphere" else self.height / 2

    def add_to(
        self, spec: mujoco.MjSpec, position: np.ndarray, quaternion=(1, 0, 0, 0), hook: str | None = None
    ) -> None:
        """Add the free body `object`, in place, its centre at `position`, m.

        Args:
            hook: a site from which it hangs, in the pose given, by equality `hanging`; to let it go, switch that off.
        """
        body = spec.worldbody.add_body(name="object", pos=position, quat=quaternion)
        body.add_freejoint(name="object")
        body.explicitinertial, body.mass, body.inertia = True, self.mass, self.mass * self.unit_inertia()
        body.ipos = [0, 0, 0]
        time, ratio = SOLREF
        soft = TOY_SOFTNESS if self.shape == "toy" else 1.0
        geom = body.add_geom(
            name="object_geom", contype=OBJECT, conaffinity=WORLD | ARM | ROBOT, condim=CONDIM, priority=HOLDS, mass=0,
            friction=coefficients(self.material), solref=[soft * time, ratio], solimp=SOLIMP, rgba=RGBA[self.material],
        )  # fmt: skip
        radius, half = self.diameter / 2, self.height / 2
        if self.shape == "cylinder":
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_CYLINDER, [radius, half, 0]
        elif self.shape == "box":
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_BOX, [radius, radius, half]
        elif self.shape == "sphere":
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, [radius, 0, 0]
        else:
            mesh = spec.add_mesh(name="toy")
            mesh.uservert = rounded_box(
                [self.diameter, self.diameter, self.height], TOY_ROUNDING * self.diameter
            ).ravel()
            geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, mesh.name
        if hook is not None:
            tie = spec.add_equality(
                name="hanging",
                type=mujoco.mjtEq.mjEQ_CONNECT,
                objtype=mujoco.mjtObj.mjOBJ_BODY,
                name1="object",
                name2="world",
            )
            tie.data[:3] = _into(quaternion, np.array(spec.site(hook).pos) - position)

    def unit_inertia(self) -> np.ndarray:
        """Moments of inertia of 1 kg about its axes, m². Shape (3,)."""
        width, height = self.diameter, self.height
        if self.shape == "sphere":
            return np.full(3, 0.1 * width**2)
        if self.shape == "cylinder":
            return np.array([*[width**2 / 16 + height**2 / 12] * 2, width**2 / 8])
        return np.array([*[(width**2 + height**2) / 12] * 2, width**2 / 6])  # a toy's rounding is left out


def _into(quaternion, vector: np.ndarray) -> np.ndarray:
    turned = np.zeros(3)
    inverse = np.zeros(4)
    mujoco.mju_negQuat(inverse, np.array(quaternion, dtype=float))
    mujoco.mju_rotVecQuat(turned, vector, inverse)
    return turned


def rounded_box(size, radius: float) -> np.ndarray:
    """Points whose hull is a box with round edges, m: an eighth of a sphere at each corner. Shape (8 · 10, 3)."""
    steps = [np.array(weights, dtype=float) for weights in product(range(4), repeat=3) if sum(weights) == 3]
    ball = np.array([step / np.linalg.norm(step) for step in steps])
    inner = np.maximum(np.array(size) / 2 - radius, 0)
    return np.concatenate([sign * (inner + radius * ball) for sign in map(np.array, product((-1, 1), repeat=3))])
