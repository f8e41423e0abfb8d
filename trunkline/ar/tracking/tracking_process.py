"""A source of poses in a process of its own, seen from who uses it: the three calls of a `Tracker`.

The process receives, checks, and writes what is newest into shared memory. Where it hangs or is gone, `latest` says so,
as where the stream does. One that hung is as a stream that was late. It ends with the process that made it.
"""

import multiprocessing
import signal
import sys
import time

import numpy as np

from trunkline.ar.tracking.pose_channel import PoseChannel
from trunkline.ar.tracking.stream_checks import StreamChecks, StreamLimits
from trunkline.ar.tracking.tracker import ExpectedBodies, OpenSource, TrackedPoses
from trunkline.compute.processes import end_with_parent, leave_signals_to_parent
from trunkline.errors import InputError

STARTING, COMES = 20.0, 5.0  # s in which a process has to start and open its source, and then a frame to come
LISTENS = 0.02  # s after which the process tells that nothing came
STALE = 0.25  # s without a sign of the process
ENDING = 2.0  # s
TOLD_AT, OPENED, STAMP, RATE, LOSS, HEAD = range(6)  # numbers; from HEAD on positions (B, 3) and quaternions (B, 4)


class TrackingProcess:
    """A `Tracker` of what `open_source` opens."""

    def __init__(self, open_source: OpenSource, expected: ExpectedBodies, limits: StreamLimits | None = None) -> None:
        self._open, self._expected, self._limits = open_source, expected, limits or StreamLimits()
        self._context = multiprocessing.get_context("spawn")
        self._process, self._channel = None, None
        self._silent, self._silent_at = "", 0.0  # that the process was, and when it was last, s

    def connect(self) -> None:
        self.stop()
        channel = self._channel = PoseChannel(self._context, HEAD + 7 * len(self._expected.names))
        setup = (channel, self._open, self._expected, self._limits)
        process = self._process = self._context.Process(target=track, args=setup, daemon=True, name="tracking")
        process.start()
        until = time.monotonic() + STARTING
        while True:
            alive, (numbers, line) = process.is_alive(), channel.hear()
            if numbers[STAMP] > 0:
                return
            if numbers[OPENED] > 0:
                until = min(until, numbers[OPENED] + COMES)
            if not alive or time.monotonic() > until:
                what = f"found no frame within {COMES:g} s, expected the stream's" if alive else "its process has ended"
                self.stop()
                raise InputError(line or f"tracking: {what}")
            time.sleep(0.005)

    def latest(self) -> TrackedPoses:
        if self._process is None or self._channel is None:
            raise InputError("tracking: found no connection, expected `connect` before `latest`")
        alive, (numbers, fault) = self._process.is_alive(), self._channel.hear()
        now = time.monotonic()
        if not alive:
            fault = fault or "its process has ended, expected it to run"
        elif now - numbers[TOLD_AT] > STALE:
            silent = f"its process is silent for {now - numbers[TOLD_AT]:.2f} s"
            self._silent = self._silent or f"{silent}, expected a sign of it within {STALE:g} s"
            self._silent_at = now
        elif now - self._silent_at >= self._limits.recovers:
            self._silent = ""
        positions, quaternions = np.split(numbers[HEAD:], [3 * len(self._expected.names)])
        return TrackedPoses(
            self._expected.names, numbers[STAMP], positions.reshape(-1, 3), quaternions.reshape(-1, 4),
            now - numbers[STAMP], numbers[RATE], numbers[LOSS], fault or self._silent,
        )  # fmt: skip

    def stop(self) -> None:
        process, self._process, self._silent = self._process, None, ""
        if process is None:
            return
        process.terminate()
        process.join(ENDING)
        if process.is_alive():
            process.kill()
            process.join()


def track(channel: PoseChannel, open_source: OpenSource, expected: ExpectedBodies, limits: StreamLimits) -> None:
    """The process: until its parent is gone, or it is ended."""
    leave_signals_to_parent()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    end_with_parent()
    numbers, checks = np.zeros(HEAD + 7 * len(expected.names)), StreamChecks(expected, limits)
    try:
        source = open_source(expected.names)
    except InputError as error:
        channel.tell(numbers, str(error))
        return
    numbers[OPENED] = time.monotonic()
    try:
        while True:
            checked = None
            try:
                frame = source.receive(LISTENS)
                now = time.monotonic()
                if frame is None:
                    checks.wait(now)
                else:
                    checked = checks.take(now, frame)
            except ValueError as error:
                now = time.monotonic()
                checks.unreadable(now, str(error))
            if checked is not None:
                head = [now, numbers[OPENED], checked.stamp, checked.rate, checked.loss]
                numbers = np.concatenate([head, checked.positions.ravel(), checked.quaternions.ravel()])
            numbers[TOLD_AT] = now
            channel.tell(numbers, checks.fault)
    finally:
        source.close()
