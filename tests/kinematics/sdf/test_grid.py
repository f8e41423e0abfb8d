"""Lattices, distance fields, blending and meshes on shapes whose distances are known."""

import numpy as np
import pytest
import trimesh

from trunkline.errors import InputError
from trunkline.kinematics.sdf.grid import (
    Lattice,
    blend,
    close_gaps,
    distance_from_cells,
    drop_specks,
    overlap,
    redistance,
    without_specks,
)
from trunkline.kinematics.sdf.mesh import LEVEL, TriangleMesh, contains, surface, unsimplified, write_obj
from trunkline.kinematics.sdf.mesh_distance import mesh_distance

SPACING = 0.01  # m


def lattice_around(radius, margin=0.05):
    return Lattice.around([-radius] * 3, [radius] * 3, SPACING, margin)


def points(lattice):
    return np.stack(np.meshgrid(*lattice.axes(), indexing="ij"), axis=-1)


def ball(lattice, radius, center=(0, 0, 0)):
    return np.linalg.norm(points(lattice) - center, axis=-1) - radius


def test_lattice_covers_its_box_and_goes_through_zero():
    lattice = Lattice.around([-0.123, 0.05], [0.2, 0.31], SPACING, 0.03)
    for axis, lower, upper in zip(lattice.axes(), [-0.123, 0.05], [0.2, 0.31], strict=True):
        assert lower - 0.03 - SPACING < axis[0] <= lower - 0.03
        assert upper + 0.03 <= axis[-1] < upper + 0.03 + SPACING
        np.testing.assert_allclose(axis / SPACING, np.round(axis / SPACING), atol=1e-9)


def test_sampling_a_linear_field_is_exact():
    lattice = lattice_around(0.1)
    slope = np.array([1.0, -2.0, 0.5])
    inside = np.random.default_rng(0).uniform(-0.1, 0.1, size=(50, 3))
    np.testing.assert_allclose(lattice.sample(points(lattice) @ slope, inside), inside @ slope, atol=1e-12)


def test_occupied_cells_are_those_of_the_points():
    lattice = lattice_around(0.05)
    cells = lattice.occupancy(np.array([[0.011, -0.02, 0.0], [5.0, 0.0, 0.0]]))
    assert cells.sum() == 1
    np.testing.assert_allclose(points(lattice)[cells][0], [0.01, -0.02, 0.0], atol=1e-12)


def test_distance_of_a_ball_from_its_cells():
    lattice = lattice_around(0.2)
    true = ball(lattice, 0.2)
    assert np.abs(distance_from_cells(true < 0, SPACING) - true).max() < 0.7 * SPACING


def test_redistance_recovers_distances_from_values_near_zero():
    lattice = lattice_around(0.2)
    true = ball(lattice, 0.2)
    clipped = np.clip(true, -1.5 * SPACING, 1.5 * SPACING)
    result = redistance(clipped, SPACING)
    assert np.abs(result - true).max() < 0.7 * SPACING
    assert (np.sign(result) == np.sign(true)).all()


def test_closing_fills_narrow_gaps_only():
    cells = np.zeros((40, 40), bool)
    cells[10:30, 5:15] = cells[10:30, 18:25] = cells[10:30, 35:38] = True
    closed = close_gaps(cells, 3.0)
    assert closed[12:28, 15:18].all()
    assert not closed[:, 27:33].any()
    assert (closed | ~cells).all()


def test_specks_vanish_inside_and_outside():
    cells = np.zeros((30, 30, 30), bool)
    cells[5:20, 5:20, 5:20] = True
    cells[10, 10, 10] = False
    cells[25, 25, 25] = True
    clean = drop_specks(cells, 10)
    assert clean[10, 10, 10]
    assert not clean[25, 25, 25]
    assert clean.sum() == 15**3
    field = without_specks(distance_from_cells(cells, SPACING), SPACING, 10)
    np.testing.assert_array_equal(field < 0, clean)


def test_blend_of_two_balls_half_way_is_the_ball_between():
    lattice = lattice_around(0.2)
    fields = np.stack([ball(lattice, 0.10), ball(lattice, 0.16)])
    angles = np.array([0.2, 0.6])
    np.testing.assert_allclose(blend(fields, angles, 0.4), ball(lattice, 0.13), atol=1e-12)
    np.testing.assert_array_equal(blend(fields, angles, 0.2), fields[0])
    np.testing.assert_array_equal(blend(fields, angles, 9.0), fields[1])


