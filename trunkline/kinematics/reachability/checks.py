"""How good the maps are: by inverse kinematics, at gravity angles without a grid, by finding poses of both arms."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from trunkline.kinematics.panda.labels import Agreement, agreement, draw_points, label
from trunkline.kinematics.reachability.hybrid_check import ReachingPoses, draw_inside_and_outside, find_poses, verified
from trunkline.kinematics.reachability.maps import Map, Maps, angle_name
from trunkline.kinematics.reachability.reach_signal import HeldOut, held_out, packed
from trunkline.kinematics.reachability.soft import SoftSettings
from trunkline.kinematics.reachability.surface_check import check_surfaces
from trunkline.kinematics.reachability.tilted import find_tilted
from trunkline.kinematics.reachability.tips import ArmTips, Tips
from trunkline.kinematics.sdf.grid import Lattice
from trunkline.kinematics.sdf.mesh import TriangleMesh, contains, unsimplified
from trunkline.kinematics.sdf.mesh_distance import mesh_distance
from trunkline.model.statics.chain import Chain


@dataclass(frozen=True)
class LabelSettings:
    """See conf/reachability/config.yaml; margin in m."""

    count: Annotated[int, Field(ge=100, le=1_000_000)]
    starts: Annotated[int, Field(ge=1, le=10000)]
    starts_in_doubt: Annotated[int, Field(ge=1, le=10000)]
    margin: Annotated[float, Field(gt=0, le=1)]


@dataclass(frozen=True)
class SpotCheckSettings:
    """See conf/reachability/config.yaml; outside in m."""

    count: Annotated[int, Field(ge=1, le=10_000)]
    outside: Annotated[float, Field(gt=0, le=0.2)]


@dataclass
class Check:
    """How good the maps are.

    `rigid`: agreement of the rigid mesh (`claimed`, (N,)) with labels (`reachable`, (N,)) at `points`
    (N, 3). `heldout`: the soft maps under gravities between theirs. `verified`: by name of each hybrid map, the shares
    of points inside it and a little outside it for which a pose of both arms was found and verified. `moved`: by name
    of each map (the soft ones together), how far simplification moved the surface at most, in voxels.
    """

    rigid: Agreement
    points: np.ndarray
    claimed: np.ndarray
    reachable: np.ndarray
    heldout: list[HeldOut]
    verified: dict[str, tuple[float, float]]
    moved: dict[str, float]


def check_maps(
    maps: Maps,
    tips_at: ArmTips,
    soft: SoftSettings,
    labels: LabelSettings,
    spot_check: SpotCheckSettings,
    *,
    seed: int,
    done: Callable[[str], None],
) -> Check:
    """Check all maps. `done` hears of each check, of the soft one once per gravity.

    Args:
        tips_at: of the soft arm. soft: how its maps were made.
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
    if maps.surfaces:
        how = {"beyond": spot_check.outside, "count": 10 * spot_check.count, "seed": seed}
        heldout = check_surfaces(maps.surfaces, tips_at.chain, soft, **how, done=done, learnt=tips_at.learnt)
    else:
        heldout = check_soft(maps, tips_at, spot_check, seed, done)
    verified_shares = check_hybrid(maps, tips_at.chain, tips_at, spot_check, seed)
    done("spot check")
    moved = {name: moved_voxels(hybrid.mesh, hybrid.field, hybrid.lattice) for name, hybrid in maps.in_space().items()}
    moved["soft"] = float(np.max([
        moved_voxels(mesh, maps.soft.at(angle), maps.soft.lattice)
        for mesh, angle in zip(maps.soft.meshes, maps.soft.mesh_angles, strict=True)
    ]))
    done("meshes")
    return Check(agreement(claimed, reachable), points, claimed, reachable, heldout, verified_shares, moved)


def check_soft(maps: Maps, tips_at: ArmTips, spot_check: SpotCheckSettings, seed: int, done) -> list[HeldOut]:
    """What a headset gets half-way between each two angles, where blending is at its worst; without gravity, against
    tips that the map was not made of."""
    soft, results = maps.soft, []
    fields = packed(soft.fields)
    for angle in (soft.angles[1:] + soft.angles[:-1]) / 2 if len(soft.angles) > 1 else soft.angles:
        tips = (tips_at.unseen or tips_at(angle)).positions
        results.append(held_out(fields, soft.angles, soft.lattice, soft.shape, tips, angle,
                                beyond=spot_check.outside, count=10 * spot_check.count, seed=seed))
        done(f"held-out {np.degrees(angle):g}°")
    return results


def check_hybrid(
    maps: Maps, chain: Chain, tips_at: ArmTips, spot_check: SpotCheckSettings, seed: int
) -> dict[str, tuple[float, float]]:
    """By hybrid map, shares of points inside and outside to which both arms together bring the soft tip."""
    weight = tips_at.unseen is None
    how = {"seed": seed, "mount_offset": maps.mount_offset, "avoid_collisions": maps.self_collision}

    def shares(space_map: Map, tips: Tips, find: Callable[[np.ndarray], ReachingPoses]) -> tuple[float, float]:
        sets = draw_inside_and_outside(space_map.field, space_map.lattice, spot_check.outside, spot_check.count, seed)
        arm = tips.lengths, chain, maps.mount_offset, weight, tips_at.learnt
        inside, outside = (float(verified(p, find(p), *arm).mean()) for p in sets)
        return inside, outside

    down, rigid = tips_at(0.0), maps.rigid
    verified_shares = {"hybrid": shares(
        maps.hybrid, down, lambda points: find_poses(points, down.positions, rigid.field, rigid.lattice, **how)
    )}  # fmt: skip
    for tilted in maps.tilted:
        tips = tips_at(tilted.tilt)
        find = functools.partial(find_tilted, pairs=tilted.pairs, tips=tips.positions, **how)
        verified_shares[angle_name(tilted.tilt, "hybrid")] = shares(tilted, tips, find)
    return verified_shares


def moved_voxels(mesh: TriangleMesh, field: np.ndarray, lattice: Lattice) -> float:
    """How far simplification moved the surface of `field` at most, in lattice steps."""
    whole = unsimplified(field, lattice)
    return mesh_distance((mesh.vertices, mesh.faces), whole, 0.5 * lattice.spacing) / lattice.spacing
