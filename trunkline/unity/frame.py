"""From MuJoCo's frame (right-handed, z up) to Unity's (left-handed, y up): y and z change places.

The map is a reflection, so rotations keep their axis, mapped, and turn the other way.
"""

import numpy as np
from numpy.typing import ArrayLike


def unity_position(position: ArrayLike) -> np.ndarray:
    """Positions or directions (..., 3) as Unity's (x, y, z)."""
    return np.asarray(position)[..., [0, 2, 1]]


def unity_obj(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    """An OBJ file that Unity imports at the right place, with its faces outwards.

    Unity takes an OBJ as right-handed and negates x, and the order of the corners. Vertices are
    therefore written as (-x, z, y), a proper rotation, with the faces as they are; the MuJoCo importer does
    the same (`ObjMeshImportUtility.CopyAndScaleOBJFile`).

    Args:
        vertices: m, in MuJoCo's frame. Shape (n, 3).
        faces: vertex indices, counter-clockwise from outside. Shape (m, 3).
    """
    rotated = unity_position(vertices) * [-1, 1, 1]
    lines = ["v {:.6f} {:.6f} {:.6f}".format(*vertex) for vertex in rotated]  # as many digits as they come with
    lines += ["f {} {} {}".format(*face) for face in np.asarray(faces) + 1]
    return ("\n".join(lines) + "\n").encode()


def unity_volume(values: np.ndarray) -> bytes:
    """A grid as the raw bytes of a Unity Texture3D of format RHalf: little-endian 16-bit floats, x fastest.

    Args:
        values: indexed along MuJoCo's x, y, z. Shape (nx, ny, nz). The texture's is (nx, nz, ny).
    """
    return np.ascontiguousarray(values.transpose(1, 2, 0), dtype="<f2").tobytes()
