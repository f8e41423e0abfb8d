"""Bags of ROS 1: what an MCAP log gives, and one line for what is wrong."""

import struct

import numpy as np
import pytest
from rosbags.rosbag1 import Writer

from tests.recordings.logs.test_bags import DRIVERS, LIMITS, assert_same, raw_trials
from tests.recordings.logs.test_schemas import (
    BODIES,
    POSITIONS,
    QUATERNIONS,
    ROS,
    STAMPS,
    a_session,
    at_stamps,
    in_ros,
    link,
    named_poses,
    ros_transform,
)
from tests.support.bags import as_bag1
from tests.support.sessions import curl_truth, instruments, record, release_truth, static_truth
from trunkline.errors import InputError
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.logs.bag2 import read_recording
from trunkline.recordings.logs.definitions import KNOWN
from trunkline.recordings.preparation.inspect import main
from trunkline.recordings.session.session import read_session
from trunkline.recordings.session.source import open_log


def transforms(frame):
    """As vicon_bridge has segments."""
    return [(f"/vicon/{BODIES[body]}", ros_transform(*link(frame, body))) for body in range(3)]


SOURCES = DRIVERS | {
    "vicon_bridge": ("geometry_msgs/msg/TransformStamped", KNOWN["geometry_msgs/TransformStamped"], transforms)
}


@pytest.mark.parametrize("packed", [None, Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4])
def test_a_session_of_bags_gives_the_raw_trials_of_its_mcap_logs(tmp_path, capsys, packed):
    (tmp_path / "lab").mkdir()
    record(tmp_path / "lab", [static_truth(30.0), release_truth(), curl_truth()], instruments())
    folder = tmp_path / "bags"
    folder.mkdir()
    for log in (tmp_path / "lab").glob("*.mcap"):
        as_bag1(log, folder / f"{log.stem}.bag", packed)
    assert main([str(folder)]) == 0
    out = capsys.readouterr().out
    assert out.count("a bag of ROS 1") == 3
    text = (tmp_path / "lab/session.yaml").read_text()
    (folder / "session.yaml").write_text(text.replace(".mcap", ".bag"))
    assert read_session(folder).unlisted == []
    assert_same(raw_trials(folder), raw_trials(tmp_path / "lab"))
    (folder / "session.yaml").write_text(out.partition("Proposed session.yaml:\n")[2])
    proposed = load_raw_trials(folder, read_session(folder), LIMITS)
    assert not any(isinstance(raw, Exception) for _, raw, _ in proposed)


@pytest.mark.parametrize("driver", [driver for driver in SOURCES if driver != "vicon_receiver before"])
def test_topics_of_drivers_come_back_as_written(tmp_path, driver):
    schema, definition, messages = SOURCES[driver]
    log = in_ros(tmp_path / "log.mcap", schema, definition, at_stamps(messages, 3_000_000))
    bag, plain = (open_log(path, a_session()).poses for path in (as_bag1(log, tmp_path / "log.bag"), log))
    assert bag.undecodable == 0
    assert bag.names == plain.names
    for field in ("stamps", "positions", "quaternions", "present"):
        np.testing.assert_array_equal(getattr(bag, field), getattr(plain, field))


def test_a_segment_of_vicon_bridge_is_a_pose(tmp_path):
    schema, definition, messages = SOURCES["vicon_bridge"]
    log = in_ros(tmp_path / "log.mcap", schema, definition, at_stamps(messages))
    poses = open_log(as_bag1(log, tmp_path / "log.bag"), a_session()).poses
    columns = [poses.names.index(name) for name in BODIES]
    present = poses.present[:, columns]
    np.testing.assert_array_equal(poses.positions[:, columns][present], POSITIONS[present])
    np.testing.assert_allclose(poses.quaternions[:, columns][present], QUATERNIONS[present], atol=1e-12)
    assert np.abs(poses.stamps - STAMPS).max() <= 2000


def a_bag(path, kind, definition, raw):
    """Of raw messages, a second apart."""
    with Writer(path) as writer:
        connection = writer.add_connection("/arm/pose", kind, msgdef=definition, md5sum="*")
        for second, data in enumerate(raw):
            writer.write(connection, 10**9 * (second + 1), data)
    return path


