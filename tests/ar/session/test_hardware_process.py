"""A real machine in a session: Panda and motors on one clock, and either's fault halts both. Nothing here is real."""

import multiprocessing
import os
import queue
import signal
import time
from dataclasses import replace

import numpy as np
import pytest

from tests.ar.session.test_robot_process import simulation, until
from tests.support.motors import PlayedMotors, homed
from tests.support.operator import PACKAGE, config
from trunkline.ar.drivers.driver import TICK
from trunkline.ar.drivers.driver_frames import Setpoint
from trunkline.ar.drivers.hardware_robot import LEAD, SMOOTH
from trunkline.ar.drivers.setpoint_filter import LIMITS, SetpointFilter
from trunkline.ar.drivers.settings import ExecutionConfig
from trunkline.ar.drivers.simulated_motors import SIMULATED
from trunkline.ar.drivers.tendon_driver import TendonDriver
from trunkline.ar.drivers.time_scaling import TimeScaledRobot
from trunkline.ar.session.__main__ import parsed
from trunkline.ar.session.hardware import hardware_of
from trunkline.ar.session.hardware_process import HardwarePlant, Pursuit, RealRobot
from trunkline.ar.session.robot_process import (
    DEAD_MAN,
    HOLD_TIME,
    MODE,
    MODES,
    PERMIT,
    PERMITTED,
    STOPS,
    Goal,
    RobotChannel,
)
from trunkline.ar.session.serving import alignment_for
from trunkline.ar.session.settings import SessionConfig as Live
from trunkline.ar.session.simulated import Loop, TwinPlant
from trunkline.ar.teleop.config import TeleoperationConfig as Teleop
from trunkline.ar.teleop.executor import BRAKE, FOLLOWS
from trunkline.ar.teleop.following import KNOT, Following
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import JOINTS, gentle, limits_of
from trunkline.errors import InputError
from trunkline.kinematics.panda.limits import ACCELERATION
from trunkline.pipeline.config import PROJECT, load_folder

EXECUTION = load_folder(ExecutionConfig, PROJECT / "conf/execution")
READY = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785])
STRAIGHT = np.array([0.5, 0.5, 0.5])
LATE = LEAD + (SMOOTH - 1) * TICK  # s by which limbs are behind the plan
TURN, PULL, SECONDS = 0.5, 0.06, 1.5
DELAY = 0.3  # s, of following


class PlayedArm:
    """An adapter's logic before a robot that goes where it is sent."""

    def __init__(self, rig):
        self._rig, self.stream, self.fault, self.ready = rig, SetpointFilter(READY, LIMITS["panda"]), "", True
        self.sent = self.measured = READY

    def send(self, due, joints):
        self.stream.hear(Setpoint(due, tuple(joints)), self._rig.now)

    def turn(self, now):
        self.fault = self.fault or self.stream.fault


class Rig:
    """Loop, machine and both limbs, on a clock that a test turns."""

    def __init__(self):
        self.bench, self.sent, self.pulls = homed(), [], []
        self.now = self.bench.now
        self.arm, self.motors = PlayedArm(self), PlayedMotors(self.bench)
        self.cables = TendonDriver(self.motors, self.now)
        machine = HardwarePlant(self.arm, self.cables, STRAIGHT, clock=lambda: self.now)
        limits = limits_of(config().motors)
        joints = machine.begin(np.zeros(7))
        robot = TimeScaledRobot(joints, STRAIGHT, limits, PACKAGE, lambda q, c, _: machine.move(q, c), LIMITS["panda"])
        self.channel = RobotChannel(multiprocessing.get_context("spawn"), 3, 0)
        self.channel.plans = queue.Queue()  # at once: between processes it has a thread, on no clock that a test turns
        self.loop, self.permitted = Loop(self.channel, robot, machine), True
        here = np.append(READY, STRAIGHT)
        rows = gentle(here, here + TURN * np.eye(10)[0] - PULL * np.eye(10)[8], limits, 0.002, SECONDS)
        self.plan = Plan(0.002, rows[:, :7], rows[:, 7:], (("approach", 0),), PACKAGE, "world")
        self.rest(0.1)
        self.channel.plans.put((1, self.plan.digest(), self.plan, self.channel.requests[STOPS]))
        self.channel.requests[PERMITTED] = 1
        self.begun = self.now
        until(lambda: self.loop.serial == 1, each=lambda: self.loop.turn(self.now))

    @property
    def mode(self):
        return MODES[int(self.channel.hear()[0][MODE])]

    def tick(self, turns=1):
        """A ms of both limbs, in which the loop turns `turns` times."""
        self.now = self.bench.now = self.now + TICK
        if self.permitted:
            self.channel.requests[PERMIT] = self.now
        for frame in self.bench.simulated.advance(self.now):
            self.bench.hear(frame)
        for _ in range(turns):
            self.loop.turn(self.now)
            self.loop.advance()
        self.loop.tell(self.now)
        self.bench.drive(*self.motors.wanted, self.now)
        self.sent.append(self.arm.stream.cycle(self.now, TICK))
        self.pulls.append(self.bench.pulls)

    def rest(self, seconds):
        for _ in range(round(seconds / TICK)):
            self.tick()

    def share(self):
        """Of the plan, done by joint 1 and by the second cable, (2,)."""
        return np.array([self.sent[-1][0] / TURN, self.pulls[-1][1] / PULL])


