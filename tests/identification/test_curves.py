"""Which shapes are drawn."""

from types import SimpleNamespace

import numpy as np

from trunkline.identification.results.curves import shape_table


def drawn(measured):
    """The measured shape (S, 2) that is drawn of one trial, mm."""
    experiment = SimpleNamespace(name="pull", gravity=np.array([0.0, 0.0, -9.81]), positions=measured)
    prediction = SimpleNamespace(experiments=[experiment], replay=SimpleNamespace(positions=[0.9 * measured]))
    table = shape_table({"identified": prediction}, ("1", "2"))
    assert set(table.source) == {"measured", "identified"}
    np.testing.assert_allclose(table[table.source == "identified"].x_mm, 0.9 * table[table.source == "measured"].x_mm)
    return table.loc[table.source == "measured", ["x_mm", "z_mm"]].to_numpy()


def path(*bends):
    """Two markers that bend aside by so many m, frame by frame. Shape (T, 2, 3)."""
    return np.array([[[bend / 3, 0.0, -0.1], [bend, 0.0, -0.2]] for bend in bends])


def test_of_a_path_there_and_back_it_is_the_bent_shape():
    np.testing.assert_allclose(drawn(path(0.0, 0.03, 0.06, 0.03, 0.0)), [[20, -100], [60, -200]])


def test_of_a_release_it_is_the_swing_to_the_other_side_and_not_the_pose_that_a_model_is_given():
    np.testing.assert_allclose(drawn(path(0.06, 0.01, -0.03, 0.01, 0.0)), [[-10, -100], [-30, -200]])


def test_of_one_frame_it_is_that_and_frames_that_are_lost_do_not_count():
    np.testing.assert_allclose(drawn(path(0.03)), [[10, -100], [30, -200]])
    lost = path(0.0, 0.09, 0.03)
    lost[1] = np.nan
    np.testing.assert_allclose(drawn(lost), [[10, -100], [30, -200]])
