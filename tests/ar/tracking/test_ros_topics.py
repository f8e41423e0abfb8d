"""Topics of ROS 2 as a source of poses: their bytes are those of ROS, a driver in another process is heard by DDS, and
what it says untruly is named; and single bodies are put together to frames."""

import itertools
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.ar.drivers.test_ros_dds import LOOPBACK
from tests.ar.tracking.ros_publisher import NAMES, PLACES, TURNED, messages, topic_of
from tests.support.waiting import until
from trunkline.ar.tracking import ros_source
from trunkline.ar.tracking.body_frames import BodyFrames, BodyPose
from trunkline.ar.tracking.ros_messages import TYPES
from trunkline.ar.tracking.ros_source import RosSource
from trunkline.ar.tracking.ros_topics import RosTopicSettings, RosTracker
from trunkline.ar.tracking.stream_checks import StreamLimits
from trunkline.ar.tracking.tracker import ExpectedBodies
from trunkline.errors import InputError
from trunkline.recordings.logs.definitions import KNOWN
from trunkline.recordings.logs.messages import POSES, TOPIC_PER_BODY

DOMAIN = 81 + os.getpid() % 19  # apart from other runs of the tests on this machine
URI = f"<CycloneDDS><Domain>{LOOPBACK}</Domain></CycloneDDS>"
APART = np.linalg.norm(PLACES[:, None] - PLACES, axis=-1)
EXPECTED = ExpectedBodies(NAMES, True, None, APART)
PATIENT = StreamLimits(silence=10.0, age=10.0)  # a busy machine is no lie
KINDS = sorted(TYPES)


def settings_of(kind, frame=""):
    return RosTopicSettings(DOMAIN, topic_of(kind), kind, frame)


@pytest.fixture(autouse=True)
def _loopback(monkeypatch):
    monkeypatch.setenv("CYCLONEDDS_URI", URI)


@contextmanager
def published(kind, reliability="reliable", fault=""):
    command = [sys.executable, "-m", "tests.ar.tracking.ros_publisher", str(DOMAIN), kind, reliability, fault]
    process = subprocess.Popen(command, env=os.environ | {"CYCLONEDDS_URI": URI}, stdout=subprocess.PIPE)
    try:
        assert process.stdout.readline() == b"publishes\n"
        yield process
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.mark.parametrize("kind", KINDS)
def test_the_bytes_are_those_of_ros(kind):
    """Written by another library by the definitions in text, whose encoding is that of ROS 2."""
    store = get_typestore(Stores.ROS2_JAZZY)
    name = kind.replace("/", "/msg/")
    if name not in store.types:
        store.register(get_types_from_msg(KNOWN[kind], name))
    for body, message in messages(kind, 7, 12.5, NAMES, PLACES, ["world"] * 3):
        data = message.serialize()
        other = store.deserialize_cdr(data, name)
        assert bytes(store.serialize_cdr(other, name)) == data
        rows = slice(None) if body is None else [NAMES.index(body)]
        for read in (other, TYPES[kind].deserialize(data)):
            poses = POSES[kind](read)
            assert np.unique(poses.time).tolist() == [12_500_000_000]
            np.testing.assert_array_equal(poses.positions, PLACES[rows])
            np.testing.assert_array_equal(poses.orientations, np.tile(TURNED, (len(PLACES[rows]), 1)))


