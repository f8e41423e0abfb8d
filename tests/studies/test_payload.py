"""Grasps tried in a batch: mounts that differ are worlds that differ, and where the arm begins."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studies.payload.trials import PAID_OUT, Schedule, Tried, Tries, try_grasps
from tests.ar.hybrid.conftest import SIZE, rubbing_arm
from trunkline.ar.hybrid.compose import Placed, compose
from trunkline.ar.hybrid.objects import GraspObject
from trunkline.ar.hybrid.worlds import SupportSurface, WorldGeometry
from trunkline.frames import wxyz_from_rotation
from trunkline.kinematics.panda.mounts import FixedMount
from trunkline.model.arm.spiral import spiral_chain
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.rest import settle

BAR = GraspObject("cylinder", 0.04, 0.12, 0.1, "plastic")
LEVEL = Rotation.from_euler("x", 90, degrees=True)  # turns the bar's z to base -y
BESIDE = np.array([0.07, 0.0, -0.34])  # m, of the bar in the base frame
SHORT = Schedule(close=0.4, settle=0.05, lift=0.1, shakes=0, hold=0.05)
PULL = np.array([0.15, 0.0, 0.0])
NEAR = 1e-6  # m, to either side of a border


@pytest.fixture(scope="module")
def models():
    arm = rubbing_arm(spiral_chain(**SIZE), 8)
    hook = [float(value) for value in BESIDE + [0, 0, 0.17]]
    table = {"table": SupportSurface([0.0, 0.0, -0.7], [1.0, 1.0, 0.03], "wood")}
    placed = Placed(BAR, BESIDE, tuple(wxyz_from_rotation(LEVEL)), True)
    whole = compose(arm, FixedMount("fixed"), WorldGeometry(None, table, hook), placed).compile()
    return whole, compose(arm, FixedMount("fixed")).compile()


def tries_of(mounts: list[tuple[np.ndarray, Rotation]], before: np.ndarray | None = None) -> Tries:
    """The same grasp, as seen from the base, at mounts (position, turn)."""
    poses = [[*(p + turn.apply(BESIDE)), *wxyz_from_rotation(turn * LEVEL)] for p, turn in mounts]
    bases = [[*p, *wxyz_from_rotation(turn)] for p, turn in mounts]
    count = len(mounts)
    return Tries(
        np.array(poses), np.full(count, 0.1), np.tile(PULL, (count, 1)), np.full(count, 0.45), np.array(bases),
        None if before is None else np.tile(before, (count, 1)),
    )  # fmt: skip


def test_where_the_mount_stands_and_faces_changes_nothing(models):
    away = (np.array([1.0, -2.0, 0.3]), Rotation.from_euler("z", 110, degrees=True))
    tried = try_grasps(*models, tries_of([(np.zeros(3), Rotation.identity()), away]), SHORT)
    apart = np.abs(tried.path[0] - tried.path[1]).max(axis=1)
    touched = int(np.argmax(apart > 1e-9))
    assert touched > 4  # before the arm comes to the bar
    assert apart.max() < 5e-3  # then contacts enlarge what was rounded
    assert tried.distance[0].min() < 0.05  # the arm came to the bar


def test_a_tilted_mount_has_another_gravity(models):
    """Nothing is pulled and nothing near: what is let go falls along what is down in the tilted base frame."""
    tries = tries_of([(np.zeros(3), Rotation.from_euler("y", -60, degrees=True))])
    tries.pulls[:], tries.poses[:, 1] = 0.0, 0.5
    tried = try_grasps(*models, tries, SHORT)
    fallen = tried.path[0, -1] - tried.path[0, tried.let_go]
    assert fallen / np.linalg.norm(fallen) == pytest.approx([-np.sin(np.pi / 3), 0, -0.5], abs=0.02)


def test_an_arm_begins_at_rest_under_its_first_pulls(models):
    before = np.array([0.05, 0.0, 0.0])
    tries = tries_of([(np.zeros(3), Rotation.identity())], before)
    tries.pulls[:] = before
    tries.poses[:, 0] += 0.5  # out of the way
    hinges = slice(0, ArmModel(models[1]).hinge_count)
    bent = try_grasps(*models, tries, SHORT).qpos[0, hinges]
    straight = try_grasps(*models, replace(tries, before=None, pulls=0 * tries.pulls), SHORT).qpos[0, hinges]
    rest = settle(models[1], models[1].tendon_length0[:3] + [-0.05, PAID_OUT, PAID_OUT], np.array([0, 0, -9.81])).qpos
    rest = rest[0, hinges]
    assert np.abs(bent - rest).max() < 0.1 * np.abs(bent - straight).max()


def test_a_table_sinks_along_gravity(models):
    whole, alone = models
    tries = tries_of([(np.zeros(3), Rotation.identity())])
    low = np.array([0.3, 0.0, -0.7 + BAR.diameter / 2])
    tries.poses[:, :3], tries.pulls[:] = low, 0.0
    slow = Schedule(close=0.2, settle=0.05, lift=0.5, sink=0.1, shakes=0, hold=0.05)
    tried = try_grasps(whole, alone, tries, slow, ("table",))
    assert tried.path[0, -1, 2] - tried.path[0, tried.let_go, 2] == pytest.approx(-0.1 * 0.55, abs=0.006)


def tried(dropped=0.0, further=0.0) -> Tried:
    """A grasp of which the thing came `dropped` m down and `further` m from the arm since it was let go in row 2."""
    path, distance = np.zeros((1, 5, 3)), np.full((1, 5), 0.03)
    path[0, -1, 2], distance[0, -1] = -dropped, 0.03 + further
    path[0, :2], distance[0, :2] = 1.0, 1.0  # before it was let go: nobody asks
    return Tried(path, distance, 2, np.zeros((1, 3)), np.zeros((1, 1)))


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
    assert Tried(path, distance, 2, np.zeros((2, 3)), np.zeros((2, 1))).success(0.5, 0.25).tolist() == [False, False]
