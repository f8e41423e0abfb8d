"""A session without physics: a robot that is where its plan says, a planner that answers at once, clients by real
sockets."""

import asyncio
import struct
import time
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from aiohttp import ClientSession, WSMsgType
from aiohttp.test_utils import TestServer, unused_port

from tests.ar.teleop.test_plan import LIMITS, NETWORK, OFFSET, START, STRAIGHT
from tests.support.operator import PACKAGE, Everywhere, config
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session import binary as wire
from trunkline.ar.session import messages
from trunkline.ar.session.auth import Origins
from trunkline.ar.session.controller import SessionController
from trunkline.ar.session.previewer import (
    FollowAnswer,
    FollowRequest,
    InlinePreviewer,
    PlanAnswer,
    PredictionAnswer,
    PreviewBegun,
    PreviewPiece,
)
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.session.server import Composition, Server
from trunkline.ar.session.settings import SessionConfig
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.executor import PlanFollower
from trunkline.ar.teleop.following import sought
from trunkline.ar.teleop.messages import PlanReport
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT, load_folder

TOKEN, RATE, BODIES = "t" * 22, 72.0, 3
TICK = 0.005  # s
WAIT = 30.0  # s at most for a message, on a loaded machine as well
PREVIEW = 0.3  # s that a preview lasts, whatever the plan


@cache
def live():
    """The settings of a live session."""
    return load_folder(SessionConfig, PROJECT / "conf/live")


class PlainRobot:
    """Where its plan says, in real time; `stops` are the times at which it was told to stop."""

    def __init__(self):
        self.robot, self.last, self.stops, self.permits = PlanFollower(START, STRAIGHT, LIMITS, PACKAGE), 0.0, [], 0
        self.silent = 0.0
        self.start, self.state, self.hear = self.robot.start, self.robot.state, self.robot.hear

    def follow(self, following):
        return self.robot.follow(following, TICK)

    def permit(self, waits=False):
        self.permits, self.robot.waits = self.permits + 1, waits

    def stop(self):
        self.stops.append(time.monotonic())
        self.robot.stop()

    def robot_state(self):
        now = time.monotonic()
        self.last = self.last or now
        while self.last + TICK <= now:
            self.robot.advance(TICK)
            self.last += TICK
        bodies = np.tile([1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0], (BODIES, 1))
        return RobotState(now, 0.0, self.robot.joints, self.robot.commands, np.full(7, np.nan), bodies)


class PlainPlanning(InlinePreviewer):
    """Plans at once, and previews with two pieces."""

    def __init__(self):
        super().__init__(self.answers)
        self.planner = Planner(RigidIK(OFFSET), NETWORK, STRAIGHT, LIMITS, OFFSET, step=0.005)
        self.plans = []

    def answers(self, order):
        if isinstance(order, FollowRequest):
            yield FollowAnswer(order.serial, *sought(self.planner, order.targets, order.joints, order.world))
            return
        serial = order.request.serial
        try:
            plan = self.planner.plan(order.request, order.world, order.joints, order.commands)
        except InputError as error:
            yield PlanAnswer(PlanReport(serial, refused=str(error)))
            return
        digest = plan.digest()
        self.plans.append(plan)
        poses = np.zeros((15, BODIES, 7), dtype=np.float32)
        yield PlanAnswer(PlanReport(serial, digest, "", plan.package, plan.world), plan)
        yield PreviewBegun(serial, messages.PreviewMessage(digest, 0.02, PREVIEW, 0.02, (("approach", 0.0),)))
        yield PreviewPiece(serial, 0, 0.02, poses, False)
        yield PreviewPiece(serial, 15, 0.32, poses, True)
        prediction = messages.PredictionMessage(digest, None, None, None, (0.0,), ((0.0, 0.0, 0.0),), (0.0,), 0.9, 12)
        yield PredictionAnswer(serial, prediction)


def patient(**seconds):
    """Settings for a machine that does other work as well: of `Safety`, with other limits."""
    core = config().core
    return replace(core, safety=replace(core.safety, **{"silence": 0.5} | seconds))


class Laid:
    """A server, its parts, and its log."""

    def __init__(
        self, port, page=Path("nowhere"), log_writer=None, anchors=None, settings=None, rate=RATE, certificate=b""
    ):
        self.robot, self.planning, self.log = PlainRobot(), PlainPlanning(), []
        core = Teleoperation(settings or patient(), Everywhere(), PACKAGE, OFFSET)
        self.controller = SessionController(core, self.robot, self.planning, make_world(()), 0.1, log_writer)
        self.controller.begin(rate)
        scene = {"bodies": ["a", "b", "c"]}
        origins = Origins.of(["127.0.0.1"], port, tls=False)
        self.server = Server(Composition(
            self.controller, TOKEN, origins, PACKAGE, scene, None, rate, page, self.log.append,
            live().alignment, anchors, certificate,
        ))  # fmt: skip
        self.url, self.origin = f"http://127.0.0.1:{port}", f"http://127.0.0.1:{port}"


