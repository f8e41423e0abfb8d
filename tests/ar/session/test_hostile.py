"""Who should not come in does not, what should not move the robot does not, and each is refused by name."""

import asyncio
import math
import struct
from contextlib import suppress

import pytest
from aiohttp import ClientSession, WSServerHandshakeError
from aiohttp.test_utils import unused_port

from tests.ar.session.test_serving import asked, executing, grips
from tests.ar.teleop.test_plan import MOUNT, TIP
from tests.support.live import TOKEN, Hands, Laid, controlling, hand, laid
from trunkline.ar.session import connections
from trunkline.ar.session.auth import HEADERS, Origins
from trunkline.ar.session.serving import Address, listening
from trunkline.ar.session.tls import make_certificate, tls_context


@pytest.mark.realtime
@pytest.mark.parametrize("origin", ["http://evil.example", "null", "", "http://127.0.0.1:1", "https://127.0.0.1"])
def test_another_origin_does_not_come_in(origin):
    async def session():
        async with laid() as here:
            with pytest.raises(WSServerHandshakeError) as refusal:
                await here.come(origin=origin)
            assert refusal.value.status == 403
            assert "origin" in here.log[-1]
            assert here.server.clients == {}

    asyncio.run(session())


@pytest.mark.realtime
def test_no_origin_and_another_host_do_not_come_in():
    async def session():
        async with laid() as here:
            with pytest.raises(WSServerHandshakeError) as refusal:
                await here.session.ws_connect(f"{here.url}/ws")
            assert refusal.value.status == 403
            for path in ("/", "/scene.json", "/ws"):
                answer = await here.session.get(f"{here.url}{path}", headers={"Host": "rebound.example:80"})
                assert (answer.status, await answer.text()) == (403, "error: host: not a name of this server\n")
            answer = await here.session.get(here.url, headers={"Origin": "http://evil.example"})
            assert answer.status == 403

    asyncio.run(session())


@pytest.mark.realtime
@pytest.mark.parametrize(
    ("hello", "word"),
    [
        ({"token": ""}, "token"), ({"token": TOKEN[:-1]}, "token"), ({"token": "", "code": "123456"}, "code"),
        ({"version": 2}, "version"), ({"type": "lease", "action": "ask"}, "message"),
    ],
)  # fmt: skip
def test_a_wrong_hello_ends_the_connection_and_says_why(hello, word):
    async def session():
        async with laid() as here:
            guest = await here.come(hello=False)
            await guest.say(**{"type": "hello", "version": 1, "token": TOKEN} | hello)
            assert word in await guest.refused(word)
            await asyncio.wait_for(guest.closed.wait(), 2.0)
            assert guest.socket.close_code == 1008
            assert here.server.clients == {}

    asyncio.run(session())


@pytest.mark.realtime
def test_who_says_nothing_is_shown_out():
    async def session():
        async with laid() as here:
            guest = await here.come(hello=False)
            assert "within 3 s" in await guest.refused("hello", 5.0)

    asyncio.run(session())


@pytest.mark.realtime
@pytest.mark.parametrize("pings", [False, True])
def test_who_says_nothing_and_does_not_close_is_gone_within_five_seconds(pings):
    """As a program may that knows no more of the protocol than how to open it."""

    async def session():
        async with laid() as here:
            host = here.url.removeprefix("http://")
            reader, writer = await asyncio.open_connection(*host.split(":"))
            lines = ["GET /ws HTTP/1.1", f"Host: {host}", f"Origin: {here.origin}", "Upgrade: websocket"]
            lines += ["Connection: Upgrade", "Sec-WebSocket-Version: 13", f"Sec-WebSocket-Key: {'A' * 22}=="]
            writer.write("\r\n".join([*lines, "", ""]).encode())
            assert b"101" in await reader.readline()

            async def ping():
                while pings:
                    await asyncio.sleep(0.5)
                    writer.write(b"\x89\x80\0\0\0\0")

            pinging = asyncio.create_task(ping())
            with suppress(ConnectionError):
                await asyncio.wait_for(reader.read(-1), 5.0)
            pinging.cancel()
            assert not here.server._waiting

    asyncio.run(session())


@pytest.mark.realtime
def test_a_pairing_code_lets_in_and_gives_the_token():
    async def session():
        async with laid() as here:
            digits = here.server.code.renew(here.server.now())
            guest = await here.come(token="", code=digits)
            assert (await guest.hears("welcome"))["token"] == TOKEN

    asyncio.run(session())


