"""A package read back: maps as they were written, and another digest for another file."""

import hashlib
import json

import numpy as np
import pytest

from trunkline.errors import InputError
from trunkline.teleop.reach import MapReach
from trunkline.unity.reach_maps import convert_grids, describe_reach
from trunkline.unity.twin import MANIFEST
from trunkline.unity.unpacked import maps_of, package_digest

RNG = np.random.default_rng(0)
ARRAYS = {
    "rigid": RNG.normal(size=(4, 5, 6)),
    "rigid_origin": np.array([-0.8, -0.7, -0.4]),
    "rigid_spacing": np.array(0.2),
    "soft_000": RNG.normal(size=(3, 6, 4)),
    "soft_030": RNG.normal(size=(3, 6, 4)),
    "soft_angles": np.radians([0.0, 30.0]),
    "soft_origin": np.array([-0.1, -0.2, -0.3]),
    "soft_spacing": np.array(0.1),
    "soft_threshold": np.array(0.0),
    "soft_tolerance": np.array(0.02),
}


@pytest.fixture
def files():
    grids, blocks = convert_grids(ARRAYS, "grids.npz")
    manifest = {
        "grids": {name: block.model_dump() for name, block in blocks.items()},
        "reach": describe_reach(ARRAYS, None, "grids.npz").model_dump(),
        "sha256": {path: hashlib.sha256(data).hexdigest() for path, data in grids.items()},
    }
    return grids | {MANIFEST: json.dumps(manifest).encode()}


def test_maps_come_back_as_they_were_in_their_own_frames(files):
    found = maps_of(files)
    for name in ("rigid", "soft_000", "soft_030"):
        np.testing.assert_array_equal(found[name], ARRAYS[name].astype(np.float16))
    for name in ("rigid_origin", "rigid_spacing", "soft_origin", "soft_spacing", "soft_angles"):
        np.testing.assert_allclose(found[name], ARRAYS[name], atol=1e-12)


def test_reach_by_the_package_is_that_by_the_stage(files):
    one, other = MapReach.from_arrays(maps_of(files)), MapReach.from_arrays(ARRAYS)
    for point in RNG.uniform(-0.3, 0.3, (30, 3)):
        place = tuple(map(float, point))
        assert one.rigid(place, (0.0, 0.0, -1.0)).outside_by == pytest.approx(
            other.rigid(place, (0.0, 0.0, -1.0)).outside_by, abs=2e-3
        )


def test_a_file_that_is_not_the_manifests_is_named(files):
    digest = package_digest(files)
    path = next(path for path in files if path != MANIFEST)
    with pytest.raises(InputError, match=f"{path}: found sha256 .*expected"):
        package_digest(files | {path: files[path][:-1] + b"\x07"})
    with pytest.raises(InputError, match="found sha256 none"):
        package_digest({name: data for name, data in files.items() if name != path})
    assert package_digest(files | {MANIFEST: files[MANIFEST] + b" "}) != digest
    with pytest.raises(InputError, match=r"found no .*manifest\.json"):
        package_digest({})
