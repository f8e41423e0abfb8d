"""Sheets: what is interpolated over directions of gravity is where the arm's tips are."""

import numpy as np
import pandas as pd
import pytest

from tests.support.bent_chain import hardening_stump
from tests.support.residual import everywhere
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY, downwards
from trunkline.kinematics.dataset.gravities import spread
from trunkline.kinematics.dataset.sampling import workspace_surface_at
from trunkline.kinematics.dataset.table import sample_table
from trunkline.kinematics.reachability import surface_check
from trunkline.kinematics.reachability.sampled import read_tips
from trunkline.kinematics.reachability.soft import SoftSettings, SurfaceSettings
from trunkline.kinematics.reachability.triangles import nearest_on_triangles
from trunkline.kinematics.reachability.weights import spline_matrix, spline_weights
from trunkline.kinematics.reachability.workspace_surface import (
    WorkspaceSurfaces,
    build_surfaces,
    finer,
    surface_triangles,
)
from trunkline.model.statics.chain import read_chain

LARGEST = np.radians(100)
SOFT = SoftSettings(
    tolerance=0.02,
    closing=0.02,
    smoothing=0.7,
    smallest=60,
    voxel=0.01,
    angle_step_deg=5.0,
    directions=60,
    steps=16,
    shown_deg=[0.0, 60.0],
    sheets=SurfaceSettings(50, 24, 12, 2),
)


@pytest.fixture(scope="module")
def chain():
    return read_chain(hardening_stump())


@pytest.fixture(scope="module")
def sheets(chain):
    return build_surfaces(chain, spread(50, LARGEST, crowd=True), 24, 12, 0.02, lambda: None)


def test_weights_give_the_nodes_back_and_every_linear_function():
    nodes = spread(30, LARGEST, crowd=True)
    matrix = spline_matrix(nodes)
    for index in (0, 7, 29):
        np.testing.assert_allclose(spline_weights(matrix, nodes, nodes[index]), np.eye(30)[index], atol=1e-9)
    down = downwards(0.8, 2.5)
    weights = spline_weights(matrix, nodes, down)
    assert weights.sum() == pytest.approx(1)
    np.testing.assert_allclose(weights @ nodes, down, atol=1e-9)


def test_a_smooth_function_is_interpolated_ever_better():
    errors = []
    for count in (25, 100):
        nodes = spread(count, LARGEST, crowd=True)
        matrix = spline_matrix(nodes)
        at = downwards(np.linspace(0.1, 1.7, 20), np.linspace(0, 6, 20))
        values = [spline_weights(matrix, nodes, down) @ np.sin(2 * nodes[:, 0] + nodes[:, 2]) for down in at]
        errors.append(np.abs(values - np.sin(2 * at[:, 0] + at[:, 2])).max())
    assert errors[1] < 0.2 * errors[0]
    assert errors[1] < 0.01


def test_the_nearest_point_of_triangles_is_as_near_as_any_of_many():
    rng = np.random.default_rng(0)
    points, corners = rng.normal(size=(40, 3)), rng.normal(size=(40, 3, 3, 3))
    nearest, distance = nearest_on_triangles(points, corners)
    np.testing.assert_allclose(np.linalg.norm(nearest - points, axis=1), distance, atol=1e-12)
    shares = rng.dirichlet(np.full(3, 0.5), 20_000)
    every = np.einsum("sc,ntck->ntsk", shares, corners).reshape(40, -1, 3)
    sampled = np.linalg.norm(every - points[:, None], axis=2).min(axis=1)
    assert (distance <= sampled + 1e-12).all()
    assert (sampled - distance).max() < 0.05


def test_the_nearest_point_before_a_face_an_edge_and_a_corner():
    corner = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], float)
    for point, expected in (([0.2, 0.3, 0.5], [0.2, 0.3, 0]), ([1, 1, 0.5], [0.5, 0.5, 0]), ([-1, -2, 3], [0, 0, 0])):
        nearest, distance = nearest_on_triangles(np.array([point], float), corner[None])
        np.testing.assert_allclose(nearest[0], expected, atol=1e-12)
        assert distance[0] == pytest.approx(np.linalg.norm(np.subtract(point, expected)))


def test_triangles_cover_the_lattice_and_close_around_the_arm():
    triangles = surface_triangles(5, 4)
    assert len(triangles) == 2 * 5 * 3
    assert len(np.unique(triangles, axis=0)) == len(triangles)
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 1).sum() == 2 * 5  # borders: around the first places, and around the last
    assert (count <= 2).all()


def test_a_sheet_between_the_directions_kept_is_where_the_arm_comes_to(chain, sheets):
    for angle, azimuth in ((0.4, 2.2), (1.0, 5.0), (1.6, 0.7)):
        down = downwards(angle, azimuth)
        solved, blended = workspace_surface_at(chain, STANDARD_GRAVITY * down, 24, 12), sheets.at(down)
        assert np.linalg.norm(blended - solved, axis=2).max() < 0.005 * chain.length
        other = sheets.at(downwards(angle, azimuth + np.pi))
        assert np.linalg.norm(other - solved, axis=2).max() > 0.02 * chain.length