class Guest:
    """A client: it answers pings, acknowledges, and keeps what it hears."""

    def __init__(self, socket, reads=True):
        self.socket, self.messages, self.frames, self.received = socket, [], [], 0
        self.task = asyncio.create_task(self._listen()) if reads else None
        self.left = self.right = None
        self.closed = asyncio.Event()

    async def _listen(self):
        async for message in self.socket:
            if message.type is WSMsgType.TEXT:
                content = message.json()
                self.messages.append(content)
                if content["type"] == "ping":
                    await self.say(type="pong", number=content["number"], stamp=self.now())
            elif message.type is WSMsgType.BINARY:
                self.received += 1
                self.frames.append(message.data)
                await self.socket.send_bytes(binary("ack", self.received, self.now()))
        self.closed.set()

    def now(self):
        return time.monotonic() + 1000.0  # another clock than the server's

    async def say(self, **message):
        await self.socket.send_json(message)

    async def hears(self, kind, seconds=WAIT, **fields):
        """The newest message of this type with these fields, once there is one."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for message in reversed(self.messages):
                if message["type"] == kind:
                    if all(message[name] == value for name, value in fields.items()):
                        return message
                    if kind in ("state", "lease"):
                        break
            await asyncio.sleep(0.005)
        raise AssertionError(f"no {kind} with {fields}; heard {self.messages[-5:]}")

    async def refused(self, word, seconds=WAIT):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for message in self.messages:
                if message["type"] == "error" and word in message["reason"]:
                    return message["reason"]
            await asyncio.sleep(0.005)
        raise AssertionError(f"no error with {word!r}; heard {self.messages[-5:]}")

    async def stop(self):
        await self.socket.send_bytes(binary("stop", self.received, self.now()))

    async def input(self, left, right, stamp=None, flags=0b1111):
        rows = np.array([left, right], dtype="<f4").tobytes()
        head = struct.pack("<BBHId", 16, flags, 2, self.received, self.now() if stamp is None else stamp)
        await self.socket.send_bytes(head + rows)


class Hands(Guest):
    """A client that sends input all the time, its hands where `left` and `right` are."""

    def begin(self):
        self.left, self.right = hand((0.5, 0.1, 1.1)), hand((0.5, 0.1, 1.1))
        self.sending = asyncio.create_task(self._send())

    async def _send(self):
        with suppress(ConnectionError):
            while not self.socket.closed:
                await self.input(self.left, self.right)
                await asyncio.sleep(1 / 72)


def binary(kind, received, stamp):
    return struct.pack("<BBHId", wire.FROM_CLIENT[kind].number, 0, 0, received, stamp)


def hand(place, **buttons):
    """A hand whose ray points straight down: its end, at its first length, is 0.6 m lower."""
    row = dict.fromkeys(wire.HAND, 0.0) | dict(zip("xyz", place, strict=True)) | {"qw": 1.0} | buttons
    return [float(row[name]) for name in wire.HAND]


@asynccontextmanager
async def laid(page=Path("nowhere"), log_writer=None, anchors=None, settings=None, rate=RATE, certificate=b""):
    """A server that runs, and how to come to it."""
    port = unused_port()
    here = Laid(port, page, log_writer, anchors, settings, rate, certificate)
    served = TestServer(here.server.app(), host="127.0.0.1", port=port)
    async with served, ClientSession() as session:

        async def come(kind=Guest, hello=True, origin=None, reads=True, **says):
            headers = {"Origin": here.origin if origin is None else origin}
            socket = await session.ws_connect(f"{here.url}/ws", headers=headers, max_msg_size=0)
            guest = kind(socket) if reads else kind(socket, reads=False)
            if hello:
                await guest.say(**{"type": "hello", "version": 1, "token": TOKEN} | says)
                if reads:
                    welcome = await guest.hears("welcome")
                    guest.id, guest.key = welcome["id"], welcome["key"]
            return guest

        here.come, here.session = come, session
        yield here


async def controlling(here):
    """A client that controls, its clock known, its hands heard."""
    guest = await here.come(Hands)
    await guest.hears("clock")
    await guest.say(type="lease", action="ask")
    await guest.hears("lease", holder=guest.id)
    guest.begin()
    return guest
