"""The rehearsal's operator at the page of a live session: hands go in as a tracker's would, what is shown comes back.

The page is the one that ships, in a headless browser; its hands at a desk are taken from the operator's instead of
mouse and keyboard. All else is the page's own: poses and buttons on the wire, previews that are played to their end,
words. After its first picture it draws no more: drawn by software, pictures take the processor from the robots, which
have 1000 cycles a second (and an emulated headset, which sends poses as it draws, would send four a second).
"""

import asyncio
import json
import time
from dataclasses import asdict

import numpy as np
from pydantic import TypeAdapter

from benchmarks.browser import Page
from rehearsal.experiments.bench import LONGEST, Staged
from rehearsal.session import REFERENCE, View
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session.log_reader import tip_path
from trunkline.ar.teleop.messages import Controller, Intent, Offer, Targets, Vector, World
from trunkline.ar.teleop.object_shapes import grip_of
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation

EVERY = 1 / 60  # s between looks at the page
OFFERED = 20.0  # s that the operator waits for an offer where the grasp is not sure
COMES = 60.0  # s for the page to be there
SHOWS = ("preview", "ready", "delay")
HANDS = """
globalThis.operator = null;
const { desktop, renderer } = globalThis.trunkline, own = desktop.hands.bind(desktop);
renderer.render = () => {};
document.body.style.display = "none";
desktop.hands = () => globalThis.operator ?? own();
globalThis.look = (hands) => {
  globalThis.operator = hands;
  const { state, told, digest, frame, drawn, playback } = globalThis.trunkline;
  const row = (rows, index) => rows && Array.from(rows.slice(7 * index, 7 * index + 7));
  const last = drawn.bodies.indexOf(globalThis.tipBody);
  const rays = [0, 1].map((ray) => row(frame?.rows, drawn.count + ray));
  const ghost = playback?.whole ? row(playback.rows, ((playback.frames - 1) * playback.width) / 7 + last) : null;
  return JSON.stringify({ state, told, digest, rays, ghost, tip: row(frame?.rows, last), world: drawn.known });
};
"""
_TARGETS, _OFFER, _WORLD = TypeAdapter[Targets | None](Targets | None), TypeAdapter(Offer), TypeAdapter(World)


class AtPage:
    """`tip`: body of the arm's tip, and where it is in that, m. accept: probability from which on no offer is waited
    for. begun: s of the server's clock at which the operator's begins; the latter stands while the batch is waited
    for, which takes its time beside so much else."""

    def __init__(self, page: Page, staged: Staged, tip: tuple[str, Vector], accept: float) -> None:
        self._page, self._script, self._session, self._tip = page, staged.script, staged.session, tip
        self._accept = accept
        self._rays: list[Vector | None] = [None, None]
        self._foreseen: tuple[str, float] = "", 0.0  # digest, and since when
        self._waited, self.begun = 0.0, time.monotonic()

    async def perform(self) -> tuple[object, list[View]]:
        """How the operator's script ended, None where it did not, and all that was seen.

        Raises:
            InputError: the page never had the robot, or lost the server.
        """
        page, views, script = self._page, [], self._script
        await self._take_control()
        self.begun = time.monotonic()
        next(script)
        while (now := time.monotonic() - self.begun - self._waited) < LONGEST:
            hands = zip(("left", "right"), self._session.hands, self._rays, strict=True)
            held = {side: hand_of(hand.controller(now, end)) for side, hand, end in hands}
            seen = json.loads(await page.value(f"look({json.dumps(held)})"))
            if seen["state"] is None:
                raise InputError("the page has lost the server")
            looked = time.monotonic()
            if self._waits(looked, seen):  # the operator reads what it says of the grasp before deciding
                await asyncio.sleep(EVERY)
                self._waited += time.monotonic() - looked
                continue
            view = self._view(now, seen)
            views.append(view)
            try:
                script.send(view)
            except StopIteration as end:
                return end.value, views
            await asyncio.sleep(max(self.begun + self._waited + now + EVERY - time.monotonic(), 0.0))
        return None, views

    async def _take_control(self) -> None:
        page, until = self._page, time.monotonic() + COMES
        while not await page.value("Boolean(globalThis.trunkline?.loaded && trunkline.frame && trunkline.state)"):
            if time.monotonic() > until:
                raise InputError(f"the page has no robot after {COMES:.0f} s")
            await asyncio.sleep(0.2)
        await page.value(f"globalThis.tipBody = {json.dumps(self._tip[0])}; {HANDS}")
        while not await page.value("trunkline.wire.controls"):
            if time.monotonic() > until:
                raise InputError(f"the page does not control after {COMES:.0f} s")
            await page.value("document.querySelector('#control').click()")
            await asyncio.sleep(1.0)

    def _view(self, now: float, seen: dict) -> View:
        state, session = seen["state"], self._session
        self._rays = [None if row is None or row[0] is None else (row[0], row[1], row[2]) for row in seen["rays"]]
        targets = _TARGETS.validate_python(_frozen(state["targets"]))
        mode, told = state["mode"], _said(seen)
        if mode == "follow" and state["notice"]:
            session.refusals.append((now, state["notice"]))
        left, right = self._rays
        intent = Intent(mode, state["motion"], state["notice"], targets, (left, right), preview=state["preview"])
        world = _WORLD.validate_python(_frozen(seen["world"])) if seen["world"] else make_world(())
        tip = tip_path(np.array(seen["tip"], dtype=float)[None], self._tip[1])[0]
        thing = np.array(grip_of(world.things[0])) if world.things else session.in_client_frame(session.place(now))
        found = View(now, intent, thing, tip, None, world)
        if mode in SHOWS and seen["ghost"]:
            found.previewed = tip_path(np.array(seen["ghost"], dtype=float)[None], self._tip[1])[0]
        if told is not None:
            found.probability = told["probability"]
            if told["offer"]:
                found.offer = _OFFER.validate_python(_frozen(told["offer"]))
        return found

    def _waits(self, now: float, seen: dict) -> bool:
        """Whether it is not said yet, at `now`, s, how surely a thing is held, or where it would be more surely."""
        state, told = seen["state"], _said(seen)
        if state["mode"] != "ready" or not state["targets"] or not state["targets"]["thing"]:
            return False
        if told is None:
            return True
        if self._foreseen[0] != told["digest"]:
            self._foreseen = told["digest"], now
        probability = told["probability"]
        sure = probability is None or probability >= self._accept or told["offer"] is not None
        return not sure and now < self._foreseen[1] + OFFERED


def _said(seen: dict) -> dict | None:
    """What the page says of the futures of the plan that it shows."""
    told = seen["told"]
    return told if seen["state"]["mode"] in SHOWS and told and told["digest"] == seen["digest"] else None


def hand_of(controller: Controller) -> dict:
    """A hand in the base frame, as the page has hands."""
    turn = rotation_from_wxyz(np.array(REFERENCE.quaternion))
    place = turn.apply(controller.position) + REFERENCE.position
    around = wxyz_from_rotation(turn * rotation_from_wxyz(np.array(controller.quaternion)))
    return asdict(controller) | {"position": place.tolist(), "quaternion": around.tolist()}


def _frozen(value):
    """JSON's lists as tuples, which messages have."""
    if isinstance(value, dict):
        return {name: _frozen(inner) for name, inner in value.items()}
    return tuple(map(_frozen, value)) if isinstance(value, list) else value
