"""All three maps from their inputs."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from trunkline.kinematics.panda.downward import sample_downward
from trunkline.kinematics.reachability.hybrid import minkowski_field, swept_cells
from trunkline.kinematics.reachability.reach_signal import THRESHOLD, packed
from trunkline.kinematics.reachability.rigid import profile, rigid_field
from trunkline.kinematics.reachability.settings import HybridMapSettings, RigidSettings
from trunkline.kinematics.reachability.soft import SoftShape, soft_fields
from trunkline.kinematics.reachability.tilted import Pairs, draw_pairs, tilted_field
from trunkline.kinematics.reachability.tips import TipSource
from trunkline.kinematics.reachability.workspace_surface import WorkspaceSurfaces
from trunkline.kinematics.sdf.grid import Lattice
from trunkline.kinematics.sdf.mesh import TriangleMesh, surface


@dataclass
class Map:
    """A signed distance `field` (m, negative inside) on `lattice`, and its surface."""

    field: np.ndarray
    lattice: Lattice
    mesh: TriangleMesh


@dataclass
class TiltedMap(Map):
    """A hybrid map with the end effector `tilt` rad off straight down, and the `pairs` that sample it."""

    tilt: float
    pairs: Pairs


@dataclass
class SoftMaps:
    """Soft maps on one lattice.

    `fields` (B, X, Y, Z) at `angles` (B,) in rad, close enough together for linear blending, made to `shape`;
    `meshes` at `mesh_angles` (A,), those that were sampled.
    """

    angles: np.ndarray
    fields: np.ndarray
    lattice: Lattice
    shape: SoftShape
    mesh_angles: np.ndarray
    meshes: list[TriangleMesh]

    def at(self, angle: float) -> np.ndarray:
        """The field at the nearest of `angles`."""
        return self.fields[np.abs(self.angles - angle).argmin()]


@dataclass
class Maps:
    """Rigid and hybrid maps in the Panda's base frame, soft maps in the soft arm's, and how they were made; `surfaces`
    where gravity comes from any side: then the soft maps are there to be shown, at some tilts."""

    rigid: Map
    soft: SoftMaps
    hybrid: Map
    tilted: list[TiltedMap]
    mount_offset: float
    self_collision: bool
    surfaces: WorkspaceSurfaces | None = None

    def arrays(self) -> dict[str, np.ndarray]:
        """Grids by name (float16, m), each with `<name>_origin` and `<name>_spacing`; soft ones share theirs."""
        arrays = {}
        for name, space_map in self.in_space().items():
            arrays |= {name: space_map.field.astype(np.float16)} | _placement(name, space_map.lattice)
        names = [angle_name(angle) for angle in self.soft.angles]
        arrays |= dict(zip(names, packed(self.soft.fields), strict=True))
        arrays |= {"soft_angles": self.soft.angles, "soft_threshold": np.asarray(THRESHOLD)}
        arrays |= {"soft_tolerance": np.asarray(self.soft.shape.tolerance)}
        if self.surfaces:
            arrays |= self.surfaces.arrays()
        return arrays | _placement("soft", self.soft.lattice)

    def meshes(self) -> dict[str, TriangleMesh]:
        """Surfaces by name."""
        soft = {angle_name(a): m for a, m in zip(self.soft.mesh_angles, self.soft.meshes, strict=True)}
        return {name: space_map.mesh for name, space_map in self.in_space().items()} | soft

    def in_space(self) -> dict[str, Map]:
        """The maps in the Panda's base frame by name."""
        tilted = {angle_name(tilted_map.tilt, "hybrid"): tilted_map for tilted_map in self.tilted}
        return {"rigid": self.rigid, "hybrid": self.hybrid} | tilted


def angle_name(angle: float, kind: str = "soft") -> str:
    """`kind` and the angle in degrees, three digits before the point: `soft_060`, `soft_007p5`."""
    text = f"{np.degrees(angle):06.2f}".rstrip("0").rstrip(".")
    return f"{kind}_" + text.replace(".", "p")


