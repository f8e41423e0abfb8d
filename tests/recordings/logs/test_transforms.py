"""Trees of transforms: poses in several frames come out in one, as composed by hand, or are refused by name."""

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from scipy.spatial.transform import RigidTransform, Rotation

from tests.recordings.logs.test_schemas import (
    BODIES,
    COUNT,
    POSITIONS,
    QUATERNIONS,
    ROS,
    STAMPS,
    a_session,
    foxglove_transform,
    in_foxglove,
    in_ros,
    ros_transform,
)
from trunkline.errors import InputError
from trunkline.recordings.preparation.inspect import propose
from trunkline.recordings.preparation.survey import survey
from trunkline.recordings.session.source import open_log

WORLD = RigidTransform.from_components([1.0, -2.0, 0.5], Rotation.from_euler("xyz", [90, 20, 0], degrees=True))


def at(frame: int, body: int) -> RigidTransform:
    """Where the body is in `mocap`."""
    turn = Rotation.from_quat(QUATERNIONS[frame, body], scalar_first=True)
    return RigidTransform.from_components(POSITIONS[frame, body], turn)


def link(stamp, parent: str, child: str, transform: RigidTransform) -> tuple:
    turn = transform.rotation.as_quat(scalar_first=True)
    return int(stamp), parent, child, transform.translation, turn


def chain(frame: int) -> list[tuple]:
    """mocap holds base, base unit_1, and that unit_2."""
    poses, parents = [at(frame, body) for body in range(3)], ("mocap", *BODIES)
    relative = [poses[0], poses[0].inv() * poses[1], poses[1].inv() * poses[2]]
    return [link(STAMPS[frame], *names, pose) for *names, pose in zip(parents, BODIES, relative, strict=False)]


def write(path, messages, encoding="ros"):
    """(topic, links) a message, logged when its first link is dated."""
    made = ros_transform if encoding == "ros" else foxglove_transform
    contents = [(topic, {"transforms": [made(*link) for link in links]}, links[0][0]) for topic, links in messages]
    if encoding == "ros":
        in_ros(path, *ROS["tf"][:2], contents)
    else:
        in_foxglove(path, encoding, FrameTransforms, contents)


STATIC = ("/tf_static", [link(STAMPS[-1], "world", "mocap", WORLD)])  # dated late: it holds all the time
CHAIN = [("/tf", chain(frame)) for frame in range(COUNT)]


def assert_poses(poses, expected):
    """`expected`(frame, body) for all; quaternions up to their sign."""
    columns = [poses.names.index(name) for name in BODIES]
    for frame in range(COUNT):
        for body, column in enumerate(columns):
            pose, turn = expected(frame, body), poses.quaternions[frame, column]
            np.testing.assert_allclose(poses.positions[frame, column], pose.translation, atol=1e-12)
            assert abs(turn @ pose.rotation.as_quat(scalar_first=True)) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("encoding", ["ros", "protobuf", "json"])
def test_a_chain_of_frames_is_composed(tmp_path, encoding):
    path = tmp_path / "log.mcap"
    write(path, [*CHAIN, STATIC], encoding)
    poses = open_log(path, a_session()).poses
    assert (poses.names, poses.parents, poses.undecodable) == (BODIES, ("mocap",), 0)
    np.testing.assert_array_equal(poses.stamps, STAMPS)
    assert_poses(poses, at)
    poses = open_log(path, a_session(frame={"up": [0, 0, 1], "name": "world"})).poses
    assert poses.parents == ("world",)
    assert_poses(poses, lambda frame, body: WORLD * at(frame, body))


def test_poses_of_one_frame_stay_in_it_to_the_last_bit(tmp_path):
    path = tmp_path / "log.mcap"
    links = [[link(STAMPS[i], "mocap", name, at(i, body)) for body, name in enumerate(BODIES)] for i in range(COUNT)]
    write(path, [STATIC, *(("/tf", some) for some in links)])
    np.testing.assert_array_equal(open_log(path, a_session()).poses.positions, POSITIONS)
    poses = open_log(path, a_session(frame={"up": [0, 0, 1], "name": "world"})).poses
    assert_poses(poses, lambda frame, body: WORLD * at(frame, body))