STAMPED = """Header header
geometry_msgs/Pose pose
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""


def stamped(number, second):
    """The bytes of a PoseStamped as ROS 1 sends it: little-endian, nothing aligned, `seq` first."""
    return struct.pack("<IIII5s7d", number, second, 5, 5, b"world", 1, 2, 3, 0, 0, 0, 1)


def test_bytes_of_ros_1_are_read_without_their_number(tmp_path):
    bag = a_bag(tmp_path / "x.bag", "geometry_msgs/msg/PoseStamped", STAMPED, [stamped(7, 3), stamped(8, 4)])
    topic = read_recording(bag).topics["/arm/pose"]
    assert topic.definition.decode().startswith("std_msgs/Header header\n")
    (data, _) = topic.messages
    assert struct.unpack_from("<iI", data, 4) == (3, 5)
    assert struct.unpack_from("<7d", data, len(data) - 56) == (1, 2, 3, 0, 0, 0, 1)


def test_what_does_not_fit_its_definition_is_counted(tmp_path):
    raw = [stamped(n, n) for n in range(20)]
    raw[5] = raw[5][:-3]
    bag = a_bag(tmp_path / "x.bag", "geometry_msgs/msg/PoseStamped", STAMPED, raw)
    poses = open_log(bag, a_session(base={"position": [0, 0, 0]})).poses
    assert (len(poses.stamps), poses.undecodable) == (19, 1)


def test_a_topic_whose_definition_cannot_be_read_is_named_and_the_others_are_read(tmp_path):
    log = in_ros(tmp_path / "log.mcap", *ROS["named"][:2], at_stamps(named_poses))
    bag = as_bag1(log, tmp_path / "log.bag", spoil="/poses")
    read = read_recording(bag)
    assert read.topics == {}
    (line,) = read.damage
    assert line.startswith("/poses: the definition of motion_capture_tracking_interfaces/msg/NamedPoseArray cannot be")
    log = in_ros(tmp_path / "three.mcap", *SOURCES["vicon_bridge"][:2], at_stamps(transforms))
    spoilt, *others = (f"/vicon/{name}" for name in BODIES)
    read, whole = read_recording(as_bag1(log, tmp_path / "three.bag", spoil=spoilt)), read_recording(log)
    assert [line.partition(":")[0] for line in read.damage] == [spoilt]
    assert {name: len(topic.messages) for name, topic in read.topics.items()} == {
        name: len(whole.topics[name].messages) for name in others
    }


def test_transforms_by_their_name_of_old_are_those_of_tf2(tmp_path):
    schema, definition, messages = SOURCES["tf"]
    log = in_ros(tmp_path / "log.mcap", schema, definition, at_stamps(messages))
    old = as_bag1(log, tmp_path / "old.bag", renamed="tf/msg/tfMessage")
    bag, plain = (open_log(path, a_session()).poses for path in (old, log))
    assert bag.names == plain.names
    np.testing.assert_array_equal(bag.positions, plain.positions)


@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (lambda data: b"", "seems to be empty"),
        (lambda data: b"no bag at all\n" + data, "file magic is invalid"),
        (lambda data: data[: len(data) // 2], "bag index looks damaged|could not be read"),
        (lambda data: data[:20], "could not be read"),
    ],
)
def test_what_is_no_whole_bag_is_refused_with_the_remedy(tmp_path, damage, problem):
    log = in_ros(tmp_path / "log.mcap", *ROS["named"][:2], at_stamps(named_poses))
    bag = as_bag1(log, tmp_path / "log.bag")
    bag.write_bytes(damage(bag.read_bytes()))
    with pytest.raises(InputError, match=rf"log\.bag: .*({problem}).*expected a bag of ROS 1; `rosbag reindex`"):
        read_recording(bag)


def test_a_damaged_chunk_costs_what_is_behind_it_and_says_so(tmp_path):
    log = in_ros(tmp_path / "log.mcap", *ROS["named"][:2], at_stamps(named_poses))
    bag = as_bag1(log, tmp_path / "log.bag", Writer.CompressionFormat.BZ2, chunk=2000)
    whole = read_recording(bag).topics["/poses"]
    data = bytearray(bag.read_bytes())
    middle = data.index(b"BZh", len(data) // 2)
    data[middle : middle + 40] = bytes(40)
    bag.write_bytes(data)
    read = read_recording(bag)
    (line,) = read.damage
    assert line.startswith("damaged: ")
    assert line.endswith(f"; {len(whole.messages) - read.count} of {len(whole.messages)} messages lost")
    assert 0.2 < read.count / len(whole.messages) < 0.8
    assert read.topics["/poses"].messages == whole.messages[: read.count]
