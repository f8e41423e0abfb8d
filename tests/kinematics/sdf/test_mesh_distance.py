"""Distances between meshes that are known."""

import numpy as np
import pytest
import trimesh

from trunkline.kinematics.sdf.mesh_distance import mesh_distance, surface_points


def parts(mesh):
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def test_balls_are_as_far_apart_as_their_radii():
    small, large = (parts(trimesh.creation.icosphere(subdivisions=4, radius=r)) for r in (0.1, 0.11))
    assert mesh_distance(small, large, 0.005) == pytest.approx(0.01, abs=2e-4)
    assert mesh_distance(small, small, 0.005) < 1e-12


def test_one_dent_counts_from_either_side():
    box = trimesh.creation.box((1, 1, 1)).subdivide().subdivide()
    dented = box.copy()
    corner = int(np.abs(box.vertices - [0, 0, 0.5]).sum(axis=1).argmin())
    dented.vertices[corner] -= [0, 0, 0.07]
    for pair in ((box, dented), (dented, box)):
        assert mesh_distance(*map(parts, pair), 0.02) == pytest.approx(0.07, abs=2e-3)


def test_every_triangle_around_a_vertex_counts():
    """A disc cut into forty sectors, and the same disc with a small ring around its middle."""
    count, step = 40, 0.1
    angles = 2 * np.pi * np.arange(count) / count
    rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])
    i, j = np.arange(count), np.roll(np.arange(count), -1)
    sectors = np.column_stack([np.zeros(count, int), i + 1, j + 1])
    outer = np.concatenate([np.column_stack([i + 1, i + 1 + count, j + 1 + count]),
                            np.column_stack([i + 1, j + 1 + count, j + 1])])
    middle = np.zeros((1, 3))
    plain = np.concatenate([middle, rim]), sectors
    ringed = np.concatenate([middle, 0.3 * step * rim, rim]), np.concatenate([sectors, outer])
    assert mesh_distance(plain, ringed, step) < 1e-12


def test_points_lie_dense_on_every_triangle():
    vertices, faces = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0.1]]), np.array([[0, 1, 2], [0, 1, 3]])
    points, owners = surface_points(vertices, faces, 0.1)
    assert np.abs(points[owners == 0][:, 2]).max() == 0
    assert np.abs(points[owners == 1][:, 1]).max() < 1e-15
    for corner in vertices:
        assert np.linalg.norm(points - corner, axis=1).min() < 1e-15
    grid = np.random.default_rng(0).dirichlet(np.ones(3), 200) @ vertices[faces[0]]
    assert np.linalg.norm(grid[:, None] - points[owners == 0], axis=2).min(axis=1).max() < 0.1
