"""Six places that a robot may hold its flange at, and touches of them by a headset."""

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.ar.session.registration import in_base, inverse, pose_of

UP = Rotation.from_euler("x", 90, degrees=True)  # of a reference frame whose y is up
TRUE = pose_of(np.array([0.4, -0.2, -0.9]), Rotation.from_euler("z", 35, degrees=True) * UP)  # reference in the base
PLACES = np.array(
    [[0.6, 0.3, 0.2], [0.6, -0.3, 0.7], [0.1, -0.6, 0.3], [0.1, 0.6, 0.7], [0.35, 0.0, 0.9], [0.5, 0.0, 0.1]]
)  # m, to which the flange reaches


def observed(places, rng, sigma):
    """Places (..., 3) in the reference frame, with noise of `sigma`, m, along each axis."""
    return in_base(inverse(TRUE), places) + rng.normal(scale=sigma, size=places.shape)


def directions(count, rng):
    """Unit vectors (count, 3)."""
    points = rng.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def at_reach(rng):
    """A point 0.9 m from the base, m (3,)."""
    about, height = rng.uniform(-np.pi, np.pi), rng.uniform(0.0, 0.6)
    away = np.sqrt(0.9**2 - height**2)
    return np.array([away * np.cos(about), away * np.sin(about), height])
