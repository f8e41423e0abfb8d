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

from trunkline.ar.session import binary, controller_input, messages
from trunkline.ar.session.alignment_procedure import AlignmentProcedure
from trunkline.ar.session.anchors import Anchor, Anchors
from trunkline.ar.session.auth import HEADERS, Origins, PairingCode, make_token, same
from trunkline.ar.session.broadcast import Broadcast, piece
from trunkline.ar.session.camera_alignment import CamerasAligned, camera_mark
from trunkline.ar.session.client import PER_SECOND, Client, end
from trunkline.ar.session.connections import IdleConnections, crowding
from trunkline.ar.session.controller import SessionController
from trunkline.ar.session.controller_input import controller_pose
from trunkline.ar.session.gc_policy import GCPolicy
from trunkline.ar.session.lease import ControlLease
from trunkline.ar.session.previewer import PredictionAnswer, PreviewBegun, PreviewPiece
from trunkline.ar.session.registration import mark_at
from trunkline.ar.session.robot_process import next_report_time
from trunkline.ar.session.routes import Routes
from trunkline.ar.session.scene import Shells
from trunkline.ar.session.settings import AlignmentSettings
from trunkline.errors import InputError

HELLO = 3.0  # s for the first message, whatever else comes before it
CLOSING = 1.0  # s for whoever is shown out to close its end as well
LARGEST = 64 * 1024  # bytes of a message
FLOOD = 4000.0  # messages of a client beyond its rate that end it
MOST_CLIENTS = 64  # and one more, for a stop
MOST_WAITING = 16  # connections before their hello; of more, the oldest of the address with the most goes
FULL = f"server: more than {MOST_CLIENTS} clients; this one may stop the robot, and watch"
HEARTBEAT = 20.0  # s
PARTING = 1.0  # s that a client has to say that it goes, as the session ends
TOUCHING = "right"  # the hand whose controller touches
PREVIEWED = ("plan", "preview", "ready", "delay")  # modes in which who comes is shown the preview from its beginning


@dataclass(frozen=True)
class Composition:
    """What a server is made of. scene: as `scene.scene` has it. alignment: how clients in a room are aligned, None
    where there are none; anchors: what is known of their rooms. certificate: the twin's page, empty without one."""

    controller: SessionController
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
    certificate: bytes = b""