def test_the_signal_is_the_distance_from_the_surface_less_the_tolerance(sheets):
    sheet = sheets.at(downwards(0.5, 1.0))
    rng = np.random.default_rng(1)
    points = rng.uniform(-0.3, 0.3, (30, 3)) + sheet.reshape(-1, 3).mean(axis=0)
    nearest, distance = sheets.nearest(sheet, points)
    corners = sheet.reshape(-1, 3)[sheets.triangles]
    every = nearest_on_triangles(points, np.broadcast_to(corners, (30, *corners.shape)))[1]
    np.testing.assert_allclose(distance, every, atol=1e-4)
    np.testing.assert_allclose(sheets.signal(sheet, points), distance - 0.02)
    assert np.abs(sheets.nearest(sheet, nearest)[1]).max() < 1e-9


def test_finer_points_lie_on_the_cells(sheets):
    sheet = sheets.at(downwards(0.5, 1.0))
    dense = finer(sheet, 3)
    assert len(dense) == 24 * 3 * (11 * 3 + 1)
    assert {tuple(point) for point in sheet.reshape(-1, 3)} <= {tuple(point) for point in dense}


def test_the_check_finds_good_sheets_good_and_bad_ones_bad(chain, sheets):
    how = {"beyond": 0.03, "count": 200, "seed": 0, "done": lambda _: None}
    for check in surface_check.check_surfaces(sheets, chain, SOFT, **how):
        assert check.iou > 0.95
        assert check.reachable > 0.99
        assert check.beyond < 0.01
    shifted = WorkspaceSurfaces(sheets.downs, sheets.points + np.float16(0.03), sheets.tolerance)
    assert all(check.iou < 0.8 for check in surface_check.check_surfaces(shifted, chain, SOFT, **how))


def test_a_surface_that_is_torn_is_refused_by_its_gravity(chain, monkeypatch):
    from trunkline.kinematics.dataset import sampling

    along = sampling._along

    def torn(*args):
        result = along(*args)
        result.snapped[5] = True
        return result

    monkeypatch.setattr(sampling, "_along", torn)
    with pytest.raises(InputError, match=r"gravity \[.*\]: found 1 of 32 tips by no steady way, expected a surface"):
        workspace_surface_at(chain, np.array([0.0, 0.0, -9.8]), 8, 4)


@pytest.mark.parametrize("azimuth", [0.0, 1.0])
def test_samples_say_whether_maps_are_of_one_tilt_or_of_gravity_from_any_side(chain, tmp_path, azimuth):
    rng = np.random.default_rng(0)
    downs = [downwards(angle, azimuth) for angle in (0.0, np.radians(70))]
    samples = pd.concat([sample_table(chain, down, 30, 8, 8, rng)[0] for down in downs])
    samples.assign(split="train").to_parquet(tmp_path / "samples.parquet")
    tips_at = read_tips(tmp_path / "samples.parquet", chain, SOFT, 0)
    if azimuth:
        assert tips_at.largest == pytest.approx(np.radians(70))
        np.testing.assert_allclose(np.degrees(tips_at.angles), [0, 60])  # of those shown, as far as the samples go
        np.testing.assert_array_equal(tips_at(0.0).positions, tips_at.fresh(0.0).positions)
    else:
        assert tips_at.largest is None
        np.testing.assert_allclose(np.degrees(tips_at.angles), [0, 70])
        assert len(tips_at(0.0).positions) == len(samples) // 2


@pytest.mark.parametrize("azimuth", [0.0, 1.0])
def test_maps_are_of_the_arm_s_tips_where_poses_tell_of_them(chain, tmp_path, azimuth):
    shift, rng = [0.003, -0.001, 0.002], np.random.default_rng(0)
    samples = pd.concat([
        sample_table(chain, downwards(angle, azimuth), 30, 8, 8, rng)[0] for angle in (0.0, np.radians(70))
    ])
    samples.assign(split="train").to_parquet(tmp_path / "samples.parquet")
    plain, arm = (read_tips(tmp_path / "samples.parquet", chain, SOFT, 0, learnt)
                  for learnt in (None, everywhere(shift, chain.tendons)))  # fmt: skip
    for angle in (0.0, np.radians(30)):
        apart = arm(angle).positions - plain(angle).positions
        np.testing.assert_allclose(apart, np.tile(shift, (len(apart), 1)), atol=1e-6)
        np.testing.assert_array_equal(arm(angle).lengths, plain(angle).lengths)


def test_a_surface_of_the_arm_s_tips_is_the_twin_s_moved(chain):
    shift, down = [0.003, -0.001, 0.002], np.array([[0.0, 0.0, -1.0]])
    learnt = everywhere(shift, chain.tendons)
    plain, arm = (build_surfaces(chain, down, 8, 6, 0.02, lambda: None, each) for each in (None, learnt))
    np.testing.assert_allclose(arm.points[0] - plain.points[0], np.broadcast_to(shift, (8, 6, 3)), atol=3e-4)
