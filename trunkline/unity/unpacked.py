"""A finished package, read back: its maps in the base frames, as the stage `reachability` wrote them, and the arm as
plain MuJoCo steps it."""

import math

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.twin.package import arm_of, manifest_of
from trunkline.unity.frame import unity_position
from trunkline.unity.unsupported import without_unsupported


def maps_of(files: dict[str, bytes]) -> dict[str, np.ndarray]:
    """The arrays that `teleop.reach.MapReach.from_arrays` takes: `rigid`, the soft maps and their lattices,
    and the sheets where gravity comes from any side.

    Raises:
        InputError: the manifest has another form, a file is missing or of another size, or soft maps do not share a
            lattice.
    """
    manifest = manifest_of(files)
    reach, grids = manifest.block("reach"), manifest.block("grids")
    soft = reach.texts("grids")
    arrays: dict[str, np.ndarray] = {"soft_angles": np.array(reach.numbers("angles"))}
    for name in soft:
        for key in ("shape", "origin", "spacing"):
            if grids.block(name).numbers(key) != grids.block(soft[0]).numbers(key):
                complaint = f"found another {key} than that of {soft[0]}"
                raise InputError(f"{name}: {complaint}, expected one lattice for all soft maps")
    for name in (*soft, "rigid"):
        block = grids.block(name)
        nx, ny, nz = block.counts("shape", 3)  # along Unity's axes, x fastest
        origin, spacing = block.numbers("origin", 3), block.numbers("spacing", 3)
        arrays[name] = _numbers(files, block.text("file"), "<f2", (nz, ny, nx)).transpose(2, 0, 1)
        group = name.split("_")[0]
        arrays[f"{group}_origin"] = unity_position(origin)  # the change of axes is its own inverse
        arrays[f"{group}_spacing"] = np.array(spacing[0])
    arrays["soft_tolerance"] = np.array(reach.number("tolerance"))
    if reach.get("sheets") is not None:
        sheets = reach.block("sheets")
        count = max(len(sheets.numbers("directions")) // 3, 1)
        downs = unity_position(np.array(sheets.numbers("directions", 3 * count)).reshape(-1, 3))
        shape = (len(downs), sheets.count("around"), sheets.count("along"), 3)
        arrays["sheets_points"] = unity_position(_numbers(files, sheets.text("file"), "<f2", shape))
        matrix = _numbers(files, sheets.text("weights"), "<f8", (len(downs), len(downs) + 4))
        arrays["sheets_downs"] = downs
        arrays["sheets_matrix"] = np.column_stack([matrix[:, :-3], unity_position(matrix[:, -3:])])  # of g itself
    return arrays


def model_of(files: dict[str, bytes]) -> mujoco.MjModel:
    """The calibrated model as plain MuJoCo steps it: without the motors' dead time and winches, and cables that rub.
    Its controls are commands, those of the file that Unity imports are pulls."""
    spec = arm_of(files)
    without_unsupported(spec)
    return spec.compile()


def _numbers(files: dict[str, bytes], path: str, kind: str, shape: tuple[int, ...]) -> np.ndarray:
    """A file's numbers of a `kind`, raw, in this shape."""
    expected = np.dtype(kind).itemsize * math.prod(shape)
    if path not in files or len(files[path]) != expected:
        complaint = f"found {len(files[path])} bytes" if path in files else "no such file"
        raise InputError(f"{path}: {complaint}, expected {expected} as the manifest's lattice says")
    return np.frombuffer(files[path], dtype=kind).reshape(shape)
