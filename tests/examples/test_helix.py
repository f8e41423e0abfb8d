"""The helix arm, declared: which rows are for what, and what its description has to bend."""

import mujoco
import numpy as np
import pytest
import yaml

from stages.build_mjcf import Config, cad_arm
from tests.support.folders import ROOT, SHARED, with_recordings
from trunkline.pipeline.config import load_config
from trunkline.recordings.session.session import Session
from trunkline.recordings.trials.splits import IDENTIFY, TEST, VALIDATE

EXAMPLE = ROOT / "examples/helix"
PATTERNS = {1: set(range(1, 1001)), 2: set(range(1001, 2001)), 3: set(range(2001, 3001))}


@pytest.fixture(scope="module")
def rows() -> dict[str, list[set[int]]]:
    """Of each split the rows of its trials."""
    session = Session.model_validate(yaml.safe_load((EXAMPLE / "session.yaml").read_text()))
    return {split: [{*(trial.chosen or ())} for trial in session.trials if trial.split == split]
            for split in (IDENTIFY, VALIDATE, TEST)}  # fmt: skip


def test_nothing_of_the_third_pattern_is_fitted(rows):
    fitted, chosen = (set().union(*rows[split]) for split in (IDENTIFY, VALIDATE))
    assert len(fitted) == 300
    assert fitted | chosen <= PATTERNS[1] | PATTERNS[2]
    assert all(part <= PATTERNS[1] or part <= PATTERNS[2] for part in rows[IDENTIFY])
    assert not fitted & chosen


def test_a_fifth_of_all_and_some_of_the_third_pattern_are_unseen(rows):
    fifth, third = rows[TEST]
    assert (len(fifth), len(third)) == (600, 300)
    assert third <= PATTERNS[3]
    assert all(fifth & pattern for pattern in PATTERNS.values())
    assert not (fifth | third) & set().union(*rows[IDENTIFY], *rows[VALIDATE])
    assert third == {*(2000 + np.random.default_rng(1).choice(np.arange(1, 1001), 300, replace=False)).tolist()}


def test_each_section_is_bent_by_its_own_tendons(monkeypatch):
    monkeypatch.chdir(EXAMPLE)
    model = cad_arm(load_config(Config, "build_mjcf")).spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    moved = np.zeros((model.ntendon, model.nv))
    mujoco.mju_sparse2dense(moved, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind)
    bends = (np.abs(moved) > 1e-6).reshape(9, 3, 12).any(axis=2)
    np.testing.assert_array_equal(bends, np.repeat(np.eye(3, dtype=bool), 3, axis=0))


@with_recordings
def test_the_recording_is_as_declared():
    with open(SHARED / "helix_epfl/poses.csv", encoding="utf-8") as file:
        assert sum(1 for _ in file) == 3001
    assert np.load(SHARED / "helix_epfl/commands.npz")["act_list"].shape == (3000, 3, 3)