@pytest.fixture
def rig():
    return Rig()


def still(rig, seconds=0.1):
    """Whether the arm and the cables rest for so long; cables to a millimetre."""
    first, pulls = rig.sent[-1], rig.pulls[-1]
    rig.rest(seconds)
    return np.array_equal(rig.sent[-1], first) and np.abs(rig.pulls[-1] - pulls).max() < 1e-3


def test_both_drivers_run_the_plan_on_one_clock(rig):
    shares = []
    while rig.mode != "done":
        rig.tick()
        shares.append(rig.share())
        due = rig.now - rig.begun - LATE
        assert abs(rig.sent[-1][0] - rig.plan.at(due)[0][0]) < 5e-3
    rig.rest(0.2)
    assert np.abs(np.diff(shares, axis=1)).max() < 1.5e-3 / PULL  # the cable's own error, mm
    np.testing.assert_allclose(rig.sent[-1], rig.plan.joints[-1], atol=1e-9)
    np.testing.assert_allclose(rig.pulls[-1], [0.0, PULL, 0.0], atol=5e-4)
    np.testing.assert_allclose(rig.loop.plant.lengths(), STRAIGHT - [0.0, PULL, 0.0], atol=5e-4)


def test_a_stop_brings_both_to_rest_on_the_plan(rig):
    rig.rest(0.7)
    rig.channel.requests[STOPS] += 1
    rig.rest(BRAKE + LATE + 0.05)
    assert rig.mode == "idle"
    rig.rest(0.2)
    assert still(rig)
    done = rig.share()
    assert 0.2 < done[0] < 0.7
    assert abs(done[1] - done[0]) < 1e-3 / PULL


def test_without_a_permit_both_come_to_rest(rig):
    rig.rest(0.6)
    rig.permitted = False
    rig.rest(DEAD_MAN + BRAKE + LATE + 0.05)
    assert rig.mode == "idle"
    rig.permitted = True
    rig.rest(0.2)
    assert still(rig)
    assert rig.share()[0] < 0.7


def test_a_silent_motor_halts_the_arm_on_the_plan(rig):
    rig.rest(0.7)
    rig.bench.simulated.motors[2].silent = True
    rig.rest(0.03)
    assert rig.mode == "fault"
    assert rig.bench.currents == [0.0, 0.0, 0.0]
    assert rig.channel.hear()[1].startswith("motors: motor 3: silent for 2")
    rig.rest(BRAKE + LATE + 0.05)
    assert rig.arm.stream.fault == ""
    first = rig.sent[-1]
    rig.rest(0.2)
    np.testing.assert_array_equal(rig.sent[-1], first)
    assert 0.2 < rig.share()[0] < 0.7


def test_a_fault_of_the_arm_halts_the_motors_and_they_hold(rig):
    rig.rest(0.7)
    rig.arm.fault = "reflex"
    rig.rest(0.002)
    assert rig.mode == "fault"
    assert rig.channel.hear()[1] == "robot: reflex"
    rig.rest(BRAKE + LATE + 0.3)
    assert still(rig)
    assert rig.motors.fault == ""
    assert all(rig.bench.currents)
    assert 0.2 < rig.share()[1] < 0.7


def test_a_fault_lasts(rig):
    rig.arm.fault = "reflex"
    rig.rest(0.5)
    rig.channel.plans.put((2, rig.plan.digest(), rig.plan, rig.channel.requests[STOPS]))
    until(lambda: rig.loop.serial == 2, each=rig.tick)
    assert rig.mode == "fault"
    assert rig.channel.hear()[1] == "robot: reflex"
    assert still(rig)


