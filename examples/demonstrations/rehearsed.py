"""Rehearsed runs as logs of live sessions, for demonstrations: a simulated operator at the stand-in robot.

    python -m examples.demonstrations.rehearsed artifacts/package_unity/*.tgz --experiment reach --runs 5
    trunkline export-dataset rehearsed/*.mcap --out dataset

A run is the rehearsal's own of that seed, to the last bit: its session controller logs as that of a live session does.
"""

import argparse
import sys
from pathlib import Path

from rehearsal.experiments.bench import bench_of, perform
from rehearsal.experiments.registry import EXPERIMENTS
from rehearsal.session import RATE, RehearsedSession
from trunkline.ar.session.log_format import LogFormat, Record, Subject
from trunkline.ar.session.log_writer import LogWriter
from trunkline.errors import InputError, in_one_line
from trunkline.version import __version__

ZERO = 1_700_000_000 * 10**9  # ns since 1970 at which every run begins
JOINTS = tuple(f"joint_{number}" for number in range(1, 8))


class Kept(LogWriter):
    """Writes here and now, by the clock of the session."""

    def __init__(self, path: Path, subject: Subject) -> None:
        self.session: RehearsedSession | None = None
        super().__init__(subject, lambda: 0.0 if self.session is None else self.session.now)
        self.file = open(path, "xb")  # noqa: SIM115
        self.book = LogFormat(self.file, subject, ZERO)

    def keep(self, record: Record) -> None:
        self.book.write(record)

    def close(self) -> None:
        self.settle()
        self.book.finish()
        self.file.close()


def record(session: RehearsedSession, journal: Kept) -> None:
    """Let a session that has not begun be logged as a live one is."""
    journal.session, session.controller.log_writer = session, journal
    session.controller.begin(RATE, __version__)


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
        staged = EXPERIMENTS[options.experiment](bench, seed)
        record(staged.session, journal)
        result, _ = perform(staged)
        journal.close()
        print(f"{path}: {result.seconds:.1f} s, {'success' if result.success else result.cause}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
