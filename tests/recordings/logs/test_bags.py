"""Bags of ROS 2, in every layout that its recorder has had: what an MCAP log gives, and one line for what is wrong."""

import shutil
import sqlite3
from contextlib import closing
from dataclasses import fields

import numpy as np
import pytest
import yaml
from mcap_ros2.writer import Writer as RosWriter

from tests.recordings.logs.test_schemas import (
    BODIES,
    COUNT,
    POSITIONS,
    QUATERNIONS,
    ROS,
    STAMPS,
    a_session,
    at_stamps,
    header,
    in_ros,
    link,
    named_poses,
    point,
    pose,
    ros_transform,
    rotation,
    stamped_poses,
)
from tests.support.bags import KINDS, Kind, as_bag
from tests.support.sessions import LIMITS, curl_truth, instruments, record, release_truth, static_truth
from trunkline.errors import InputError
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.logs import encodings
from trunkline.recordings.logs.bag2 import read_recording
from trunkline.recordings.logs.definitions import HEADER, KNOWN, POSITION, RIGID_BODIES
from trunkline.recordings.preparation.inspect import main
from trunkline.recordings.session.session import logs_in, read_session
from trunkline.recordings.session.source import open_log

SQLITE, SPLIT = Kind(), Kind(parts=3)
every_kind = pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
both_storages = pytest.mark.parametrize("kind", [SQLITE, Kind(tables=3), Kind("mcap")], ids=["4", "3", "mcap"])


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """A session of MCAP logs."""
    folder = tmp_path_factory.mktemp("lab")
    record(folder, [static_truth(30.0), release_truth(), curl_truth()], instruments())
    return folder


def session_of_bags(lab, folder, kind):
    """The same session, of bags."""
    text = (lab / "session.yaml").read_text()
    for log in sorted(lab.glob("*.mcap")):
        text = text.replace(log.name, as_bag(log, folder / log.stem, kind).name)
    (folder / "session.yaml").write_text(text)
    return folder


def raw_trials(folder):
    return [raw for _, raw, _ in load_raw_trials(folder, read_session(folder), LIMITS)]


def assert_same(trials, others):
    assert len(trials) == len(others) == 3
    for raw, other in zip(trials, others, strict=True):
        assert not isinstance(raw, Exception), raw
        assert not isinstance(other, Exception), other
        for field in fields(raw):
            np.testing.assert_array_equal(getattr(raw, field.name), getattr(other, field.name))


@every_kind
def test_a_session_of_bags_gives_the_raw_trials_of_its_mcap_logs(tmp_path, lab, kind):
    folder = session_of_bags(lab, tmp_path, kind)
    before = contents(folder)
    session = read_session(folder)
    assert session.unlisted == []
    assert [trial.name for trial in session.trials] == [trial.name for trial in read_session(lab).trials]
    assert_same(raw_trials(folder), raw_trials(lab))
    assert contents(folder) == before


def contents(folder):
    return {path: path.is_file() and path.read_bytes() for path in sorted(folder.rglob("*"))}


@every_kind
def test_inspect_says_what_each_bag_is_and_proposes_a_session_that_is_read(tmp_path, lab, capsys, kind):
    folder = session_of_bags(lab, tmp_path, kind)
    (folder / "session.yaml").unlink()
    assert main([str(folder)]) == 0
    out = capsys.readouterr().out
    files = [path for path in folder.rglob("*") if path.is_file() and path.name != "metadata.yaml"]
    if kind.metadata:
        assert [out.count(path.name) for path in files] == [1] * len(files)
    assert out.count(f"  rosbag2: {kind.storage}") == 3
    assert ("compressed one by one," in out, "the file compressed" in out) == (
        kind.packed == "message", kind.packed == "file")  # fmt: skip
    (folder / "session.yaml").write_text(out.partition("Proposed session.yaml:\n")[2])
    session = read_session(folder)
    assert [trial.name for trial in session.trials] == sorted(trial.name for trial in read_session(lab).trials)
    assert not any(isinstance(raw, Exception) for raw in raw_trials(folder))


