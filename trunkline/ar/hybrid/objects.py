"""What the robot grasps: one rigid body. A config group in `conf/hybrid/object/`.

Its mass is spread evenly, but for a basket's. A soft toy is a box whose edges are rounded by a quarter of its width and
whose contacts give way four times as slowly: it does not change its shape. A basket is a box with a handle, of which
the arm wraps the bar: see `trunkline/ar/hybrid/basket.py`.
"""

from dataclasses import dataclass, field
from itertools import product
from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from trunkline.ar.hybrid.basket import Basket, Part, parts_of, unit_inertia
from trunkline.ar.hybrid.friction import CONDIM, SOLIMP, SOLREF, coefficients
from trunkline.ar.hybrid.worlds import RGBA, Material
from trunkline.frames import wxyz_from_rotation
from trunkline.model.arm.contact_geometry import ARM, OBJECT, ROBOT, WORLD

TOY_ROUNDING, TOY_SOFTNESS = 0.25, 4.0  # radius of its edges over its width; of contacts' time constants
HOLDS = 1  # MuJoCo's priority: the object's friction, of its material on TPU, counts for every contact that it makes

TYPES = {
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER, "box": mujoco.mjtGeom.mjGEOM_BOX,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
}  # fmt: skip

Shape = Literal["cylinder", "box", "sphere", "toy", "basket"]
GRIP = "object_grip"  # the site in the middle of what the arm wraps


@dataclass
class ObjectShape:
    """What an object is like.

    Attributes:
        diameter: m; of a box or toy, its width along x and y; of a basket, its bar's.
        height: m, along z; of a sphere, idle; of a basket, its box's.
        mass: kg.
        basket: a basket's other sizes, idle for other shapes.
    """

    shape: Shape
    diameter: Annotated[float, Field(ge=0.005, le=0.5)]
    height: Annotated[float, Field(ge=0.005, le=1)]
    mass: Annotated[float, Field(gt=0, le=20)]
    basket: Basket = field(default=Basket(), kw_only=True)

    def __post_init__(self):
        if self.shape == "basket":
            self.basket.require_room(self.diameter)

    @property
    def half_height(self) -> float:
        """From its centre of mass to what it stands on, m."""
        if self.shape == "basket":
            box = self.parts()["box"]
            return float(box.half[2] - box.place[2])
        return self.diameter / 2 if self.shape == "sphere" else self.height / 2

    @property
    def grip(self) -> np.ndarray:
        """The middle of what the arm wraps, in the body's frame, which is in its centre of mass, m. Shape (3,)."""
        return self.parts()["bar"].place if self.shape == "basket" else np.zeros(3)

    def parts(self) -> dict[str, Part]:
        """Of a basket, by their names."""
        return parts_of(self.basket, self.diameter, self.height)


@dataclass
class GraspObject(ObjectShape):
    """An object in a composed model, and the material of its surface."""

    material: Material

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
        touch = {
            "contype": OBJECT, "conaffinity": WORLD | ARM | ROBOT, "condim": CONDIM, "priority": HOLDS, "mass": 0,
            "friction": coefficients(self.material), "solref": [soft * time, ratio], "solimp": SOLIMP,
            "rgba": RGBA[self.material],
        }  # fmt: skip
        if self.shape == "basket":
            for name, part in self.parts().items():
                turn = wxyz_from_rotation(Rotation.from_matrix(part.turn))
                body.add_geom(name=f"object_{name}", type=TYPES[part.shape], size=_size(part.shape, part.half),
                              pos=part.place, quat=turn, **touch)  # fmt: skip
        elif self.shape == "toy":
            mesh = spec.add_mesh(name="toy")
            size = [self.diameter, self.diameter, self.height]
            mesh.uservert = rounded_box(size, TOY_ROUNDING * self.diameter).ravel()
            body.add_geom(name="object_geom", type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name, **touch)
        else:
            half = np.array([self.diameter, self.diameter, self.height]) / 2
            body.add_geom(name="object_geom", type=TYPES[self.shape], size=_size(self.shape, half), **touch)
        body.add_site(name=GRIP, pos=self.grip)
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
        if self.shape == "basket":
            return unit_inertia(self.parts())
        if self.shape == "sphere":
            return np.full(3, 0.1 * width**2)
        if self.shape == "cylinder":
            return np.array([*[width**2 / 16 + height**2 / 12] * 2, width**2 / 8])
        return np.array([*[(width**2 + height**2) / 12] * 2, width**2 / 6])  # a toy's rounding is left out


def object_geoms(model: mujoco.MjModel) -> np.ndarray:
    """Numbers of the object's geoms in a composed model; none if there is no object."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "object")
    return np.flatnonzero(model.geom_bodyid == body)


def touched(model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """Whether the arm touches the object, in each pose of a composed model. Shapes (B, nq) to (B,)."""
    object, arm = object_geoms(model), np.flatnonzero(model.geom_contype & ARM)
    data, touching = mujoco.MjData(model), np.zeros(len(qpos), dtype=bool)
    for row in np.flatnonzero(np.isfinite(qpos).all(axis=1)):
        data.qpos[:] = qpos[row]
        mujoco.mj_fwdPosition(model, data)
        pairs = data.contact.geom[data.contact.dist <= 0]
        touching[row] = (np.isin(pairs, object).any(axis=1) & np.isin(pairs, arm).any(axis=1)).any()
    return touching


def _size(shape: str, half: np.ndarray) -> list[float]:
    """MuJoCo's size of a cylinder, box or sphere from half its sizes (3,), m."""
    return {"cylinder": [half[0], half[2], 0], "box": list(half), "sphere": [half[0], 0, 0]}[shape]


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
