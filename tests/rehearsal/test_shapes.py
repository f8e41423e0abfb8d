"""Distances to shapes against sampled surfaces, and a disc's nearest point against all of its points."""

import numpy as np
import pytest

from rehearsal.robot.shapes import BOX, CYLINDER, distance, nearest

SHAPES = {
    "box": (BOX, np.array([0.03, 0.02, 0.05]), 0.0),
    "toy": (BOX, np.array([0.02, 0.02, 0.04]), 0.01),
    "sphere": (BOX, np.zeros(3), 0.03),
    "capsule": (BOX, np.array([0.0, 0.0, 0.1]), 0.004),
    "cylinder": (CYLINDER, np.array([0.025, 0.025, 0.06]), 0.0),
}


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_going_by_the_distance_down_the_gradient_ends_on_the_surface(shape):
    """The step is as long as the distance says, and no shorter one would do: the gradient has length 1."""
    rng = np.random.default_rng(3)
    for point in rng.uniform(-0.15, 0.15, (200, 3)):
        away, gradient = distance(*shape, tuple(point))
        assert np.linalg.norm(gradient) == pytest.approx(1)
        landed, _ = distance(*shape, tuple(point - away * np.array(gradient)))
        assert landed == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_no_point_of_a_disc_is_nearer_than_its_nearest(shape):
    """Found within a few steps, each of which begins where the last has ended."""
    rng, checked = np.random.default_rng(4), 0
    for _ in range(10):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        side = np.cross(axis, [1.0, 0.2, 0.3])
        side /= np.linalg.norm(side)
        centre, radius, offset = rng.uniform(0.04, 0.1, 3), 0.03, (0.0, 0.0, 0.0)
        for _ in range(40):
            offset, away, _ = nearest(*shape, tuple(centre), tuple(axis), radius, offset)
        angle, share = np.meshgrid(np.linspace(0, 2 * np.pi, 91), np.linspace(0, 1, 11))
        disc = (
            radius
            * share[..., None]
            * (np.cos(angle)[..., None] * side + np.sin(angle)[..., None] * np.cross(axis, side))
        )
        least = min(distance(*shape, tuple(centre + point))[0] for point in disc.reshape(-1, 3))
        assert away <= least + 1e-6 or least < 0  # a disc never gets inside: its edge touches before
        checked += least > 0
        assert np.dot(offset, axis) == pytest.approx(0, abs=1e-12)
    assert checked > 3
