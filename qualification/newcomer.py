"""From the command to a twin that has moved, in a browser: what README and page say, done without a thought.

    python -m qualification.newcomer [PACKAGE] [--times 3]

The command is started, the address that it prints is opened in a headless Chromium that draws by software, control is
taken, the mount's target is moved by a few keys, a plan asked for, watched to its end and confirmed, and the grip held
until the page says that the robot has arrived. All is as a user has it: no setting is changed. A person reads besides.
"""

import asyncio
import os
import re
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from qualification.browser import Page, browsing
from qualification.command import qualify
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT

PORT, SIZE = 18454, (1280, 800)
KEYS = ("Digit1", *["ArrowRight"] * 5, "Digit2", *["ArrowRight"] * 5)  # both targets 5 cm to the side
PATIENCE = 120.0  # s for each step
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


async def visit(url: str, done) -> None:
    """The page's part; `done` is told the name of each step as it is."""
    page_steps = iter(STEPS[1:])

    async def step(page: Page) -> None:
        what, happens = next(page_steps)
        await page.until(happens, what, PATIENCE)
        done(what)

    async with browsing(url, SIZE) as page:
        await step(page)
        await page.until("!document.querySelector('#control').disabled", "control can be taken", PATIENCE)
        await page.click("#control")
        await step(page)
        for code in KEYS:
            await page.key(code)
            await asyncio.sleep(PACE)
        await page.until("trunkline.state?.targets?.tip?.reach === 'inside'", "both targets are in reach", PATIENCE)
        await page.key("Enter")
        await step(page)
        await step(page)
        await page.key("KeyG", "rawKeyDown")
        await page.until("trunkline.hands.left.grip || trunkline.hands.right.grip", "the grip is held", PATIENCE)
        await page.key("Enter")
        await step(page)
        await step(page)
        await page.key("KeyG", "keyUp")


async def once(package: Path) -> list[float]:
    """s from the command to each of STEPS."""
    began, found = time.monotonic(), []

    def done(what: str) -> None:
        found.append(time.monotonic() - began)
        print(f"{what}: {found[-1]:.1f} s", file=sys.stderr, flush=True)

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
            await visit(address[0].decode(), done)
        finally:
            server.terminate()
            await server.wait()
    return found


def _environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(PROJECT)}


def main(package: Path, times: int) -> None:
    rows = np.array([asyncio.run(once(package)) for _ in range(times)])
    print(f"| step | s since the command: median of {times} | most |")
    print("|---|---:|---:|")
    for (what, _), column in zip(STEPS, rows.T, strict=True):
        print(f"| {what} | {np.median(column):.0f} | {column.max():.0f} |")
    print(f"\nGoal: {GOAL:g} s until it has moved, a person's reading included.")


if __name__ == "__main__":
    sys.exit(qualify("newcomer", __doc__, main, times=3))
