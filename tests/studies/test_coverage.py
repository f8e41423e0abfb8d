"""The study of coverage at a small size: known parameters come back from afar, and a wrong plant shows."""

import numpy as np

from studies.coverage import cover


def test_a_wrong_plant_shows_beside_the_right_one():
    right, wrong = cover("damping", True, 2), cover("damping", False, 2)
    damping = right.names.index("damping")
    assert np.abs(right.errors)[:, damping].max() < 0.02
    assert (np.abs(wrong.errors) > wrong.widths)[:, damping].all(), "dry friction passes for damping, in every trial"
    assert len(right.rows("`identify_damping`", "the model")) == len(right.names)
