"""Trials of a session that a twin is identified from come out as episodes that LeRobot reads."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from tests.support.matched_plant import curl, release, small_model, static_pull, tilt
from trunkline.ar.dataset.episodes import ACTION, DONE, ENVIRONMENT, STATE
from trunkline.ar.dataset.trials import MEASURED, episode_of, main
from trunkline.recordings.trials.trial import Trial, write_trials

FPS, RATE = 30, 120  # of the dataset and of the trials
TENDONS = ("tendon_1", "tendon_2", "tendon_3")


def without_tendons(trial: Trial) -> Trial:
    nothing = np.empty((len(trial.time), 0))
    return replace(trial, tendons=(), commands=nothing, tendon_positions=nothing)


@pytest.fixture(scope="module")
def trials() -> list[Trial]:
    """At rest and in motion, with and without motors, of which the pulls lag."""
    model = small_model(4)
    moved = curl(model, 40, "identify", frames=62)
    moved = replace(moved, tendon_positions=moved.commands - 0.001)
    moved.measured[8, 2] = False
    pulled, let_go = static_pull(model, (10, -300, 5), split="validate"), release(model, 0.2, "validate", 40)
    tested = curl(model, 50, "test", frames=30)
    return [without_tendons(tilt(model, 45)), pulled, without_tendons(let_go), moved, tested]


@pytest.fixture(scope="module")
def dataset(trials, tmp_path_factory):
    root = tmp_path_factory.mktemp("lab")
    (root / "session").mkdir()
    write_trials(root / "session", trials)
    assert main([str(root / "session"), "--out", str(root / "dataset"), "--fps", f"{FPS}"]) == 0
    return root / "dataset"


def test_a_frame_has_what_was_measured_by_then_and_what_was_commanded_by_the_next(trials):
    trial = trials[3]
    frames = episode_of(trial, TENDONS, FPS).frames
    rows = np.arange(0, 62, RATE // FPS)
    np.testing.assert_array_equal(frames[STATE][:, :12], trial.positions[rows].reshape(len(rows), 12))
    np.testing.assert_array_equal(frames[STATE][:, 12:], trial.tendon_positions[rows])
    np.testing.assert_array_equal(frames[ACTION], trial.commands[np.minimum(rows + RATE // FPS, 61)])
    np.testing.assert_array_equal(frames[ENVIRONMENT], np.tile([*trial.gravity, 0.0], (len(rows), 1)))
    assert np.argwhere(frames[MEASURED] == 0).tolist() == [[2, 2]]
    assert frames[DONE].tolist() == [False] * (len(rows) - 1) + [True]


def test_rates_that_do_not_divide_take_the_last_sample_by_then(trials):
    frames = episode_of(trials[3], TENDONS, 50).frames
    rows = np.floor(np.arange(len(frames[STATE])) * RATE / 50 + 1e-6).astype(int)
    np.testing.assert_array_equal(frames[STATE][:, :12], trials[3].positions[rows].reshape(len(rows), 12))
    assert len(rows) == 61 * 50 // RATE + 1


def test_shapes_at_rest_have_their_own_pulls_and_what_is_not_commanded_is_slack(trials):
    tilted, pulled, let_go, _, _ = (episode_of(trial, TENDONS, FPS) for trial in trials)
    assert [len(episode.frames[STATE]) for episode in (tilted, pulled, let_go)] == [1, 1, 10]
    np.testing.assert_allclose(pulled.frames[ACTION], [[0.010, -0.3, 0.005]])
    np.testing.assert_allclose(tilted.frames[ACTION], [[-0.3] * 3])
    path = replace(trials[1], **{name: np.repeat(getattr(trials[1], name), 3, axis=0)
                                 for name in ("positions", "measured", "commands", "tendon_positions")},
                   time=np.array([0.0, 7.0, 9.0]))  # fmt: skip
    path.commands[:, 0] = [0.01, 0.02, 0.03]
    np.testing.assert_allclose(episode_of(path, TENDONS, FPS).frames[ACTION][:, 0], [0.01, 0.02, 0.03])


def test_the_files_are_those_of_the_format_and_the_split_test_is_not_in_them(dataset, trials, capsys):
    info = json.loads((dataset / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["total_episodes"]) == ("v3.0", FPS, 4)
    assert info["features"][STATE]["names"][:3] + info["features"][STATE]["names"][-1:] == [
        "unit_01.x", "unit_01.y", "unit_01.z", "tendon_3.pos",
    ]  # fmt: skip
    data = pq.read_table(dataset / "data/chunk-000/file-000.parquet").to_pandas()
    assert set(data.columns) == set(info["features"])
    for name, feature in info["features"].items():
        assert feature["shape"] == [np.size(data[name][0])], name
    tasks = pd.read_parquet(dataset / "meta/tasks.parquet")
    assert tasks.index.tolist()[0] == "at rest, the mount tilted"
    assert np.isfinite(np.stack(data[STATE].to_numpy())).all()
    np.testing.assert_allclose(data[data.episode_index == 3][ACTION].iloc[0], trials[3].commands[4], atol=1e-7)


def test_a_session_without_motors_has_states_and_no_actions(trials, tmp_path):
    (tmp_path / "session").mkdir()
    write_trials(tmp_path / "session", [trials[0], trials[2]])
    assert main([str(tmp_path / "session"), "--out", str(tmp_path / "dataset")]) == 0
    info = json.loads((tmp_path / "dataset/meta/info.json").read_text())
    assert ACTION not in info["features"]
    assert info["features"][STATE]["shape"] == [12]


def test_what_is_no_dataset_is_one_line_and_nothing_is_written(trials, tmp_path, capsys):
    for name, some in (
        ("test_alone", trials[4:]),
        ("gap", [replace(trials[0], positions=trials[0].positions * np.nan)]),
        ("other", [replace(trials[0], markers=("a", "b", "c", "d"))]),
        ("whole", trials[:1]),
    ):
        (tmp_path / name).mkdir()
        write_trials(tmp_path / name, some)
    for words, expected in (
        (["test_alone"], "found no trial of identify or validate"),
        (["gap"], "gap: trial tilt_45_identify: found a gap"),
        (["whole", "other"], "other: trial tilt_45_identify: found other markers than in the first session"),
        (["whole", "--fps", "0"], "--fps: found 0"),
        (["whole", "--out", str(tmp_path / "whole")], "found something there, expected a new folder"),
    ):
        words = [str(tmp_path / word) if (tmp_path / word).is_dir() else word for word in words]
        assert main(["--out", str(tmp_path / "dataset"), *words]) == 1
        assert expected in capsys.readouterr().err.splitlines()[-1]
    assert not (tmp_path / "dataset").exists()
