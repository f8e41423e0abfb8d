"""Rotations in Unity's frame."""

import numpy as np


def unity_quaternion(wxyz: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4), w first, as the manifest's words have them in Unity, (x, y, z, w)."""
    return np.asarray(wxyz)[..., [1, 3, 2, 0]] * [1, 1, 1, -1]