def test_both_drivers_follow_and_rest_as_they_are_let_go(rig):
    """Seen from another place than where its plan would have led."""
    rig.channel.requests[STOPS] += 1
    rig.rest(BRAKE + LATE + 0.05)
    stops, here = rig.channel.requests[STOPS], np.append(rig.sent[-1], STRAIGHT)
    rig.channel.plans.put((2, FOLLOWS, Following(DELAY, 0.0, 0.05), stops))
    rig.channel.requests[PERMITTED] = 2
    until(lambda: rig.loop.serial == 2, each=lambda: rig.loop.turn(rig.now))
    goal = here + 0.1 * np.eye(10)[0] - 0.02 * np.eye(10)[8]
    for _ in range(20):
        rig.channel.plans.put((2, FOLLOWS, Goal(rig.now, goal), stops))
        rig.rest(KNOT)
    assert rig.mode == "running"
    assert rig.arm.stream.fault == ""
    np.testing.assert_allclose(rig.sent[-1], goal[:7], atol=1e-6)
    np.testing.assert_allclose(rig.pulls[-1], STRAIGHT - goal[7:], atol=1e-3)
    rig.permitted = False
    rig.rest(DEAD_MAN + 0.2)
    assert rig.mode == "idle"
    assert still(rig)


def test_a_loop_that_is_late_by_less_than_the_lead_moves_nothing_otherwise(rig):
    for _ in range(35):
        for _ in range(19):
            rig.tick(0)
        rig.tick(20)
    assert rig.arm.stream.fault == ""
    gain = np.diff(np.array(rig.sent[-700:]), 2, axis=0) / TICK**2
    assert (np.abs(gain) / ACCELERATION).max() < 0.5


def test_a_loop_that_is_late_by_more_is_a_fault_of_the_arm(rig):
    rig.rest(0.7)
    for _ in range(60):
        rig.tick(0)
    assert rig.arm.stream.fault.startswith("setpoints have run out")
    rig.rest(0.01)
    assert rig.mode == "fault"
    rig.rest(0.5)
    assert rig.arm.stream.resting
    assert still(rig)


# --- as processes, in real time


@pytest.fixture(scope="module")
def robot():
    """A machine without limbs: how late its process is moves nothing."""
    robot = RealRobot(replace(hardware_of("fr3", "simulated", "", "", EXECUTION), robot=""), simulation())
    until(lambda: robot.ready or not robot.alive, 60.0)
    yield robot
    robot.close()


@pytest.mark.realtime
def test_a_session_runs_a_plan_on_it_and_draws_it(robot):
    s, now = simulation(), robot.robot_state()
    here = np.append(now.joints, now.commands)
    rows = gentle(here, here + np.eye(10)[0] * 0.2 - np.eye(10)[7] * 0.01, s.limits, 0.002, 1.0)
    plan = Plan(0.002, rows[:, :7], rows[:, 7:], (("approach", 0),), s.package, "world")
    assert robot.start(plan, plan.digest()) == ""
    until(lambda: robot.state().mode == "done", 20.0, robot.permit)
    np.testing.assert_allclose(robot.robot_state().joints, plan.joints[-1], atol=1e-9)
    link = s.bodies.index("link_7")
    until(lambda: np.linalg.norm((robot.robot_state().bodies[link] - now.bodies[link])[:3]) > 0.02, 20.0)
    pressed = time.monotonic()
    robot.stop()
    until(lambda: robot.channel.hear()[0][HOLD_TIME] >= pressed)


def test_the_twin_is_not_thrown_about_by_what_its_process_hears_late():
    """The machine sways, and the process is told up to 4 ms late of where it is, 8 ms apart."""
    asked, rng = simulation(), np.random.default_rng(0)
    plant = TwinPlant(asked)
    pursuit, worst = Pursuit(asked, plant.tick), 0.0
    for now in np.arange(0, 3, plant.tick):
        heard = max(now - rng.uniform(0, 0.004), 0.0)
        sway = 0.1 * np.sin(np.pi * heard) ** 2
        pursuit.hear(now, np.append(asked.joints + sway, asked.commands))
        pursuit.go(now)
        here = pursuit.here
        plant.move(here[:JOINTS], here[JOINTS:])
        worst = max(worst, np.abs(plant.measured() - here[:JOINTS]).max())
    assert not plant.fault
    assert worst < 0.06  # as it is heard: 0.3


