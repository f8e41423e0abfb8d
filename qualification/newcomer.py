"""From the command to a twin that has moved, in a browser: what README and page say, done without a thought.

    python -m qualification.newcomer [PACKAGE] [--times 3] [--load 0]

The command is started, the address that it prints is opened in a headless Chromium that draws by software, control is
taken, the mount's target is moved by a few keys, a plan asked for, watched to its end and confirmed, and the grip held
until the page says that the robot has arrived. Where the page says what to press instead, that is pressed: control was
lost, the robot was stopped, or it holds. All is as a user has it: no setting is changed. A person reads besides.
`--load` busy loops run beside it.
"""

import asyncio
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from qualification.browser import Page, browsing
from qualification.command import qualify
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT

PORT, SIZE = 18454, (1280, 800)
KEYS = ("Digit1", *["ArrowRight"] * 5, "Digit2", *["ArrowRight"] * 5)  # both targets 5 cm to the side
PATIENCE, LONGEST = 120.0, 600.0  # s for each of the first steps, and for all that follow
HELP = ("no control", "stopped", "hold")  # in which the page says what to do beside the steps
PACE = 0.2  # s between keys
GOAL = 120.0  # s
MODE = "document.querySelector('#mode').dataset.mode"
STEPS = (
    ("address printed", ""),
    ("page shows the robot", "Boolean(globalThis.trunkline?.loaded && trunkline.frame && trunkline.state)"),
    ("control taken, aiming", f"{MODE} === 'aim'"),
    ("preview begins", f"{MODE} === 'preview'"),
    ("preview watched to its end", f"{MODE} === 'ready'"),
    ("robot moves", f"{MODE} === 'execute'"),
    ("robot has arrived", f"{MODE} === 'aim' && trunkline.state.robot === 'done'"),
)


CONTROLS = "Boolean(trunkline.wire?.controls)"
LOOK = 0.1  # s between looks at the page


async def visit(url: str, done: Callable[[str], None], stumbled: Callable[[str], None]) -> None:
    """The page's part; `done` is called with the name of each step when it is reached, `stumbled` with what else was to
    be done."""
    async with browsing(url, SIZE) as page:
        await page.until(STEPS[1][1], STEPS[1][0], PATIENCE)
        done(STEPS[1][0])
        await take_control(page)
        await page.until(STEPS[2][1], STEPS[2][0], PATIENCE)
        done(STEPS[2][0])
        for code in KEYS:
            await page.key(code)
            await asyncio.sleep(PACE)
        ahead, moves, end, before = list(STEPS[3:]), False, time.monotonic() + LONGEST, ""
        while ahead:
            if time.monotonic() > end:
                says = await page.value("document.querySelector('#status')?.innerText")
                raise InputError(f"{ahead[0][0]}: not reached in {LONGEST:g} s; the page says {says!r}")
            what, happens = ahead[0]
            if await page.value(happens) and (what != STEPS[-1][0] or moves):
                done(what)
                moves |= what == STEPS[-2][0]
                ahead.pop(0)
                continue
            mode = await page.value(MODE) if await page.value(CONTROLS) else "no control"
            if mode != before and mode in HELP:
                stumbled(mode)
            before = mode
            await act(page, mode)
            await asyncio.sleep(LOOK)
        await page.key("KeyG", "keyUp")


async def take_control(page: Page) -> None:
    await page.until("!document.querySelector('#control').disabled", "control can be taken", PATIENCE)
    await page.click("#control")
    await page.until(CONTROLS, "control", PATIENCE)


async def act(page: Page, mode: str) -> None:
    """What the page says to do in a mode, or while nobody controls."""
    if mode in HELP:
        await page.key("KeyG", "keyUp")
    if mode == "no control":
        await take_control(page)
    elif mode == "stopped":
        await page.key("KeyR")
    elif mode == "aim" and await page.value("trunkline.state?.targets?.tip?.reach === 'inside'"):
        await page.key("KeyG", "keyUp")
        await page.key("Enter")
    elif mode == "ready":
        await page.key("KeyG", "rawKeyDown")
        await page.until("trunkline.hands.left.grip || trunkline.hands.right.grip", "the grip is held", PATIENCE)
        await page.key("Enter")


async def once(package: Path) -> tuple[list[float], list[str]]:
    """s from the command to each of STEPS, and what was to be done beside them."""
    began, times, stumbles = time.monotonic(), [], []

    def done(what: str) -> None:
        times.append(time.monotonic() - began)
        print(f"{what}: {times[-1]:.1f} s", file=sys.stderr, flush=True)

    def stumbled(what: str) -> None:
        stumbles.append(what)
        print(f"{what}: {time.monotonic() - began:.1f} s", file=sys.stderr, flush=True)

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
            done(STEPS[0][0])
            await visit(address[0].decode(), done, stumbled)
        finally:
            server.terminate()
            await server.wait()
    return times, stumbles


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
        runs = [asyncio.run(once(package)) for _ in range(times)]
    print(f"| step | s since the command: median of {times} | most |")
    print("|---|---:|---:|")
    for (what, _), column in zip(STEPS, np.array([seconds for seconds, _ in runs]).T, strict=True):
        print(f"| {what} | {np.median(column):.0f} | {column.max():.0f} |")
    counts = Counter(stumble for _, stumbles in runs for stumble in stumbles)
    stumbles = ", ".join(f"{what} {counts[what]}" for what in HELP)
    print(f"\nBusy loops beside it: {load}. Done besides, as the page says, in all runs: {stumbles}.")
    print(f"Goal: {GOAL:g} s until it has moved, a person's reading included.")


if __name__ == "__main__":
    sys.exit(qualify("newcomer", __doc__, main, times=3, load=0))
