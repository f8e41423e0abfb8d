"""The example of an arm described tendon by tendon: its session from the public CSVs, and its model."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from examples.ftdcr.session import COLUMNS, make_session, read_csv
from stages.build_mjcf import Config, cad_arm
from tests.support.folders import SHARED, with_recordings
from trunkline.errors import InputError
from trunkline.pipeline.config import load_config
from trunkline.recordings.cleaning.checks import TrialLimits
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.filtering.filter import Filter, filter_raw_trial
from trunkline.recordings.session.session import read_session

ROOT = Path(__file__).parents[2]
LIMITS = TrialLimits(0.5, 0.3, 0.1, 1.0)
FILTER = Filter(rate=120.0, cutoff=20.0, order=4, longest_bridge=0.06, outlier_deviations=8.0, release="onset")


def rows(patterns: int, name: str, poses: int = 6) -> str:
    """A CSV like the public one: `patterns` of `poses` each, 0.57 s apart, motor k wound in by k mm at the most."""
    lines = [",".join(COLUMNS)]
    for index in range(patterns * poses):
        share = index % poses / (poses - 1)
        pulls = [share * number for number in range(1, 10)]
        end = "_hold" if index % poses == poses - 1 else ""
        label, cells = f"rep1_{name}{index // poses}{end}", (*pulls, 5.0 * share, -7.0 * share, 188.0 - share)
        lines.append(",".join([repr(1000.0 + 0.57 * index), label, *map(repr, cells)]))
    return "\n".join(lines) + "\n"


@pytest.fixture
def public(tmp_path):
    (tmp_path / "train.csv").write_text(rows(7, "alone"))
    (tmp_path / "val.csv").write_text(rows(2, "together"))
    return tmp_path


def test_the_public_csvs_become_a_session_of_settled_poses(public, tmp_path):
    folder = tmp_path / "session"
    assert make_session(public, folder) == 9
    session = read_session(folder)
    assert [trial.split for trial in session.trials] == ["identify"] * 5 + ["validate", "identify"] + ["test"] * 2
    for _, raw, findings in load_raw_trials(folder, session, LIMITS):
        assert not isinstance(raw, InputError), raw
        assert not findings.repairs
        trial, _ = filter_raw_trial(raw, FILTER)
        share = np.linspace(0, 1, 6)
        np.testing.assert_allclose(trial.positions[:, 0], 1e-3 * np.outer(share, [5, 7, 1]) - [0, 0, 0.188], atol=1e-12)
        np.testing.assert_allclose(trial.commands, 1e-3 * np.outer(share, range(1, 10)), atol=1e-12)
        assert trial.tendons == tuple(f"tendon_{k}" for k in range(1, 10))
        assert (trial.gravity == 0).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("tip_x", "tip_q"), "row 1: found timestamp"),
        (lambda text: text.replace("1000.0,", "soon,", 1), "row 2: could not convert"),
        (lambda text: text.replace("1000.0,", "1000.0,more,", 1), "row 2: found 15 cells, expected 14"),
    ],
)
def test_a_wrong_row_is_named(public, change, message):
    path = public / "train.csv"
    path.write_text(change(path.read_text()))
    with pytest.raises(InputError, match=message):
        make_session(public, public / "session")
    assert not (public / "session").exists()


def test_what_is_not_there_is_told_in_words(public):
    (public / "val.csv").unlink()
    with pytest.raises(InputError, match=r"val\.csv: no such file or directory, expected train\.csv or val\.csv of"):
        make_session(public, public / "session")
    with pytest.raises(InputError, match=r"nowhere: no such folder, expected one with train\.csv and val\.csv"):
        make_session(public / "nowhere", public / "session")
    assert not (public / "session").exists()


def test_tendons_end_where_the_description_says(monkeypatch):
    monkeypatch.chdir(ROOT / "examples/ftdcr")
    model = cad_arm(load_config(Config, "build_mjcf")).spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    moved = np.zeros((model.ntendon, model.nv))
    mujoco.mju_sparse2dense(moved, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind)
    crossed = (np.abs(moved) > 1e-6).reshape(9, 15, 2).any(axis=2).sum(axis=1)
    assert crossed.tolist() == [5] * 3 + [10] * 3 + [15] * 3
    assert model.nu == 9


@with_recordings
def test_the_real_poses_are_read_whole():
    assert [len(read_csv(SHARED / f"ftdcr_v4/{name}.csv")) for name in ("train", "val")] == [1620, 443]
