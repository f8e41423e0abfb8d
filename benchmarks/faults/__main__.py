"""What goes wrong in a live session as its robot moves: until the robot is told to hold, until it rests, and why.

    python -m benchmarks.faults [PACKAGE] [--times 5]

The session is the real one on the simulated robot: server, log, planning and robot are processes of their own, and so
is the client that controls. It goes through aim, preview, confirmation and execution; as the robot moves, something is
done to one of them. Times are noted by the robot's own process, of its axes as they are sent, on one clock; where that
process is what is killed, by the session's log. The reason is read from that log. Then whoever controls is back, holds
its grips for 1 s and confirms nothing: does the robot go on by itself?

A motor is silent in a session whose Panda and motors are simulated, the latter behind their real driver.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from benchmarks.faults.course import FAULTS, Suffered, session
from trunkline.ar.preview.package import only_package
from trunkline.ar.session.robot import DEAD_MAN
from trunkline.errors import in_one_line
from upkeep.results import recorded

GOAL = 0.15  # s


def main(package: Path, times: int) -> None:
    """Faults that are mended share a session, with the first that is not; each other one has its own."""
    mended = [fault for fault in FAULTS if fault.mend is not None] * times
    first, *others = [fault for fault in FAULTS if fault.mend is None] * times
    found: dict[str, list[Suffered]] = {fault.title: [] for fault in FAULTS}
    for faults in ([*mended, first], *([fault] for fault in others)):
        for one in session(package, faults):
            found[one.fault.title].append(one)
    print("| as the robot moves | times | told to hold after, ms: median | most | rests after, ms: most"
          " | went on by itself | said |")  # fmt: skip
    print("|---|---:|---:|---:|---:|---:|---|")
    for title, rows in found.items():
        print(f"| {title} | {told(rows)} | {rows[0].said} |")
    most = max(one.held for rows in found.values() for one in rows)
    print(f"\nGoal: {1e3 * GOAL:.0f} ms; found at most {1e3 * most:.0f} ms. The robot itself brakes after"
          f" {1e3 * DEAD_MAN:.0f} ms without a permit.")  # fmt: skip


def told(rows: list[Suffered]) -> str:
    held, rested = (1e3 * np.array([getattr(one, what) for one in rows]) for what in ("held", "rested"))
    resumed = [one.resumed for one in rows if one.resumed is not None]
    again = str(sum(resumed)) if resumed else "nobody comes back"
    return f"{len(rows)} | {np.median(held):.0f} | {held.max():.0f} | {rested.max():.0f} | {again}"


@in_one_line
def run(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.faults", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("package", nargs="?", type=Path)
    parser.add_argument("--times", type=int, default=5)
    given = parser.parse_args(arguments)
    package = given.package or only_package()
    with recorded("faults", given.times >= 5):
        main(package, given.times)
    return 0


if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
