"""Rehearsed runs as logs of live sessions, for demonstrations: a simulated operator at the stand-in robot.

    python -m examples.demonstrations.rehearsed artifacts/package_unity/*.tgz --experiment reach --runs 5
    trunkline export-dataset rehearsed/*.mcap --out dataset

A run is the rehearsal's own of that seed, to the last bit: it is only listened to.
"""

import argparse
import sys
from dataclasses import dataclass, fields
from pathlib import Path
from typing import cast

import numpy as np

from rehearsal.experiments.bench import Bench, bench_of, perform
from rehearsal.experiments.registry import EXPERIMENTS
from rehearsal.session import RATE, Session
from trunkline.ar.session.log_format import LogFormat, Record, Subject
from trunkline.ar.session.log_writer import LogWriter
from trunkline.ar.session.robot import RobotState
from trunkline.ar.teleop.core import Teleoperation
from trunkline.errors import InputError, in_one_line

ZERO = 1_700_000_000 * 10**9  # ns since 1970 at which every run begins
JOINTS = tuple(f"joint_{number}" for number in range(1, 8))


class Kept(LogWriter):
    """Writes here and now, by the clock of the session."""

    def __init__(self, path: Path, subject: Subject) -> None:
        self.session: Session | None = None
        super().__init__(subject, lambda: 0.0 if self.session is None else self.session.now)
        self.file = open(path, "xb")  # noqa: SIM115
        self.book = LogFormat(self.file, subject, ZERO)

    def keep(self, record: Record) -> None:
        self.book.write(record)

    def close(self) -> None:
        self.settle()
        self.book.finish()
        self.file.close()


@dataclass(frozen=True)
class Logged(Bench):
    """A bench whose sessions are heard by a journal."""

    journal: LogWriter = LogWriter()

    def session(self, *args, **kwargs) -> Session:
        session, journal = super().session(*args, **kwargs), self.journal
        assert isinstance(journal, Kept)
        journal.session = session
        journal.event("begin", package=session.package.digest, rate=RATE, tip={"body": "tip", "place": [0.0, 0.0, 0.0]})
        listen(session, journal)
        return session


class RecordedCore:
    """A core whose steps are told to a journal."""

    def __init__(self, core: Teleoperation, journal: LogWriter) -> None:
        self.core, self.journal = core, journal

    def step(self, state, inputs, dt):
        state, intent = self.core.step(state, inputs, dt)
        self.journal.step(dt, inputs, intent)
        return state, intent

    def __getattr__(self, name: str):
        return getattr(self.core, name)


def listen(session: Session, journal: LogWriter) -> None:
    """Tell the journal all that passes in a session, and change nothing of it."""
    frame, readings, start = session.frame, session.robot.readings, session.executor.start
    last: dict = {}

    def saw():
        last["seen"] = readings()
        return last["seen"]

    def started(plan, digest):
        refused = start(plan, digest)
        journal.event("execute", digest=digest, refused=refused)
        return refused

    def changed(name: str, value: object) -> bool:
        before, last[name] = last.get(name), value
        return value is not None and value != before

    def framed():
        view, now = frame(), last["seen"]
        straight, sent = session.package.straight, session.executor
        tip = np.concatenate([now.tip, now.tip_quaternion])
        journal.robot_state(
            RobotState(session.now, 0.0, sent.joints, sent.commands, tip, tip[None], now.joints, straight - now.wound)
        )
        if changed("world", session.world):
            journal.event("world", world=session.world)
        if changed("report", session.report):
            journal.event("planned", report=session.report)
            if session.foreseen is not None and session.report is not None:
                event = {"digest": session.report.digest, "probability": session.foreseen.probability, "spread": []}
                journal.event("foreseen", foreseen=event)
        if changed("robot", sent.state()):
            journal.event("robot", robot=sent.state())
        return view

    session.frame, session.robot.readings, session.executor.start = framed, saw, started
    session.core = cast(Teleoperation, RecordedCore(session.core, journal))


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m examples.demonstrations.rehearsed", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("package", type=Path)
    parser.add_argument("--experiment", choices=list(EXPERIMENTS), default="reach")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--out", type=Path, default=Path("rehearsed"), metavar="FOLDER")
    options = parser.parse_args(arguments)
    bench = bench_of(options.package)
    options.out.mkdir(parents=True, exist_ok=True)
    for seed in range(options.runs):
        path = options.out / f"{options.experiment}_{seed:03d}.mcap"
        if path.exists():
            raise InputError(f"{path}: found a log there, expected a folder without one of that name")
        tendons = tuple(f"tendon_{number + 1}" for number in range(len(bench.package.straight)))
        journal = Kept(path, Subject(("tip",), JOINTS, tendons, bench.package.straight, ("tip", (0.0, 0.0, 0.0))))
        logged = Logged(**{field.name: getattr(bench, field.name) for field in fields(bench)}, journal=journal)
        result, _ = perform(EXPERIMENTS[options.experiment](logged, seed))
        journal.close()
        print(f"{path}: {result.seconds:.1f} s, {'success' if result.success else result.cause}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
