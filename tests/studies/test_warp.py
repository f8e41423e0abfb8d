"""MuJoCo Warp, where it is installed, on a GPU or a CPU: its arm is where MuJoCo's is, to the bound stated here."""

import numpy as np
import pytest

from studies import warp

BOUND = 5e-6  # m, in the first tenth of a second


def test_a_difference_is_off_by_its_share():
    ours = np.array([[0.0, 2.0], [2.0, 0.0]])
    assert warp.share(1.1 * ours, ours) == "10.00%"
    assert warp.share(ours, 0 * ours) == "-"


def test_every_candidate_differs_in_one_parameter():
    fields = warp.changed(warp.arm())
    assert {len(values) for values in fields.values()} == {1 + len(warp.CHANGED) * len(warp.BY)}
    for candidate in range(1, len(fields["dof_damping"])):
        assert any((values[candidate] != values[0]).any() for values in fields.values())


@pytest.mark.parametrize("trial", [warp.let_go, warp.pulled])
def test_warp_has_the_arm_where_mujoco_has_it(trial, monkeypatch):
    mujoco_warp = pytest.importorskip("mujoco_warp", reason="no GPU's library, mujoco_warp")
    monkeypatch.setattr(warp, "SECONDS", 0.1)
    model = warp.arm()
    fields, (start, controls) = warp.changed(model), trial(model)
    ours = warp.by_mujoco(model, fields, start, controls)
    theirs = warp.by_warp(mujoco_warp, model, fields, start, controls)
    assert np.linalg.norm(ours - ours[:, :1], axis=-1).max() > 100 * BOUND
    assert np.linalg.norm(theirs - ours, axis=-1).max() < BOUND
