"""What a stream of poses does wrong as the arm is seen: what is noticed, how soon, and whether it is relied on again.

    python -m qualification.stream_faults [PACKAGE]

The cameras are the simulated ones, in their own process and behind the checks of every stream; the arm of the package
bends to and fro before them. From BEGINS on the stream does something else for LASTS s, then it is true again. A row:
the page's sentence, from which on no plan corrects itself; s until it was there; how far the tip that was relied on was
off; and whether the stream is relied on again: one that was late is, once it is on time; one that was untrue is not,
until it is connected anew.
"""

import ctypes
import math
import multiprocessing
import os
import re
import signal
import sys
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import mujoco
import numpy as np

from qualification.command import qualify
from trunkline.ar.session.arm_cameras import EVERY, MOUNT, ArmCameraSettings, expected_bodies
from trunkline.ar.session.settings import SessionConfig
from trunkline.ar.tracking.pose_channel import PoseChannel
from trunkline.ar.tracking.simulated_cameras import CameraSettings, SimulatedCameras
from trunkline.ar.tracking.tracker import CameraFrame
from trunkline.ar.tracking.tracking_process import TrackingProcess
from trunkline.frames import rotation_from_wxyz
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.twin.package import arm_of, read_package

BEGINS, LASTS, AFTERWARDS = 2.0, 1.5, 4.0  # s
SPEED, BEND = 0.4, 0.05  # Hz and rad a joint, of the motion to and fro
HZ = 90.0  # of looks, as a session's
PHASES = 240  # of the motion, between which poses are interpolated
Lie = Callable[[CameraFrame, CameraFrame], CameraFrame]  # of a frame and of the last true one


def _body(frame: CameraFrame, row: int, **of: np.ndarray | float) -> CameraFrame:
    """With something else of one body."""
    changed = {name: getattr(frame, name).copy() for name in of}
    for name, value in of.items():
        changed[name][row] = value
    return replace(frame, **changed)


def _swapped(frame: CameraFrame) -> CameraFrame:
    order = np.arange(len(frame.positions))
    order[2:4] = 3, 2
    return replace(frame, positions=frame.positions[order], quaternions=frame.quaternions[order])


TRUTH = "nothing else"
LIES: dict[str, Lie] = {
    TRUTH: lambda frame, _: frame,
    "a position is no number": lambda frame, _: _body(frame, 2, positions=np.nan),
    "a quaternion of zeros": lambda frame, _: _body(frame, 2, quaternions=0.0),
    "a body 0.5 m off": lambda frame, _: _body(frame, 2, positions=frame.positions[2] + [0.0, 0.0, 0.5]),
    "a body at the origin": lambda frame, _: _body(frame, 2, positions=0.0),
    "two labels exchanged": lambda frame, _: _swapped(frame),
    "a frozen body": lambda frame, true: _body(
        frame, -1, positions=true.positions[-1], quaternions=true.quaternions[-1]
    ),
    "all frozen": lambda frame, true: replace(frame, positions=true.positions, quaternions=true.quaternions),
    "millimeters": lambda frame, _: replace(frame, positions=1e3 * frame.positions),
    "stamps stand": lambda frame, true: replace(frame, stamp=true.stamp),
    "stamps go back by 0.7 s": lambda frame, _: replace(frame, stamp=frame.stamp - 0.7),
    "frames' numbers stand": lambda frame, true: replace(frame, number=true.number),
}  # fmt: skip
SILENT, LATE, STOPPED, KILLED = "no frames", "frames 0.3 s late", "the process hangs", "the process is killed"
ROWS = (*LIES, SILENT, LATE, STOPPED, KILLED)
DELAY = 0.3  # s


class LyingCameras:
    """A `PoseSource` of simulated cameras that does what `switch` says: a row of ROWS, 0 for the truth."""

    def __init__(
        self, settings: CameraSettings, shown: PoseChannel, switch: ctypes.c_int, names: tuple[str, ...]
    ) -> None:
        self._cameras, self._switch = SimulatedCameras(settings, shown, names), switch
        self._true: CameraFrame | None = None
        self._late: deque[tuple[float, CameraFrame]] = deque()

    def receive(self, seconds: float) -> CameraFrame | None:
        does, frame = ROWS[self._switch.value], self._cameras.receive(seconds)
        if frame is None:
            return None
        if not self._switch.value or self._true is None:
            self._true = frame
        if does == LATE:
            self._late.append((time.monotonic() + DELAY, frame))
            return self._late.popleft()[1] if self._late[0][0] <= time.monotonic() else None
        self._late.clear()  # else the queue, as long as before, would keep the stream late for good
        return None if does == SILENT else LIES.get(does, LIES[TRUTH])(frame, self._true)

    def close(self) -> None:
        self._cameras.close()


