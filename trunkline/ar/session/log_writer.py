"""The log of a live session: all that is heard, wanted and done goes to one MCAP file, by a process of its own.

So a slow disk delays no frame and no stop. What is lost by `kill -9` is younger than `period`. Where the log cannot be
written any more, or nothing has been written for `period` and LATE s, `fault` says why, and whoever moves the robot has
to hold it. A process that comes back before MOST records wait has lost nothing, and ends that fault.
"""

import ctypes
import multiprocessing
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from pydantic import ConfigDict, TypeAdapter

from trunkline.ar.session.decimation import LogDecimation
from trunkline.ar.session.log_format import (
    BASE,
    EVENTS,
    HEADSET,
    INPUT,
    INTENT,
    JOINTS,
    JOINTS_SENT,
    MEASURED,
    NOTHING,
    REFERENCE,
    STATIC,
    TENDONS,
    TENDONS_SENT,
    TEXT,
    TWIN,
    WRIST,
    Record,
    Subject,
    new_file,
    run,
)
from trunkline.ar.session.log_reader import tip_path
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.teleop import messages
from trunkline.ar.teleop.messages import Input, Intent, Pose
from trunkline.errors import InputError

MOST = 5000  # records that may wait: some 15 s of a session
_EVENT = TypeAdapter(dict[str, Any], config=ConfigDict(ser_json_inf_nan="null"))
GATHERS = 0.02  # s
PATIENCE = 5.0  # s that the process has to end in
BEGINS = 60.0  # s that it has to begin in
LATE = 0.5  # s beyond `period` that it may write nothing in: 1 s of a session that nobody would ever know
LOOKS = 0.05  # s between looks at whether it writes


class LogWriter:
    """Turns what happens in a session of `subject` into records for `keep`, which does nothing here. Times are s of
    `now`."""

    fault = ""  # why it is not written any more, in one line

    def __init__(self, subject: Subject = NOTHING, now: Callable[[], float] = time.monotonic) -> None:
        self.subject, self.now = subject, now
        self._decimation = LogDecimation()

    def keep(self, record: Record) -> None:
        """Take a record, without waiting."""

    def step(self, dt: float, core_input: Input, intent: Intent) -> None:
        """What the core was given and wanted, exactly."""
        text = b'{"dt":%b,"given":%b}' % (repr(float(dt)).encode(), messages.to_json(core_input))
        now = self.now()
        self.keep(Record(INPUT, now, now, text))
        self.keep(Record(INTENT, now, now, messages.to_json(intent)))

    def robot_state(self, robot: RobotState) -> None:
        """What the robot does; of what is measured, what is. While it rests, a few are kept, somewhat later."""
        for state, now in self._decimation.take(robot, self.now()):
            self._write_state(state, now)

    def settle(self) -> None:
        """Keep what a robot at rest was told of last."""
        for state, now in self._decimation.rest():
            self._write_state(state, now)

    def _write_state(self, robot: RobotState, now: float) -> None:
        for topic, axes in (
            (JOINTS_SENT, robot.joints), (JOINTS, robot.measured), (TENDONS_SENT, robot.commands),
            (TENDONS, robot.lengths),
        ):  # fmt: skip
            if axes is not None and np.isfinite(axes).all():
                self.keep(Record(topic, robot.time, now, axes))
        self.keep(Record(self.subject.poses, robot.time, now, robot.bodies, BASE))

    def measured(self, stamp: float, poses: np.ndarray) -> None:
        """Of the bodies that cameras saw at `stamp`, s, NaN where one was not seen. Shape (B, 7)."""
        if self.subject.measured:
            self.keep(Record(MEASURED, stamp, self.now(), poses, BASE))

    def headset(self, part: str, at: float, pose: np.ndarray, in_base: bool) -> None:
        """Pose (7,) of the `left` or `right` hand, or of the `view`."""
        self.keep(Record(HEADSET + part, at, self.now(), pose, BASE if in_base else REFERENCE))

    def alignment(self, pose: Pose) -> None:
        """Of the reference frame in the base."""
        now = self.now()
        self.keep(Record(STATIC, now, now, np.array([*pose.position, *pose.quaternion]), BASE))

    def piece(self, first: int, begins: float, poses: np.ndarray) -> None:
        """Of a preview: the arm's last body in frames from the one numbered `first`, at `begins` s of the plan, and
        where the last of them has what cameras see; of a real machine the rigid robot's last body too.

        Args:
            poses: of all bodies, (F, N, 7).
        """
        bodies = self.subject.bodies
        if bodies:
            wrist = {WRIST: poses[:, bodies.index(WRIST)].tolist()} if self.subject.poses == TWIN else {}
            rows = poses[:, bodies.index(self.subject.tip[0])]
            markers = {"markers": self._markers(poses[-1])} if self.subject.markers else {}
            self.event("piece", first=first, begins=begins, poses=rows.tolist(), **wrist, **markers)

    def _markers(self, poses: np.ndarray) -> list[list[float] | None]:
        """m, of those that cameras see, the bodies at `poses` (N, 7); None of those that the arm's model lacks."""
        on, bodies = self.subject.markers, self.subject.bodies
        return [
            None if marker is None else tip_path(poses[[bodies.index(marker[0])]].astype(float), marker[1])[0].tolist()
            for marker in on
        ]

    def event(self, kind: str, **fields: object) -> None:
        """Anything else, by the name of its `kind`; fields are what JSON can hold, or dataclasses."""
        now = self.now()
        plain = {name: _plain(value) for name, value in fields.items()}
        self.keep(Record(EVENTS, now, now, _EVENT.dump_json({"event": kind, "time": now} | plain)))


