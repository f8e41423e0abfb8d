"""A picture of each state of a live session's page, for docs/live-sessions.md: docs/live-hold.png, ...

    python -m tests.ar.session.pictures [PACKAGE] [--folder docs] [--size 760x640] [--cameras]

With --cameras: of the measured arm once a plan has arrived, the same as if something pushed it beside and far beside
its preview's end, of a plan that may correct itself, and of cameras that have the last body elsewhere. --size: of the
window, pixels; half of a screen's shows the page as at 200 %.

The true server and its processes on the simulated robot; the committed page in a headless Chromium, by its buttons, its
slider and its keys. Drawing is by software, and all share a processor. So page and robot may be silent for longer, the
plan is kept back until its state's picture is taken, and the page gets no later state while that of the delay is.
All else is as conf/live and conf/teleop have it. `make browser` installs the browser.
"""

import argparse
import asyncio
import base64
import io
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np
from PIL import Image

from qualification.browser import Page, browsing
from trunkline.ar.preview.package import only_package
from trunkline.ar.session import clock, controller, lease, robot_process
from trunkline.ar.session.arm_cameras import ArmCameras
from trunkline.ar.session.previewer import Answer, FollowRequest, Order, Previewer
from trunkline.ar.session.serving import Address, opened
from trunkline.ar.session.settings import SessionConfig
from trunkline.ar.teleop.config import TeleoperationConfig as Teleop
from trunkline.ar.teleop.messages import Mode
from trunkline.ar.tracking import tracking_process
from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.config import PROJECT, load_folder

ADDRESS, YIELDS = Address(18452), 3  # of the page, and how nice its browser is
COLOURS = 128  # of a picture's palette
PATIENCE = 180.0  # s for a state to come
SILENCE, STALE = 10.0, 1.0  # s for which the page, its inputs and pictures, and the robot's process may be late
EYE, AT = (1.29, 1.04, 1.94), (0.35, 0.43, 0.05)  # m, in the room: where the picture is taken from, and what it is of
# presses of each arrow, 1 cm each, for the mount's target and for the tip's
AIMED = (
    ("Digit1", {"ArrowRight": 10, "PageDown": 12, "ArrowUp": 4}),
    ("Digit2", {"ArrowRight": 20, "PageDown": 14, "ArrowUp": 8}),
)
LED = (("Digit1", {"ArrowLeft": 15}), ("Digit2", {"ArrowLeft": 15}))
WATCHED, MOVED = 0.55, 0.5  # shares of the preview and of the mount's way, at which their pictures are taken
ASTRAY = 0.5  # m, of the last body, where cameras have it elsewhere
PUSHED = {"beyond": 1.5, "far-beyond": 2.5}  # times the radius, of the tip beside its preview's end
BACK = 0.05  # share by which the preview is taken back, as its slider reports only changes

MODE = "document.querySelector('#mode').dataset.mode"
# nothing is wrong or late
CALM = "!document.querySelector('#notice').innerText && !/OLD|Fault/.test(document.querySelector('#facts').innerText)"
# in the delay the page gets no later state until `showLater`
STILL = """(() => {
  const original = trunkline.changed;
  let later = null;
  trunkline.changed = (state) => {
    if (trunkline.state?.mode === "delay") later = state;
    else original.call(trunkline, state);
  };
  trunkline.showLater = () => {
    delete trunkline.changed;
    if (later) trunkline.changed(later);
  };
})()"""
SETTLED = """(() => {
  const { desktop, state } = trunkline, { rigid, tip } = state.targets ?? {};
  const isReleased = performance.now() / 1000 > desktop.pressedUntil.grip + 0.5;
  return rigid?.reach === "inside" && tip?.reach === "inside" && isReleased;
})()"""
# m from the mount to its target
AWAY = """(() => {
  const { drawn: { bodies }, frame: { rows }, state: { targets } } = trunkline;
  const first = 7 * bodies.findIndex((name) => name === "base" || name.startsWith("unit_"));
  return Math.hypot(...targets.rigid.position.map((x, axis) => x - rows[first + axis]));
})()"""


class Kept:
    """What plans, but orders are kept back until it may go on."""

    def __init__(self, previewer: Previewer) -> None:
        self._previewer, self._orders = previewer, []

    def submit(self, order: Order | FollowRequest) -> None:
        self._orders.append(order)

    def leave(self) -> None:
        self._orders.clear()
        self._previewer.leave()

    def poll(self) -> list[Answer | None]:
        return self._previewer.poll()

    def go_on(self) -> None:
        for order in self._orders:
            self._previewer.submit(order)
        self._orders.clear()


