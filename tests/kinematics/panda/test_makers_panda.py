"""Our Panda and our labels against the Panda of the maker's URDF, and mink on it."""

import mujoco
import numpy as np
import pytest

from tests.kinematics.panda.mounts import assert_mounts
from tests.support.franka_panda import panda
from tests.support.mink_solver import Mink
from trunkline.kinematics.panda.collision import clearance
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN
from trunkline.kinematics.panda.labels import draw_points, label

OFFSET = 0.05  # m


@pytest.fixture(scope="module")
def model():
    return panda(OFFSET)


def test_frames_and_limits_are_the_makers(model):
    np.testing.assert_array_equal(model.jnt_range, np.column_stack([Q_MIN, Q_MAX]))
    assert_mounts(model, np.random.default_rng(0).uniform(Q_MIN, Q_MAX, (500, 7)), OFFSET, 1e-12)


def test_collisions_are_the_makers_but_for_what_the_map_simplifies(model):
    """The plug beside the flange is left out, and the base's sphere covers its capsule but for the back end."""
    uncovered = np.hypot(0.075 + 0.015, 0.06) + 0.06 - 0.15  # m, of the capsule beyond the sphere
    plug = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "link7_1")
    data, q = mujoco.MjData(model), np.random.default_rng(1).uniform(Q_MIN, Q_MAX, (3000, 7))
    touching, gaps = [], clearance(q, OFFSET)
    for pose in q:
        data.qpos[:] = pose
        mujoco.mj_forward(model, data)
        touching.append(any(plug not in contact.geom for contact in data.contact))
    touching = np.array(touching)
    assert touching.sum() > 50
    assert gaps[touching].max() < uncovered
    assert ((gaps < 0) & ~touching).mean() < 0.03


def test_labels_are_those_of_mink_on_the_makers_panda(model):
    points = draw_points(np.array([-0.9, -0.9, -0.5]), np.array([0.9, 0.9, 0.9]), 60, seed=5)
    ours = label(points, seed=0, starts=60, starts_in_doubt=0, mount_offset=OFFSET, avoid_collisions=True)
    solver = Mink(model)
    solved = np.array([solver.solve(point, 8, [5, i]) is not None for i, point in enumerate(points)])
    assert 10 < solved.sum() < 50
    assert (ours == solved).mean() >= 0.96  # a point by the base may tell the simpler shapes apart