def test_one_bag_may_be_inspected_by_itself_and_a_folder_that_is_one_is_a_session(tmp_path, lab, capsys):
    bag = as_bag(lab / "tilt_30.mcap", tmp_path / "tilt_30", SPLIT)
    for place in (bag, bag / "metadata.yaml"):
        assert main([str(place), str(place)]) == 0
        assert capsys.readouterr().out.count("rosbag2: sqlite3, 3 files: tilt_30_0.db3") == 1
    assert main([str(bag)]) == 0
    assert "  - {file: tilt_30, experiment: static_tilt, split: identify" in capsys.readouterr().out
    assert logs_in(bag) == ["metadata.yaml"]
    text = (lab / "session.yaml").read_text().replace("tilt_30.mcap", "metadata.yaml, name: tilt_30")
    lines = [line for line in text.splitlines(keepends=True) if ".mcap" not in line]
    (bag / "session.yaml").write_text("".join(lines))
    (raw,) = raw_trials(bag)
    np.testing.assert_array_equal(raw.positions, next(r for r in raw_trials(lab) if r.name == "tilt_30").positions)


def test_a_session_may_still_name_the_file_in_a_bag(tmp_path, lab):
    """As before bags were read as such."""
    folder = session_of_bags(lab, tmp_path, Kind("mcap"))
    text = (folder / "session.yaml").read_text().replace("file: tilt_30", "name: tilt_30, file: tilt_30/tilt_30_0.mcap")
    (folder / "session.yaml").write_text(text)
    assert read_session(folder).unlisted == []
    assert_same(raw_trials(folder), raw_trials(lab))


@pytest.mark.parametrize("second", ["tilt_30/tilt_30_0.db3", "copy", "tilt_30_1.db3"])
def test_a_bag_and_what_shares_a_file_with_it_are_not_in_two_splits(tmp_path, lab, second):
    bag = as_bag(lab / "tilt_30.mcap", tmp_path / "tilt_30", SPLIT)
    shutil.copytree(bag, tmp_path / "copy")
    shutil.copy(bag / "tilt_30_1.db3", tmp_path)
    head = (lab / "session.yaml").read_text().partition("trials:")[0]
    trials = [{"name": name, "file": file, "experiment": "release", "split": split}
              for name, file, split in (("a", "tilt_30", "identify"), ("b", second, "validate"))]  # fmt: skip
    (tmp_path / "session.yaml").write_text(head + yaml.safe_dump({"trials": trials}))
    with pytest.raises(InputError, match="trials a and b share data.*expected no data in two splits"):
        read_session(tmp_path)


def test_an_unpacked_file_beside_the_packed_one_is_one_log(tmp_path, lab):
    as_bag(lab / "tilt_30.mcap", tmp_path / "tilt_30", Kind(metadata=0))
    as_bag(lab / "tilt_30.mcap", tmp_path / "other" / "tilt_30", Kind(packed="file"))
    as_bag(lab / "tilt_30.mcap", tmp_path / "packed", Kind(metadata=0, packed="file")).rename(
        tmp_path / "tilt_30.db3.zstd")  # fmt: skip
    assert logs_in(tmp_path) == ["tilt_30.db3"]


def test_a_file_that_was_packed_or_unpacked_by_hand_is_taken(tmp_path, lab):
    bag = as_bag(lab / "tilt_30.mcap", tmp_path / "tilt_30", Kind(packed="file"))
    (bag / "tilt_30_0.db3.zstd").unlink()
    as_bag(lab / "tilt_30.mcap", bag / "tilt_30_0", Kind(metadata=0))
    assert read_recording(bag).count == read_recording(lab / "tilt_30.mcap").count


# what drivers publish, by schema: the definition, and the messages of a frame
POSITION_NOW = f"std_msgs/Header header\n{POSITION}{HEADER}"


def natnet(frame):
    return [(topic.replace("/vrpn/", "/"), content) for topic, content in stamped_poses(frame)]


def vrpn(frame):
    return [(topic.replace("/vrpn/", "/vrpn_mocap/"), content) for topic, content in stamped_poses(frame)]


def vicon(frame, headed=True):
    """In mm, a topic a segment."""
    messages = []
    for body, name in enumerate(BODIES):
        (x, y, z), (w, i, j, k) = 1000 * POSITIONS[frame, body], QUATERNIONS[frame, body]
        content = dict(x_trans=x, y_trans=y, z_trans=z, x_rot=i, y_rot=j, z_rot=k, w=w, segment_name=name,
                       subject_name=name, frame_number=frame, translation_type="Global")  # fmt: skip
        messages.append((f"/vicon/{name}/{name}", {"header": header(STAMPS[frame]), **content} if headed else content))
    return messages


