"""All three maps from their inputs, and the checks that tell how good they are."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trunkline.reachability.downward import sample_downward
from trunkline.reachability.grid import Lattice
from trunkline.reachability.hybrid_check import draw_inside_and_outside, find_poses
from trunkline.reachability.hybrid_map import minkowski_field, swept_cells
from trunkline.reachability.labels import Agreement, agreement, draw_points, label
from trunkline.reachability.mesh import Surface, contains, surface
from trunkline.reachability.rigid_map import profile, rigid_field
from trunkline.reachability.soft_map import SoftShape, heldout_overlap, soft_fields, soft_lattice
from trunkline.reachability.tips import TipSamples


@dataclass(frozen=True)
class RigidSettings:
    """See conf/reachability/config.yaml; lengths in m, smoothing in lattice steps."""

    mount_offset: float
    self_collision: bool
    poses: int
    profile_voxel: float
    voxel: float
    closing: float
    smoothing: float
    smallest: int


@dataclass(frozen=True)
class LabelSettings:
    """See conf/reachability/config.yaml; margin in m."""

    count: int
    starts: int
    starts_in_doubt: int
    margin: float


@dataclass(frozen=True)
class HybridSettings:
    """See conf/reachability/config.yaml; voxel in m, smoothing in lattice steps."""

    voxel: float
    smoothing: float
    smallest: int


@dataclass(frozen=True)
class SpotCheckSettings:
    """See conf/reachability/config.yaml; outside in m."""

    count: int
    outside: float


@dataclass(frozen=True)
class Map:
    """A signed distance ``field`` (m, negative inside) on ``lattice``, and its surface."""

    field: NDArray
    lattice: Lattice
    mesh: Surface


@dataclass(frozen=True)
class SoftMaps:
    """Soft maps on one lattice.

    ``fields`` (B, X, Y, Z) at ``angles`` (B,) in rad, close enough together for linear blending; ``meshes`` at
    ``mesh_angles`` (A,), those that were sampled.
    """

    angles: NDArray
    fields: NDArray
    lattice: Lattice
    mesh_angles: NDArray
    meshes: list[Surface]

    def at(self, angle: float) -> NDArray:
        """The field at the nearest of ``angles``."""
        return self.fields[np.abs(self.angles - angle).argmin()]


@dataclass(frozen=True)
class Maps:
    """Rigid and hybrid maps in the Panda's base frame, soft maps in the soft arm's, and how they were made."""

    rigid: Map
    soft: SoftMaps
    hybrid: Map
    mount_offset: float
    self_collision: bool

    def arrays(self) -> dict[str, NDArray]:
        """Grids by name (float16, m), each with ``<name>_origin`` and ``<name>_spacing``; soft ones share theirs."""
        arrays = {}
        for name, one in (("rigid", self.rigid), ("hybrid", self.hybrid)):
            arrays |= {name: one.field.astype(np.float16)} | _placement(name, one.lattice)
        names = [angle_name(angle) for angle in self.soft.angles]
        arrays |= dict(zip(names, self.soft.fields.astype(np.float16), strict=True))
        return arrays | {"soft_angles": self.soft.angles} | _placement("soft", self.soft.lattice)

    def meshes(self) -> dict[str, Surface]:
        """Surfaces by name."""
        soft = {angle_name(a): m for a, m in zip(self.soft.mesh_angles, self.soft.meshes, strict=True)}
        return {"rigid": self.rigid.mesh, "hybrid": self.hybrid.mesh} | soft


@dataclass(frozen=True)
class Check:
    """How good the maps are.

    ``rigid``: agreement of the rigid mesh (``claimed``, (N,)) with labels (``reachable``, (N,)) at ``points``
    (N, 3). ``heldout``: overlap at each inner gravity angle left out. ``found_inside``, ``found_outside``: shares
    of points inside the hybrid map and a little outside it for which a pose of both arms was found.
    """

    rigid: Agreement
    points: NDArray
    claimed: NDArray
    reachable: NDArray
    heldout: list[float]
    found_inside: float
    found_outside: float


def angle_name(angle: float) -> str:
    """``soft_`` and the angle in degrees, three digits before the point: ``soft_060``, ``soft_007p5``."""
    text = f"{np.degrees(angle):06.2f}".rstrip("0").rstrip(".")
    return "soft_" + text.replace(".", "p")


def build_maps(
    samples: TipSamples,
    rigid: RigidSettings,
    shape: SoftShape,
    hybrid: HybridSettings,
    *,
    soft_voxel: float,
    step: float,
    most_triangles: int,
    seed: int,
    done: Callable[[str], None],
) -> Maps:
    """All maps: ``soft_voxel`` in m; ``step`` in rad between soft fields, at most; ``done`` hears of each part."""
    rigid_map = build_rigid(rigid, most_triangles, seed)
    done("rigid")
    soft_maps = build_soft(samples, shape, soft_voxel, step, most_triangles, done)
    cells, cells_lattice = swept_cells(samples.tips[samples.hanging()], hybrid.voxel)
    field, lattice = minkowski_field(
        rigid_map.field, rigid_map.lattice, cells, cells_lattice, hybrid.smoothing, hybrid.smallest
    )
    hybrid_map = Map(field, lattice, surface(field, lattice, most_triangles, "reachability.hybrid"))
    done("hybrid")
    return Maps(rigid_map, soft_maps, hybrid_map, rigid.mount_offset, rigid.self_collision)


def build_rigid(rigid: RigidSettings, most_triangles: int, seed: int) -> Map:
    """The set that the mount reaches with the end effector straight down."""
    poses = sample_downward(rigid.poses, seed, rigid.mount_offset, rigid.self_collision)
    outline = profile(poses, rigid.mount_offset, rigid.profile_voxel, rigid.closing, rigid.smallest)
    field, lattice = rigid_field(outline, rigid.voxel, rigid.smoothing)
    return Map(field, lattice, surface(field, lattice, most_triangles, "reachability.rigid"))


def blend_angles(sampled: NDArray, step: float) -> NDArray:
    """``sampled`` angles (A,) and evenly between them as many as it takes to be no more than ``step`` apart; rad."""
    angles = [sampled[:1]]
    for low, high in zip(sampled[:-1], sampled[1:], strict=True):
        angles.append(np.linspace(low, high, int(np.ceil((high - low) / step - 1e-6)) + 1)[1:])
    return np.concatenate(angles)


def build_soft(
    samples: TipSamples, shape: SoftShape, voxel: float, step: float, most_triangles: int, done: Callable[[str], None]
) -> SoftMaps:
    """Fields at the ``blend_angles``; meshes at the sampled ones. ``done`` hears of each field by its name."""
    angles = blend_angles(samples.angles, step)
    lattice = soft_lattice(samples, shape, voxel)
    fields = soft_fields(samples, angles, lattice, shape, lambda angle: done(angle_name(angle)))
    sampled = [fields[np.abs(angles - a).argmin()] for a in samples.angles]
    meshes = [surface(field, lattice, most_triangles, "reachability.soft") for field in sampled]
    return SoftMaps(angles, fields, lattice, samples.angles, meshes)


def check_maps(
    maps: Maps,
    samples: TipSamples,
    labels: LabelSettings,
    spot_check: SpotCheckSettings,
    shape: SoftShape,
    *,
    step: float,
    seed: int,
    done: Callable[[str], None],
) -> Check:
    """Check the rigid map by inverse kinematics, the soft ones by leaving out angles, the hybrid by finding poses.

    ``done`` hears of each check, of the soft one once per angle left out.
    """
    corners = maps.rigid.mesh.vertices
    points = draw_points(corners.min(axis=0) - labels.margin, corners.max(axis=0) + labels.margin, labels.count, seed)
    claimed = contains(maps.rigid.mesh, points)
    reachable = label(
        points,
        seed=seed,
        starts=labels.starts,
        starts_in_doubt=labels.starts_in_doubt,
        mount_offset=maps.mount_offset,
        avoid_collisions=maps.self_collision,
    )
    done("labels")
    heldout = []
    for i in range(1, len(samples.angles) - 1):
        own = maps.soft.at(samples.angles[i])
        heldout.append(heldout_overlap(samples, i, own, step, maps.soft.lattice, shape))
        done(f"held-out {angle_name(samples.angles[i])}")
    inside, outside = (
        find_poses(
            some,
            samples.tips[samples.hanging()],
            maps.rigid.field,
            maps.rigid.lattice,
            seed=seed,
            mount_offset=maps.mount_offset,
            avoid_collisions=maps.self_collision,
        ).found.mean()
        for some in draw_inside_and_outside(
            maps.hybrid.field, maps.hybrid.lattice, spot_check.outside, spot_check.count, seed
        )
    )
    done("spot check")
    return Check(agreement(claimed, reachable), points, claimed, reachable, heldout, float(inside), float(outside))


def _placement(name: str, lattice: Lattice) -> dict[str, NDArray]:
    return {f"{name}_origin": np.asarray(lattice.origin), f"{name}_spacing": np.asarray(lattice.spacing)}
