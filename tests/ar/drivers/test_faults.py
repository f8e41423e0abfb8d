"""What is a fault of each limb and of the machine, from both sides of each border, each by itself: motors, reels, a
controller of ROS 2, and both limbs on one clock."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.support.motors import TICK, homed, motor_settings
from trunkline.ar.drivers import hardware_robot, ros_panda
from trunkline.ar.drivers.driver import CONNECTING
from trunkline.ar.drivers.gm6020 import Feedback
from trunkline.ar.drivers.hardware_robot import LEAD, HardwareRobot
from trunkline.ar.drivers.motors import FEEDBACK_TIMEOUT, PRESENT, MotorGroup
from trunkline.ar.drivers.ros_panda import JOINT_STATE_TIMEOUT, RosPanda
from trunkline.ar.drivers.setpoint_filter import ROUNDING
from trunkline.ar.drivers.settings import ExecutionConfig
from trunkline.ar.drivers.winch import Winch
from trunkline.errors import InputError
from trunkline.kinematics.panda.limits import VELOCITY
from trunkline.pipeline.config import PROJECT, load_folder

NEAR = 1e-6
ROS = load_folder(ExecutionConfig, PROJECT / "conf/execution").ros
READY = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785])
JOINTS = range(7)


# --- motors


def heard_at(now, motors, numbers=(1, 2, 3), celsius=30):
    for number in numbers:
        motors.hear(Feedback(number, 0, 0, 0.0, celsius), now)


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize(("silent", "faulty"), [(FEEDBACK_TIMEOUT - NEAR, False), (FEEDBACK_TIMEOUT + NEAR, True)])
def test_a_motor_may_be_silent_for_so_long(number, silent, faulty):
    motors = MotorGroup(motor_settings(), 100.0)
    heard_at(100.0, motors)
    heard_at(100.0 + silent, motors, {1, 2, 3} - {number})
    currents = motors.currents([0.0] * 3, [0.0] * 3, 100.0 + silent)
    assert motors.fault == (f"motor {number}: silent for 20 ms, expected feedback every 1 ms" if faulty else "")
    assert not (faulty and any(currents.values()))


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize(("late", "faulty"), [(PRESENT - NEAR, False), (PRESENT + NEAR, True)])
def test_each_motor_has_to_be_heard_at_first_and_none_is_driven_before(number, late, faulty):
    motors = MotorGroup(motor_settings(), 100.0)
    heard_at(100.0 + late, motors, {1, 2, 3} - {number})
    assert set(motors.currents([0.01] * 3, [0.0] * 3, 100.0 + late).values()) == {0.0}
    assert motors.fault.startswith(f"motor {number}: found no feedback") == faulty


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("beyond", [0, 1])
def test_a_motor_may_be_so_hot(number, beyond):
    bench = homed()
    hot = int(motor_settings().hot) + beyond
    bench.motors.hear(Feedback(number, bench.motors.winches[number - 1]._angle, 0, 0.0, hot), bench.now)
    assert bench.motors.fault == (f"motor {number}: found {hot} °C, expected at most 80" if beyond else "")


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("cable", range(3))
def test_a_cable_may_be_so_far_from_where_it_shall_be(cable, sign):
    """Reeled in too far, or not far enough."""
    astray = motor_settings().astray
    for off, faulty in ((astray - NEAR, False), (astray + NEAR, True)):
        bench = homed()
        pulls = np.array(bench.motors.pulls)
        currents = bench.motors.currents(pulls + sign * off * np.eye(3)[cable], np.zeros(3), bench.now)
        fault = f"motor {cable + 1}: found 20 mm from where its cable shall be, expected at most 20"
        assert bench.motors.fault == (fault if faulty else "")
        assert faulty == (not any(currents.values()))


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_fault_of_any_motor_ends_the_current_of_all(number):
    bench = homed()
    bench.rest(0.3, pull=0.01)
    assert min(np.abs(bench.currents)) > 0.05
    bench.motors.hear(Feedback(number, 0, 0, 0.0, 120), bench.now)
    bench.tick(pull=0.01)
    assert bench.currents == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("beyond", [-NEAR, NEAR])
def test_a_cable_may_be_so_loose_as_homing_begins(beyond):
    settings = motor_settings().reel
    winch = Winch(settings, 1)
    winch.read(Feedback(1, 0, 0, 0.0, 30), 0.0)
    winch.pull = settings.slack + beyond
    current = winch.home(0.001)
    assert winch.fault == ("found no tension within 100 mm, expected 6 N" if beyond > 0 else "")
    assert not (winch.fault and current)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("wanted", [-1.0, 1.0])
def test_the_current_of_a_loop_ends_at_what_the_settings_allow_either_way(side, wanted):
    winch = Winch(motor_settings().reel, side)
    winch.read(Feedback(1, 0, 0, 0.0, 30), 0.0)
    assert winch.current(wanted, 0.0, 0.001) == pytest.approx(side * wanted * motor_settings().reel.most)

# --- a controller of ROS 2


class Link:
    """A link that a test has in its hands. `sent`: (s, joints) of each point."""

    def __init__(self):
        self.listeners, self.joints, self.sent, self.error = 1, READY, [], None

    def send(self, seconds, joints):
        if self.error is not None:
            raise self.error
        self.sent.append((seconds, np.array(joints)))

    def states(self):
        return [] if self.joints is None else [(list(ROS.names), self.joints.tolist())]

    def close(self):
        pass


@pytest.fixture
def link(monkeypatch):
    made = Link()
    monkeypatch.setattr(ros_panda, "link_of", lambda settings: made)
    monkeypatch.setattr(ros_panda.time, "monotonic", lambda: 100.0)
    return made


@pytest.fixture
def arm(link):
    arm = RosPanda(ROS)
    arm.turn(100.0)
    assert arm.ready
    return arm


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("joint", JOINTS)
def test_a_joint_may_be_so_far_from_where_its_controller_is_sent(arm, link, joint, sign):
    arm.send(100.0 + LEAD, READY)
    arm.turn(100.0)
    off = sign * np.eye(7)[joint]
    for beyond, faulty in ((-NEAR, False), (NEAR, True)):
        link.joints = READY + (ROS.astray + beyond) * off
        arm.turn(100.01)
        fault = f"{ROS.names[joint]}: found 0.1 rad from where it is sent, expected at most 0.1"
        assert arm.fault == (fault if faulty else "")


@pytest.mark.parametrize("joint", JOINTS)
def test_a_joint_whose_place_is_no_number_is_a_fault(arm, link, joint):
    link.joints = np.where(np.arange(7) == joint, np.nan, READY)
    arm._sent = READY
    arm.turn(100.01)
    assert arm.fault.startswith(f"{ROS.names[joint]}: found nan rad")


@pytest.mark.parametrize(
    ("silent", "faulty"), [(JOINT_STATE_TIMEOUT - NEAR, False), (JOINT_STATE_TIMEOUT + NEAR, True)]
)
def test_joints_have_to_be_told_of_so_often(arm, link, silent, faulty):
    link.joints = None
    arm.turn(100.0 + silent)
    assert arm.fault == (f"{ROS.states}: silent for 200 ms" if faulty else "")


@pytest.mark.parametrize(("late", "faulty"), [(CONNECTING - NEAR, False), (CONNECTING + NEAR, True)])
@pytest.mark.parametrize("missing", ["listeners", "states"])
def test_a_controller_has_to_be_there_within_its_time(link, missing, late, faulty):
    if missing == "listeners":
        link.listeners = 0
    else:
        link.joints = None
    arm = RosPanda(ROS)
    arm.turn(100.0 + late)
    assert not arm.ready
    side = "found nobody who listens" if missing == "listeners" else "found no state of panda_joint1 and others"
    topic = ROS.trajectory if missing == "listeners" else ROS.states
    assert arm.fault == (f"{topic}: {side} within 20 s" if faulty else "")


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("joint", JOINTS)
def test_no_joint_is_sent_faster_than_it_may_go(link, joint, sign):
    for share, faulty in ((1 - 1e-4, False), (1 + 1e-4, True)):
        link.joints, link.sent = READY, []
        arm = RosPanda(ROS)
        arm.turn(100.0)
        there = READY + sign * share * ROUNDING * VELOCITY[joint] * LEAD * np.eye(7)[joint]
        arm.send(100.02 + LEAD, there)
        arm.turn(100.02)
        assert arm.fault.startswith(f"setpoint: {ROS.names[joint]} asks for ") == faulty
        assert len(link.sent) == (0 if faulty else 1)


@pytest.mark.parametrize("place", range(8))
def test_a_point_that_is_no_number_is_not_sent(arm, link, place):
    numbers = [100.0 + LEAD, *READY]
    numbers[place] = np.nan
    arm.send(numbers[0], np.array(numbers[1:]))
    arm.turn(100.02)
    assert arm.fault == "setpoint: found values that are not finite"
    assert link.sent == []


def test_a_point_that_cannot_be_sent_is_a_fault(arm, link):
    link.error = InputError("dds: closed")
    arm.send(100.02 + LEAD, READY)
    arm.turn(100.02)
    assert arm.fault == "dds: closed"


# --- both limbs


class FailedDriver:
    """A limb that is told what to be. `ahead`: s from its clock to when each setpoint is due."""

    def __init__(self, ready=True, fault="", at=READY):
        self.ready, self.fault, self.sent, self.measured = ready, fault, at, at
        self.turns, self.closed = 0, False

    def send(self, due, axes):
        self.sent = axes

    def turn(self, now):
        self.turns += 1

    def close(self):
        self.closed = True


@pytest.mark.parametrize(
    ("arm", "motors", "fault"),
    [("", "", ""), ("reflex", "", "robot: reflex"), ("", "hot", "motors: hot"), ("reflex", "hot", "robot: reflex"),
     (None, "hot", "motors: hot"), ("reflex", None, "robot: reflex"), (None, None, "")],
)  # fmt: skip
def test_a_fault_of_either_driver_is_the_robots_and_has_its_name(arm, motors, fault):
    drivers = [None if fault is None else FailedDriver(fault=fault) for fault in (arm, motors)]
    assert HardwareRobot(*drivers, np.full(3, 0.5), lambda: 100.0).fault == fault


@pytest.fixture
def waits(monkeypatch):
    """What is done while a machine waits for its limbs, one after the other."""
    done = []
    clock = SimpleNamespace(sleep=lambda seconds: done.pop(0)(), monotonic=lambda: 100.0)
    monkeypatch.setattr(hardware_robot, "time", clock)
    return done


def test_a_robot_begins_once_both_drivers_are_ready(waits):
    arm, motors = FailedDriver(ready=False), FailedDriver(ready=False, at=np.zeros(3))
    waits += [lambda: setattr(arm, "ready", True), lambda: None, lambda: setattr(motors, "ready", True)]
    made = HardwareRobot(arm, motors, np.full(3, 0.5), lambda: 100.0)
    np.testing.assert_array_equal(made.begin(np.ones(7)), READY)
    assert waits == []
    assert (arm.turns, motors.turns) == (3, 3)


@pytest.mark.parametrize(("driver", "fault"), [("panda", "robot: no robot"), ("motors", "motors: no robot")])
def test_a_robot_whose_driver_fails_does_not_begin(waits, driver, fault):
    drivers = {"panda": FailedDriver(ready=False), "motors": FailedDriver(ready=False)}
    waits += [lambda: setattr(drivers[driver], "fault", "no robot")]
    with pytest.raises(InputError, match=f"^{fault}$"):
        HardwareRobot(**drivers, straight=np.full(3, 0.5), clock=lambda: 100.0).begin(np.ones(7))


def test_a_machine_that_is_ready_and_has_failed_does_not_begin():
    with pytest.raises(InputError, match="^robot: reflex$"):
        HardwareRobot(FailedDriver(fault="reflex"), FailedDriver(), np.full(3, 0.5), lambda: 100.0).begin(np.ones(7))


@pytest.mark.parametrize("ready", [True, False])
def test_a_machine_that_nobody_wants_any_more_does_not_begin(ready):
    with pytest.raises(InputError, match="^the session is gone$"):
        HardwareRobot(FailedDriver(ready=ready), None, np.full(3, 0.5), lambda: 100.0).begin(np.ones(7), lambda: True)


@pytest.mark.parametrize("drivers", [(True, True), (True, False), (False, True)])
def test_each_driver_that_is_there_is_given_back(drivers):
    made = [FailedDriver() if there else None for there in drivers]
    HardwareRobot(*made, np.full(3, 0.5), lambda: 100.0).close()
    assert [driver.closed for driver in made if driver is not None] == [True] * sum(drivers)


def test_moves_that_are_due_anew_are_not_made_up_for():
    now = [100.0]
    made = HardwareRobot(FailedDriver(), None, np.full(3, 0.5), lambda: now[0])
    made.begin(READY)
    made.move(READY, np.full(3, 0.5))
    assert made.behind == 0.0  # the first
    now[0] += TICK
    made.move(READY, np.full(3, 0.5))
    assert made.behind == np.inf
    now[0] += LEAD + 2 * TICK
    made.move(READY, np.full(3, 0.5))
    assert made.behind == 0.0
