"""Grasps tried in a batch: the arm comes to the object, supports sink, and what counts as held."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studies.payload.trials import Schedule, Tried, Tries, try_grasps
from tests.ar.hybrid.conftest import SIZE, rubbing_arm
from trunkline.ar.hybrid.compose import Placed, compose
from trunkline.ar.hybrid.objects import GraspObject
from trunkline.ar.hybrid.worlds import SupportSurface, WorldGeometry
from trunkline.frames import wxyz_from_rotation
from trunkline.kinematics.panda.mounts import FixedMount
from trunkline.model.arm.spiral import spiral_chain

BAR = GraspObject("cylinder", 0.04, 0.12, 0.1, "plastic")
LEVEL = Rotation.from_euler("x", 90, degrees=True)  # turns the bar's z to base -y
BESIDE = np.array([0.07, 0.0, -0.34])  # m, of the bar in the base frame
SHORT = Schedule(close=0.4, settle=0.05, lift=0.1, shakes=0, hold=0.05)
PULL = np.array([0.15, 0.0, 0.0])
NEAR = 1e-6  # m, to either side of a border


@pytest.fixture(scope="module")
def model():
    arm = rubbing_arm(spiral_chain(**SIZE), 8)
    hook = [float(value) for value in BESIDE + [0, 0, 0.17]]
    table = {"table": SupportSurface([0.0, 0.0, -0.7], [1.0, 1.0, 0.03], "wood")}
    placed = Placed(BAR, BESIDE, tuple(wxyz_from_rotation(LEVEL)), True)
    return compose(arm, FixedMount("fixed"), WorldGeometry(None, table, hook), placed).compile()


def bar_tries() -> Tries:
    """One grasp of the bar beside the arm."""
    pose = [*BESIDE, *wxyz_from_rotation(LEVEL)]
    return Tries(np.array([pose]), np.array([0.1]), PULL[None].copy(), np.array([0.45]))


def test_the_arm_comes_to_the_bar_that_hangs_until_it_is_let_go(model):
    tried = try_grasps(model, bar_tries(), SHORT)
    assert tried.distance.min() < 0.05
    loose = bar_tries()
    loose.pulls[:], loose.poses[:, 1] = 0.0, 0.5  # nothing is pulled and nothing near
    tried = try_grasps(model, loose, SHORT)
    assert np.abs(tried.path[0, : tried.let_go] - tried.path[0, 0]).max() < 1e-3
    fallen = tried.path[0, -1] - tried.path[0, tried.let_go]
    assert fallen / np.linalg.norm(fallen) == pytest.approx([0, 0, -1], abs=0.02)


def test_a_table_sinks_along_gravity(model):
    tries = bar_tries()
    low = np.array([0.3, 0.0, -0.7 + BAR.diameter / 2])
    tries.poses[:, :3], tries.pulls[:] = low, 0.0
    slow = Schedule(close=0.2, settle=0.05, lift=0.5, sink=0.1, shakes=0, hold=0.05)
    tried = try_grasps(model, tries, slow, ("table",))
    assert tried.path[0, -1, 2] - tried.path[0, tried.let_go, 2] == pytest.approx(-0.1 * 0.55, abs=0.006)


def tried(dropped=0.0, further=0.0) -> Tried:
    """A grasp of which the object came `dropped` m down and `further` m from the arm since it was let go in row 2."""
    path, distance = np.zeros((1, 5, 3)), np.full((1, 5), 0.03)
    path[0, -1, 2], distance[0, -1] = -dropped, 0.03 + further
    path[0, :2], distance[0, :2] = 1.0, 1.0  # before it was let go: nobody asks
    return Tried(path, distance, 2)


@pytest.mark.parametrize(
    ("dropped", "further", "held"),
    [(0.0, 0.0, True), (0.08 - NEAR, 0.0, True), (0.08 + NEAR, 0.0, False), (0.0, 0.02 - NEAR, True),
     (0.0, 0.02 + NEAR, False), (-0.08 - NEAR, 0.0, False), (0.0, -0.02, True), (np.nan, 0.0, False),
     (0.0, np.nan, False)],
)  # fmt: skip
def test_what_counts_as_held_in_a_trial(dropped, further, held):
    assert tried(dropped, further).success(sag=0.08, slip=0.02).tolist() == [held]


def test_at_a_border_itself_nothing_is_held_in_a_trial_either():
    path, distance = np.zeros((2, 5, 3)), np.zeros((2, 5))
    path[0, -1, 2], distance[1, -1] = -0.5, 0.25
    assert Tried(path, distance, 2).success(0.5, 0.25).tolist() == [False, False]