def test_overlap_of_balls_is_the_ratio_of_volumes():
    lattice = lattice_around(0.2)
    assert overlap(ball(lattice, 0.1), ball(lattice, 0.2)) == pytest.approx(1 / 8, rel=0.02)
    assert overlap(ball(lattice, 0.1), ball(lattice, 0.1)) == 1.0
    assert overlap(ball(lattice, -1), ball(lattice, 0.1)) == 0.0


def test_two_empty_sets_are_no_match():
    nothing = ball(lattice_around(0.2), -1)
    with pytest.raises(InputError, match="overlap of two maps: found both empty"):
        overlap(nothing, nothing)


@pytest.mark.parametrize("most", [20_000, 2_000])
def test_mesh_of_a_ball_is_closed_outward_and_near(most):
    lattice = lattice_around(0.2)
    mesh = surface(ball(lattice, 0.2), lattice, most, "reachability.soft")
    assert len(mesh.faces) <= most
    assert mesh.is_closed()
    assert mesh.mesh.volume == pytest.approx(4 / 3 * np.pi * 0.2**3, rel=0.01)
    whole = unsimplified(ball(lattice, 0.2), lattice)
    assert mesh_distance((mesh.vertices, mesh.faces), whole, 0.5 * SPACING) < 0.25 * SPACING


def test_mesh_of_a_set_that_leaves_the_lattice_is_closed():
    lattice = lattice_around(0.1, margin=0.0)
    assert surface(ball(lattice, 0.12), lattice, 8000, "reachability.soft").is_closed()


def test_mesh_of_a_field_that_is_exactly_zero_on_lattice_points_is_closed():
    lattice = lattice_around(0.1)
    box = np.abs(points(lattice)).max(axis=-1) - 0.1
    assert (box == 0).any() or np.isclose(box, 0).any()
    assert surface(np.round(box, 12), lattice, 8000, "reachability.soft").is_closed()


def test_mesh_of_nothing_is_refused():
    lattice = lattice_around(0.1)
    with pytest.raises(InputError, match="params.yaml: reachability.soft.voxel: found 0.01 m and an empty map"):
        surface(ball(lattice, -1.0), lattice, 8000, "reachability.soft")


def test_mesh_that_needs_more_triangles_is_refused():
    lattice = lattice_around(0.2)
    refused = r"soft.voxel: found 0.01 m and \d+ triangles, expected a closed mesh of at most .* 4"
    with pytest.raises(InputError, match=refused):
        surface(np.abs(ball(lattice, 0.14)) - 0.04, lattice, 4, "reachability.soft")


def test_contains_knows_a_shell():
    lattice = lattice_around(0.2)
    shell = np.abs(ball(lattice, 0.14)) - 0.04
    mesh = surface(shell, lattice, 3000, "reachability.soft")
    inside = np.random.default_rng(0).uniform(-0.25, 0.25, size=(1000, 3))
    true = np.abs(np.linalg.norm(inside, axis=1) - 0.14) - 0.04
    clear = np.abs(true) > 0.006
    np.testing.assert_array_equal(contains(mesh, inside)[clear], (true < 0)[clear])


def test_obj_reads_back_as_the_same_closed_mesh(tmp_path):
    lattice = lattice_around(0.1)
    mesh = surface(ball(lattice, 0.1), lattice, 2000, "reachability.soft")
    write_obj(tmp_path / "ball.obj", mesh, "ball")
    read = trimesh.load_mesh(tmp_path / "ball.obj")
    assert read.is_watertight
    assert len(read.faces) == len(mesh.faces)
    assert read.volume == pytest.approx(mesh.mesh.volume, rel=1e-4)


def test_a_surface_that_touches_lattice_points_reads_back_as_closed(tmp_path):
    """Its vertices there have the same digits: as it comes from marching cubes, readers find it open."""
    lattice = lattice_around(0.1)
    middle = ball(lattice, 0.0)
    nearest = np.abs(middle - 0.1).argmin()
    touching = ball(lattice, middle.ravel()[nearest] - LEVEL * lattice.spacing - 1e-8)
    raw, mesh = TriangleMesh(*unsimplified(touching, lattice)), surface(touching, lattice, 10**6, "reachability.rigid")
    read = []
    for name, shape in (("raw", raw), ("mesh", mesh)):
        write_obj(tmp_path / f"{name}.obj", shape, name)
        read.append(trimesh.load_mesh(tmp_path / f"{name}.obj"))
    assert raw.is_closed()
    assert not read[0].is_watertight
    assert read[1].is_watertight
    assert len(read[1].faces) == len(mesh.faces) < len(raw.faces)
