"""A live session beside MuJoCo's own Studio viewer: bytes a frame, the server's processor, frames that are drawn.

    python -m benchmarks.studio [PACKAGE] [--seconds 20] [--pictures FOLDER]

Both show the same model, the package's hybrid robot, as MuJoCo compiled it, in the same browser, one after the other,
in a window of 1280 x 720. The first picture is timed from the command that starts the server. Both simulate meanwhile:
ours in a process of its own, Studio in its server's main thread; neither counts as the server's. A frame is a message
with the poses of all bodies; Studio's user interface is another stream, told apart. Drawing is by software here: its
frames say how heavy a page is, not how fast it is on a headset.
"""

import argparse
import asyncio
import contextlib
import os
import signal
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Iterable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.browser import browsing
from trunkline.ar.preview.package import only_package, read_package
from trunkline.ar.session.composition import SEARCH, simulation_of
from trunkline.ar.session.settings import SessionConfig
from trunkline.ar.teleop.config import Config as Teleop
from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.config import PROJECT, load_folder
from upkeep.results import recorded

PORTS, SIZE = (18448, 18449), (1280, 720)
COMES, SETTLES = 120.0, 5.0  # s for a server to come, s after a page's first picture
OURS, THEIRS = "a live session", "MuJoCo's Studio viewer"
FRAMES = {OURS: "/ws", THEIRS: "/state"}  # the path of its frames
SMALL = 200  # bytes, of messages that are no frame


@dataclass
class Found:
    """Of one server. comes: s from its command until something is drawn. frame: bytes, median. others: bytes a second
    that are no frames. rate: frames a second. cpu: s of its processor a frame. drawn: frames a second."""

    comes: float
    frame: float
    others: float
    rate: float
    cpu: float
    drawn: float


@contextlib.asynccontextmanager
async def served(command: list[str], says: str) -> AsyncIterator[tuple[int, str]]:
    """A server in a process of its own, and the first line of it that has `says`."""
    server = await asyncio.create_subprocess_exec(
        sys.executable, *command, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
        start_new_session=True,
    )  # fmt: skip
    assert server.stdout is not None
    try:
        line = ""
        while says not in line:
            line = (await asyncio.wait_for(server.stdout.readline(), COMES)).decode()
            if not line:
                raise InputError(f"{' '.join(command[:2])}: ended before it served anything")
        reading = asyncio.create_task(server.stdout.read())
        yield server.pid, line.strip()
        reading.cancel()
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(server.pid, signal.SIGKILL)
        await server.wait()


def processor(threads: Iterable[Path]) -> float:
    """s that these threads have taken."""
    taken = 0
    for thread in threads:
        with contextlib.suppress(FileNotFoundError):
            words = (thread / "stat").read_text().rpartition(")")[2].split()
            taken += int(words[11]) + int(words[12])
    return taken / os.sysconf("SC_CLK_TCK")


def threads_of(pid: int, but_main: bool) -> list[Path]:
    return [one for one in Path(f"/proc/{pid}/task").iterdir() if not (but_main and one.name == str(pid))]


async def measured(title: str, url: str, pid: int, begun: float, seconds: float, pictures: Path | None) -> Found:
    """begun: s, of the server."""
    but_main = title != OURS  # whose main thread simulates
    async with browsing(url, SIZE) as page:
        while not await page.value("globalThis.drawn"):
            await asyncio.sleep(0.1)
        comes = time.monotonic() - begun
        await asyncio.sleep(SETTLES)
        drawn, began = await page.value("drawn"), time.monotonic()
        page.sizes.clear()
        cpu = processor(threads_of(pid, but_main))
        await asyncio.sleep(seconds)
        sizes = {path: np.array(found) for path, found in page.sizes.items()}
        cpu, lasted = processor(threads_of(pid, but_main)) - cpu, time.monotonic() - began
        drawn = (await page.value("drawn") - drawn) / (time.monotonic() - began)
        if pictures is not None:
            await page.picture(pictures / f"{title.replace(' ', '_')}.png")
    own = sizes.get(FRAMES[title], np.array([]))
    frames = own[own > SMALL]
    if not len(frames):
        raise InputError(f"{title}: found no frame in {seconds:g} s")
    others = sum(found.sum() for found in sizes.values()) - frames.sum()
    return Found(comes, float(np.median(frames)), others / lasted, len(frames) / lasted, cpu / len(frames), drawn)


async def compared(package: Path, seconds: float, pictures: Path | None) -> dict[str, Found]:
    ours = ["-m", "trunkline.ar.session", str(package), "--port", str(PORTS[0])]
    found = {}
    begun = time.monotonic()
    async with served(ours, "#token=") as (pid, line):
        found[OURS] = await measured(OURS, line, pid, begun, seconds, pictures)
    with tempfile.TemporaryDirectory() as folder:
        teleop, config = load_folder(Teleop, PROJECT / "conf/teleop"), load_folder(SessionConfig, PROJECT / "conf/live")
        model = simulation_of(read_package(package), teleop, config, SEARCH).twin.model
        path = Path(folder) / "robot.mjb"
        mujoco.mj_saveModel(model, str(path), None)
        theirs = ["-m", "mujoco.studio.viewer", "--model", str(path), "--gfx=web", "--port", str(PORTS[1])]
        begun = time.monotonic()
        async with served(theirs, "Local:") as (pid, _):
            url = f"http://localhost:{PORTS[1]}/"
            found[THEIRS] = await measured(THEIRS, url, pid, begun, seconds, pictures)
    return found


@in_one_line
def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("package", nargs="?", type=Path)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--pictures", type=Path, help="a folder, for a picture of each page")
    given = parser.parse_args(arguments)
    package = given.package or only_package()
    with recorded("studio", given.seconds >= 20):
        found = asyncio.run(compared(package, given.seconds, given.pictures))
        print("| | first picture, s | bytes a frame | others a second | frames a second | server, CPU ms a frame |"
              " drawn a second |")  # fmt: skip
        print("|---|---:|---:|---:|---:|---:|---:|")
        for title, row in found.items():
            stream = f"{row.frame:.0f} | {row.others:.0f} | {row.rate:.1f} | {1e3 * row.cpu:.2f}"
            print(f"| {title} | {row.comes:.1f} | {stream} | {row.drawn:.1f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