@pytest.mark.realtime
@pytest.mark.parametrize("message", [
    bytes(10_000_000), b"\x10", b"", struct.pack("<BBHId", 99, 0, 0, 0, 0.0), "x" * 10_000_000, "{", '{"type": "go"}',
    '{"type": "execute", "digest": "' + "a" * 64 + '"}',
])  # fmt: skip
def test_what_is_no_message_ends_the_connection_and_nothing_else(message):
    async def session():
        async with laid() as here:
            guest, other = await here.come(), await here.come()
            send = guest.socket.send_str if isinstance(message, str) else guest.socket.send_bytes
            with suppress(ConnectionError):  # it is cut off within the large ones
                await send(message)
            await asyncio.wait_for(guest.closed.wait(), 3.0)
            assert guest.socket.close_code in (1006, 1008, 1009)
            assert any(line.startswith(f"refused {guest.id}: ") for line in here.log)
            count = len(other.frames)
            await asyncio.sleep(0.3)
            assert len(other.frames) > count
            assert here.robot.permits == 0

    asyncio.run(session())


@pytest.mark.realtime
@pytest.mark.parametrize("number", [math.nan, math.inf, 3e38])
def test_poses_that_are_no_numbers_hold_the_robot(number):
    async def session():
        async with laid() as here:
            guest = await controlling(here)
            await executing(here, guest)
            guest.left = grips((number, 0.0, 0.0))
            await asyncio.sleep(0.5)
            state = await guest.hears("state", motion="hold")
            if not math.isfinite(number):
                assert "not a number" in state["notice"]
            assert here.robot.state().mode != "running"
            count = len(guest.frames)
            await asyncio.sleep(0.3)
            assert len(guest.frames) > count

    asyncio.run(session())


@pytest.mark.realtime
def test_a_confirmation_that_is_sent_again_is_refused_and_moves_nothing():
    async def session():
        async with laid() as here:
            guest = await controlling(here)
            state = await asked(here, guest)
            await asyncio.sleep(0.4)
            await guest.say(type="shown", digest=state["preview"])
            await guest.hears("state", mode="ready")
            guest.sending.cancel()
            began = guest.now()
            for n in range(40):
                await guest.input(grips(MOUNT), grips(TIP, trigger=float(n > 20)), began + n / 200)
                await asyncio.sleep(1 / 200)
            guest.begin()
            guest.left, guest.right = hand(MOUNT), hand(TIP)  # taken back within the delay
            await guest.hears("state", mode="ready")
            await asyncio.sleep(0.2)
            for n in range(40):
                await guest.input(grips(MOUNT), grips(TIP, trigger=float(n > 20)), began + n / 200)
            await guest.refused("s late, expected at most")
            await asyncio.sleep(1.0)
            assert here.robot.permits == 0
            assert here.robot.state().mode == "idle"

    asyncio.run(session())


@pytest.mark.realtime
def test_an_input_that_is_sent_again_at_once_counts_once():
    async def session():
        async with laid() as here:
            guest = await controlling(here)
            guest.sending.cancel()
            stamp = guest.now()
            for _ in range(2):
                await guest.input(hand(MOUNT), hand(TIP), stamp)
            await guest.refused("heard before")

    asyncio.run(session())


@pytest.mark.realtime
def test_a_preview_that_was_not_shown_is_not_taken_for_shown():
    async def session():
        async with laid() as here:
            guest, watcher = await controlling(here), await here.come()
            await guest.say(type="shown", digest="a" * 64)
            await guest.refused("no plan is previewed")
            state = await asked(here, guest)
            await watcher.say(type="shown", digest=state["preview"])
            await watcher.refused("shown: you do not control")
            await asyncio.sleep(0.6)
            await guest.say(type="shown", digest="b" * 64)
            await guest.refused("shown: found digest 'bbbbbbbbbbbb'")
            assert here.controller.intent.mode == "preview"
            guest.right = grips(TIP, trigger=1.0)
            await asyncio.sleep(0.3)
            assert here.controller.intent.mode == "preview"
            assert here.robot.permits == 0

    asyncio.run(session())


@pytest.mark.realtime
def test_a_preview_lasts_as_long_as_it_lasts():
    async def session():
        async with laid() as here:
            guest = await controlling(here)
            state = await asked(here, guest)
            here.controller._since = here.server.now()
            await guest.say(type="shown", digest=state["preview"])
            await guest.refused("shown: its preview lasts")
            assert here.controller.intent.mode == "preview"

    asyncio.run(session())


@pytest.mark.realtime
def test_a_second_client_moves_nothing():
    async def session():
        async with laid() as here:
            guest, second = await controlling(here), await here.come(Hands)
            await guest.hears("state", mode="aim")
            await second.hears("clock")
            second.begin()
            second.left, second.right = grips(MOUNT), grips(TIP, trigger=1.0)
            await second.say(type="alignment", pose={"position": [0, 0, 0], "quaternion": [1, 0, 0, 0]})
            await second.refused("input: you do not control")
            await second.refused("alignment")
            await asyncio.sleep(0.5)
            assert here.controller.state.left.target is None
            assert here.controller.intent.mode == "aim"

    asyncio.run(session())


