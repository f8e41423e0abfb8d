"""A finished package, read back: its digest, and its maps in the base frames, as the stage `reachability` wrote
them."""

import hashlib
import json

import numpy as np

from trunkline.errors import InputError
from trunkline.unity.frame import unity_position
from trunkline.unity.twin import MANIFEST


def package_digest(files: dict[str, bytes]) -> str:
    """SHA-256 of the manifest, which has that of every other file: of another package, another digest.

    Args:
        files: contents by path, as `package.read_tarball` gives them.

    Raises:
        InputError: naming the file that is not the one that the manifest means.
    """
    manifest = _manifest(files)
    for path, expected in manifest["sha256"].items():
        found = hashlib.sha256(files[path]).hexdigest() if path in files else "none"
        if found != expected:
            raise InputError(f"{path}: found sha256 {found[:12]}, expected {expected[:12]} as the manifest says")
    return hashlib.sha256(files[MANIFEST]).hexdigest()


def maps_of(files: dict[str, bytes]) -> dict[str, np.ndarray]:
    """The arrays that `teleop.reach.MapReach.from_arrays` takes: `rigid`, the soft maps and their lattices."""
    manifest = _manifest(files)
    arrays: dict[str, np.ndarray] = {"soft_angles": np.array(manifest["reach"]["angles"])}
    for name in ("rigid", *manifest["reach"]["grids"]):
        block = manifest["grids"][name]
        nx, ny, nz = block["shape"]  # along Unity's axes, x fastest
        values = np.frombuffer(files[block["file"]], dtype="<f2").reshape(nz, ny, nx).transpose(2, 0, 1)
        arrays[name] = values
        group = name.split("_")[0]
        arrays[f"{group}_origin"] = unity_position(block["origin"])  # the change of axes is its own inverse
        arrays[f"{group}_spacing"] = np.array(block["spacing"][0])
    return arrays


def _manifest(files: dict[str, bytes]) -> dict:
    if MANIFEST not in files:
        raise InputError(f"package: found no {MANIFEST}, expected one of the stage package_unity")
    return json.loads(files[MANIFEST])
