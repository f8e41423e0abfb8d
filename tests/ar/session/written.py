"""A log that is written here and now, by a clock that a test turns, of a session of three bodies."""

import time

from tests.ar.teleop.test_plan import STRAIGHT
from trunkline.ar.session.log_format import LogFormat, Subject
from trunkline.ar.session.log_writer import LogWriter

NAMES = ("link_7", "base", "unit_01")
JOINTS = tuple(f"joint_{n}" for n in range(1, 8))
TENDONS = ("tendon_1", "tendon_2", "tendon_3")
SUBJECT = Subject(NAMES, JOINTS, TENDONS, STRAIGHT, ("unit_01", (0.0, 0.0, -0.1)))
ZERO = 1_700_000_000 * 10**9
REAL = "the robot fr3 at 192.168.1.11, no real motors"


class Written(LogWriter):
    """`time` is its clock where it is set."""

    def __init__(self, path, subject=SUBJECT):
        super().__init__(subject, lambda: time.monotonic() if self.time is None else self.time)
        self.time = None
        self.file = open(path, "wb")  # noqa: SIM115
        self.book = LogFormat(self.file, subject, ZERO)

    def keep(self, record):
        self.book.write(record)

    def close(self):
        self.settle()
        self.book.finish()
        self.file.close()
