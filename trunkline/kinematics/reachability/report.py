"""What is said about the maps: how well they agree with what the arms can do, and how they are made."""

import numpy as np
import pandas as pd

from trunkline.kinematics.reachability.checks import Check
from trunkline.kinematics.reachability.maps import Maps
from trunkline.kinematics.sdf.mesh import TriangleMesh


def heldout_table(check: Check) -> pd.DataFrame:
    """A row for each gravity between the soft maps', in degrees, by angle."""
    table = pd.DataFrame(check.heldout).rename(columns={"angle": "angle_deg", "azimuth": "azimuth_deg"})
    for name in ("angle_deg", "azimuth_deg"):
        table[name] = np.degrees(table[name]).round(6)
    return table.sort_values("angle_deg", ignore_index=True)


def summary(maps: Maps, check: Check) -> dict:
    """The maps in a few numbers, for metrics.json; NaN, which Python's own `min` and `max` may pass over, stays."""
    soft = maps.soft.meshes
    space = {name: mesh_summary(space_map.mesh, check.moved[name]) for name, space_map in maps.in_space().items()}
    shares = {
        name: space[name] | {"found_inside": inside, "found_outside": outside}
        for name, (inside, outside) in check.verified.items()
    }
    return shares | {
        "rigid": check.rigid._asdict() | space["rigid"],
        "soft": {
            "heldout_iou_min": np.min([space_map.iou for space_map in check.heldout]),
            "heldout_reachable_min": np.min([space_map.reachable for space_map in check.heldout]),
            "heldout_beyond_max": np.max([space_map.beyond for space_map in check.heldout]),
            "watertight": all(mesh.is_closed() for mesh in soft),
            "triangles": max(len(mesh.faces) for mesh in soft),
            "moved_voxels": check.moved["soft"],
        },
    }


def mesh_summary(mesh: TriangleMesh, moved: float) -> dict:
    return {"watertight": mesh.is_closed(), "triangles": len(mesh.faces), "moved_voxels": moved}