class Server:
    """The session's edge. `now` is its clock, s."""

    def __init__(self, composition: Composition, now: Callable[[], float] = time.monotonic) -> None:
        self.composition, self.controller, self.now = composition, composition.controller, now
        self.lease, self.code = ControlLease(), PairingCode()
        self.clients: dict[str, Client] = {}
        self._ids: dict[str, str] = {}  # by key, of clients that are here or may come again
        self._procedures: dict[str, AlignmentProcedure] = {}  # by key, likewise
        self._waiting: dict[web.WebSocketResponse, str | None] = {}  # each with its address
        self.broadcast = Broadcast(composition.controller, composition.shells)
        self._routes = Routes(
            composition.origins, composition.token, composition.scene, composition.page, composition.log,
            composition.certificate,
        )  # fmt: skip
        self._world, self._unwritten, self._gc_policy = None, "", GCPolicy()
        self._aligned_cameras: CamerasAligned | None = None  # the last of which the terminal has a line
        self._ticked = now()

    # --- routes

    def app(self) -> web.Application:
        app = web.Application(middlewares=[self._routes.guarded], client_max_size=LARGEST)
        app.router.add_get("/ws", self._socket)
        self._routes.add_routes(app)
        app.cleanup_ctx.append(self._clockwork)
        app.on_shutdown.append(self._part)
        return app

    @property
    def idle(self) -> IdleConnections:
        return self._routes.idle

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        reason = self.composition.origins.fault(request.headers.get("Host"), request.headers.get("Origin"), True)
        if reason:
            self.composition.log(f"refused {request.remote}: {reason}")
            return web.Response(status=403, text=f"error: {reason}\n")
        socket = web.WebSocketResponse(
            timeout=CLOSING, max_msg_size=LARGEST, compress=False, heartbeat=HEARTBEAT
        )
        socket.headers.update(HEADERS)
        await socket.prepare(request)
        self._waiting[socket] = request.remote
        if len(self._waiting) > MOST_WAITING:
            crowd = crowding(self._waiting)
            del self._waiting[crowd]
            asyncio.create_task(end(crowd, "server: too many connections that say nothing"))
        try:
            client = await self._welcome(socket)
        except InputError as error:
            self.composition.log(f"refused {request.remote}: {error}")
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(CLOSING):  # it may read nothing of what it has asked for
                    await end(socket, str(error))
            if request.transport is not None:
                request.transport.abort()
            return socket
        finally:
            self._waiting.pop(socket, None)
        tasks = [asyncio.create_task(work) for work in (client.send(), client.ping(self.now))]
        try:
            await self._hear(client)
        except InputError as error:
            self.composition.log(f"refused {client.id}: {error}")
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
            async with asyncio.timeout(HELLO):  # that of `receive` begins anew with each ping
                message = await socket.receive()
        except TimeoutError:
            raise InputError(f"hello: found none within {HELLO:g} s") from None
        if message.type is not WSMsgType.TEXT:
            raise InputError("hello: found none")
        hello = messages.hear(message.data)
        if not isinstance(hello, messages.Hello):
            raise InputError(f"hello: found {hello.type}")
        if hello.token or not hello.code:
            if not same(hello.token, self.composition.token):
                raise InputError("token: wrong")
        elif reason := self.code.fault(hello.code, self.now()):
            raise InputError(reason)
        if hello.version != binary.VERSION:
            raise InputError(f"version: found {hello.version}, expected {binary.VERSION}; load the page anew")
        older = self.clients.get(self._ids.get(hello.key, ""))
        if older is not None:
            self._leave(older)
            asyncio.create_task(end(older.socket, "connection: the same client came again"))
        if hello.space == "room" and self.composition.alignment is None:
            raise InputError("space: found room, expected base: nothing is aligned here")
        id, key = self._identity(hello.key)
        procedure = self._procedure(hello, key)
        client = Client(id, key, hello.name, hello.space, socket, procedure, reserve=self._make_place())
        client.counted = self.now()
        self.clients[id] = client
        self.composition.log(f"{id} {hello.name!r} came, {len(self.clients)} here")
        self.controller.log_writer.event("came", client=id, name=hello.name, space=hello.space)
        self._greet(client)
        return client

    def _identity(self, key: str) -> tuple[str, str]:
        """The id and the key of whom comes: those of before by its key, which nobody else knows; else new ones."""
        id = self._ids.pop(key, "")
        if not id:
            id, key = secrets.token_hex(4), make_token()
        self._ids[key] = id
        away = [key for key, id in self._ids.items() if id not in self.clients][:-MOST_CLIENTS]
        for forgotten in away:
            del self._ids[forgotten]
            self._procedures.pop(forgotten, None)
        return id, key

    def _make_place(self) -> bool:
        """Whether only the place that is kept for a stop is left; who had it goes."""
        reserves = [client for client in self.clients.values() if client.reserve]
        if len(self.clients) - len(reserves) < MOST_CLIENTS:
            return False
        for former in reserves:
            self._leave(former)
            asyncio.create_task(end(former.socket, "server: too many clients; another has the place for a stop"))
        return True

    def _procedure(self, hello: messages.Hello, key: str) -> AlignmentProcedure | None:
        """Its own where it comes again to the same room: whose anchor has to be seen anew."""
        former = self._procedures.pop(key, None)
        if hello.space == "base" or self.composition.alignment is None:
            return None
        anchors = self.composition.anchors
        if former is not None:
            former.lose()
        self._procedures[key] = procedure = former or AlignmentProcedure(
            self.composition.alignment, anchors.find(anchors.newest) if anchors is not None else None
        )
        return procedure

    def _greet(self, client: Client) -> None:
        controller, say = self.controller, client.outbox.say
        say(
            messages.tell(
                messages.Welcome(
                    client.id, client.key, self.composition.token, self.composition.package, self.composition.rate
                )
            )
        )
        if client.reserve:
            self._refuse(client, FULL)
        if client.procedure is not None:
            say(messages.tell(client.procedure.progress()))
        say(messages.tell(messages.WorldMessage(controller.world)))
        if controller.intent is not None:
            say(messages.tell(controller.state_message(self.lease.holder)))
            if controller.preview is not None and controller.intent.mode in PREVIEWED:
                say(messages.tell(controller.preview))
                for frames in controller.pieces:
                    client.outbox.piece(piece(frames))
        if controller.prediction is not None:
            say(messages.tell(controller.prediction))
        if self.broadcast.shell:
            client.outbox.show("shell", self.broadcast.shell)
        self._tell_lease()

    async def _hear(self, client: Client) -> None:
        """Until it leaves.

        Raises:
            InputError: it has said what ends a connection.
        """
        async for message in client.socket:
            if message.type not in (WSMsgType.BINARY, WSMsgType.TEXT):
                self.composition.log(f"refused {client.id}: {message.data or 'the connection broke'}")
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
                self._handle(client, messages.hear(message.data), now)
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
            self.controller.stop()
            if received.kind == "stop" or not client.stopping:
                self.composition.log(f"{client.id} stopped the robot")
                self.controller.log_writer.event("stopped", client=client.id)
        client.stopping = stops and received.kind == "input"

    def _input(self, client: Client, received: binary.Received, now: float) -> None:
        if client.id != self.lease.holder:
            self._refuse(client, "input: you do not control; ask for it")
            return
        reason = client.clock.fault(received.stamp, now)
        hands, drawn = controller_input.controllers(received), "drawn" in received.flags
        reason = reason or self.controller.hear(received.stamp, *hands, drawn, "correct" in received.flags)
        if reason:
            self._refuse(client, reason)
        else:
            self.lease.hear(client.id, now)
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
                self.controller.log_writer.headset(name, at, pose, client.space == "base")

    def _keep_view(self, client: Client, received: binary.Received) -> None:
        offset = client.clock.offset if client.id == self.lease.holder else None
        if offset is not None and "tracked" in received.flags and received.view is not None:
            self.controller.log_writer.headset("view", received.stamp + offset, received.view, client.space == "base")

    def _touch(self, client: Client, received: binary.Received) -> None:
        """What the touching hand of whom controls tells of the base's place."""
        procedure, settings = client.procedure, self.composition.alignment
        if procedure is None or settings is None or procedure.step in ("done", "lost", "place"):
            return
        rests = self.controller.robot.state().mode in ("idle", "done")
        mark = mark_at(self.controller.robot.robot_state().joints, settings.mark) if rests else None
        before = procedure.progress()
        arm, offset = self.controller.arm, self.controller.core.mount_offset
        visible = camera_mark(arm, settings.mark, offset) if arm is not None and mark is not None else None
        procedure.hear(received.stamp, controller_pose(received, TOUCHING), mark, visible)
        self._aligned(client, before)

    def _handle(self, client: Client, message: messages.ClientMessage, now: float) -> None:
        if isinstance(message, messages.Pong):
            if client.clock.pong(message.number, message.stamp, now):
                assert client.clock.offset is not None
                client.outbox.say(messages.tell(messages.Clock(client.clock.offset, client.clock.round_trip)))
                self.controller.log_writer.event("clock", client=client.id, offset=client.clock.offset)
        elif client.reserve:
            self._refuse(client, FULL)
        elif isinstance(message, messages.LeaseRequest):
            self._lease(client, message, now)
        elif isinstance(message, messages.AlignmentByEye | messages.TouchRequest | messages.AnchorPose):
            self._align(client, message)
        elif isinstance(message, messages.PreviewShown):
            reason = "shown: you do not control" if client.id != self.lease.holder else ""
            if reason := reason or self.controller.preview_shown(message.digest, now):
                self._refuse(client, reason)
        else:
            self._refuse(client, "hello: was said before")

    def _align(
        self, client: Client, message: messages.AlignmentByEye | messages.TouchRequest | messages.AnchorPose
    ) -> None:
        procedure, anchors, reason = client.procedure, self.composition.anchors, ""
        if procedure is None:
            self._refuse(client, "alignment: your poses are in the base frame")
            return
        before, anchor = procedure.progress(), procedure.anchor
        if isinstance(message, messages.TouchRequest):
            procedure.touch()
        elif isinstance(message, messages.AnchorPose):
            reason = procedure.anchored(
                message.id, message.pose, anchors.find(message.id) if anchors is not None else None
            )
        elif message.pose is None:
            procedure.reset()
        else:
            reason = procedure.by_eye(message.pose)
        if reason:
            self._refuse(client, reason)
        if anchors is not None and procedure.anchor is not None and procedure.anchor != anchor:
            self._keep_anchor(anchors, procedure.anchor)
        self._aligned(client, before)

    def _aligned(self, client: Client, before: messages.AlignmentProgress) -> None:
        """The core, the client and the log hear what has changed."""
        assert client.procedure is not None
        now = client.procedure.progress()
        if client.id == self.lease.holder:
            self.controller.align(client.alignment, client.unfit)
        if now == before:
            return
        client.outbox.state("aligning", messages.tell(now))
        if (now.step, now.said) != (before.step, before.said):
            self.controller.log_writer.event("aligning", client=client.id, aligning=now)

    def _keep_anchor(self, anchors: Anchors, anchor: Anchor) -> None:
        """Known from now on, and in its file as soon as the disk has it."""
        if anchors.find(anchor.id) == anchor:
            return
        anchors.keep(anchor)

        def saved(done: asyncio.Future) -> None:
            if error := done.exception():
                self.composition.log(f"{anchors.path}: {error}; the anchor is not kept")

        asyncio.get_running_loop().run_in_executor(None, anchors.save).add_done_callback(saved)

    def _lease(self, client: Client, wish: messages.LeaseRequest, now: float) -> None:
        before = self.lease.holder
        if wish.action == "ask":
            self.lease.ask(client.id, now)
        elif wish.action == "release":
            self.lease.release(client.id, now)
        elif wish.to not in self.clients:
            self._refuse(client, f"lease: found no client {wish.to!r}")
        elif not self.lease.give(client.id, wish.to, now):
            self._refuse(client, "lease: you do not control")
        self._passed(before)
        self._tell_lease()

    def _leave(self, client: Client) -> None:
        if self.clients.get(client.id) is not client:
            return
        del self.clients[client.id]
        before = self.lease.holder
        self.lease.release(client.id, self.now())
        self._passed(before)
        self.composition.log(f"{client.id} left, {len(self.clients)} here")
        self.controller.log_writer.event("left", client=client.id)
        self._tell_lease()

    def _passed(self, before: str) -> None:
        """The robot holds whenever somebody else controls."""
        holder = self.lease.holder
        if holder == before:
            return
        self.composition.log(f"{holder or 'nobody'} controls")
        self.controller.log_writer.event("control", client=holder)
        client = self.clients.get(holder)
        self.controller.control(client.alignment if client else None, client.unfit if client else "")

    def _refuse(self, client: Client, reason: str) -> None:
        """One line to whom it concerns, the same no oftener than once a second."""
        if client.refuse(reason, self.now()):
            self.composition.log(f"refused {client.id}: {reason}")
            self.controller.log_writer.event("refused", client=client.id, reason=reason)

    # --- the clockwork

    async def _clockwork(self, app: web.Application):
        task = asyncio.create_task(self._run())
        yield
        task.cancel()
        self._gc_policy.tell(moving=False)

    async def _part(self, app: web.Application) -> None:
        """All clients are told that it ends; one that does not answer is not waited for."""
        ends = [client.socket.close(code=WSCloseCode.GOING_AWAY) for client in self.clients.values()]
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(asyncio.gather(*ends), PARTING)

    async def _run(self) -> None:
        """Ticks at the session's rate, each once the robot has told of itself; one that is late is not made up for."""
        period = 1 / self.composition.rate
        self._ticked = self.now()
        due = self._ticked + period
        while True:
            after = next_report_time(due, self.controller.robot.robot_state().time)
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
            self.controller.stop()
            self.composition.log(f"error: {type(error).__name__}: {error}; the robot holds")
        self._ticked = now

    def tick(self, now: float, dt: float) -> None:
        """A step of the core, and what all see of it."""
        before = self.lease.holder
        if self.lease.silent(now):
            self.composition.log(f"{before} was silent")
            self._passed(before)
            self._tell_lease()
        self._show_answers(now)
        self._gc_policy.tell(moving=self.controller.tick(dt).motion != "hold")
        if self.controller.log_writer.fault != self._unwritten:
            self._unwritten = self.controller.log_writer.fault
            self.composition.log(self._unwritten or "log: written again")
        aligned = self.controller.aligned
        if aligned is not None and aligned is not self._aligned_cameras:
            self._aligned_cameras = aligned
            self.composition.log(aligned.words)
        self._show(now)
        if self.controller.world is not self._world:
            self._world = self.controller.world
            self._tell(messages.WorldMessage(self.controller.world))

    def _show_answers(self, now: float) -> None:
        """What the previewer has answered, to all."""
        for answer in self.controller.poll(now):
            if isinstance(answer, PreviewBegun):
                for client in self.clients.values():
                    client.outbox.forget_pieces()
                self._tell(answer.preview)
            elif isinstance(answer, PreviewPiece):
                message = piece(answer)
                for client in self.clients.values():
                    client.outbox.piece(message)
            elif isinstance(answer, PredictionAnswer):
                self._tell(answer.prediction)

    def _show(self, now: float) -> None:
        """The robot, its reach and the state to all."""
        frame, shell = self.broadcast.robot(now), self.broadcast.new_shell(now)
        state, measured = self.broadcast.new_state(now, self.lease.holder), self.broadcast.new_measured(now)
        text = messages.tell(state) if state is not None else ""
        arm = messages.tell(measured) if measured is not None else ""
        for client in self.clients.values():
            client.outbox.show("robot", frame)
            if shell:
                client.outbox.show("shell", shell)
            if text:
                client.outbox.state("state", text)
            if arm:
                client.outbox.state("measured", arm)

    def _tell_lease(self) -> None:
        people = tuple(messages.Person(client.id, client.name) for client in self.clients.values())
        self._tell(messages.Lease(self.lease.holder, tuple(self.lease.asking), people))

    def _tell(self, answer: messages.ServerMessage) -> None:
        text = messages.tell(answer)
        for client in list(self.clients.values()):
            if not client.outbox.say(text):
                self.composition.log(f"refused {client.id}: it does not read")
                self._leave(client)
                asyncio.create_task(client.socket.close())