class BendingArm:
    """The arm of a package before cameras of `settings`, as it bends to and fro. names: of the bodies that they see."""

    def __init__(self, package: Path, settings: CameraSettings) -> None:
        model = arm_of(read_package(package)).compile()
        data, names = mujoco.MjData(model), [model.body(row).name for row in range(model.nbody)]
        units = [name for name in names if re.fullmatch(r"unit_\d+", name)]
        self.names = (MOUNT, *units[(len(units) - 1) % EVERY :: EVERY])
        rows = [names.index(name) for name in self.names]
        phases = np.linspace(0.0, 2 * np.pi, PHASES + 1)
        self._table = np.empty((len(phases), len(rows), 7))
        for place, phase in zip(self._table, phases, strict=True):
            data.qpos[:] = model.qpos0 + BEND * np.sin(phase)
            mujoco.mj_kinematics(model, data)
            place[:] = np.hstack([data.xpos[rows], data.xquat[rows]])
        self._turn, self._origin = rotation_from_wxyz(np.array(settings.quaternion)), np.array(settings.origin)

    def poses(self, now: float) -> tuple[np.ndarray, np.ndarray]:
        """Positions (B, 3), m, and quaternions (B, 4), at `now`, s."""
        share, row = math.modf(PHASES * (now * SPEED % 1.0))
        place = (1 - share) * self._table[int(row)] + share * self._table[int(row) + 1]
        return place[:, :3], place[:, 3:] / np.linalg.norm(place[:, 3:], axis=1, keepdims=True)

    def seen_tip(self, now: float) -> np.ndarray:
        """Where cameras that are right see the last body, m (3,)."""
        return self._turn.apply(self.poses(now)[0][-1]) + self._origin


def row(package: Path, does: str, cameras: ArmCameraSettings) -> str:
    """Of the table: a stream that does this from BEGINS to BEGINS + LASTS s."""
    settings, context = cameras.simulated, multiprocessing.get_context("spawn")
    arm = BendingArm(package, settings)
    shown, switch = PoseChannel(context, 7 * len(arm.names)), context.RawValue(ctypes.c_int, 0)
    shown.tell(np.concatenate([part.ravel() for part in arm.poses(0.0)]))
    expected = expected_bodies(arm.names, np.linalg.norm(np.diff(arm.poses(0.0)[0], axis=0), axis=1))
    tracker = TrackingProcess(partial(LyingCameras, settings, shown, switch), expected, cameras.limits)
    tracker.connect()
    begun, line, noticed, again, most = time.monotonic(), "", np.nan, np.nan, 0.0
    process = next(child for child in multiprocessing.active_children() if child.name == "tracking")
    begins, ends = begun + BEGINS, begun + BEGINS + LASTS
    try:
        while (now := time.monotonic()) < ends + AFTERWARDS:
            wrong = begins <= now < ends
            if wrong and not switch.value and does != TRUTH:
                switch.value = ROWS.index(does)
                if does in (STOPPED, KILLED):
                    os.kill(process.pid or 0, signal.SIGSTOP if does == STOPPED else signal.SIGKILL)
            elif not wrong and switch.value:
                switch.value = 0
                if does == STOPPED:
                    os.kill(process.pid or 0, signal.SIGCONT)
            shown.tell(np.concatenate([part.ravel() for part in arm.poses(now)]))
            tracked = tracker.latest()
            if tracked.fault:
                line, noticed, again = tracked.fault, np.fmin(noticed, now - begins), np.nan
            elif line and np.isnan(again) and now > ends:
                again = now - ends
            if not tracked.fault and now >= begins and np.isfinite(tracked.positions[-1]).all():
                most = max(most, float(np.linalg.norm(tracked.positions[-1] - arm.seen_tip(tracked.stamp))))
            time.sleep(max(now + 1 / HZ - time.monotonic(), 0.0))
    finally:
        tracker.stop()
    noticing = "–" if np.isnan(noticed) else f"{noticed:.2f}"
    relied = "yes" if not line else "no" if np.isnan(again) else f"{again:.1f} s later"
    return f"| {does} | {line or '–'} | {noticing} | {1e3 * most:.1f} | {relied} |"


def measure(package: Path) -> None:
    print("| the stream | the page says | after, s | tip that was relied on, off by at most, mm | relied on again |")
    print("|---|---|---:|---:|---|")
    cameras = load_folder(SessionConfig, PROJECT / "conf/live").cameras
    for does in ROWS:
        print(row(package, does, cameras), flush=True)


if __name__ == "__main__":
    sys.exit(qualify("stream_faults", __doc__, measure))
