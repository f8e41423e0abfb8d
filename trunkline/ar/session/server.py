"""Connections and the clockwork of a live session: one port, one origin, one event loop.

Nothing here takes longer than a frame: plans, previews and the robot are processes of their own. The stop is heard
before anything else of a message is looked at.
"""

import asyncio
import contextlib
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from aiohttp import WSCloseCode, WSMsgType, web

from trunkline.ar.session import binary, controller_input, messages, preview_process
from trunkline.ar.session.alignment import mark_at
from trunkline.ar.session.alignment_procedure import AlignmentProcedure
from trunkline.ar.session.anchors import Anchor, Anchors
from trunkline.ar.session.auth import HEADERS, Origins, PairingCode, same
from trunkline.ar.session.broadcast import Broadcast, piece
from trunkline.ar.session.client import PER_SECOND, Client, end
from trunkline.ar.session.controller import SessionController
from trunkline.ar.session.controller_input import controller_pose
from trunkline.ar.session.gc_policy import GCPolicy
from trunkline.ar.session.lease import Control
from trunkline.ar.session.robot import next_report_time
from trunkline.ar.session.routes import Routes
from trunkline.ar.session.scene import Shells
from trunkline.ar.session.settings import AlignmentSettings
from trunkline.errors import InputError

HELLO = 3.0  # s for the first message
LARGEST = 64 * 1024  # bytes of a message
FLOOD = 4000.0  # messages of a client beyond its rate that end it
MOST_CLIENTS = 64
HEARTBEAT = 20.0  # s
PARTING = 1.0  # s that a client has to say that it goes, as the session ends
TOUCHING = "right"  # the hand whose controller touches
PREVIEWED = ("plan", "preview", "ready", "delay")  # modes in which who comes is shown the preview from its beginning


@dataclass(frozen=True)
class Composition:
    """What a server is made of. scene: as `scene.scene` has it. alignment: how clients in a room are aligned, None
    where there are none; anchors: what is known of their rooms."""

    desk: SessionController
    token: str
    origins: Origins
    package: str
    scene: dict
    shells: Shells | None
    rate: float
    page: Path
    log: Callable[[str], None] = print
    alignment: AlignmentSettings | None = None
    anchors: Anchors | None = None


