"""The arm as cameras see it: its frame, its tip, what is named, and a session that corrects its tip by them."""

import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.ar.session.test_robot_process import simulation
from tests.support.live import live
from tests.support.waiting import until
from trunkline.ar.session.__main__ import parsed
from trunkline.ar.session.arm_cameras import ArmCameras, SimulatedArmCameras, real_cameras, with_session
from trunkline.ar.session.bodies import BodyPoses
from trunkline.ar.session.composition import subject_of
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.ar.teleop.messages import Pose
from trunkline.ar.tracking.tracker import TrackedPoses
from trunkline.errors import InputError
from trunkline.frames import wxyz_from_rotation

PATIENT = replace(
    live().cameras, limits=replace(live().cameras.limits, silence=10.0, age=10.0)
)  # a busy machine is no lie


class ToldTracker:
    def __init__(self, positions, quaternions, fault=""):
        self.poses = TrackedPoses(("base", "tip"), 5.0, positions, quaternions, 0.01, 120.0, 0.02, fault)

    def latest(self):
        return self.poses


def test_what_cameras_see_is_in_the_robots_frame_and_its_tip_is_beside_the_last_body():
    rng = np.random.default_rng(0)
    turn, origin, place = Rotation.random(rng=rng), rng.standard_normal(3), np.array([0.01, 0.02, -0.03])
    positions, turns = rng.standard_normal((2, 3)), Rotation.random(2, rng=rng)
    pose = Pose(tuple(origin), tuple(wxyz_from_rotation(turn)))
    tracker = ToldTracker(positions, wxyz_from_rotation(turns), "found no frame")
    arm = ArmCameras(tracker, ("base", "tip"), pose, place, -2 * place).latest()
    np.testing.assert_allclose(arm.poses[:, :3], turn.apply(positions) + origin)
    np.testing.assert_allclose(arm.poses[:, 3:], wxyz_from_rotation(turn * turns))
    np.testing.assert_allclose(arm.tip, turn.apply(positions[1] + turns[1].apply(place)) + origin)
    np.testing.assert_allclose(arm.mount, turn.apply(positions[0] + turns[0].apply(-2 * place)) + origin)
    assert (arm.stamp, arm.age, arm.rate, arm.loss, arm.fault) == (5.0, 0.01, 120.0, 0.02, "found no frame")


@pytest.mark.parametrize("body", [0, 1])
def test_a_body_that_is_not_seen_has_no_pose_and_without_the_last_there_is_no_tip(body):
    positions, quaternions = np.zeros((2, 3)), np.tile([1.0, 0, 0, 0], (2, 1))
    positions[body] = quaternions[body] = np.nan
    arm = ArmCameras(
        ToldTracker(positions, quaternions), ("base", "tip"), Pose((0, 0, 0), (1, 0, 0, 0)), *np.zeros((2, 3))
    )
    assert np.isnan(arm.latest().poses).all(axis=1).tolist() == [body == 0, body == 1]
    assert np.isnan(arm.latest().tip).all() == (body == 1)
    assert np.isnan(arm.latest().mount).all() == (body == 0)


def markers_in(s, bodies: np.ndarray, names) -> np.ndarray:
    """Where the model has the markers of these bodies, m; its base has none beside its frame. Shape (B, 3)."""
    poses = bodies[[s.bodies.index(name) for name in names]]
    places = [np.zeros(3) if name == "base" else s.twin.model.site(f"{name}_center").pos for name in names]
    return poses[:, :3] + Rotation.from_quat(poses[:, 3:], scalar_first=True).apply(places)


@pytest.mark.realtime
@pytest.mark.parametrize("swaps", [0.0, 20.0])
def test_simulated_cameras_see_the_simulated_robots_arm_and_name_exchanged_labels(swaps):
    s = simulation()
    settings = replace(PATIENT, simulated=replace(PATIENT.simulated, swaps=swaps, swap=(2000.0, 3000.0), gaps=0.0))
    cameras = SimulatedArmCameras(s, subject_of(s).tip, settings)
    assert cameras.names == ("base", "unit_04", "unit_08")
    cameras.connect()
    try:
        poses = BodyPoses(s.twin.model, s.bodies).of(s.twin.start)
        if swaps:
            until(lambda: cameras.latest().fault, seconds=20.0)
            return
        last = s.bodies.index("unit_08")
        tip = poses[last, :3] + Rotation.from_quat(poses[last, 3:], scalar_first=True).apply(subject_of(s).tip[1])
        for shift in (0.0, 0.05):
            moved = poses + np.eye(7)[0] * shift
            cameras.show(moved)
            began = time.monotonic()
            until(lambda: cameras.latest().stamp > began + 0.05)  # noqa: B023
            arm = cameras.latest()
            assert np.linalg.norm(arm.tip - tip - [shift, 0, 0]) < 3e-3
            assert np.linalg.norm(arm.mount - base_frames(s.joints, s.mount_offset)[0] - [shift, 0, 0]) < 3e-3
            np.testing.assert_allclose(arm.poses[:, :3], markers_in(s, moved, cameras.names), atol=3e-3)
        assert arm.fault == ""
    finally:
        cameras.close()