class Camera:
    """At a page of this size, pixels. pictures: PNGs by name; they are made small later, as the server shares this
    thread."""

    def __init__(self, page: Page, size: tuple[int, int]) -> None:
        self.page, self.size = page, size
        self.pictures: dict[str, bytes] = {}

    async def until(self, expression: str, what: str) -> None:
        await self.page.until(expression, what, PATIENCE)

    async def drawn(self, frames: int = 2) -> None:
        first = await self.page.value("globalThis.drawn")
        await self.until(f"globalThis.drawn >= {first + frames}", "a picture of the page")

    async def take(self, mode: Mode, when: str = CALM, name: str = "") -> None:
        """In `mode`, while `when` is true; `name` in place of the mode's.

        Raises:
            InputError: it is not reached, or over before its picture is taken.
        """
        end, png = time.monotonic() + PATIENCE, ""
        while not png or not await self.page.value(when):
            await self.until(f"{MODE} === '{mode}' && ({when})", f"state {mode!r}")
            png = (await self.page.ask("Page.captureScreenshot"))["data"]
            after = await self.page.value(MODE)
            if after != mode or time.monotonic() > end:
                raise InputError(f"state {mode!r}: over before its picture was taken, the page is in {after!r}")
        self.pictures[name or mode] = base64.b64decode(png)

    async def move(self, steps: tuple[tuple[str, dict[str, int]], ...]) -> None:
        """Targets, by arrows."""
        for target, arrows in steps:
            await self.page.key(target)
            for arrow, presses in arrows.items():
                for _ in range(presses):
                    await self.page.key(arrow)
            await self.drawn()


async def arrive(camera: Camera) -> None:
    page = camera.page
    wide, high = camera.size
    await page.ask("Emulation.setDeviceMetricsOverride", width=wide, height=high, deviceScaleFactor=1, mobile=False)
    there = "Boolean(globalThis.trunkline?.loaded && trunkline.frame && trunkline.state)"
    await camera.until(there, "the page's robot")
    await page.value(f"trunkline.camera.position.set(...{list(EYE)}); trunkline.orbit.target.set(...{list(AT)})")
    await page.value("trunkline.quality.change(trunkline.quality.best, 0), trunkline.quality.isFixed = true")
    await camera.until("!document.querySelector('#control').disabled", "the page's clock")
    await camera.drawn()


async def aim(camera: Camera) -> None:
    await camera.page.click("#control")
    await camera.until(f"{MODE} === 'aim'", "state 'aim'")
    await camera.move(AIMED)


async def taken(camera: Camera, previewer: Kept) -> None:
    """Every state's picture."""
    await arrive(camera)
    await camera.take("hold")
    await aim(camera)
    await camera.take("aim", f"{SETTLED} && {CALM}")
    await camera.page.key("Enter")
    await camera.take("plan")
    previewer.go_on()
    await camera.until("trunkline.playback?.whole && trunkline.drawn.ghost.visible", "the preview")
    await camera.until(f"trunkline.playback.played > {WATCHED} * trunkline.playback.duration", "half of the preview")
    place = await camera.page.place("#scrub", WATCHED - BACK)
    await camera.page.mouse("mousePressed", *place)  # where the slider is held, it stays
    await camera.until("trunkline.playback.paused", "a slider that is held")
    await camera.drawn()
    await camera.take("preview")
    await camera.page.mouse("mouseReleased", *place)
    ended = "trunkline.playback.at >= trunkline.playback.available"
    await camera.take("ready", f"trunkline.prediction && {ended} && {CALM}")
    way = await camera.page.value(AWAY)
    await camera.page.key("KeyG", "rawKeyDown")
    await camera.drawn()
    await camera.page.value(STILL)
    await camera.page.key("Enter")
    await camera.take("delay", "true")
    await camera.page.value("trunkline.showLater()")
    await camera.take("execute", f"{AWAY} < {(1 - MOVED) * way}")
    await camera.until(f"{MODE} === 'aim' && trunkline.state.robot === 'done'", "the motion's end")
    await camera.page.key("KeyF")
    await camera.until(f"{MODE} === 'follow' && trunkline.state.robot === 'running'", "state 'follow'")
    await camera.move(LED)
    await camera.take("follow")
    await camera.page.key("Space")
    await camera.page.key("KeyG", "keyUp")
    await camera.take("stopped", "trunkline.state.robot !== 'running'")