@pytest.mark.realtime
def test_a_clock_that_jumps_holds_the_robot():
    async def session():
        async with laid() as here:
            guest = await controlling(here)
            await executing(here, guest)
            guest.now = lambda now=guest.now: now() + 5.0
            await guest.refused("the clock has jumped")
            await guest.hears("state", motion="hold")
            assert here.robot.stops

    asyncio.run(session())


@pytest.mark.realtime
def test_input_does_not_count_before_the_clock_is_known():
    async def session():
        async with laid() as here:
            guest = await here.come(Hands)
            await guest.say(type="lease", action="ask")
            await guest.input(hand(MOUNT), hand(TIP))
            await guest.refused("offset is not known")

    asyncio.run(session())


@pytest.mark.realtime
def test_only_the_page_s_own_files_are_served_with_every_header(tmp_path):
    page = tmp_path / "page"
    page.mkdir()
    (page / "index.html").write_text("<p>page</p>")
    (page / "app.js").write_text("1")
    (page / "notes.txt").write_text("secret")
    (page / "link.js").symlink_to(tmp_path / "secret.js")
    (tmp_path / "secret.js").write_text("secret")

    async def session():
        async with laid(page) as here:
            responses = {}
            for path in ("/", "/app.js", "/index.html", "/notes.txt", "/link.js", "/../secret.js", "/%2e%2e/secret.js",
                         "/pyproject.toml", "/scene.json"):  # fmt: skip
                answer = await here.session.get(here.url + path)
                responses[path] = answer.status
                assert "secret" not in await answer.text()
                assert {name: answer.headers[name] for name in HEADERS} == HEADERS
            assert [path for path, status in responses.items() if status == 200] == ["/", "/app.js", "/index.html"]
            assert responses["/scene.json"] == 401
            answer = await here.session.get(f"{here.url}/scene.json", headers={"Authorization": f"Bearer {TOKEN}"})
            assert (await answer.json())["bodies"] == ["a", "b", "c"]
            assert (await here.session.post(here.url, data=b"x")).status in (404, 405)

    asyncio.run(session())


@pytest.mark.realtime
def test_without_a_page_there_is_one_line():
    async def session():
        async with laid() as here:
            answer = await here.session.get(here.url)
            assert answer.status == 503
            assert "error: the page is not built" in await answer.text()

    asyncio.run(session())


def test_names_of_a_server_are_exact():
    origins = Origins.of(["127.0.0.1", "localhost"], 8443, tls=True)
    assert origins.fault("localhost:8443", "https://localhost:8443", True) == ""
    for host, origin in [
        ("localhost", "https://localhost:8443"), ("LOCALHOST:8443.evil.example", None), (None, None),
        ("localhost:8443", "http://localhost:8443"), ("localhost:8443", "https://localhost:8443.evil.example"),
    ]:  # fmt: skip
        assert origins.fault(host, origin, True)


@pytest.mark.realtime
def test_an_id_that_all_know_takes_nobody_s_place():
    """Spectators see every id; only the key, which the welcome alone has, makes one the same client again."""

    async def session():
        async with laid() as here:
            guest = await controlling(here)
            lease = await guest.hears("lease")
            assert guest.key not in str(lease)
            for key in (guest.id, guest.key[:-1], "x"):
                other = await here.come(key=key)
                assert other.id != guest.id
                assert other.key != guest.key
            assert not guest.closed.is_set()
            assert here.server.lease.holder == guest.id

    asyncio.run(session())


@pytest.mark.realtime
def test_one_place_is_left_for_a_stop_however_many_there_are(monkeypatch):
    monkeypatch.setattr("trunkline.ar.session.server.MOST_CLIENTS", 2)

    async def session():
        async with laid() as here:
            guests = [await here.come(), await here.come()]
            first = await here.come()
            await first.refused("server")
            await first.say(type="lease", action="ask")
            last = await here.come()
            await asyncio.wait_for(first.closed.wait(), 2.0)
            assert here.server.lease.holder == ""
            assert not any(guest.closed.is_set() for guest in guests)
            await last.stop()
            for _ in range(200):
                if here.robot.stops:
                    break
                await asyncio.sleep(0.01)
            assert here.robot.stops

    asyncio.run(session())


@pytest.mark.realtime
def test_those_that_say_nothing_keep_nobody_out(monkeypatch):
    monkeypatch.setattr("trunkline.ar.session.server.MOST_WAITING", 3)

    async def session():
        async with laid() as here:
            silent = [await here.come(hello=False) for _ in range(5)]
            await asyncio.gather(*(asyncio.wait_for(guest.closed.wait(), 2.0) for guest in silent[:2]))
            assert "say nothing" in await silent[0].refused("server")
            assert not any(guest.closed.is_set() for guest in silent[2:])
            assert (await here.come()).id in here.server.clients

    asyncio.run(session())