def older_vicon(frame):
    return vicon(frame, headed=False)


def named_v2(frame):
    ((topic, content),) = named_poses(frame)
    return [(topic, content | {"timestamp": 7, "latencies": [{"source": "camera", "latency": 5}]})]


def rigid_bodies(frame):
    """As the driver of mocap4r2 for OptiTrack has them."""
    bodies = [{"rigid_body_name": BODIES[body], "pose": pose(frame, body),
               "markers": [{"id_type": 0, "marker_index": 1, "marker_name": "m", "translation": point(np.ones(3))}]}
              for body in range(3)]  # fmt: skip
    return [("/rigid_bodies", {"header": header(STAMPS[frame]), "frame_number": frame, "rigidbodies": bodies})]


def tf(frame):
    return [("/tf", {"transforms": [ros_transform(*link(frame, body)) for body in range(3)]})]


STAMPED = ROS["stamped"][:2]
DRIVERS = {
    "natnet_ros2": (*STAMPED, natnet),
    "vrpn_mocap": (*STAMPED, vrpn),
    "vicon_receiver": ("vicon_receiver/msg/Position", POSITION_NOW, vicon),
    "vicon_receiver before": ("vicon_receiver/msg/Position", POSITION, older_vicon),
    "motion_capture_tracking": (*ROS["named"][:2], named_poses),
    "motion_capture_tracking V2": (
        "motion_capture_tracking_interfaces/msg/NamedPoseArrayV2",
        KNOWN["motion_capture_tracking_interfaces/NamedPoseArrayV2"], named_v2),
    "mocap4r2": ("mocap4r2_msgs/msg/RigidBodies", RIGID_BODIES, rigid_bodies),
    "tf": (*ROS["tf"][:2], tf),
}  # fmt: skip


@both_storages
@pytest.mark.parametrize("driver", DRIVERS)
def test_topics_of_drivers_come_back_as_written(tmp_path, driver, kind):
    """Of tables of version 3 by the usual definition, as those have none."""
    schema, definition, messages = DRIVERS[driver]
    log = in_ros(tmp_path / "log.mcap", schema, definition, at_stamps(messages, 3_000_000))
    poses = open_log(as_bag(log, tmp_path / "bag", kind), a_session()).poses
    vicon_names = tuple(f"{name}/{name}" for name in BODIES)
    names = vicon_names if driver.startswith("vicon") else BODIES
    assert set(poses.names) == set(names)
    assert poses.undecodable == 0
    columns = [poses.names.index(name) for name in names]
    scale, precision = (1000.0, 1e-6) if driver.startswith("vicon") else (1.0, 0.0)
    present = poses.present[:, columns]
    np.testing.assert_allclose(poses.positions[:, columns][present], scale * POSITIONS[present], rtol=precision)
    np.testing.assert_allclose(poses.quaternions[:, columns][present], QUATERNIONS[present], rtol=precision, atol=1e-7)
    late = 3_000_000 if driver == "vicon_receiver before" else 0
    assert np.abs(poses.stamps - STAMPS - late).max() <= (2000 if messages in (natnet, vrpn) else 0)
    assert (kind.tables == 3 and kind.storage == "sqlite3") == any("its usual definition" in n for n in poses.notes)


@pytest.mark.parametrize("kind", [Kind(tables=3), Kind(tables=2, metadata=4)])
def test_a_type_that_nobody_knows_is_one_line_with_topic_type_and_remedy(tmp_path, monkeypatch, kind):
    monkeypatch.setattr(encodings, "KNOWN", {})
    log = in_ros(tmp_path / "log.mcap", *ROS["named"][:2], at_stamps(named_poses))
    bag = as_bag(log, tmp_path / "bag", kind)
    with pytest.raises(InputError, match=r"bag: /poses: found no text in the schema motion_capture_tracking_interfaces/"
                       r"msg/NamedPoseArray, expected its definition: .*`ros2 bag convert` to MCAP"):  # fmt: skip
        open_log(bag, a_session())


@both_storages
def test_topics_of_other_types_are_named(tmp_path, kind):
    with open(tmp_path / "log.mcap", "wb") as file, RosWriter(file) as writer:
        schema = writer.register_msgdef("my_lab/msg/Arm", "float64 x\n")
        writer.write_message("/arm", schema, {"x": 1.0}, 1)
    with pytest.raises(InputError, match=r"bag: no pose topic, found /arm \(my_lab/msg/Arm\), expected one of"):
        open_log(as_bag(tmp_path / "log.mcap", tmp_path / "bag", kind), a_session())


