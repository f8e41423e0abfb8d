"""Where the straight arm hangs as cameras see it: when that is looked at, in which frame it is kept, when it counts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.ar.session.test_camera_alignment import NOISE, SET, TRUE
from tests.ar.session.test_correction_steps import CHAIN, pulled, tip_of
from tests.ar.teleop.test_plan import MOUNT, OFFSET, START
from tests.support.camera_session import CameraSession, damped
from trunkline.ar.session.arm_cameras import ArmCameras, MeasuredArm
from trunkline.ar.session.camera_alignment import CamerasAligned
from trunkline.ar.session.composition import hanging_tip
from trunkline.ar.session.hanging import HangingWatch
from trunkline.ar.session.previewer import Order
from trunkline.ar.session.registration import in_base, inverse
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.teleop.base_frames import base_frames

RATE, STRAIGHT, LIMIT = 100.0, np.array([0.5, 0.5, 0.5]), 30e-3
TWIN, HANGS = np.array([0.0, 0.0, -0.5]), np.array([0.006, 0.008, -0.5])  # m, in the base frame
PLACE, TURN = base_frames(START, OFFSET)


class Lab:
    """A robot at START whose arm hangs at `hangs`, as cameras see it whose frame is at TRUE, and set to be at SET."""

    def __init__(self, hangs=HANGS, twin=TWIN, set_to=TRUE):
        self.rng, self.time, self.hangs = np.random.default_rng(0), 0.0, hangs
        self.cameras = ArmCameras(None, ("base", "tip"), set_to, *np.zeros((2, 3)))
        self.watch = HangingWatch(self.cameras, STRAIGHT, twin, OFFSET, LIMIT)

    def look(self, seconds=2.0, joints=START, commands=STRAIGHT, swing=0.0, fault="", mount=True, measured=None):
        for _ in range(round(seconds * RATE)):
            self.time += 1 / RATE
            place, turn = base_frames(joints, OFFSET)
            swings = [swing * np.sin(2 * np.pi * 1.3 * self.time), 0.0, 0.0]
            seen = np.array([place + turn @ (self.hangs + swings), place]) + NOISE * self.rng.standard_normal((2, 3))
            tip, at_mount = in_base(self.cameras.pose, in_base(inverse(TRUE), seen))
            arm = MeasuredArm(self.time, np.zeros((2, 7)), tip, 0.01, RATE, 0.0, fault, at_mount if mount else None)
            state = RobotState(self.time, 0.0, joints, commands, np.zeros(7), np.zeros((0, 7)), measured)
            self.watch.observe(state, arm)
        return self.watch.place


def test_the_tip_of_the_straight_arm_is_seen_in_its_base_frame():
    lab = Lab()
    assert lab.look(0.5) is None
    assert lab.watch.words == ""
    np.testing.assert_allclose(lab.look(), HANGS, atol=0.3e-3)
    assert lab.watch.words.startswith("the straight arm hangs 10.")
    assert lab.watch.words.endswith(" mm from the twin's")


def test_it_is_as_the_cameras_frame_is_known_now():
    lab = Lab(set_to=SET)
    before = lab.look()
    assert np.linalg.norm(before - HANGS) > 1e-3, "the frame is turned"
    lab.cameras.align(TRUE)
    np.testing.assert_allclose(lab.watch.place, HANGS, atol=0.3e-3)


def test_the_mount_as_cameras_see_it_takes_the_frames_shift_away():
    lab = Lab(set_to=replace(TRUE, position=tuple(np.array(TRUE.position) + [0.02, -0.01, 0.03])))
    np.testing.assert_allclose(lab.look(), HANGS, atol=0.3e-3)


@pytest.mark.parametrize(
    "changes",
    [
        {"commands": STRAIGHT - [0.0, 0.001, 0.0]},
        {"joints": START + [0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.0]},
        {"swing": 5e-3},
        {"fault": "late"},
        {"mount": False},
        {"measured": START + [0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0]},
    ],
    ids=["pulled", "tilted", "swinging", "fault", "no mount", "tilted as measured"],
)
def test_nothing_is_seen_of_an_arm_that_does_not_hang_straight_and_still(changes):
    lab = Lab()
    assert lab.look(**changes) is None
    np.testing.assert_allclose(lab.look(2.5), HANGS, atol=0.3e-3)


def test_a_look_that_was_disturbed_begins_anew():
    lab = Lab()
    for _ in range(4):
        assert lab.look(0.7) is None
        assert lab.look(0.1, fault="late") is None


def test_after_the_first_motion_nothing_is_seen_and_what_was_seen_stays():
    lab, late = Lab(), Lab()
    seen = lab.look()
    lab.watch.end()
    lab.hangs = np.array([0.02, 0.0, -0.5])
    np.testing.assert_array_equal(lab.look(), seen)
    late.watch.end()
    assert late.look() is None


def test_a_tip_that_is_too_far_from_the_twins_is_not_used():
    lab = Lab(hangs=np.array([0.032, 0.0, -0.5]))
    assert lab.look() is None
    assert lab.watch.words.endswith(" mm from the twin's, not used: expected at most 30 mm")


def test_a_session_knows_where_its_twin_hangs():
    tip = hanging_tip(damped())
    np.testing.assert_allclose(tip, (tip_of(CHAIN, CHAIN.straight_lengths) - PLACE) @ TURN, atol=1e-3)


@pytest.mark.parametrize("is_aligned", [False, True])
def test_previews_lean_once_the_frame_is_aligned(tmp_path, is_aligned):
    session = CameraSession(tmp_path / "run.mcap")
    controller, orders = session.controller, []
    submit = controller.previewer.submit
    controller.previewer.submit = lambda order: (orders.append(order), submit(order))
    hangs = (tip_of(CHAIN, CHAIN.straight_lengths) - PLACE) @ TURN
    controller.hanging = SimpleNamespace(observe=lambda robot, arm: None, place=hangs, words="it hangs")
    controller.camera_alignment = SimpleNamespace(observe=lambda robot, arm: None, take=lambda: None)
    if is_aligned:
        controller._frame_by = CamerasAligned(session.cameras.pose, 6, 1e-3, 5e-4, 2e-3, 0.1, 0.05, "")
    session.places = np.array(MOUNT), np.array(MOUNT) + tip_of(CHAIN, pulled(0.02, 0, 0)) - PLACE
    session.until(lambda intent: intent.mode == "aim")
    session.left, session.right = {"grip": 1.0}, {"grip": 1.0}
    session.wait(0.5)
    session.right = {"grip": 1.0, "trigger": 1.0}
    session.until(lambda intent: intent.request is not None)
    assert controller.cameras_frame.endswith("; it hangs") == is_aligned
    (order,) = [order for order in orders if isinstance(order, Order)]
    assert np.array_equal(order.hangs, hangs) if is_aligned else order.hangs is None
    session.close()


def test_a_motion_ends_the_look(tmp_path):
    session, ends = CameraSession(tmp_path / "run.mcap"), []
    session.controller.hanging = SimpleNamespace(
        observe=lambda robot, arm: None, place=None, words="", end=lambda: ends.append(session.robot.now)
    )
    session.plan(MOUNT, np.array(MOUNT) + tip_of(CHAIN, pulled(0.02, 0, 0)) - PLACE)
    assert len(ends) == 1
    session.close()
