"""A controller of ROS 2: the bytes it is sent, and the other end by DDS on this machine's loopback."""

import os
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from rosbags.typesys import Stores, get_typestore

from tests.support.waiting import SOON, until
from trunkline.ar.drivers.ros_messages import Header, JointState, JointTrajectory, Time, trajectory
from trunkline.ar.drivers.ros_panda import RosPanda
from trunkline.ar.drivers.settings import ExecutionConfig
from trunkline.pipeline.config import PROJECT, load_folder

SETTINGS = replace(load_folder(ExecutionConfig, PROJECT / "conf/execution").ros, domain=77)
LOOPBACK = '<General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces></General>'
READY = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785])
THREADS = """
import time
from pathlib import Path
from cyclonedds.domain import DomainParticipant
participant, names = DomainParticipant(79), []
while "dq.user" not in names:  # it begins last
    time.sleep(0.1)
    names = [path.read_text().strip() for path in Path("/proc/self/task").glob("*/comm")]
print(*names)
"""


def test_its_bytes_are_those_of_ros():
    rng = np.random.default_rng(0)
    rows = [(float(t), rng.normal(size=7).tolist()) for t in (0.03, 1.25, 3.999999999)]
    data = trajectory(SETTINGS.names, rows).serialize()
    read = get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(data, "trajectory_msgs/msg/JointTrajectory")
    assert read.joint_names == list(SETTINGS.names)
    for (seconds, positions), point in zip(rows, read.points, strict=True):
        np.testing.assert_allclose(point.positions, positions, rtol=0, atol=1e-12)
        assert point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec == pytest.approx(seconds, abs=1e-9)
        assert not len(point.velocities) + len(point.accelerations) + len(point.effort)
    assert (read.header.stamp.sec, read.header.stamp.nanosec, read.header.frame_id) == (0, 0, "")


def test_what_ros_says_of_joints_is_read():
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](5, 6), "base")
    state = types["sensor_msgs/msg/JointState"](header, ["a", "b"], np.array([0.1, -0.2]), np.array([]), np.array([]))
    read = JointState.deserialize(bytes(store.serialize_cdr(state, "sensor_msgs/msg/JointState")))
    assert (list(read.name), list(read.position), read.header.stamp) == (["a", "b"], [0.1, -0.2], Time(5, 6))


class Controller:
    """The other end: it is where it is sent, and says so."""

    def __init__(self):
        self.joints, self.heard, self.stuck = READY.copy(), [], False
        participant = DomainParticipant(SETTINGS.domain)
        reliable = Qos(Policy.Reliability.Reliable(0), Policy.History.KeepLast(10))
        self._orders = DataReader(
            participant, Topic(participant, f"rt{SETTINGS.trajectory}", JointTrajectory), reliable
        )
        self._states = DataWriter(participant, Topic(participant, f"rt{SETTINGS.states}", JointState), reliable)

    def turn(self):
        for order in self._orders.take(10):
            self.heard.append(order)
            self.joints = self.joints if self.stuck else np.array(order.points[-1].positions)
        names = ["finger", *reversed(SETTINGS.names)]
        header = Header(Time(0, 0), "")
        self._states.write(JointState(header, names, [9.0, *reversed(self.joints.tolist())], [], []))


@pytest.fixture
def joined(monkeypatch):
    monkeypatch.setenv("CYCLONEDDS_URI", f"<CycloneDDS><Domain>{LOOPBACK}</Domain></CycloneDDS>")
    controller, arm = Controller(), RosPanda(SETTINGS)
    until(lambda: not np.isnan(arm.sent).any(), lambda: (controller.turn(), arm.turn(time.monotonic())))
    until(lambda: arm.ready, lambda: (controller.turn(), arm.turn(time.monotonic())))
    arm.fault = ""  # of a busy machine, until both knew each other
    yield arm, controller
    arm.close()


@pytest.mark.realtime
def test_a_controller_hears_where_the_joints_shall_be(joined):
    arm, controller = joined
    np.testing.assert_array_equal(arm.sent, READY)
    target, due = READY + 0.05, time.monotonic() + SOON

    def each():
        arm.send(due, target)
        controller.turn()
        arm.turn(time.monotonic())

    until(lambda: bool(controller.heard), each)
    (point,) = controller.heard[0].points
    np.testing.assert_allclose(point.positions, target, rtol=0, atol=1e-12)
    assert controller.heard[0].joint_names == list(SETTINGS.names)
    assert 0 <= point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec <= SOON
    until(
        lambda: np.abs(arm.measured - target).max() < 1e-12, lambda: (controller.turn(), arm._hear(time.monotonic()))
    )


def test_one_thread_receives_so_that_a_process_ends():
    """With one for each socket each reads until it has sent itself a packet, which never comes where a firewall drops
    it (eclipse-cyclonedds/cyclonedds, issue 1916). One for all is woken by a pipe: the default since pull request 1920.
    """
    environment = os.environ | {"CYCLONEDDS_URI": f"<CycloneDDS><Domain>{LOOPBACK}</Domain></CycloneDDS>"}
    command = [sys.executable, "-c", THREADS]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=True)
    assert [name for name in done.stdout.split() if name.startswith("recv")] == ["recv"]