# damage


@pytest.fixture
def bag(tmp_path):
    log = in_ros(tmp_path / "log.mcap", *ROS["named"][:2], at_stamps(named_poses))
    return as_bag(log, tmp_path / "bag", SPLIT)


@pytest.fixture(scope="module")
def long_log(tmp_path_factory):
    """Of many pages, of numbers that do not compress."""
    rng = np.random.default_rng(1)
    pose = [{"position": point(place), "orientation": rotation(turn)}
            for place, turn in zip(rng.normal(size=(6000, 3)), rng.normal(size=(6000, 4)), strict=True)]  # fmt: skip
    messages = [
        ("/poses", {"header": header(stamp), "poses": [{"name": n, "pose": pose.pop()} for n in BODIES]}, stamp)
        for stamp in (STAMPS[0] + 8_333_333 * np.arange(2000)).tolist()
    ]
    return in_ros(tmp_path_factory.mktemp("long") / "log.mcap", *ROS["named"][:2], messages)


@pytest.mark.parametrize("share", [0.5, 0.9])
def test_a_file_that_is_cut_off_gives_what_is_before_and_says_so(tmp_path, long_log, share):
    bag = as_bag(long_log, tmp_path / "bag", Kind(parts=2))
    whole = read_recording(bag).topics["/poses"]
    file = bag / "bag_1.db3"
    data = file.read_bytes()
    size = int(len(data) * share)
    file.write_bytes(data[:size])
    log = read_recording(bag)
    assert log.damage[0] == f"bag_1.db3: cut off at byte {size} of {len(data)}"
    assert any(" messages before and behind it are read" in line for line in log.damage)
    assert log.damage[-1] == f"{2000 - log.count} of 2000 messages lost"
    assert 0.5 + 0.5 * share - 0.1 < log.count / 2000 < 1
    assert log.topics["/poses"].messages == whole.messages[: log.count]


def test_a_damaged_page_costs_its_messages_alone(tmp_path, long_log):
    file = as_bag(long_log, tmp_path / "bag", Kind(metadata=0))
    whole = read_recording(file).topics["/poses"]
    data = bytearray(file.read_bytes())
    page = int.from_bytes(data[16:18], "big")
    start = data.index(whole.messages[1000][:100]) // page * page
    data[start : start + page] = b"\xff" * page
    file.write_bytes(data)
    log = read_recording(file)
    assert any("database disk image is malformed" in line for line in log.damage)
    assert 1980 < log.count < 2000
    assert log.topics["/poses"].messages[-900:] == whole.messages[-900:]


def test_definitions_that_are_lost_are_the_usual_ones(tmp_path, lab):
    file = as_bag(lab / "tilt_30.mcap", tmp_path / "bag", Kind(metadata=0))
    whole = open_log(lab / "tilt_30.mcap", read_session(lab))
    data = bytearray(file.read_bytes())
    page = int.from_bytes(data[16:18], "big")
    with closing(sqlite3.connect(file)) as database:
        query = "SELECT rootpage FROM sqlite_master WHERE name = 'message_definitions'"
        ((root,),) = database.execute(query)
    data[(root - 1) * page : root * page] = b"\xff" * page
    file.write_bytes(data)
    source = open_log(file, read_session(lab))
    assert any("definitions of messages lost" in line for line in source.log.damage)
    np.testing.assert_array_equal(source.poses.positions, whole.poses.positions)


