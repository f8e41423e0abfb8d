"""The study of certificates: the lab's arm is brought where it is sent, and its table counts what lies inside."""

import numpy as np
import pytest

from demo.plants.bench import LOOSE
from demo.plants.choice import plant_of
from demo.rig import ROOT, Config
from studies.certificate import Slow, told_lines, true_tips
from trunkline.arm.spiral import spiral_chain
from trunkline.certificate.budget import Budget
from trunkline.certificate.poses import Poses
from trunkline.frames import STANDARD_GRAVITY
from trunkline.pipeline.config import load_config


def test_the_table_counts_the_tips_inside():
    tips = np.array([[0.0, 0, 0], [0, 0, 0.02], [0, 0.005, 0], [0, 0, 0.001]])
    found = Budget(np.zeros((4, 3)), [], np.zeros(4), np.full(4, 0.01))
    loose, back = np.array([False, False, False, True]), np.array([False, True, False, False])
    lines = told_lines(tips, found, loose, back)
    assert lines[2].startswith("| all | 75.0 % | 4 | 10.0 mm |")
    assert lines[3].startswith("| pulled, from straight | 100.0 % | 2 |")
    assert lines[4].startswith("| pulled, from beyond | 0.0 % | 1 |")
    assert lines[4].endswith("| 2.0 |")


def test_a_hanging_arm_is_found_where_its_rest_is():
    settings = load_config(Config, "record", ROOT)
    plant, drawn = plant_of(settings), settings.arm
    last = spiral_chain(drawn.length, drawn.base_width, drawn.tip_width, drawn.units).lengths[-1]
    poses = Poses(np.array([[0.0, 0.0, -STANDARD_GRAVITY]]), np.zeros((1, 3)))
    slow = Slow(0.2, 40.0, 0.1, 1.0, 0.1, 0.1, 0.1)
    loose, half = np.full((1, 3), -LOOSE), np.array([0, 0, -last / 2])
    tips = true_tips(plant, drawn.units, half, slow, poses, loose, np.array([False]))
    rested = plant.reach(loose, poses.gravity)
    assert np.linalg.norm(tips - rested) < 1e-3
    assert tips[0, 2] == pytest.approx(-drawn.length, abs=0.01)
