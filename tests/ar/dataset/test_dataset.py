"""Demonstrations: a live session's log becomes a dataset in LeRobot's format, with what was so and what was sent."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from tests.ar.dataset.sample import PLACE, RATE, sent, write_session
from trunkline.ar.dataset.__main__ import main
from trunkline.ar.dataset.episodes import ACTION, ENVIRONMENT, GOAL, OPERATOR, RAYS, STATE, episodes
from trunkline.ar.dataset.recording import read_recording
from trunkline.ar.session.log_reader import read_session_log

FPS = 25
READER = Path(__file__).parents[3] / "examples/demonstrations/load.py"
OTHER = os.environ.get("LEROBOT_PYTHON", "")
TASKS = ("bring the mount and the soft arm's tip to their targets", "grasp the cylinder",
         "follow the hands with mount and tip")  # fmt: skip


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("logs") / "run.mcap"
    write_session(path)
    return path


@pytest.fixture(scope="module")
def recording(log):
    return read_recording(log)


@pytest.fixture(scope="module")
def dataset(log, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("dataset") / "all"
    assert main([str(log), "--out", str(folder), "--fps", str(FPS), "--all"]) == 0
    return folder


def data_of(folder: Path) -> pd.DataFrame:
    return pq.read_table(folder / "data/chunk-000/file-000.parquet").to_pandas()


def array(data: pd.DataFrame, name: str) -> np.ndarray:
    return np.stack(data[name].to_numpy())


def test_every_motion_is_an_episode_that_knows_how_it_ended(recording):
    recorded = list(episodes(recording, FPS))
    assert [(episode.task, episode.end, episode.succeeded) for episode in recorded] == [
        (TASKS[0], "done", True), (TASKS[0], "held", False), (TASKS[1], "not held", False), (TASKS[2], "done", True),
    ]  # fmt: skip
    assert [len(episode.frames[ACTION]) for episode in recorded] == [51, 26, 26, 38]  # 2, 1, 1 and 1.5 s, both ends


def test_a_frame_has_what_was_measured_by_then_and_what_was_sent_by_the_next(recording):
    """Held, as a robot holds it: so it is late by less than a step of the log, and never early."""
    first = next(episodes(recording, FPS))
    began = next(step.time for step in recording.steps if step.intent.motion == "execute")
    zero = recording.logbook.zero
    for number in range(len(first.frames[ACTION]) - 1):
        at = 1e-9 * (began - zero) + number / FPS
        last_step = np.floor(round((at - 100.0) * RATE, 6)) / RATE + 100.0  # the step of the log that was last by then
        ahead = np.floor(round((at + 1 / FPS - 100.0) * RATE, 6)) / RATE + 100.0
        np.testing.assert_allclose(first.frames[ACTION][number], np.concatenate(sent(ahead)), atol=1e-9)
        state = first.frames[STATE][number]
        np.testing.assert_allclose(state[:10], np.concatenate(sent(last_step - 0.02)), atol=1e-9)
        tip = [0.1 * last_step, 0.0, -PLACE[2]]  # the last body is turned by half a turn about x
        np.testing.assert_allclose(state[10:], tip, atol=1e-9)


def test_the_goal_is_what_the_executed_plan_was_asked_for_or_what_is_followed(recording):
    done, _, grasp, followed = (episode.frames[ENVIRONMENT] for episode in episodes(recording, FPS))
    assert np.unique(done[:, GOAL.index("rigid.x")]).tolist() == [0.5]
    assert np.unique(done[:, GOAL.index("thing.known")]).tolist() == [0.0]
    assert grasp[0, GOAL.index("thing.known") :].tolist() == [1.0, 0.7, 0.1, 0.2]
    assert np.ptp(followed[:, GOAL.index("tip.x")]) == pytest.approx(0.1 * 1.5, abs=0.1 / FPS)
    assert done[0, GOAL.index("heading")] == 0.25


def test_rays_are_told_and_one_that_is_not_there_says_so(recording):
    rays = next(episodes(recording, FPS)).frames[OPERATOR]
    assert (rays[:, RAYS.index("left.known")] == 1).all()
    assert (np.diff(rays[:, RAYS.index("left.z")]) > 0).all()
    assert (rays[:, RAYS.index("right.known") :] == 0).all()


def test_with_aiming_an_episode_begins_where_the_user_did(recording):
    short, long = next(episodes(recording, FPS)), next(episodes(recording, FPS, aiming=True))
    more = len(long.frames[ACTION]) - len(short.frames[ACTION])
    assert more == 25  # 0.5 s of aiming, 0.2 s of planning, 0.3 s to confirm
    np.testing.assert_allclose(long.frames[STATE][more], short.frames[STATE][0], atol=2e-3)


def test_the_files_are_those_of_the_format(dataset):
    info = json.loads((dataset / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["total_episodes"], info["total_tasks"]) == ("v3.0", FPS, 4, 3)
    data = data_of(dataset)
    assert info["total_frames"] == len(data)
    assert info["splits"] == {"train": "0:4"}
    assert set(data.columns) == set(info["features"])
    schema = pq.read_schema(dataset / "data/chunk-000/file-000.parquet")
    for name, feature in info["features"].items():
        (size,) = feature["shape"]
        kind = {"float32": "float", "int64": "int64", "bool": "bool"}[feature["dtype"]]
        assert str(schema.field(name).type) == (kind if size == 1 else f"fixed_size_list<element: {kind}>[{size}]")
        assert feature["names"] is None or len(feature["names"]) == size
    assert info["data_path"].format(chunk_index=0, file_index=0) == "data/chunk-000/file-000.parquet"
    assert data["index"].tolist() == list(range(len(data)))
    np.testing.assert_allclose(data["timestamp"], data["frame_index"] / FPS, atol=1e-6)


def test_episodes_lie_end_to_end_and_only_their_last_frames_are_done(dataset):
    table = pq.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pandas()
    data = data_of(dataset)
    assert table["dataset_from_index"].tolist() == [0, *table["dataset_to_index"][:-1]]
    assert table["dataset_to_index"].iloc[-1] == len(data)
    last = data[data["next.done"]]
    assert last["index"].tolist() == (table["dataset_to_index"] - 1).tolist()
    assert last["next.success"].tolist() == [True, False, False, True]
    assert data["next.success"].sum() == 2
    tasks = pd.read_parquet(dataset / "meta/tasks.parquet")
    assert tasks.index[last["task_index"]].tolist() == [row[0] for row in table["tasks"]] == [TASKS[0], *TASKS]


def test_statistics_are_those_of_the_rows(dataset):
    stats, data = json.loads((dataset / "meta/stats.json").read_text()), data_of(dataset)
    for name in (STATE, ACTION, ENVIRONMENT):
        values = array(data, name)
        np.testing.assert_allclose(stats[name]["mean"], values.mean(axis=0), rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(stats[name]["std"], values.std(axis=0), rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(stats[name]["q50"], np.quantile(values, 0.5, axis=0), rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(stats[name]["max"], values.max(axis=0))
    assert stats["next.success"]["count"] == [len(data)]


def test_what_failed_is_left_out_unless_it_is_asked_for(log, tmp_path, capsys):
    assert main([str(log), str(log), "--out", str(tmp_path / "d"), "--task", "reach"]) == 0
    assert f"{log}: 4 demonstrations, 2 taken; held: " in capsys.readouterr().out
    info = json.loads((tmp_path / "d/meta/info.json").read_text())
    assert (info["total_episodes"], info["total_tasks"]) == (4, 1)
    assert pd.read_parquet(tmp_path / "d/meta/tasks.parquet").index.tolist() == ["reach"]


def test_where_nobody_measures_the_state_is_what_was_sent_and_its_names_say_so(tmp_path):
    write_session(tmp_path / "blind.mcap", measured=False)
    first = next(episodes(read_recording(tmp_path / "blind.mcap"), FPS))
    assert first.names[STATE][0] == "joint_1.sent"
    assert first.names[ACTION][0] == "joint_1.pos"
    np.testing.assert_allclose(first.frames[STATE][1:, :10], first.frames[ACTION][:-1], atol=1e-9)


def test_a_tip_that_nobody_sees_is_the_twins_and_its_names_say_so(tmp_path, recording):
    write_session(tmp_path / "real.mcap", hardware="the robot panda")
    first, measured = (next(episodes(log, FPS)) for log in (read_recording(tmp_path / "real.mcap"), recording))
    assert first.names[STATE][-3:] == ("tip.x.twin", "tip.y.twin", "tip.z.twin")
    np.testing.assert_array_equal(first.frames[STATE], measured.frames[STATE])


def test_logs_of_different_arms_are_not_mixed(log, tmp_path, capsys):
    write_session(tmp_path / "other.mcap", names=("tendon_1", "tendon_2", "tendon_4"))
    assert main([str(log), str(tmp_path / "other.mcap"), "--out", str(tmp_path / "d")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "other.mcap: observation.state: found other axes" in line
    assert "tendon_4.pos" in line
    assert not (tmp_path / "d").exists()


def test_a_log_without_a_demonstration_or_a_folder_that_is_taken_is_one_line(log, tmp_path, capsys):
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken/mine.txt").write_text("mine")
    for arguments, expected in (
        ([str(log), "--out", str(tmp_path / "taken")], "found something there, expected a new folder"),
        ([str(tmp_path / "no.mcap"), "--out", str(tmp_path / "d")], "no.mcap"),
        ([str(log), "--out", str(tmp_path / "d"), "--fps", "0"], "--fps: found 0"),
    ):
        assert main(arguments) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert expected in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["taken"]
    assert read_session_log(log).damage == []


@pytest.mark.skipif(
    not OTHER, reason="LEROBOT_PYTHON names no Python with lerobot, which needs an older torch than this"
)
def test_lerobot_s_own_loader_reads_it(dataset):
    offline = os.environ | {"HF_HUB_OFFLINE": "1", "HF_HOME": str(dataset.parent / "hub"), "PYTHONPATH": ""}
    done = subprocess.run([OTHER, str(READER), str(dataset)], env=offline, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    loaded, data = json.loads(done.stdout.splitlines()[-1]), data_of(dataset)
    assert (loaded["episodes"], loaded["fps"], len(loaded["frames"])) == (4, FPS, len(data))
    assert loaded["features"][STATE] == [13]
    for name in (STATE, ACTION, ENVIRONMENT, OPERATOR):
        np.testing.assert_allclose([frame[name] for frame in loaded["frames"]], array(data, name), rtol=1e-6)
        np.testing.assert_allclose(loaded["stats"][name], array(data, name).mean(axis=0), rtol=1e-4, atol=1e-6)
    assert [frame["next.success"] for frame in loaded["frames"]] == data["next.success"].tolist()
    assert {frame["task"] for frame in loaded["frames"]} == set(TASKS)
    actions, episode = array(data, ACTION), data["episode_index"].to_numpy()
    for row, (chunk, padded) in enumerate(zip(loaded["chunks"], loaded["padded"], strict=True)):
        within = [row + n < len(data) and episode[row + n] == episode[row] for n in range(len(chunk))]
        assert padded == [not there for there in within]
        np.testing.assert_allclose(np.array(chunk)[within], actions[row : row + sum(within)], rtol=1e-6)