def test_a_file_of_which_nothing_is_readable_is_left_out_of_its_recording(bag):
    (bag / "bag_1.db3").write_bytes(b"not a database" * 100)
    log = read_recording(bag)
    assert any("bag_1.db3: file is not a database" in line and line.endswith("left out") for line in log.damage)
    assert 0 < log.count < COUNT


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", r"found the tables \(none\) without topics and messages"),
        (b"not a database" * 100, "file is not a database"),
    ],
)
def test_a_file_that_is_no_recording_is_one_line(tmp_path, capsys, content, problem):
    (tmp_path / "log.db3").write_bytes(content)
    with pytest.raises(InputError, match=rf"log\.db3: {problem}.*, expected a recording of rosbag2 in sqlite3$"):
        read_recording(tmp_path / "log.db3")
    assert main([str(tmp_path)]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_what_the_recorder_did_not_close_is_read_with_what_lies_beside_it(tmp_path):
    """Killed with all messages in the write-ahead log."""
    log = in_ros(tmp_path / "log.mcap", *ROS["named"][:2], at_stamps(named_poses))
    with closing(sqlite3.connect(as_bag(log, tmp_path / "bag", Kind(metadata=0)))) as database:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("PRAGMA wal_autocheckpoint=0")
        database.execute("DELETE FROM messages WHERE id > 30")
        database.commit()
        (tmp_path / "killed").mkdir()
        for end in ("", "-wal"):
            shutil.copy(tmp_path / f"bag.db3{end}", tmp_path / "killed")
    before = contents(tmp_path / "killed")
    result = read_recording(tmp_path / "killed" / "bag.db3")
    assert result.count == 30
    assert result.damage == ["not closed by its recorder: read with bag.db3-wal"]
    assert contents(tmp_path / "killed") == before


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_compressed_file_that_is_cut_off_gives_what_it_has(tmp_path, long_log, storage):
    file = as_bag(long_log, tmp_path / "bag", Kind(storage, metadata=0, packed="file"))
    whole, packed = read_recording(file), file.read_bytes()
    file.write_bytes(packed[:10])
    with pytest.raises(InputError, match=r"bag\.(db3|mcap)\.zstd: "):
        read_recording(file)
    file.write_bytes(packed[:-10])
    log = read_recording(file)
    assert "cut off: unpacked to " in log.damage[0]
    assert 0.1 * whole.count < log.count < whole.count
    file.write_bytes(b"no zstd at all")
    with pytest.raises(InputError, match=rf"bag\.(db3|mcap)\.zstd: .*expected a recording of rosbag2 in {storage}"):
        read_recording(file)


def edited(bag, **keys):
    path = bag / "metadata.yaml"
    content = yaml.safe_load(path.read_text())
    content["rosbag2_bagfile_information"] |= keys
    path.write_text(yaml.safe_dump(content))


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ({"relative_file_paths": ["bag_7.db3"]},
         "relative_file_paths: found 'bag_7.db3', expected a file beside it, where there is bag_0.db3, bag_1.db3, "
         "bag_2.db3"),
        ({"relative_file_paths": []}, r"relative_file_paths: found \[\], expected list should have at least 1 item"),
        ({"storage_identifier": "mcap"},
         "storage_identifier: found 'mcap' with bag_0.db3, which is sqlite3, expected files of one storage"),
        ({"storage_identifier": "rosbag_v2"}, "storage_identifier: found 'rosbag_v2', expected 'sqlite3' or 'mcap'"),
        ({"compression_format": "bz2"}, "compression_format: found 'bz2', expected '', 'none' or 'zstd'"),
    ],
)  # fmt: skip
def test_a_wrong_metadata_file_is_one_line(bag, capsys, keys, line):
    edited(bag, **keys)
    with pytest.raises(InputError, match=rf"bag/metadata\.yaml: {line}"):
        read_recording(bag)
    assert main([str(bag)]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_mixed_storages_and_broken_metadata_are_one_line(bag, tmp_path):
    shutil.copy(tmp_path / "log.mcap", bag / "bag_3.mcap")
    assert "bag_3.mcap: not named in metadata.yaml, left out" in read_recording(bag).damage
    edited(bag, relative_file_paths=["bag_0.db3", "bag_3.mcap"])
    with pytest.raises(InputError, match="found 'sqlite3' with bag_3.mcap, which is mcap, expected files of one"):
        read_recording(bag)
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    with pytest.raises(InputError, match=r"bag/metadata\.yaml: "):
        read_recording(bag)
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: 9\n")
    with pytest.raises(InputError, match=r"metadata\.yaml: storage_identifier: missing, expected"):
        read_recording(bag)


def test_a_metadata_file_of_something_else_makes_no_bag(tmp_path):
    (tmp_path / "day").mkdir()
    (tmp_path / "day/metadata.yaml").write_text("author: me\n")
    log = in_ros(tmp_path / "day/log.mcap", *ROS["named"][:2], at_stamps(named_poses))
    assert logs_in(tmp_path) == ["day/log.mcap"]
    assert read_recording(log).kind == ""