def test_settings_of_cameras_say_what_is_missing():
    with pytest.raises(InputError, match=r"^cameras.bodies: found none"):
        real_cameras("natnet", live().cameras)
    with pytest.raises(ValueError, match="found 2 bodies and 0 distances, expected a distance from each to the next"):
        replace(live().cameras, bodies=("a", "b"))
    with pytest.raises(ValueError, match="found a length of 2, expected 1"):
        replace(live().cameras, quaternion=(2.0, 0.0, 0.0, 0.0))
    named = replace(live().cameras, bodies=("mount", "mid", "tip"), apart=(0.2, 0.1), tip=(0.0, 0.0, -0.01))
    assert real_cameras("natnet", named).names == ("mount", "mid", "tip")


@pytest.mark.parametrize(
    ("bodies", "mount", "expected"),
    [(("a", "b"), (0.0, 0.1, 0.0), (0.0, 0.1, 0.0)), (("a", "b"), None, None), (("a",), (0.0, 0.1, 0.0), None)],
)
def test_which_streams_have_a_body_at_the_mount(bodies, mount, expected):
    named = replace(live().cameras, bodies=bodies, apart=(0.2,) * (len(bodies) - 1), mount=mount)
    cameras = real_cameras("natnet", named)
    cameras._tracker = ToldTracker(np.zeros((len(bodies), 3)), np.tile([1.0, 0, 0, 0], (len(bodies), 1)))
    place = cameras.latest().mount
    assert (None if place is None else tuple(place)) == expected


@pytest.mark.parametrize("more", [["--robot", "panda"], ["--motors", "gm6020", "--bus", "can0"]])
def test_simulated_cameras_are_not_for_a_real_arm(more):
    assert parsed(["package", "--cameras", "simulated"]).cameras == "simulated"
    assert parsed(["package", "--cameras", "natnet", *more]).cameras == "natnet"
    with pytest.raises(InputError, match="--cameras simulated: found --robot or --bus besides"):
        parsed(["package", "--cameras", "simulated", *more])


SESSION = """
frame: {up: [0, 1, 0]}
base: mount
markers: {middle: unit_04, end: unit_08}
trials: [{file: a.mcap, experiment: release, level: 0.1, split: identify}]
"""


@pytest.fixture
def recorded(tmp_path):
    (tmp_path / "a.mcap").touch()
    (tmp_path / "session.yaml").write_text(SESSION)
    return tmp_path


@pytest.mark.parametrize("kind", ["natnet", "ros2", "qualisys"])
def test_a_session_names_the_bodies_and_what_the_model_calls_them(recorded, kind):
    settings = replace(live().cameras, session=str(recorded), apart=(0.2, 0.1))
    assert with_session(settings).bodies == ("mount", "middle", "end")
    cameras = real_cameras(kind, settings)
    assert cameras.names == ("base", "unit_04", "unit_08")
    assert cameras._tracker._expected.names == ("mount", "middle", "end")
    np.testing.assert_array_equal(np.diag(cameras._tracker._expected.distances, 1), [0.2, 0.1])
    assert cameras.sees_mount


@pytest.mark.parametrize(
    ("before", "after", "reason"),
    [
        ("base: mount", "base: {position: [0, 0, 0]}", "found a fixed base"),
        ("markers: {middle: unit_04, end: unit_08}", "", "found no `markers`"),
        ("end: unit_08", "end: unit_08, more: unit_09", "found 4 bodies and 2 distances"),
    ],
)
def test_a_session_that_names_no_such_arm_is_refused(recorded, before, after, reason):
    (recorded / "session.yaml").write_text(SESSION.replace(before, after))
    settings = replace(live().cameras, session=str(recorded), apart=(0.2, 0.1))
    with pytest.raises(InputError, match=rf"^cameras.session: .*session.yaml: .*{reason}"):
        real_cameras("natnet", settings)
    with pytest.raises(InputError, match=r"^cameras.session: .*/absent: no such folder, expected a session"):
        real_cameras("natnet", replace(settings, session=str(recorded / "absent")))


def test_names_are_said_once():
    with pytest.raises(ValueError, match="session: found `bodies` or `markers` besides, expected neither"):
        replace(live().cameras, session="data/raw/lab", bodies=("a",))