def test_a_pursuit_is_there_once_it_has_come_to_where_the_machine_stays():
    asked, tick = simulation(), 1 / 120
    pursuit, rest = Pursuit(asked, tick), np.append(asked.joints, asked.commands)
    assert pursuit.there
    for now in np.arange(0, 2, tick):
        pursuit.hear(now, rest + 0.05)
        if now == 0:
            assert not pursuit.there
        pursuit.go(now)
    assert pursuit.there
    np.testing.assert_allclose(pursuit.here, rest + 0.05, atol=1e-9)


@pytest.mark.realtime
def test_a_twin_that_hangs_is_a_fault_while_it_does(robot):
    """Or a picture at rest would be taken for the robot's."""
    os.kill(robot._twin.pid, signal.SIGSTOP)
    until(lambda: robot.state().mode == "fault")
    assert robot.state().fault.startswith("the twin that is drawn: silent for 0.5")
    os.kill(robot._twin.pid, signal.SIGCONT)
    until(lambda: robot.state().mode != "fault")


@pytest.mark.realtime
def test_without_its_twin_nothing_is_permitted(robot):
    robot._twin.kill()
    until(lambda: robot.state().mode == "fault")
    assert robot.state().fault == "its process has ended"


@pytest.mark.realtime
def test_a_machine_that_is_not_there_ends_before_it_begins():
    named = hardware_of("simulated", "gm6020", "nowhere0", "", EXECUTION)
    robot = RealRobot(named, simulation())
    until(lambda: not robot.alive, 60.0)
    assert not robot.ready
    robot.close()


# --- what is named


def test_nothing_real_moves_unless_it_is_named():
    assert hardware_of("simulated", "simulated", "", "", EXECUTION) is None
    assert not hardware_of("simulated", "gm6020", SIMULATED, "", EXECUTION).real
    assert hardware_of("panda", "simulated", "", "", EXECUTION).real
    assert hardware_of("simulated", "gm6020", "can0", "", EXECUTION).words() == (
        "no real robot, motors 1, 2, 3 on the bus can0"
    )
    for motors, bus in (("gm6020", ""), ("simulated", "can0")):
        with pytest.raises(InputError, match="--motors, --bus: found one of them"):
            hardware_of("simulated", motors, bus, "", EXECUTION)


def test_plans_are_slow_enough_for_the_robot_that_is_named():
    """An FR3's last joints may accelerate half as much as a Panda's."""
    teleop = load_folder(Teleop, PROJECT / "conf/teleop")
    panda, fr3 = (hardware_of(robot, "simulated", "", "", EXECUTION) for robot in ("panda", "fr3"))
    assert panda.slow_enough(teleop) == teleop
    limits = limits_of(fr3.slow_enough(teleop).motors)
    assert (limits.acceleration[:7] < LIMITS["fr3"].acceleration).all()
    assert (limits.acceleration[:7] >= 0.39 * LIMITS["panda"].acceleration).all()
    hasty = replace(teleop, motors=replace(teleop.motors, share=1.0))
    for robot in (panda, fr3):
        limits = limits_of(robot.slow_enough(hasty).motors)
        assert (limits.velocity[:7] < robot.limits.velocity).all()


def test_the_base_of_a_real_robot_is_never_put_in_place_by_eye():
    by_eye = replace(load_folder(Live, PROJECT / "conf/live").alignment, by_eye=True)
    simulated, real = (hardware_of("simulated", "gm6020", bus, "", EXECUTION) for bus in (SIMULATED, "can0"))
    assert alignment_for(None, by_eye).by_eye
    assert alignment_for(simulated, by_eye).by_eye
    assert not alignment_for(real, by_eye).by_eye


@pytest.mark.parametrize("named", [["--robot", "panda"], ["--motors", "gm6020", "--bus", "can0"]])
def test_a_dry_run_names_nothing_real(named):
    assert parsed(["p", *named]).package.name == "p"
    with pytest.raises(InputError, match=r"^--dry-run: found --robot or --motors besides"):
        parsed(["p", "--dry-run", *named])


def test_as_many_motors_as_tendons():
    two = replace(EXECUTION.motors, numbers=(1, 2), sides=(1, 1))
    named = replace(hardware_of("simulated", "gm6020", "can0", "", EXECUTION), motors=two)
    with pytest.raises(InputError, match=r"motors.numbers: found 2, expected 3"):
        RealRobot(named, simulation())
