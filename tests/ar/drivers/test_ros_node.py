"""A controller of ROS 2 by a node: `rclpy` is a stub here, and no ROS was tried."""

import sys
import threading
import time
from dataclasses import dataclass, field, replace
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from trunkline.ar.drivers.ros_panda import RosPanda
from trunkline.ar.drivers.settings import ExecutionConfig
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT, load_folder

SETTINGS = replace(load_folder(ExecutionConfig, PROJECT / "conf/execution").ros, link="rclpy", domain=77)
READY = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785])
SENSORS = "best effort, the newest"
LINK = "trunkline.ar.drivers.ros_node"


@dataclass
class Duration:
    sec: int = 0
    nanosec: int = 0


@dataclass
class Point:
    positions: list = field(default_factory=list)
    time_from_start: Duration = field(default_factory=Duration)
    velocities: list = field(default_factory=list)


@dataclass
class Trajectory:
    joint_names: list = field(default_factory=list)
    points: list = field(default_factory=list)


class Stub:
    """Of rclpy, what the link calls, and the controller behind it: it is where it is sent."""

    def __init__(self):
        self.domain = self.hears = self.quality = None
        self.heard, self.ended, self.spins, self.broken = [], [], threading.Event(), False
        self.counts = 1

    def init(self, args, context, domain_id):
        assert args == []
        assert context is not None
        self.domain = domain_id

    def node(self, name, context, use_global_arguments):
        def publisher(kind, topic, quality):
            assert (kind, topic, quality) == (Trajectory, SETTINGS.trajectory, "keep 1")
            return SimpleNamespace(publish=self.publish, get_subscription_count=lambda: self.counts)

        def subscription(kind, topic, hears, quality):
            assert (topic, quality) == (SETTINGS.states, SENSORS)
            self.hears = hears

        ends = lambda: self.ended.append("node")  # noqa: E731
        return SimpleNamespace(create_publisher=publisher, create_subscription=subscription, destroy_node=ends)

    def executor(self, context):
        def spin():
            assert self.spins.wait(10.0)

        return SimpleNamespace(add_node=lambda node: None, spin=spin, shutdown=self.spins.set)

    def publish(self, order):
        if self.broken:
            raise RuntimeError("publisher is not valid")
        self.heard.append(order)

    def say(self, joints):
        names = ["finger", *reversed(SETTINGS.names)]
        self.hears(SimpleNamespace(name=names, position=[9.0, *reversed(joints.tolist())]))


@pytest.fixture
def stub(monkeypatch):
    stub = Stub()
    environment = {
        "rclpy": {"Context": object, "init": stub.init, "shutdown": lambda context: stub.ended.append("context")},
        "rclpy.executors": {"SingleThreadedExecutor": stub.executor},
        "rclpy.node": {"Node": stub.node},
        "rclpy.qos": {"QoSProfile": lambda depth: f"keep {depth}", "qos_profile_sensor_data": SENSORS},
        "builtin_interfaces.msg": {"Duration": Duration},
        "sensor_msgs.msg": {"JointState": object},
        "trajectory_msgs.msg": {"JointTrajectory": Trajectory, "JointTrajectoryPoint": Point},
    }
    for package in ("builtin_interfaces", "sensor_msgs", "trajectory_msgs"):
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
    for name, holds in environment.items():
        module = ModuleType(name)
        vars(module).update(holds)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, LINK, raising=False)
    yield stub
    sys.modules.pop(LINK, None)


@pytest.fixture
def arm(stub):
    arm = RosPanda(SETTINGS)
    stub.say(READY)
    arm.turn(arm._state_time)
    assert arm.ready
    yield arm
    arm.close()


def test_a_node_sends_one_point_for_when_it_is_due(stub, arm):
    assert stub.domain == SETTINGS.domain
    np.testing.assert_array_equal(arm.sent, READY)
    now = arm._state_time
    for step in (0.04, 0.05):  # of those that wait the newest is sent
        arm.send(now + 1.5, READY + step)
    arm.turn(now)
    arm.send(now + 1.5, READY + 0.06)
    arm.turn(now)  # within PERIOD of the last
    (order,) = stub.heard
    (point,) = order.points
    assert order.joint_names == list(SETTINGS.names)
    np.testing.assert_allclose(point.positions, READY + 0.05, rtol=0, atol=1e-12)
    assert point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec == pytest.approx(1.5, abs=1e-6)
    assert not point.velocities


def test_what_it_hears_is_the_newest(stub, arm):
    for step in range(20):
        stub.say(READY + 0.001 * step)
    arm.turn(time.monotonic())
    np.testing.assert_allclose(arm.measured, READY + 0.019, rtol=0, atol=1e-12)
    assert not arm.fault


def test_a_topic_that_nobody_hears_and_one_that_fails_are_faults(stub, arm):
    now, stub.counts = arm._state_time, 0
    arm.turn(now)
    assert arm.fault == f"{SETTINGS.trajectory}: nobody listens any more"
    arm.fault, stub.counts, stub.broken = "", 1, True
    arm.send(now, READY)
    arm.turn(now)
    assert arm.fault == f"{SETTINGS.trajectory}: publisher is not valid"


def test_it_ends_its_node_and_its_context(stub):
    RosPanda(SETTINGS).close()
    assert stub.spins.is_set()
    assert stub.ended == ["node", "context"]


def test_no_rclpy_is_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "rclpy", None)
    monkeypatch.delitem(sys.modules, LINK, raising=False)
    with pytest.raises(InputError, match=r"^ros\.link: found no rclpy \(.*\), expected ROS 2 to be sourced, or dds$"):
        RosPanda(SETTINGS)
