"""The study of coverage at a small size: known parameters come back from afar, forces over the masses."""

import numpy as np
import pytest

from studies.coverage import MASS_FACTOR, cover


@pytest.mark.parametrize("is_matched", [True, False], ids=["the model", "a heavier plant with dry friction"])
def test_what_is_known_comes_back(is_matched):
    found = cover("damping", is_matched, 2)
    assert found.names == ["stiffness", "damping", "relaxation", "relaxation_time", "relaxation_2", "relaxation_time_2"]
    errors = np.abs(found.errors)
    assert errors[:, 0].max() < 0.5 * np.log(MASS_FACTOR), "expected over the factor of the masses"
    # the fast branch, hardly told here, takes up some of the dry friction and gives of it to the slow one
    assert errors[:, :4].max() < (0.15 if is_matched else 0.35)
    assert (np.array(found.widths) > 0).all()
    assert len(found.rows("`identify_damping`", "the model")) == len(found.names)


def test_signed_parameters_come_back_over_their_truth():
    found = cover("stiffness", True, 1)
    assert {"joint_place", "mount_tilt_x", "rest_bend_y"} <= set(found.names)
    assert np.abs(found.errors).max() < 0.1
