"""From the command to a twin that has moved, in a browser: what README and page say, done without a thought.

    python -m qualification.newcomer [PACKAGE] [--times 3] [--load 0]

The command is started, the address that it prints is opened in a headless Chromium that draws by software, and four
things are done: a reach, by keys; a grasp, by dragging the tip's marker onto the cylinder; a motion that is stopped on
its way; and the same motion after all. Each is aimed, its plan asked for, watched to its end and confirmed, and the
grip held until the page says that the robot has arrived. Where the page says what to press besides, that is pressed,
and counted: control was lost, the robot was stopped, it holds, or a point is offered. All is as a user has it: no
setting is changed. A person reads besides. `--load` busy loops run beside it.
"""

import asyncio
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from qualification.browser import Page, browsing
from qualification.command import qualify
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT

PORT, SIZE = 18454, (1280, 800)
ASIDE = ("Digit1", *["ArrowRight"] * 5, "Digit2", *["ArrowRight"] * 5)  # both targets 5 cm to the side
BACK = ("Digit1", *["ArrowLeft"] * 5, "Digit2", *["ArrowLeft"] * 5)
PATIENCE, LONGEST = 120.0, 600.0  # s for each of the first steps, and for each task
PACE, LOOK = 0.2, 0.1  # s between keys, and between looks at the page
AIM_TIMEOUT = 5.0  # s in which targets that were moved are those of the session
GOAL = 120.0  # s
MODE = "document.querySelector('#mode').dataset.mode"
SHOWN = "Boolean(globalThis.trunkline?.loaded && trunkline.frame && trunkline.state)"
CONTROLS = "Boolean(trunkline.wire?.controls)"
INSIDE = "['rigid', 'tip'].every((name) => trunkline.state?.targets?.[name]?.reach === 'inside')"
AIM = "trunkline.state?.targets?"
OFFERED = f"Boolean({AIM}.rigid?.offer || {AIM}.tip?.offer || trunkline.prediction?.offer)"
MARKED = f"Boolean({AIM}.thing)"
HELD = "trunkline.desktop.objects.length === 0"  # of those that are not held
# where the tip's marker is in the window, and the object
DRAGGED = """(() => {
  const { desktop } = trunkline, [object] = desktop.objects, marker = desktop.wanted[1 - desktop.rigid];
  return JSON.stringify([marker, marker.clone().set(...object.position)].map((point) => desktop.toScreen(point)));
})()"""
HELP = ("no control", "stopped", "hold", "offer")  # in which the page says what to do beside the steps


@dataclass
class Visit:
    """A person at a page. times: s from the command to each step. stumbles: what was to be done besides. holds: whether
    the object was held once the grasp had arrived."""

    began: float = field(default_factory=time.monotonic)
    times: dict[str, float] = field(default_factory=dict)
    stumbles: list[str] = field(default_factory=list)
    holds: bool = False

    def done(self, what: str) -> None:
        self.times[what] = time.monotonic() - self.began
        print(f"{what}: {self.times[what]:.1f} s", file=sys.stderr, flush=True)

    def stumbled(self, what: str) -> None:
        self.stumbles.append(what)
        print(f"{what}: {time.monotonic() - self.began:.1f} s", file=sys.stderr, flush=True)

    async def at(self, page: Page) -> None:
        await page.until(SHOWN, "page shows the robot", PATIENCE)
        self.done("page shows the robot")
        await take_control(page)
        await self.move(page, "reach", INSIDE, ASIDE)
        await self.move(page, "grasp", f"{INSIDE} && {MARKED}")
        self.holds = bool(await page.value(HELD))
        await press(page, BACK)
        await self.move(page, "stop", INSIDE, BACK, stops=True)
        await self.move(page, "the same after it", INSIDE, BACK)

    async def move(self, page: Page, task: str, aimed: str, keys: tuple[str, ...] = (), stops: bool = False) -> None:
        """Until the robot has arrived, or, if one `stops` it, is stopped. aimed: what is true once a plan can be asked
        for; until then these `keys` are pressed, also anew where control was lost meanwhile, and targets with it.
        Without any the tip's marker is dragged onto the object."""
        end, before, moved = time.monotonic() + LONGEST, "", False
        while True:
            if time.monotonic() > end:
                says = await page.value("document.querySelector('#status')?.innerText")
                raise InputError(f"{task}: not done in {LONGEST:g} s; the page says {says!r}")
            mode = await page.value(MODE) if await page.value(CONTROLS) else "no control"
            moved |= mode == "execute"
            if moved and mode == "aim" and await page.value("trunkline.state.robot === 'done'"):
                break
            if mode == "aim" and await page.value(OFFERED):
                mode = "offer"
            if mode != before and mode in HELP:
                self.stumbled(mode)
            before = mode
            if stops and mode == "execute":
                await page.key("Space")
                await page.until(f"{MODE} === 'stopped'", "stopped", PATIENCE)
                break
            if mode == "aim" and not await page.value(aimed):
                await (press(page, keys) if keys else drag(page))
                with suppress(InputError):  # the page hears of its targets later
                    await page.until(aimed, "aimed", AIM_TIMEOUT)
            else:
                await act(page, mode)
            await asyncio.sleep(LOOK)
        await page.key("KeyG", "keyUp")
        self.done(task)