class Server:
    """The session's edge. `now` is its clock, s."""

    def __init__(self, house: Composition, now: Callable[[], float] = time.monotonic) -> None:
        self.house, self.desk, self.now = house, house.desk, now
        self.control, self.code = Control(), PairingCode()
        self.clients: dict[str, Client] = {}
        self._aligners: dict[str, AlignmentProcedure] = {}  # of clients that may come again
        self.showing = Broadcast(house.desk, house.shells)
        self._site = Routes(house.origins, house.token, house.scene, house.page, house.log)
        self._world, self._unwritten, self._garbage = None, "", GCPolicy()
        self._ticked = now()

    # --- routes

    def app(self) -> web.Application:
        app = web.Application(middlewares=[self._site.guarded], client_max_size=LARGEST)
        app.router.add_get("/ws", self._socket)
        self._site.add_routes(app)
        app.cleanup_ctx.append(self._clockwork)
        app.on_shutdown.append(self._part)
        return app

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        reason = self.house.origins.fault(request.headers.get("Host"), request.headers.get("Origin"), True)
        if reason or len(self.clients) >= MOST_CLIENTS:
            reason = reason or "server: too many clients"
            self.house.log(f"refused {request.remote}: {reason}")
            return web.Response(status=403, text=f"error: {reason}\n")
        socket = web.WebSocketResponse(max_msg_size=LARGEST, compress=False, heartbeat=HEARTBEAT)
        socket.headers.update(HEADERS)
        await socket.prepare(request)
        try:
            client = await self._welcome(socket)
        except InputError as error:
            self.house.log(f"refused {request.remote}: {error}")
            await end(socket, str(error))
            return socket
        tasks = [asyncio.create_task(work) for work in (client.send(), client.ping(self.now))]
        try:
            await self._hear(client)
        except InputError as error:
            self.house.log(f"refused {client.id}: {error}")
            await end(socket, str(error))
        finally:
            for task in tasks:
                task.cancel()
            self._leave(client)
        return socket

    # --- a connection

    async def _welcome(self, socket: web.WebSocketResponse) -> Client:
        """
        Raises:
            InputError: the first message is no hello that may come in.
        """
        try:
            message = await socket.receive(timeout=HELLO)
        except TimeoutError:
            raise InputError(f"hello: found none within {HELLO:g} s") from None
        if message.type is not WSMsgType.TEXT:
            raise InputError("hello: found none")
        hello = messages.hear(message.data)
        if not isinstance(hello, messages.Hello):
            raise InputError(f"hello: found {hello.type}")
        if hello.token or not hello.code:
            if not same(hello.token, self.house.token):
                raise InputError("token: wrong")
        elif reason := self.code.fault(hello.code, self.now()):
            raise InputError(reason)
        if hello.version != binary.VERSION:
            raise InputError(f"version: found {hello.version}, expected {binary.VERSION}; load the page anew")
        older = self.clients.get(hello.id)
        if older is not None:
            self._leave(older)
            asyncio.create_task(end(older.socket, "connection: the same client came again"))
        if hello.space == "room" and self.house.alignment is None:
            raise InputError("space: found room, expected base: nothing is aligned here")
        aligner = self._aligner(hello)
        id = hello.id if older is not None or hello.id in self._aligners else secrets.token_hex(4)
        client = Client(id, hello.name, hello.space, socket, aligner)
        if aligner is not None:
            self._aligners[id] = aligner
        client.counted = self.now()
        self.clients[id] = client
        self.house.log(f"{id} {hello.name!r} came, {len(self.clients)} here")
        self.desk.journal.event("came", client=id, name=hello.name, space=hello.space)
        self._greet(client)
        return client

    def _aligner(self, hello: messages.Hello) -> AlignmentProcedure | None:
        """Its own where it comes again to the same room: whose anchor has to be seen anew."""
        kept = self._aligners.pop(hello.id, None)
        if hello.space == "base" or self.house.alignment is None:
            return None
        if kept is not None:
            kept.lose()
            self._aligners[hello.id] = kept
            return kept
        anchors = self.house.anchors
        while len(self._aligners) >= MOST_CLIENTS:
            self._aligners.pop(next(iter(self._aligners)))
        return AlignmentProcedure(self.house.alignment, anchors.find(anchors.newest) if anchors is not None else None)

    def _greet(self, client: Client) -> None:
        desk, say = self.desk, client.outbox.say
        say(messages.tell(messages.Welcome(client.id, self.house.token, self.house.package, self.house.rate)))
        if client.aligner is not None:
            say(messages.tell(client.aligner.told()))
        say(messages.tell(messages.WorldMessage(desk.world)))
        if desk.intent is not None:
            say(messages.tell(desk.told(self.control.holder)))
            if desk.preview is not None and desk.intent.mode in PREVIEWED:
                say(messages.tell(desk.preview))
                for shown in desk.pieces:
                    client.outbox.piece(piece(shown))
        if desk.foreseen is not None:
            say(messages.tell(desk.foreseen))
        if self.showing.shell:
            client.outbox.show("shell", self.showing.shell)
        self._tell_lease()

    async def _hear(self, client: Client) -> None:
        """Until it leaves.

        Raises:
            InputError: it has said what ends a connection.
        """
        async for message in client.socket:
            if message.type not in (WSMsgType.BINARY, WSMsgType.TEXT):
                self.house.log(f"refused {client.id}: {message.data or 'the connection broke'}")
                break
            now = self.now()
            client.count(now)
            if message.type is WSMsgType.BINARY:
                received = binary.read(message.data)
                self._heed(client, received)
                client.outbox.acknowledge(received.received)
                if received.kind == "input" and client.left >= 0:
                    self._input(client, received, now)
                elif received.kind == "view" and client.left >= 0:
                    self._keep_view(client, received)
            elif client.left >= 0:
                self._said_by(client, messages.hear(message.data), now)
            if client.left < 0:
                self._refuse(client, f"rate: more than {PER_SECOND:g} messages a second; they are left out")
            if client.left < -FLOOD:
                raise InputError(f"rate: {FLOOD:g} messages too many")

    def _heed(self, client: Client, received: binary.Received) -> None:
        """The stop, of everybody and always: a message of its own, or a secondary button."""
        if received.kind not in ("stop", "input"):
            return
        stops = received.kind == "stop" or controller_input.stops(received)
        if stops:
            self.desk.stop()
            if received.kind == "stop" or not client.stopping:
                self.house.log(f"{client.id} stopped the robot")
                self.desk.journal.event("stopped", client=client.id)
        client.stopping = stops and received.kind == "input"

    def _input(self, client: Client, received: binary.Received, now: float) -> None:
        if client.id != self.control.holder:
            self._refuse(client, "input: you do not control; ask for it")
            return
        reason = client.clock.fault(received.stamp, now) or self.desk.hear(received)
        if reason:
            self._refuse(client, reason)
        else:
            self.control.hear(client.id, now)
            self._keep_hands(client, received)
            self._touch(client, received)
            pressed = controller_input.buttons(received)
            if pressed != client.buttons:  # what a button does is not left to wait for the next tick
                client.buttons = pressed
                self.step()

    def _keep_hands(self, client: Client, received: binary.Received) -> None:
        assert client.clock.offset is not None
        for name, hand in zip(binary.HANDS, received.hands, strict=True):
            if {f"{name}_tracked", "visible"} <= received.flags:
                at, pose = received.stamp + client.clock.offset, hand[: len(binary.POSE)]
                self.desk.journal.headset(name, at, pose, client.space == "base")

    def _keep_view(self, client: Client, received: binary.Received) -> None:
        offset = client.clock.offset if client.id == self.control.holder else None
        if offset is not None and "tracked" in received.flags and received.view is not None:
            self.desk.journal.headset("view", received.stamp + offset, received.view, client.space == "base")

    def _touch(self, client: Client, received: binary.Received) -> None:
        """What the touching hand of whom controls tells of the base's place."""
        aligner, settings = client.aligner, self.house.alignment
        if aligner is None or settings is None or aligner.step in ("done", "lost", "place"):
            return
        rests = self.desk.robot.state().mode in ("idle", "done")
        mark = mark_at(self.desk.robot.standing().joints, settings.mark) if rests else None
        before = aligner.told()
        aligner.hear(received.stamp, controller_pose(received, TOUCHING), mark)
        self._aligned(client, before)

    def _said_by(self, client: Client, said: messages.ClientMessage, now: float) -> None:
        if isinstance(said, messages.Pong):
            if client.clock.pong(said.number, said.stamp, now):
                assert client.clock.offset is not None
                client.outbox.say(messages.tell(messages.Clock(client.clock.offset, client.clock.round_trip)))
                self.desk.journal.event("clock", client=client.id, offset=client.clock.offset)
        elif isinstance(said, messages.LeaseRequest):
            self._lease(client, said, now)
        elif isinstance(said, messages.AlignmentByEye | messages.TouchRequest | messages.AnchorPose):
            self._align(client, said)
        elif isinstance(said, messages.PreviewShown):
            reason = "shown: you do not control" if client.id != self.control.holder else ""
            if reason := reason or self.desk.shown(said.digest, now):
                self._refuse(client, reason)
        else:
            self._refuse(client, "hello: was said before")

    def _align(self, client: Client, said: messages.AlignmentByEye | messages.TouchRequest | messages.AnchorPose) -> None:
        aligner, anchors, reason = client.aligner, self.house.anchors, ""
        if aligner is None:
            self._refuse(client, "alignment: your poses are in the base frame")
            return
        before, anchor = aligner.told(), aligner.anchor
        if isinstance(said, messages.TouchRequest):
            aligner.touch()
        elif isinstance(said, messages.AnchorPose):
            reason = aligner.anchored(said.id, said.pose, anchors.find(said.id) if anchors is not None else None)
        elif said.pose is None:
            aligner.reset()
        else:
            reason = aligner.by_eye(said.pose)
        if reason:
            self._refuse(client, reason)
        if anchors is not None and aligner.anchor is not None and aligner.anchor != anchor:
            self._keep_anchor(anchors, aligner.anchor)
        self._aligned(client, before)

    def _aligned(self, client: Client, before: messages.AlignmentProgress) -> None:
        """The core, the client and the log hear what has changed."""
        assert client.aligner is not None
        now = client.aligner.told()
        if client.id == self.control.holder:
            self.desk.align(client.alignment, client.unfit)
        if now == before:
            return
        client.outbox.state("aligning", messages.tell(now))
        if (now.step, now.said) != (before.step, before.said):
            self.desk.journal.event("aligning", client=client.id, aligning=now)

    def _keep_anchor(self, anchors: Anchors, anchor: Anchor) -> None:
        """Known from now on, and in its file as soon as the disk has it."""
        if anchors.find(anchor.id) == anchor:
            return
        anchors.keep(anchor)

        def saved(done: asyncio.Future) -> None:
            if error := done.exception():
                self.house.log(f"{anchors.path}: {error}; the anchor is not kept")

        asyncio.get_running_loop().run_in_executor(None, anchors.save).add_done_callback(saved)

    def _lease(self, client: Client, wish: messages.LeaseRequest, now: float) -> None:
        before = self.control.holder
        if wish.action == "ask":
            self.control.ask(client.id, now)
        elif wish.action == "release":
            self.control.release(client.id, now)
        elif wish.to not in self.clients:
            self._refuse(client, f"lease: found no client {wish.to!r}")
        elif not self.control.give(client.id, wish.to, now):
            self._refuse(client, "lease: you do not control")
        self._passed(before)
        self._tell_lease()

    def _leave(self, client: Client) -> None:
        if self.clients.get(client.id) is not client:
            return
        del self.clients[client.id]
        before = self.control.holder
        self.control.release(client.id, self.now())
        self._passed(before)
        self.house.log(f"{client.id} left, {len(self.clients)} here")
        self.desk.journal.event("left", client=client.id)
        self._tell_lease()

    def _passed(self, before: str) -> None:
        """The robot holds whenever somebody else controls."""
        holder = self.control.holder
        if holder == before:
            return
        self.house.log(f"{holder or 'nobody'} controls")
        self.desk.journal.event("control", client=holder)
        client = self.clients.get(holder)
        self.desk.control(client.alignment if client else None, client.unfit if client else "")

    def _refuse(self, client: Client, reason: str) -> None:
        """One line to whom it concerns, the same no oftener than once a second."""
        if client.refuse(reason, self.now()):
            self.house.log(f"refused {client.id}: {reason}")
            self.desk.journal.event("refused", client=client.id, reason=reason)

    # --- the clockwork

    async def _clockwork(self, app: web.Application):
        task = asyncio.create_task(self._run())
        yield
        task.cancel()
        self._garbage.tell(moving=False)

    async def _part(self, app: web.Application) -> None:
        """All clients are told that it ends; one that does not answer is not waited for."""
        ends = [client.socket.close(code=WSCloseCode.GOING_AWAY) for client in self.clients.values()]
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(asyncio.gather(*ends), PARTING)

    async def _run(self) -> None:
        """Ticks at the house's rate, each once the robot has told of itself; one that is late is not made up for."""
        period = 1 / self.house.rate
        self._ticked = self.now()
        due = self._ticked + period
        while True:
            after = next_report_time(due, self.desk.robot.standing().time)
            await asyncio.sleep(max(after - self.now(), 0.0))
            self.step()
            due = max(due + period, self._ticked)

    def step(self) -> None:
        """A tick, now; what fails in it stops the robot."""
        now = self.now()
        if now <= self._ticked:
            return
        try:
            self.tick(now, now - self._ticked)
        except Exception as error:  # a session that goes on blindly could move the robot
            self.desk.stop()
            self.house.log(f"error: {type(error).__name__}: {error}; the robot holds")
        self._ticked = now

    def tick(self, now: float, dt: float) -> None:
        """A step of the core, and what all see of it."""
        before = self.control.holder
        if self.control.silent(now):
            self.house.log(f"{before} was silent")
            self._passed(before)
            self._tell_lease()
        self._garbage.tell(moving=self.desk.tick(dt).motion != "hold")
        if self.desk.journal.fault != self._unwritten:
            self._unwritten = self.desk.journal.fault
            self.house.log(self._unwritten)
        self._show(now)
        if self.desk.world is not self._world:
            self._world = self.desk.world
            self._tell(messages.WorldMessage(self.desk.world))

    def foreseen(self, answer: preview_process.Answer | None) -> None:
        """An answer of the process that plans; called in the event loop."""
        if not self.desk.answered(answer, self.now()):
            return
        if isinstance(answer, preview_process.PreviewBegun):
            for client in self.clients.values():
                client.outbox.forget_pieces()
            self._tell(answer.preview)
        elif isinstance(answer, preview_process.PreviewPiece):
            message = piece(answer)
            for client in self.clients.values():
                client.outbox.piece(message)
        elif isinstance(answer, preview_process.PredictionAnswer):
            self._tell(answer.foreseen)

    def _show(self, now: float) -> None:
        """The robot, its reach and the state to all."""
        frame, shell = self.showing.robot(now), self.showing.new_shell(now)
        state = self.showing.new_state(now, self.control.holder)
        text = messages.tell(state) if state is not None else ""
        for client in self.clients.values():
            client.outbox.show("robot", frame)
            if shell:
                client.outbox.show("shell", shell)
            if text:
                client.outbox.state("state", text)

    def _tell_lease(self) -> None:
        people = tuple(messages.Person(client.id, client.name) for client in self.clients.values())
        self._tell(messages.Lease(self.control.holder, tuple(self.control.asking), people))

    def _tell(self, answer: messages.ServerMessage) -> None:
        text = messages.tell(answer)
        for client in list(self.clients.values()):
            if not client.outbox.say(text):
                self.house.log(f"refused {client.id}: it does not read")
                self._leave(client)
                asyncio.create_task(client.socket.close())
