"""What is said about the maps: the worst angle counts, and one without an answer is not passed over."""

from types import SimpleNamespace

import numpy as np
import pytest

from trunkline.kinematics.panda.labels import Agreement
from trunkline.kinematics.reachability.reach_signal import HeldOut
from trunkline.kinematics.reachability.report import summary

MESH = SimpleNamespace(is_closed=lambda: True, faces=[0] * 5)
MAPS = SimpleNamespace(soft=SimpleNamespace(meshes=[MESH]), in_space=lambda: {"rigid": SimpleNamespace(mesh=MESH)})


def soft_of(*heldout):
    moved = {"rigid": 0.1, "soft": 0.1}
    check = SimpleNamespace(heldout=heldout, moved=moved, verified={}, rigid=Agreement(1.0, 1.0, 0.0, 1, 1))
    return summary(MAPS, check)["soft"]


def test_the_worst_angle_counts():
    table = soft_of(HeldOut(0.1, 0.9, 1.0, 0.0), HeldOut(0.2, 0.8, 0.99, 0.02))
    assert (table["heldout_iou_min"], table["heldout_reachable_min"], table["heldout_beyond_max"]) == (0.8, 0.99, 0.02)


@pytest.mark.parametrize("place", [0, 1])
def test_an_angle_without_an_answer_is_not_passed_over(place):
    rows = [HeldOut(0.1, 0.9, 1.0, 0.0)]
    rows.insert(place, HeldOut(0.2, np.nan, np.nan, np.nan))
    table = soft_of(*rows)
    assert np.isnan([table["heldout_iou_min"], table["heldout_reachable_min"], table["heldout_beyond_max"]]).all()