def build_maps(
    tips_at: TipSource,
    sampled: np.ndarray,
    rigid: RigidSettings,
    shape: SoftShape,
    hybrid: HybridMapSettings,
    *,
    soft_voxel: float,
    step: float,
    most_triangles: int,
    seed: int,
    done: Callable[[str], None],
) -> Maps:
    """All maps.

    Args:
        tips_at: the soft arm's tips at any gravity angle.
        sampled: gravity angles that get a mesh, rad, ascending from 0. Shape (A,).
        soft_voxel: m. step: rad between soft fields, at most. done: hears of each part.
    """
    rigid_map = build_rigid(rigid, most_triangles, seed)
    done("rigid")
    soft_maps = build_soft(tips_at, sampled, shape, soft_voxel, step, most_triangles, done)
    cells, cells_lattice = swept_cells(tips_at(0.0).positions, hybrid.voxel)
    field, lattice = minkowski_field(
        rigid_map.field, rigid_map.lattice, cells, cells_lattice, hybrid.smoothing, hybrid.smallest
    )
    hybrid_map = Map(field, lattice, surface(field, lattice, most_triangles, "reachability.hybrid"))
    done("hybrid")
    tilted_maps = []
    for tilt in hybrid.tilts:
        tilted_maps.append(build_tilted(tips_at, rigid, hybrid, tilt, most_triangles, seed))
        done(angle_name(tilt, "hybrid"))
    return Maps(rigid_map, soft_maps, hybrid_map, tilted_maps, rigid.mount_offset, rigid.self_collision)


def build_tilted(
    tips_at: TipSource, rigid: RigidSettings, hybrid: HybridMapSettings, tilt: float, most_triangles: int, seed: int
) -> TiltedMap:
    """The hybrid map with the end effector `tilt` rad off straight down."""
    pairs = draw_pairs(tips_at(tilt).positions, tilt, hybrid.tilted_poses, seed,
                       mount_offset=rigid.mount_offset, avoid_collisions=rigid.self_collision)
    field, lattice = tilted_field(pairs, hybrid.voxel, hybrid.smoothing, hybrid.smallest)
    return TiltedMap(field, lattice, surface(field, lattice, most_triangles, "reachability.hybrid"), tilt, pairs)


def build_rigid(rigid: RigidSettings, most_triangles: int, seed: int) -> Map:
    """The set that the mount reaches with the end effector straight down."""
    poses = sample_downward(rigid.poses, seed, rigid.mount_offset, rigid.self_collision)
    outline = profile(poses, rigid.mount_offset, rigid.profile_voxel, rigid.closing, rigid.smallest)
    field, lattice = rigid_field(outline, rigid.voxel, rigid.smoothing)
    return Map(field, lattice, surface(field, lattice, most_triangles, "reachability.rigid"))


def blend_angles(sampled: np.ndarray, step: float) -> np.ndarray:
    """`sampled` angles (A,) and evenly between them as many as it takes to be no more than `step` apart; rad."""
    angles = [sampled[:1]]
    for low, high in zip(sampled[:-1], sampled[1:], strict=True):
        angles.append(np.linspace(low, high, int(np.ceil((high - low) / step - 1e-6)) + 1)[1:])
    return np.concatenate(angles)


def build_soft(
    tips_at: TipSource,
    sampled: np.ndarray,
    shape: SoftShape,
    voxel: float,
    step: float,
    most_triangles: int,
    done: Callable[[str], None],
) -> SoftMaps:
    """Fields at the `blend_angles`; meshes at the `sampled` ones. `done` hears of each field by its name."""
    angles = blend_angles(sampled, step)
    fields, lattice = soft_fields(tips_at, angles, shape, voxel, lambda angle: done(angle_name(angle)))
    chosen = [fields[np.abs(angles - a).argmin()] for a in sampled]
    meshes = [surface(field, lattice, most_triangles, "reachability.soft") for field in chosen]
    return SoftMaps(angles, fields, lattice, shape, sampled, meshes)


def _placement(name: str, lattice: Lattice) -> dict[str, np.ndarray]:
    return {f"{name}_origin": np.asarray(lattice.origin), f"{name}_spacing": np.asarray(lattice.spacing)}
