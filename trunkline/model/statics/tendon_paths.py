"""Tendons' paths through sites, cut into what the joints change and what they do not."""

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.model.arm_model import ArmModel


def tendon_holes(model: mujoco.MjModel, data: mujoco.MjData, units: np.ndarray):
    """Per tendon its name and its sites as (unit index, -1 for the base; world position)."""
    index_of = {0: -1} | {int(body): index for index, body in enumerate(units)}
    arm, holes = ArmModel(model), []
    for tendon, name in zip(arm.cables, arm.cable_names, strict=True):
        sites = arm.cable_sites(tendon)
        bodies = model.body_weldid[model.site_bodyid[sites]]
        path = [(index_of[int(b)], data.site_xpos[s]) for b, s in zip(bodies, sites, strict=True)]
        holes.append((name, path))
    return holes


def tendon_crossings(holes, data, base, to_base, anchors):
    """Split each path into chords that cross one joint and chords within one unit, which never change."""
    units, tendons = len(anchors), len(holes)
    hole_in, hole_out = np.zeros((units, tendons, 3)), np.zeros((units, tendons, 3))
    crosses, fixed_length = np.zeros((units, tendons)), np.zeros(tendons)
    for tendon, (name, path) in enumerate(holes):
        for (unit_a, world_a), (unit_b, world_b) in zip(path[:-1], path[1:], strict=True):
            if unit_a == unit_b:
                fixed_length[tendon] += np.linalg.norm(world_b - world_a)
                continue
            if abs(unit_a - unit_b) != 1:
                raise InputError(f"model: tendon {name!r}: found sites that skip a unit, expected one in each")
            (_, world_in), (outer, world_out) = sorted([(unit_a, world_a), (unit_b, world_b)], key=_unit_of)
            if crosses[outer, tendon]:
                raise InputError(f"model: tendon {name!r}: found a joint that it crosses twice, expected once")
            hole_in[outer, tendon] = to_base @ (world_in - data.xpos[base]) - anchors[outer]
            hole_out[outer, tendon] = to_base @ (world_out - data.xpos[base]) - anchors[outer]
            crosses[outer, tendon] = 1
    return hole_in, hole_out, crosses, fixed_length


def _unit_of(hole: tuple) -> int:
    return hole[0]
