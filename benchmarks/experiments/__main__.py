"""The paper's four experiments through page, server, franka-sim and motors on a virtual bus: a Markdown table.

    ROBOT_PYTHON=fr3/bin/python python -m benchmarks.experiments [PACKAGE] [--runs N] [--only NAME]

Seeds and operator are the rehearsal's. Each run is a live session of its own: the operator's hands go into the page in
a headless browser, and the machines do what was confirmed there. What they did is then done again by the rehearsal's
stand-in among true objects, from the session's log, and judged as the rehearsal is. Rates stand beside the rehearsal's
own.

ROBOT_PYTHON is of an environment with pylibfranka and franka-sim; franka-sim listens to every address, so the whole
belongs in a network of its own (docs/execution.md). A run is a row of docs/results/experiments.csv as soon as it is
done; stopped, the command goes on from there. Runs of other code or with another package stay in that file, and count
for nothing; with `--again` each seed is run once more, as a further row. The first attempt of each seed counts, and the
lines under the table tell of all others.
"""

import argparse
import asyncio
import contextlib
import json
import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from benchmarks.browser import browsing
from benchmarks.experiments.at_page import AtPage
from benchmarks.experiments.judging import done_again
from benchmarks.experiments.machines import franka_sim, hardware
from rehearsal import settings
from rehearsal.experiments.bench import FLOOR, Bench, Staged, bench_of
from rehearsal.experiments.registry import EXPERIMENTS
from rehearsal.experiments.result import COLUMNS, Result, as_row, causes, rate
from studies.rows import Rows
from trunkline.ar.preview.package import only_package
from trunkline.ar.session.session import Address, opened
from trunkline.ar.session.settings import SessionConfig
from trunkline.ar.teleop.config import Config as Teleop
from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.config import PROJECT, load_folder
from upkeep.provenance import SHOWN
from upkeep.results import recorded

ADDRESS, WINDOW, YIELDS = Address(8899), (320, 240), 3  # of the page: pixels, and how nice its browser is
FEWEST = 20  # runs of each that are kept
URGENT = 1  # of the server's SCHED_FIFO, where that is allowed: after the robot's own processes, before all else
SILENCE = 0.6  # s for which the page may be silent: it shares the processor with two robots of 1000 cycles a second
REHEARSED = Path("artifacts/rehearse/metrics.json")


def config_of(bench: Bench, staged: Staged, folder: str) -> SessionConfig:
    """A live session's settings where the experiment is staged."""
    config, world = load_folder(SessionConfig, PROJECT / "conf/live"), staged.session.world
    x, y, z = bench.settings.mount_ready
    return replace(
        config, ready=(x, y, z), floor=FLOOR, boxes=world.boxes[1:], thing=next(iter(world.things), None),
        journal=replace(config.journal, folder=folder), preview=bench.previewing,
    )  # fmt: skip


def patient(bench: Bench) -> Teleop:
    """Teleoperation that is set as the rehearsal's, but for SILENCE."""
    core = bench.config.core
    return replace(bench.config, core=replace(core, safety=replace(core.safety, silence=SILENCE)))


async def perform(bench: Bench, staged: Staged, python: Path, package: Path) -> Result:
    """One run in a session of its own."""
    accept, session = settings.grasped().accept, staged.session
    with tempfile.TemporaryDirectory() as folder:
        config = config_of(bench, staged, folder)
        async with franka_sim(python, session.robot.joints[0]):
            asked = package, ADDRESS, lambda line: None, hardware(python), config, patient(bench)
            async with opened(*asked) as (server, made):
                url = f"{ADDRESS.url}/#token={server.composition.token}"
                async with browsing(url, WINDOW, YIELDS) as page:
                    operator = AtPage(page, staged, made.controller.log_writer.subject.tip, accept)
                    ending, views = await operator.perform()
                    seconds = time.monotonic() - operator.begun
            log = made.log_writer.path
        frames = await asyncio.to_thread(done_again, session, log, operator.begun)
    return staged.judged(ending, frames, views, seconds)


