"""A finished package, read back: its digest, its maps in the base frames, as the stage `reachability` wrote them, the
calibrated model, the arm whole, and what holds it."""

import hashlib
import json
import math
from pathlib import Path

import mujoco
import numpy as np
from pydantic import TypeAdapter

from trunkline.errors import InputError
from trunkline.kinematics.panda.mounts import Robot
from trunkline.unity.frame import unity_position
from trunkline.unity.package import MANIFEST, read_tarball
from trunkline.unity.unsupported import without_unsupported


def read_package(path: Path) -> dict[str, bytes]:
    """Contents by path in the package, of its .tgz or of the folder that it was unpacked into.

    Raises:
        InputError: if it is not a package.
    """
    if not path.is_dir():
        return read_tarball(path)
    files = {str(file.relative_to(path).as_posix()): file.read_bytes() for file in path.rglob("*") if file.is_file()}
    if MANIFEST not in files:
        raise InputError(f"{path}: found no {MANIFEST}, expected a package's folder")
    return files


def package_digest(files: dict[str, bytes]) -> str:
    """SHA-256 of the manifest, which has that of every other file: of another package, another digest.

    Args:
        files: contents by path, as `package.read_tarball` gives them.

    Raises:
        InputError: naming the file that is not the one that the manifest means.
    """
    manifest = manifest_of(files)
    for path, expected in manifest["sha256"].items():
        digest = hashlib.sha256(files[path]).hexdigest() if path in files else "none"
        if digest != expected:
            raise InputError(f"{path}: found sha256 {digest[:12]}, expected {expected[:12]} as the manifest says")
    return hashlib.sha256(files[MANIFEST]).hexdigest()


def maps_of(files: dict[str, bytes]) -> dict[str, np.ndarray]:
    """The arrays that `teleop.reach.MapReach.from_arrays` takes: `rigid`, the soft maps and their lattices,
    and the sheets where gravity comes from any side.

    Raises:
        InputError: a file is missing or of another size, or soft maps do not share a lattice.
    """
    manifest = manifest_of(files)
    arrays: dict[str, np.ndarray] = {"soft_angles": np.array(manifest["reach"]["angles"])}
    soft = manifest["reach"]["grids"]
    for name in soft:
        for key in ("shape", "origin", "spacing"):
            if manifest["grids"][name][key] != manifest["grids"][soft[0]][key]:
                complaint = f"found another {key} than that of {soft[0]}"
                raise InputError(f"{name}: {complaint}, expected one lattice for all soft maps")
    for name in (*soft, "rigid"):
        block = manifest["grids"][name]
        nx, ny, nz = block["shape"]  # along Unity's axes, x fastest
        arrays[name] = _numbers(files, block["file"], "<f2", (nz, ny, nx)).transpose(2, 0, 1)
        group = name.split("_")[0]
        arrays[f"{group}_origin"] = unity_position(block["origin"])  # the change of axes is its own inverse
        arrays[f"{group}_spacing"] = np.array(block["spacing"][0])
    arrays["soft_tolerance"] = np.array(manifest["reach"]["tolerance"])
    if sheets := manifest["reach"].get("sheets"):
        downs = unity_position(np.array(sheets["directions"]).reshape(-1, 3))
        shape = (len(downs), sheets["around"], sheets["along"], 3)
        arrays["sheets_points"] = unity_position(_numbers(files, sheets["file"], "<f2", shape))
        matrix = _numbers(files, sheets["weights"], "<f8", (len(downs), len(downs) + 4))
        arrays["sheets_downs"] = downs
        arrays["sheets_matrix"] = np.column_stack([matrix[:, :-3], unity_position(matrix[:, -3:])])  # of g itself
    return arrays


def model_of(files: dict[str, bytes]) -> mujoco.MjModel:
    """The calibrated model as plain MuJoCo steps it: without the motors' dead time and winches, and cables that rub.
    Its controls are commands, those of the file that Unity imports are pulls."""
    spec = arm_of(files)
    without_unsupported(spec)
    return spec.compile()


def arm_of(files: dict[str, bytes]) -> mujoco.MjSpec:
    """The calibrated arm, with the motors' dead time and winches, and cables that rub: what `hybrid.compose` takes."""
    return mujoco.MjSpec.from_string(file_of(files, "arm").decode())


def robot_of(files: dict[str, bytes]) -> Robot:
    """What holds the arm."""
    return TypeAdapter(Robot).validate_python(_hybrid(files)["robot"])


class _CheckedBlock(dict):
    """A block of a JSON file, and where it is, so that what is missing is named."""

    def __init__(self, values: dict, source: str) -> None:
        super().__init__(
            (name, _CheckedBlock(value, f"{source}: {name}") if isinstance(value, dict) else value)
            for name, value in values.items()
        )
        self._source = source

    def __missing__(self, name: str):
        raise InputError(f"{self._source}: found no {name}, expected one")


def file_of(files: dict[str, bytes], name: str) -> bytes:
    """The file that the manifest's block `hybrid` calls `name`."""
    return files[_hybrid(files)[name]]


def _hybrid(files: dict[str, bytes]) -> dict:
    manifest = manifest_of(files)
    if "hybrid" not in manifest:
        raise InputError(f"{MANIFEST}: found no block hybrid, expected a package that a preview can be made of")
    return manifest["hybrid"]


def _numbers(files: dict[str, bytes], path: str, kind: str, shape: tuple[int, ...]) -> np.ndarray:
    """A file's numbers of a `kind`, raw, in this shape."""
    expected = np.dtype(kind).itemsize * math.prod(shape)
    if path not in files or len(files[path]) != expected:
        complaint = f"found {len(files[path])} bytes" if path in files else "no such file"
        raise InputError(f"{path}: {complaint}, expected {expected} as the manifest's lattice says")
    return np.frombuffer(files[path], dtype=kind).reshape(shape)


def manifest_of(files: dict[str, bytes]) -> _CheckedBlock:
    """The package's manifest; what is missing in it is an error that names it."""
    if MANIFEST not in files:
        raise InputError(f"package: found no {MANIFEST}, expected one of the stage package_unity")
    try:
        manifest = json.loads(files[MANIFEST].decode(errors="replace"))
    except json.JSONDecodeError as error:
        raise InputError(f"{MANIFEST}: found no JSON at character {error.pos}, expected some") from None
    if not isinstance(manifest, dict):
        raise InputError(f"{MANIFEST}: found no block, expected one")
    return _CheckedBlock(manifest, MANIFEST)