def test_static_transforms_connect_the_frames_of_two_cameras(tmp_path):
    """Each camera sees one of the bodies; only their mounting in the room relates them."""
    path, right = tmp_path / "log.mcap", WORLD.inv()
    static = [link(0, "room", "left", WORLD), link(0, "room", "right", right)]
    moving = [
        ("/tf", [link(STAMPS[i], "left", "base", at(i, 0)), link(STAMPS[i], "right", "tip", at(i, 1))])
        for i in range(COUNT)
    ]
    write(path, [*moving, ("/tf_static", static)])
    poses = open_log(path, a_session()).poses
    assert (poses.names, poses.parents) == (("base", "tip"), ("room",))
    np.testing.assert_allclose(poses.positions[7, 0], (WORLD * at(7, 0)).translation)
    np.testing.assert_allclose(poses.positions[7, 1], (right * at(7, 1)).translation)


def test_a_parent_is_where_it_was_last_seen(tmp_path):
    """The base is sent every fourth frame, first with the third; what came before it cannot be placed."""
    path = tmp_path / "log.mcap"
    messages = []
    for i in range(COUNT):
        messages.append(("/tf", [link(STAMPS[i], "base", "unit_1", at(i, 1))]))
        if i % 4 == 2:
            messages.append(("/tf", [link(STAMPS[i], "mocap", "base", at(i, 0))]))
    write(path, messages)
    poses = open_log(path, a_session()).poses
    column = poses.names.index("unit_1")
    assert poses.present[:, column].all()
    assert np.isnan(poses.positions[:2, column]).all()
    for i in range(2, COUNT):
        expected = at(i - (i - 2) % 4, 0) * at(i, 1)
        np.testing.assert_allclose(poses.positions[i, column], expected.translation, atol=1e-12)


def test_a_parent_that_is_turned_by_no_rotation_places_nothing(tmp_path):
    path = tmp_path / "log.mcap"
    broken = [(topic, [links[0][:4] + (np.zeros(4),), *links[1:]]) for topic, links in CHAIN[:1]]
    write(path, [*broken, *CHAIN[1:]])
    poses = open_log(path, a_session()).poses
    assert np.isnan(poses.positions[0, 1:]).all()
    assert np.isfinite(poses.positions[1:]).all()


@pytest.mark.parametrize(
    ("links", "name", "message"),
    [
        ([("a", "b"), ("b", "c"), ("c", "a")], None, "found a cycle of frames, b in a in c in b, expected a tree"),
        ([("mocap", "base"), ("base", "tip"), ("lab", "tip")], None, "found 'tip' in the frames base and lab"),
        ([("mocap", "base"), ("lab", "tip")], None, "found poses in the frames mocap, lab, which nothing con"),
        ([("mocap", "base"), ("base", "tip")], "room", "found poses in the frames base, mocap, expected 'room', as in"),
        ([("mocap", "base")], "room", "found poses in the frames mocap, expected 'room', as in session.yaml"),
    ],
)
def test_frames_that_are_no_tree_are_refused_by_name(tmp_path, links, name, message):
    path = tmp_path / "log.mcap"
    write(path, [("/tf", [link(STAMPS[i], *pair, at(i, 0))]) for i in range(COUNT) for pair in links])
    with pytest.raises(InputError) as caught:
        open_log(path, a_session(frame={"up": [0, 0, 1], "name": name}))
    assert f"{path}: /tf: {message}" in str(caught.value)


def test_of_several_trees_the_named_one_counts(tmp_path):
    path = tmp_path / "log.mcap"
    other = [link(STAMPS[0], "map", "robot", WORLD)]
    write(path, [*CHAIN, ("/tf", other)])
    assert "name: mocap" in propose([survey(path)])
    poses = open_log(path, a_session(frame={"up": [0, 0, 1], "name": "mocap"})).poses
    assert poses.names == BODIES
    assert_poses(poses, at)
