"""What others read: the log of a session that is killed, and a trajectory as ROS 2 is sent it."""

import os
import signal
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from benchmarks.acceptance.row import Row
from tests.support.ticking import fed, ticks
from tests.support.waiting import until
from trunkline.ar.drivers.ros_messages import trajectory
from trunkline.ar.drivers.settings import ExecutionConfig as Execution
from trunkline.ar.session.log_writer import NOTHING, LogWriterProcess
from trunkline.ar.session.settings import SessionConfig
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT, load_folder

KILLS, FED, POINTS = 10, (1.0, 2.0), 1000  # s for which the log is told something before each
COMES, BEGUN = 600.0, 500  # s for the process to begin; bytes of a file that has


def rows() -> list[Row]:
    return [killed(), sent()]


def killed() -> Row:
    rng, period = np.random.default_rng(0), load_folder(SessionConfig, PROJECT / "conf/live").journal.period
    with tempfile.TemporaryDirectory() as folder:
        lost = [_lost(Path(folder) / f"{number}.mcap", period, rng.uniform(*FED)) for number in range(KILLS)]
    what = f"log, its process killed -9, {KILLS} times: lost, worst"
    return Row(what, f"{max(lost):.2f} s", "≤ 1 s")


def _lost(path: Path, period: float, seconds: float) -> float:
    """s from the first that was told and is not in the file until the kill."""
    log_writer = LogWriterProcess(path, NOTHING, period)
    log_writer.event("tick", number=0)
    until(lambda: path.exists() and path.stat().st_size > BEGUN, seconds=COMES)
    told, end = fed(log_writer, seconds), time.monotonic()
    assert log_writer.pid is not None
    os.kill(log_writer.pid, signal.SIGKILL)
    numbers, _ = ticks(path)
    log_writer.close()
    if numbers != list(range(len(numbers))):
        raise InputError(f"{path.name}: found a gap between what is kept, expected none")
    return end - told[numbers[-1]] if numbers[-1] < len(told) else 0.0


def sent() -> Row:
    """The bytes that go out by DDS, as another reader than the one that wrote them has them."""
    rng, names = np.random.default_rng(0), load_folder(Execution, PROJECT / "conf/execution").ros.names
    positions, times = rng.normal(size=(POINTS, len(names))), 0.002 * np.arange(1, POINTS + 1)
    data = trajectory(names, list(zip(times.tolist(), positions.tolist(), strict=True))).serialize()
    read: Any = get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(data, "trajectory_msgs/msg/JointTrajectory")
    if read.joint_names != list(names) or len(read.points) != POINTS:
        raise InputError(f"trajectory: found {len(read.points)} points of {read.joint_names}, expected {POINTS}")
    apart = np.abs(np.array([point.positions for point in read.points]) - positions).max()
    what = f"JointTrajectory's bytes for DDS, read by rosbags, {POINTS} points: largest difference"
    return Row(what, f"{apart:.2g} rad", "≤ 1e-12 rad")