def _plain(value: object) -> object:
    """A dataclass with the keys that it has as JSON, a value of any other type as it is."""
    return _adapter(type(value)).dump_python(value) if is_dataclass(value) else value


@cache
def _adapter(kind: type) -> TypeAdapter:
    return TypeAdapter(kind)


class LogWriterProcess(LogWriter):
    """One that writes to `path`, by another process."""

    def __init__(
        self, path: Path, subject: Subject, period: float, opened: Callable[[Path], BinaryIO] | None = None
    ) -> None:
        super().__init__(subject)
        context = multiprocessing.get_context("spawn")
        theirs, self._pipe = context.Pipe(duplex=False)
        self._fault, self._lost, self._late = context.RawArray(ctypes.c_char, TEXT), "", ""
        self._written, self._sent, self._silent = context.RawValue(ctypes.c_int64, -1), 0, period + LATE
        zero = time.time_ns() - round(1e9 * self.now())  # once: a wall clock that jumps moves nothing in the log
        self.path = path
        self._process = context.Process(
            target=run, args=(theirs, self._fault, self._written, path, subject, zero, period, opened or new_file),
            daemon=True, name="journal",
        )  # fmt: skip
        self._process.start()
        theirs.close()
        self._waiting: deque[Record] = deque()
        self._ended = threading.Event()
        for work in (self._send, self._watch):
            threading.Thread(target=work, daemon=True).start()

    @property
    def pid(self) -> int | None:
        return self._process.pid

    @property
    def fault(self) -> str:
        return self._ending or self._late

    @property
    def _ending(self) -> str:
        """Why nothing will be written any more."""
        return self._fault.value.decode(errors="replace") or self._lost

    def keep(self, record: Record) -> None:
        if self._ending:
            return
        if len(self._waiting) < MOST:
            self._waiting.append(record)
        else:
            self._lose("the disk does not keep up")

    def await_begun(self) -> None:
        """Until its process can write, or says why not: nothing is to move before."""
        until = time.monotonic() + BEGINS
        while self._written.value < 0 and not self.fault and self._process.is_alive():
            if time.monotonic() > until:
                self._lose(f"its process has not begun for {BEGINS:g} s")
            time.sleep(GATHERS)

    def close(self) -> None:
        """Write what waits, and end the file."""
        self.settle()
        self._ended.set()
        self._process.join(PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _send(self) -> None:
        """Records until it is closed, those of GATHERS s at once: to send each alone costs as much as to make it."""
        waiting, ended = self._waiting, False
        try:
            while not (ended or self._lost):
                ended = self._ended.wait(GATHERS)
                if records := [waiting.popleft() for _ in range(len(waiting))]:
                    self._sent += 1
                    self._pipe.send(records)
        except OSError:
            self._lose("its process has ended")
        finally:
            self._pipe.close()

    def _watch(self) -> None:
        """Whether anything waits and nothing is written, until it is closed. It counts its own looks: where all of the
        machine stands still for a while, that is one."""
        looks, before = 0, self._written.value
        while not (self._ended.wait(LOOKS) or self._lost):
            written = self._written.value
            looks = looks + 1 if 0 <= before == written < self._sent else 0
            before = written
            late = looks * LOOKS >= self._silent
            self._late = self._worded(f"its process does not answer for {self._silent:g} s") if late else ""

    def _lose(self, why: str) -> None:
        """From here on nothing is written: what is there stays without gaps."""
        self._lost = self._lost or self._worded(why)

    def _worded(self, why: str) -> str:
        return f"log: {self.path.name}: {why}; nothing is executed"


def new_path(folder: Path) -> Path:
    """For a log that begins now, in a `folder` that is made where there is none.

    Raises:
        InputError: it cannot be.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"journal.folder: {folder}: {reason}, expected a folder to write logs into") from error
    return folder / time.strftime("%Y-%m-%dT%H-%M-%S.mcap", time.gmtime())