@pytest.mark.realtime
@pytest.mark.parametrize("value", ["Bearer é", "Bearer \udce9", "Bearer", "Basic x", "é" * 100])
def test_an_odd_token_is_refused_without_a_traceback(value, capfd):
    async def session():
        async with laid() as here:
            reader, writer = await asyncio.open_connection("127.0.0.1", int(here.url.rpartition(":")[2]))
            lines = f"GET /scene.json HTTP/1.1\r\nHost: {here.url[7:]}\r\nAuthorization: {value}\r\n\r\n"
            writer.write(lines.encode(errors="surrogateescape"))
            assert (await reader.readline()).startswith(b"HTTP/1.1 401")
            writer.close()

    asyncio.run(session())
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.realtime
def test_half_a_request_is_closed_and_nothing_says_versions(monkeypatch):
    """Half a request, none, a damaged one: each a connection that is closed; a client that is here stays."""
    monkeypatch.setattr(connections, "LONGEST", 0.6)
    monkeypatch.setattr(connections, "EVERY", 0.1)

    async def session():
        here = Laid(unused_port())
        address = Address(int(here.url.rpartition(":")[2]))
        async with listening(here.server, address), ClientSession() as web:
            socket = await web.ws_connect(f"{here.url}/ws", headers={"Origin": here.origin})
            await socket.send_json({"type": "hello", "version": 1, "token": TOKEN})
            for half in (b"", b"GET / HTTP/1.1\r\nHos", b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 99\r\n\r\nx"):
                reader, writer = await asyncio.open_connection("127.0.0.1", address.port)
                writer.write(half)
                answer = await asyncio.wait_for(reader.read(), 3.0)
                assert b"ython" not in answer
                writer.close()
            reader, writer = await asyncio.open_connection("127.0.0.1", address.port)
            writer.write(b"GET / HTTP/1.1\r\nno header\r\n\r\n")
            answer = await asyncio.wait_for(reader.read(), 3.0)
            assert b"400" in answer.partition(b"\r\n")[0]
            assert b"ython" not in answer
            assert any(line.startswith("refused: Error handling request") for line in here.log)
            assert not socket.closed
            answer = await web.get(here.url)
            assert answer.headers["Server"] == "trunkline"

    asyncio.run(session())


def test_of_too_many_idle_connections_the_oldest_go(monkeypatch):
    monkeypatch.setattr(connections, "MOST", 2)

    class Transport:
        closed, left, address = False, 0, "10.0.0.1"

        def abort(self):
            self.closed = True

        def get_write_buffer_size(self):
            return self.left

        def get_extra_info(self, name):
            return (self.address, id(self))

    idle, each = connections.IdleConnections(), [Transport() for _ in range(5)]
    idle.busy.add(each[0])
    assert idle.close(each[:2], 0.0) == 0
    assert idle.close(each[:4], 1.0) == 1
    assert [transport.closed for transport in each] == [False, True, False, False, False]
    assert idle.close([each[0], each[2], each[3]], 1.0 + connections.LONGEST) == 2
    lone, flood = Transport(), [Transport() for _ in range(3)]
    lone.address = "10.0.0.2"  # came first, and is from elsewhere
    idle = connections.IdleConnections()
    idle.close([lone], 0.0)
    assert idle.close([lone, *flood], 1.0) == 2
    assert [transport.closed for transport in (lone, *flood)] == [False, True, True, False]
    idle, reads, waits = connections.IdleConnections(), Transport(), Transport()
    for step, left in enumerate((0, 900, 600, 300, 200, 100)):  # an answer that begins after 2 s
        reads.left, waits.left = left, 500 if left else 0
        assert idle.close([reads] if waits.closed else [reads, waits], 2.0 * step) == (step == 3)
    assert (reads.closed, waits.closed) == (False, True), "who reads is answered, who does not is gone"


@pytest.mark.realtime
def test_half_a_tls_handshake_is_closed_within_five_seconds():
    assert connections.HANDSHAKE + connections.LONGEST + connections.EVERY <= 5.0

    async def session():
        here = Laid(unused_port())
        port, context = int(here.url.rpartition(":")[2]), tls_context(*make_certificate(["127.0.0.1"]))
        async with listening(here.server, Address(port, context=context)):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(b"\x16\x03\x01\x02\x00\x01")  # the head of a client's hello, and no more
            assert await asyncio.wait_for(reader.read(), 5.0) == b""
            writer.close()

    asyncio.run(session())