async def take_control(page: Page) -> None:
    await page.until("!document.querySelector('#control').disabled", "control can be taken", PATIENCE)
    await page.click("#control")
    await page.until(CONTROLS, "control", PATIENCE)
    await page.until(f"{MODE} === 'aim'", "aiming", PATIENCE)


async def press(page: Page, codes: tuple[str, ...]) -> None:
    for code in codes:
        await page.key(code)
        await asyncio.sleep(PACE)


async def drag(page: Page) -> None:
    """The tip's marker onto the object."""
    marker, thing = json.loads(await page.value(DRAGGED))
    await page.mouse("mouseMoved", *marker)
    await page.mouse("mousePressed", *marker)
    for share in np.linspace(0.25, 1.0, 4):
        await page.mouse("mouseMoved", *((1 - share) * np.array(marker) + share * np.array(thing)).tolist())
        await asyncio.sleep(PACE)
    await page.mouse("mouseReleased", *thing)
    await asyncio.sleep(5 * PACE)


async def act(page: Page, mode: str) -> None:
    """What the page says to do in a mode, or while nobody controls."""
    if mode in HELP:
        await page.key("KeyG", "keyUp")
    if mode == "no control":
        await take_control(page)
    elif mode in ("stopped", "offer"):
        await page.key("KeyR")
    elif mode == "aim":
        await page.key("KeyG", "keyUp")
        await page.key("Enter")
    elif mode == "ready":
        await page.key("KeyG", "rawKeyDown")
        await page.until("trunkline.hands.left.grip || trunkline.hands.right.grip", "the grip is held", PATIENCE)
        await page.key("Enter")


async def once(package: Path) -> Visit:
    visit = Visit()
    with tempfile.TemporaryDirectory() as folder:  # in which the log is
        server = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "trunkline.ar.session", package, "--port", str(PORT), cwd=folder,
            stdout=asyncio.subprocess.PIPE, stdin=asyncio.subprocess.DEVNULL, env=_environment(),
        )  # fmt: skip
        try:
            assert server.stdout is not None
            async with asyncio.timeout(PATIENCE):
                while not (address := re.search(rb"http://\S+#token=\S+", line := await server.stdout.readline())):
                    if not line:
                        raise InputError("the command: has ended before it printed an address")
            visit.done("address printed")
            async with browsing(address[0].decode(), SIZE) as page:
                await visit.at(page)
        finally:
            server.terminate()
            await server.wait()
    return visit


def _environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(PROJECT)}


@contextmanager
def busy(loops: int) -> Iterator[None]:
    """So many processes that do nothing but count."""
    processes = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(loops)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def main(package: Path, times: int, load: int) -> None:
    with busy(load):
        visits = [asyncio.run(once(package)) for _ in range(times)]
    print(f"| done | s since the command: median of {times} | most |")
    print("|---|---:|---:|")
    for what in visits[0].times:
        column = np.array([visit.times[what] for visit in visits])
        print(f"| {what} | {np.median(column):.0f} | {column.max():.0f} |")
    counts = Counter(stumble for visit in visits for stumble in visit.stumbles)
    stumbles = ", ".join(f"{what} {counts[what]}" for what in HELP)
    print(f"\nObject held after the grasp: {sum(visit.holds for visit in visits)} of {times}.")
    print(f"Busy loops beside it: {load}. Done besides, as the page says, in all runs: {stumbles}.")
    print(f"Goal: {GOAL:g} s until it has moved, a person's reading included.")


if __name__ == "__main__":
    sys.exit(qualify("newcomer", __doc__, main, times=3, load=0))
