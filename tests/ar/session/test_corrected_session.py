"""From two rays to a tip that is where it was pointed to: the simulated robot, an arm not as its twin, simulated
cameras, and the true planner."""

import copy
import time
from dataclasses import replace

import numpy as np
import pytest

from tests.ar.session.test_arm_cameras import PATIENT
from tests.ar.session.test_controller import BASE, TRACKED, UP
from tests.ar.session.test_correction_control import Events
from tests.ar.session.test_correction_steps import BEYOND, CHAIN, PLANNER, pulled, tip_of
from tests.ar.session.test_preview_process import made
from tests.ar.session.test_robot_process import simulation
from tests.ar.teleop.test_plan import MOUNT, OFFSET, START
from tests.support.live import patient
from tests.support.operator import PACKAGE, Everywhere, config
from tests.support.small_arm import small_spec
from tests.support.waiting import until
from trunkline.ar.correction.correction import CorrectionSettings
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session import robot_process, simulated
from trunkline.ar.session.arm_cameras import SimulatedArmCameras
from trunkline.ar.session.binary import HAND, Received
from trunkline.ar.session.composition import subject_of
from trunkline.ar.session.controller import SessionController
from trunkline.ar.session.controller_input import controllers
from trunkline.ar.session.previewer import InlinePreviewer, PreviewPlanner
from trunkline.ar.session.robot_process import RobotProcess
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.vibration import shaper_for
from trunkline.frames import rotation_from_wxyz

BENT = -0.015  # rad, of each joint of the arm at rest: what its twin does not know
LATE = 5.0  # s
TARGET = np.array(MOUNT) + tip_of(CHAIN, pulled(0.02, 0, 0)) - base_frames(START, OFFSET)[0]


def unlike():
    """The simulated robot, its arm bent at rest in the plane of the first tendon."""
    s = simulation()
    model = copy.copy(s.twin.model)
    for joint in range(model.njnt):
        if model.body(model.jnt_bodyid[joint]).name.startswith("unit_") and abs(model.jnt_axis[joint][1]) > 0.9:
            model.qpos_spring[model.jnt_qposadr[joint]] += BENT
    return replace(s, twin=replace(s.twin, model=model))


def run_patiently(channel, simulation):
    """The robot's process, on a machine that does other work as well."""
    simulated.DEAD_MAN = LATE
    simulated.run(channel, simulation)


class Operator:
    """Both hands, in real time."""

    def __init__(self, controller):
        self.controller, self.left, self.right = controller, {}, {}
        self.last = time.monotonic()

    def tick(self):
        time.sleep(max(self.last + 1 / 72 - time.monotonic(), 0.0))
        now = time.monotonic()
        rows = [
            [
                ({"qw": 1.0} | dict(zip("xyz", np.array(place) + UP, strict=True)) | pressed).get(name, 0.0)
                for name in HAND
            ]
            for place, pressed in ((MOUNT, self.left), (TARGET, self.right))
        ]
        hands = controllers(Received("input", frozenset(TRACKED), 0, now, np.array(rows)))
        assert self.controller.hear(now, *hands, True, correct=True) == ""
        self.controller.poll(now)
        intent, self.last = self.controller.tick(now - self.last), now
        return intent

    def until(self, happens, seconds=120.0):
        end = time.monotonic() + seconds
        while not happens(intent := self.tick()):
            assert time.monotonic() < end, (intent.mode, intent.notice, self.controller.correction.words)
        return intent


@pytest.mark.realtime
def test_the_tip_of_an_arm_that_is_not_as_its_twin_is_corrected_by_cameras(monkeypatch):
    monkeypatch.setattr(robot_process, "STALE", LATE)
    s = unlike()
    shaper = shaper_for(small_spec().compile(), config().shaping)
    planning = PreviewPlanner(
        replace(PLANNER, shaper=shaper),
        replace(made().foresight, robot_model=replace(made().robot_model, lacking=BEYOND)),
        (),
    )
    cameras, log = SimulatedArmCameras(s, subject_of(s).tip, PATIENT), Events()
    cameras.connect()
    robot = RobotProcess(run_patiently, (s,), len(s.commands), len(s.bodies), s.limits, s.package)
    try:
        until(lambda: robot.ready, seconds=60.0)
        core = Teleoperation(patient(silence=5.0), Everywhere(), PACKAGE, OFFSET)
        controller = SessionController(
            core, robot, InlinePreviewer(planning.answers), make_world(()), 0.1, log, 0.0, cameras,
            CorrectionSettings(),
        )  # fmt: skip
        controller.control(BASE)
        operator = Operator(controller)
        operator.until(lambda intent: intent.mode == "aim")
        operator.left, operator.right = {"grip": 1.0}, {"grip": 1.0}
        begin = time.monotonic()
        operator.until(lambda _: time.monotonic() > begin + 1.0)
        operator.right = {"grip": 1.0, "trigger": 1.0}
        operator.until(lambda intent: intent.mode == "preview")
        assert controller.preview.correction.steps == 5, controller.preview.uncorrected
        operator.right = {"grip": 1.0}
        operator.until(lambda _: not controller.preview_shown(controller.intent.preview, time.monotonic()))
        operator.until(lambda intent: intent.mode == "ready")
        operator.right = {"grip": 1.0, "trigger": 1.0}
        operator.until(lambda intent: intent.mode == "execute")
        operator.right = {"grip": 1.0}

        def off():  # as it is, not as it is seen
            pose = robot.robot_state().bodies[s.bodies.index("unit_08")]
            place = rotation_from_wxyz(pose[3:]).apply(subject_of(s).tip[1])
            return float(np.linalg.norm(pose[:3] + place - controller.correction._bounds.target))

        operator.until(lambda _: controller.correction._phase == "moves" or controller.correction.over)
        before = off()
        operator.until(lambda intent: intent.mode == "aim")
        after = off()
        print(f"the tip was {1e3 * before:.2f} mm off, and is {1e3 * after:.2f} mm off; {controller.correction.words}")
        assert before > 1.5e-3
        (ended,) = [fields for kind, fields in log.events if kind == "corrected"]
        assert ended["errors"][0] == pytest.approx(before, abs=1e-3)
        assert ended["errors"][-1] == pytest.approx(after, abs=1e-3)
        assert after < 0.6 * before
    finally:
        robot.close()
        cameras.close()