def made_of(bench: Bench, name: str, seed: int, python: Path, package: Path) -> Result:
    """A run; one that breaks off by an error failed, and its cause is the error."""
    try:
        return asyncio.run(perform(bench, EXPERIMENTS[name](bench, seed), python, package))
    except (InputError, ArithmeticError, AssertionError, ValueError, TimeoutError) as error:
        return Result(name, seed, False, f"error: {type(error).__name__}: {error}")


def told(name: str, rows: list[Result], rehearsed: dict) -> str:
    share, low, high = rate(rows)
    other = rehearsed.get(name)
    beside = f"{100 * other['rate']:.0f} % ({100 * other['low']:.0f} to {100 * other['high']:.0f})" if other else "none"
    why = ", ".join(f"{kind} {count}" for kind, count in causes(rows).items())
    mean = sum(row.seconds for row in rows) / len(rows)
    own = f"{100 * share:.0f} % ({100 * low:.0f} to {100 * high:.0f})"
    return f"| {name} | {len(rows)} | {own} | {beside} | {mean:.0f} | {why} |"


def counted(rows: Rows, name: str, runs: int) -> dict[int, Result]:
    """By seed, the first run of an experiment with this code and package."""
    every = (
        Result(**{key: row[key] for key in COLUMNS if key in row and key != "code"}) for row in rows.read().values()
    )
    return {result.seed: result for result in every if result.experiment == name and result.seed < runs}


def others(rows: Rows, names: list[str]) -> list[str]:
    """Lines on what is in the table beside the runs that count: further attempts, and runs of other code."""
    line, told = rows.attempts(), []
    for name in names:
        runs = [row for row in rows.uncounted() if row["experiment"] == name]
        told += [f"{name} {sum(row['success'] == 'True' for row in runs)} of {len(runs)}"] if runs else []
    return [line, f"successes of those that do not count: {', '.join(told)}"] if line else []


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.experiments", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("package", nargs="?", type=Path)
    parser.add_argument("--runs", type=int, default=FEWEST, help="of each experiment, seeds 0, 1, ...")
    parser.add_argument("--only", choices=sorted(EXPERIMENTS))
    parser.add_argument("--again", action="store_true", help="each seed once more, as a further row")
    given = parser.parse_args()
    with contextlib.suppress(OSError):  # what it starts has it not
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(URGENT))
    python = Path(os.environ.get("ROBOT_PYTHON", ""))
    if not python.is_file():
        raise InputError(f"ROBOT_PYTHON: found {str(python)!r}, expected the Python of pylibfranka and franka-sim")
    package, names = given.package or only_package(), [given.only] if given.only else list(EXPERIMENTS)
    bench = bench_of(package)
    rows = Rows("experiments", bench.package.digest[:SHOWN], "run")
    with recorded("experiments", keep=given.runs >= FEWEST and not given.only, origin=rows.origin):
        print("| experiment | runs | success (95 %) | rehearsed | s a run | why it failed |")
        print("|---|---:|---:|---:|---:|---|", flush=True)
        rehearsed = json.loads(REHEARSED.read_text()) if REHEARSED.is_file() else {}
        for name in names:
            done = counted(rows, name, given.runs)
            for seed in range(given.runs):
                if given.again or seed not in done:
                    found = made_of(bench, name, seed, python.absolute(), package)
                    cells = as_row(replace(found, package=rows.made_of))
                    rows.add(f"{name} {seed}", **{key: cells[key] for key in COLUMNS if key != "code"})
                    print(f"{name} {seed}: {found.cause or 'success'}; {found.seconds:.0f} s", file=sys.stderr)
            print(told(name, list(counted(rows, name, given.runs).values()), rehearsed), flush=True)
        print(f"\nPackage: {rows.made_of}; rehearsed: {rehearsed.get('package', 'none')}.")
        print("\n".join(others(rows, names)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
