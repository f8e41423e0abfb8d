"""A package read back: maps as they were written, and another digest for another file."""

import contextlib
import functools
import hashlib
import json

import numpy as np
import pytest

from tests.support.folders import unpack
from trunkline.ar.teleop.reach import MapReach
from trunkline.errors import InputError
from trunkline.kinematics.dataset.gravities import spread
from trunkline.kinematics.reachability.workspace_surface import WorkspaceSurfaces
from trunkline.twin.package import MANIFEST, package_digest, read_package
from trunkline.unity.reach_maps import convert_grids, convert_sheets, describe_reach
from trunkline.unity.rounding import rounded
from trunkline.unity.unpacked import maps_of
from trunkline.unity.upm_package import write_tarball

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
POINTS = RNG.normal(scale=0.2, size=(20, 8, 5, 3)).astype(np.float16)
SHEETS = WorkspaceSurfaces(spread(20, 2.0, crowd=True), POINTS, 0.02)


@pytest.fixture(params=["one tilt", "any side"])
def arrays(request):
    return ARRAYS | (SHEETS.arrays() if request.param == "any side" else {})


@pytest.fixture
def files(arrays):
    grids, blocks = convert_grids(arrays, "grids.npz")
    surface, block = convert_sheets(arrays, "grids.npz")
    grids |= surface
    manifest = {
        "grids": {name: block.model_dump() for name, block in blocks.items()},
        "reach": describe_reach(arrays, block, "grids.npz").model_dump(),
        "sha256": {path: hashlib.sha256(data).hexdigest() for path, data in grids.items()},
    }
    return grids | {MANIFEST: json.dumps(manifest).encode()}


def test_maps_come_back_as_they_were_in_their_own_frames(files, arrays):
    maps = maps_of(files)
    assert maps.keys() == arrays.keys() - {"soft_threshold"}
    for name in maps:
        expected = arrays[name].astype(np.float16) if np.ndim(arrays[name]) > 3 else arrays[name]
        expected = rounded(expected) if np.ndim(expected) == 3 else expected
        np.testing.assert_allclose(maps[name], expected, atol=1e-12)


def keys_in(block, *before):
    """The ways to all values of a JSON file."""
    for key in block if isinstance(block, dict) else range(len(block)) if isinstance(block, list) else ():
        yield (*before, key)
        yield from keys_in(block[key], *before, key)


def test_whatever_the_manifest_has_in_place_of_a_value_is_one_line(files):
    """Or the value is read no more than as it stands."""
    manifest, refused = json.loads(files[MANIFEST]), 0
    for *way, last in keys_in({name: manifest[name] for name in ("grids", "reach")}):
        if isinstance(last, int) and last > 3:
            continue  # of long lists
        for value in (None, "x", -1, 0.5, 10**12, [], {}, [1, 2], ["x"], float("nan")):
            changed = json.loads(files[MANIFEST])
            block = functools.reduce(lambda inner, key: inner[key], way, changed)
            block[last] = value
            with contextlib.suppress(InputError):
                maps_of(files | {MANIFEST: json.dumps(changed).encode()})
                refused -= 1
            refused += 1
    assert refused > 100


def test_reach_by_the_package_is_that_by_the_stage(files, arrays):
    packaged, of_stage = MapReach.from_arrays(maps_of(files)), MapReach.from_arrays(arrays)
    down = (0.0, 0.0, -1.0)
    for point in RNG.uniform(-0.3, 0.3, (30, 3)):
        place = tuple(map(float, point))
        for gravity in (down, (0.48, 0.0, -((1 - 0.48**2) ** 0.5))):
            reading, expected = packaged.soft(place, gravity), of_stage.soft(place, gravity)
            assert reading.outside_by == pytest.approx(expected.outside_by, abs=2e-3)
            assert expected.where != "unknown"
        assert packaged.rigid(place, down).outside_by == pytest.approx(of_stage.rigid(place, down).outside_by, abs=2e-3)


def test_a_package_is_read_from_its_folder_as_from_its_tarball(files, tmp_path):
    write_tarball(tmp_path / "twin.tgz", files)
    assert read_package(unpack(files, tmp_path / "folder")) == read_package(tmp_path / "twin.tgz") == files
    with pytest.raises(InputError, match=r"found no .*manifest\.json, expected a package's folder"):
        read_package(tmp_path / "folder/Runtime")


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