async def taken_of_cameras(camera: Camera, cameras: ArmCameras) -> None:
    """The measured arm's pictures."""
    message = "trunkline.measured.message"
    sound = f"{message} && !{message}.fault"
    await arrive(camera)
    await camera.until(sound, "the measured arm")
    await aim(camera)
    await camera.until(f"{SETTLED} && {CALM}", "both targets")
    await camera.page.key("Enter")
    await camera.until(f"{MODE} === 'ready'", "state 'ready'")
    await camera.page.key("KeyG", "rawKeyDown")
    await camera.drawn()
    await camera.page.key("Enter")
    there = f"trunkline.state.robot === 'done' && {sound} && {message}.radius !== null"
    await camera.until(there, "a tip that has arrived")
    await camera.page.key("KeyG", "keyUp")
    await camera.take("aim", there, "measured")
    show, far = cameras.show, 1e-3 * float(await camera.page.value(f"1000 * {message}.radius"))

    def elsewhere(place: Callable[[np.ndarray], None]) -> Callable[[np.ndarray], None]:
        """As `cameras.show`, of bodies that `place` moves."""

        def moved(bodies: np.ndarray) -> None:
            bodies = bodies.copy()
            place(bodies)
            show(bodies)

        return moved

    def push(by: float, bodies: np.ndarray) -> None:
        bodies[cameras._rows, 1] += by * np.linspace(0.0, 1.0, len(cameras._rows)) ** 2

    for name, radii in PUSHED.items():
        cameras.show = elsewhere(partial(push, radii * far))
        off = f"{sound} && {message}.from_preview > {radii - 0.3} * {message}.radius"
        await camera.take("aim", off, name)
    cameras.show = show
    await camera.page.key("KeyC")
    await camera.until("document.querySelector('#correct').ariaPressed === 'true'", "a correction that is asked for")
    await camera.move(LED)
    await camera.until(f"{SETTLED} && {sound}", "both targets")
    await camera.page.key("Enter")
    await camera.until("Boolean(trunkline.planned)", "a plan")
    if not await camera.page.value("Boolean(trunkline.planned.correction)"):
        raise InputError(f"correction: {await camera.page.value('trunkline.planned.uncorrected')}")
    await camera.take("ready", f"trunkline.measured.bounds.visible && {sound}", "correcting")

    def astray(bodies: np.ndarray) -> None:
        bodies[cameras._rows[-1], 0] += ASTRAY

    cameras.show = elsewhere(astray)
    await camera.take("ready", f"{message}?.fault", "astray")


async def session(package: Path, size: tuple[int, int], cameras: str) -> dict[str, bytes]:
    """PNGs by name."""
    config, teleop = load_folder(SessionConfig, PROJECT / "conf/live"), load_folder(Teleop, PROJECT / "conf/teleop")
    safety = replace(teleop.core.safety, silence=SILENCE, plan_wait=PATIENCE)
    teleop = replace(teleop, core=replace(teleop.core, safety=safety))
    lease.LEASE_TIMEOUT = controller.UNDRAWN = clock.LATEST = SILENCE
    robot_process.STALE, tracking_process.STALE = STALE, SILENCE
    with tempfile.TemporaryDirectory() as logs:
        limits = replace(config.cameras.limits, silence=SILENCE, age=SILENCE)
        arm_cameras = replace(config.cameras, limits=limits)
        config = replace(config, journal=replace(config.journal, folder=logs), cameras=arm_cameras)
        async with opened(
            package, ADDRESS, lambda line: None, config=config, teleop=teleop, cameras=cameras
        ) as opening:
            server, made = opening
            async with browsing(f"{ADDRESS.url}/#token={server.composition.token}", size, YIELDS) as page:
                camera = Camera(page, size)
                if made.cameras is not None:
                    await taken_of_cameras(camera, made.cameras)
                else:
                    previewer = made.controller.previewer = Kept(made.controller.previewer)
                    await taken(camera, previewer)
    return camera.pictures


@in_one_line
def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("package", nargs="?", type=Path)
    parser.add_argument("--folder", type=Path, default=PROJECT / "docs")
    parser.add_argument("--size", default="760x640")
    parser.add_argument("--cameras", action="store_const", const="simulated", default="")
    args = parser.parse_args(arguments)
    wide, high = map(int, args.size.split("x"))
    pictures = asyncio.run(session(args.package or only_package(), (wide, high), args.cameras))
    missing = [] if args.cameras else [mode for mode in get_args(Mode) if mode not in pictures]
    if missing:
        raise InputError(f"states: found no picture of {', '.join(missing)}, expected one of each")
    for name, png in pictures.items():
        path = args.folder / f"live-{name}.png"
        picture = Image.open(io.BytesIO(png)).convert("RGB")
        picture.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