@pytest.mark.realtime
@pytest.mark.parametrize("reliability", ["reliable", "best_effort"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_source_hears_each_message_however_it_is_published(kind, reliability):
    with published(kind, reliability):
        source = RosSource(settings_of(kind, "world"), ("tip", "base"))
        frames = [source.receive(5.0) for _ in range(20)]
        source.close()
    for frame in frames:
        assert frame.tracked.all()
        np.testing.assert_allclose(frame.positions, PLACES[[2, 0]], atol=3e-3)
        np.testing.assert_array_equal(frame.quaternions, [TURNED, TURNED])
    stamps, numbers = np.array([(frame.stamp, frame.number) for frame in frames]).T
    assert np.all(np.diff(stamps) > 5e-3)
    assert np.all(np.diff(numbers) >= 1)
    assert abs(stamps[-1] - time.time()) < 60


def test_the_kinds_are_those_that_logs_have():
    assert set(TYPES) <= set(POSES)
    assert {kind for kind in TYPES if kind in TOPIC_PER_BODY} == {"geometry_msgs/PoseStamped"}
    for kind in KINDS:
        assert settings_of(kind).message == kind


@pytest.mark.realtime
@pytest.mark.parametrize(
    ("fault", "line"),
    [
        ("old", "expected both to grow"),
        ("back", "expected both to grow"),
        ("frozen", "only repeat the one before|to the last bit"),
        ("swapped", "taken for each other|for the usual"),
        ("off", "for the usual"),
        ("nan", "'tip': found a position that is not finite"),
        ("frame", "found 'tip' in the frame 'elsewhere', expected 'world'"),
        ("frame of a topic", "found 'tip' in the frame 'elsewhere', expected 'world'"),
    ],
)
def test_what_is_published_untruly_is_named(fault, line):
    kind = "tf2_msgs/TFMessage" if fault == "frame" else "geometry_msgs/PoseStamped"
    with published(kind, fault=fault.removesuffix(" of a topic")) as driver:
        tracker = RosTracker(settings_of(kind), EXPECTED, PATIENT)
        try:
            tracker.connect()
            poses = tracker.latest()
            assert poses.sound
            np.testing.assert_allclose(poses.positions, PLACES, atol=3e-3)
            driver.send_signal(signal.SIGUSR1)
            until(lambda: not tracker.latest().sound, seconds=30.0)
            assert re.search(line, tracker.latest().fault), tracker.latest().fault
        finally:
            tracker.stop()


def test_a_body_that_no_topic_can_have_and_bodies_that_are_stamped_apart_are_refused(monkeypatch):
    with pytest.raises(InputError, match="cameras.bodies: found 'unit 04', expected letters, digits and _, as a part"):
        RosSource(settings_of("geometry_msgs/PoseStamped"), ("base", "unit 04"))
    monkeypatch.setattr(ros_source, "COMES", 0.2)
    stamps = itertools.count()
    turn = np.array([1.0, 0.0, 0.0, 0.0])
    monkeypatch.setattr(RosSource, "_messages", lambda self, seconds: [
        [BodyPose(name, 2e-3 * next(stamps), np.zeros(3), turn)] for name in NAMES
    ])  # fmt: skip
    with pytest.raises(InputError, match="found each body stamped by itself, expected two of them within 1 ms"):
        RosSource(settings_of("geometry_msgs/PoseStamped"), NAMES)


@pytest.mark.realtime
def test_a_driver_that_falls_silent_is_named_and_forgiven_where_it_is_on_time_again():
    limits = StreamLimits(silence=2.0, age=10.0, recovers=0.5)
    kind = "motion_capture_tracking_interfaces/NamedPoseArray"
    tracker = RosTracker(settings_of(kind), EXPECTED, limits)
    try:
        with published(kind):
            tracker.connect()
            assert tracker.latest().sound
            until(lambda: tracker.latest().rate > 0)
        until(lambda: not tracker.latest().sound)
        assert tracker.latest().fault.startswith("found no frame for 2.")
        with published(kind, "best_effort"):
            until(lambda: tracker.latest().sound, seconds=30.0)
    finally:
        tracker.stop()


@pytest.mark.realtime
def test_a_body_that_is_not_published_and_a_silent_topic_are_refused(monkeypatch):
    kind = "mocap4r2_msgs/RigidBodies"
    monkeypatch.setattr(ros_source, "COMES", 0.2)
    with pytest.raises(InputError) as error:
        RosSource(settings_of(kind), NAMES)
    nothing = f"found no {kind} within 0.2 s, expected 'base'"
    assert str(error.value) == f"ROS 2 topic /rigid_bodies: {nothing}"
    monkeypatch.setattr(ros_source, "COMES", 8.0)
    with published(kind, fault="missing"), pytest.raises(InputError) as error:
        RosSource(settings_of(kind), ("base", "midle"))
    missing = "found the bodies base, middle within 8 s, expected 'midle', did you mean 'middle'?"
    assert str(error.value) == f"ROS 2 topic /rigid_bodies: {missing}"


@pytest.mark.parametrize(
    ("topic", "message", "expected"),
    [
        ("/poses", "geometry_msgs/PoseStamped", "{body} in it once"),
        ("/{body}/{body}", "geometry_msgs/PoseStamped", "{body} in it once"),
        ("/{other}/{body}", "geometry_msgs/PoseStamped", "{body} in it once"),
        ("/{body}", "tf2_msgs/TFMessage", "no {body}: a message names its bodies"),
    ],
)
def test_a_topic_names_the_body_only_where_the_message_does_not(topic, message, expected):
    with pytest.raises(ValueError, match=f"topic: found '{topic}' for {message}, expected ") as error:
        RosTopicSettings(0, topic, message)
    assert expected in str(error.value)


def body(name, stamp, x=0.0, number=None):
    return BodyPose(name, stamp, np.array([x, 0.0, 0.0]), np.array([1.0, 0, 0, 0]), number)


def numbers(frames):
    return [(frame.number, frame.stamp, frame.tracked.tolist()) for frame in frames]


def test_bodies_of_one_stamp_are_a_frame_and_who_is_missing_is_not_tracked():
    frames = BodyFrames(("a", "b"))
    assert frames.add([body("a", 1.0)]) == []
    (first,) = frames.add([body("b", 1.0004, 7.0), body("other", 9.0)])
    assert (first.number, first.stamp, first.tracked.tolist()) == (1, 1.0004, [True, True])
    assert first.positions[:, 0].tolist() == [0.0, 7.0]
    assert frames.add([body("b", 1.01)]) == []  # `a` is hidden
    assert numbers(frames.add([body("a", 1.02)])) == [(2, 1.01, [False, True])]
    (whole,) = frames.add([body("b", 1.02)])
    assert (whole.number, whole.stamp) == (3, 1.02)


def test_a_stamp_that_goes_back_or_stands_still_makes_a_frame_that_says_so():
    frames = BodyFrames(("a", "b"))
    both = numbers(frames.add([body("a", 5.0), body("b", 5.0), body("a", 4.0), body("b", 4.0)]))
    assert both == [(1, 5.0, [True, True]), (2, 4.0, [True, True])]
    again = numbers(frames.add([body("a", 6.0), body("a", 6.0), body("b", 6.0)]))
    assert again == [(3, 6.0, [True, False]), (4, 6.0, [True, True])]


def test_a_number_of_the_cameras_counts_where_a_message_has_one():
    assert BodyFrames(("a",)).add([body("a", 1.0, number=41)])[0].number == 41
