"""A session over real sockets: from two hands to a robot that has arrived, and every way out."""

import asyncio
import contextlib
import gc
import os
import signal
import socket
import time
from contextlib import closing

import numpy as np
import pytest

from tests.ar.teleop.test_plan import MOUNT, OFFSET, TIP
from tests.support.live import RATE, Hands, Laid, binary, controlling, hand, laid
from trunkline.ar.session import binary as wire
from trunkline.ar.session.__main__ import main
from trunkline.ar.session.gc_policy import NEVER
from trunkline.ar.session.serving import Address, expect_free
from trunkline.ar.teleop.messages import Intent
from trunkline.ar.teleop.plan import Plan
from trunkline.errors import InputError
from trunkline.kinematics.panda.kinematics import mount_pose

ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
UP = np.array([0.0, 0.0, 0.6])  # from a ray's end to the hand


def grips(place, **buttons):
    return hand(np.array(place) + UP, grip=1.0, **buttons)


async def aimed(guest, **buttons):
    """Both targets set, and then these of the right hand's buttons pressed."""
    await guest.hears("state", mode="aim")
    guest.left, guest.right = grips(MOUNT), grips(TIP)
    await asyncio.sleep(0.8)
    guest.right = grips(TIP, **buttons)


async def asked(here, guest):
    """Both targets set, and a plan asked for; the state once its preview is there."""
    await aimed(guest, trigger=1.0)
    state = await guest.hears("state", mode="preview")
    guest.right = grips(TIP)
    return state


async def executing(here, guest):
    """A plan previewed, confirmed and running."""
    state = await asked(here, guest)
    await asyncio.sleep(0.4)
    await guest.say(type="shown", digest=state["preview"])
    await guest.hears("state", mode="ready")
    guest.right = grips(TIP, trigger=1.0)
    state = await guest.hears("state", mode="execute")
    guest.right = grips(TIP)
    await guest.hears("state", robot="running")
    return state


@pytest.mark.realtime
def test_from_hands_to_a_robot_that_has_arrived():
    async def session():
        async with laid() as here:
            guest = await controlling(here)
            before, usual = here.robot.robot.joints.copy(), gc.get_threshold()
            state = await executing(here, guest)
            assert state["execute"] == here.planning.plans[0].digest()
            assert gc.get_threshold()[2] == NEVER, "a whole collection would take longer than a permit lasts"
            assert any(frame[0] == 2 for frame in guest.frames)
            assert (await guest.hears("foreseen"))["digest"] == state["execute"]
            await guest.hears("state", 20.0, mode="aim", robot="done")
            assert gc.get_threshold() == usual
            np.testing.assert_allclose(here.robot.robot.joints, here.planning.plans[0].joints[-1], atol=1e-9)
            assert np.abs(here.robot.robot.joints - before).max() > 0.05

    asyncio.run(session())


@pytest.mark.realtime
def test_a_robot_follows_moving_targets_until_both_grips_are_let_go():
    async def session():
        async with laid() as here:
            guest = await controlling(here)
            await aimed(guest, stick_pressed=1.0)
            await guest.hears("state", mode="follow")
            aside = np.array([0.0, 0.05, 0.0])
            guest.left, guest.right = grips(MOUNT + aside), grips(TIP + aside)
            await guest.hears("state", motion="follow", robot="running")
            for mount in (MOUNT + aside, np.array(MOUNT)):  # there, and back again
                guest.left, guest.right = grips(mount), grips(TIP + mount - MOUNT)
                await asyncio.sleep(here.controller.core.settings.follow_delay)
                async with asyncio.timeout(20.0):
                    while np.abs(mount_pose(here.robot.robot.joints[None], OFFSET)[0][0][:2] - mount[:2]).max() > 5e-3:
                        await asyncio.sleep(0.1)
            guest.left, guest.right = hand(MOUNT + UP), hand(TIP + UP)
            await guest.hears("state", mode="hold", robot="idle")
            assert not here.planning.plans

    asyncio.run(session())


@pytest.mark.realtime
def test_a_robot_that_follows_stops_where_the_process_that_plans_is_silent_and_does_not_go_on():
    async def session():
        async with laid() as here:
            guest = await controlling(here)
            await aimed(guest, stick_pressed=1.0)
            await guest.hears("state", motion="follow", robot="running")
            seeking = here.controller._follow
            answers, seeking._order = seeking._order, lambda order: None
            state = await guest.hears("state", mode="stopped")
            assert "the process that plans has not answered for 1.0" in state["notice"]
            seeking._order = answers
            aside = np.array([0.0, 0.05, 0.0])
            guest.left, guest.right = grips(MOUNT + aside), grips(TIP + aside)
            await asyncio.sleep(0.5)
            rests = here.robot.robot.joints.copy()
            await asyncio.sleep(0.5)
            np.testing.assert_array_equal(here.robot.robot.joints, rests)
            assert here.controller.intent.mode == "stopped"

    asyncio.run(session())


def test_a_start_that_is_on_its_way_is_stopped_by_what_comes_after_it():
    here = Laid(0)
    controller, plan = here.controller, Plan(1.0, np.zeros((2, 7)), np.zeros((2, 3)), (), "", "")
    controller.plan, here.robot.start = plan, lambda *_: ""  # its process has not told of it yet
    controller._drive(Intent("execute", "execute", "", None, (None, None), execute=plan.digest()))
    assert here.robot.permits == 1
    controller._drive(Intent("hold", "hold", "", None, (None, None)))
    assert len(here.robot.stops) == 1
    controller._drive(Intent("hold", "hold", "", None, (None, None)))
    assert len(here.robot.stops) == 1


@pytest.mark.realtime
def test_nobody_is_told_that_nobody_who_controls_is_silent():
    async def session():
        async with laid() as here:
            guest = await here.come()
            await asyncio.sleep(1.0)
            assert here.controller.intent.notice == "base is not aligned; holding"
            assert {message["notice"] for message in guest.messages if message["type"] == "state"} == {""}

    asyncio.run(session())


@pytest.mark.realtime
def test_a_button_is_not_left_to_wait_for_the_next_tick():
    async def press():
        async with laid(rate=0.02) as here:  # a tick in 50 s
            guest = await here.come()
            await guest.say(type="lease", action="ask")
            await guest.hears("lease", holder=guest.id)
            await guest.hears("clock")
            await guest.input(hand((0.5, 0.1, 1.1), secondary=1.0), hand((0.5, 0.1, 1.1)))
            await guest.hears("state", mode="stopped")

    asyncio.run(press())


@pytest.mark.parametrize("answers", [ValueError("a pipe"), ["no answer"]], ids=["no poll", "a broken answer"])
def test_what_fails_as_the_previewer_answers_stops_the_robot_and_the_session_goes_on(answers):
    here, clock = Laid(1), [time.monotonic()]
    here.server.now = lambda: clock[0]

    def broken():
        if isinstance(answers, Exception):
            raise answers
        return answers

    def step():
        clock[0] += 1 / RATE
        here.server.step()

    poll, here.planning.poll = here.planning.poll, broken
    step()
    assert len(here.robot.stops) == 1
    assert here.robot.permits == 0
    assert here.log[-1].endswith("; the robot holds")
    here.planning.poll = poll
    step()
    assert here.controller.intent.mode == "stopped"


@pytest.mark.realtime
def test_frames_tell_bodies_and_both_targets():
    async def session():
        async with laid() as here:
            guest = await controlling(here)
            await asked(here, guest)
            frame = [frame for frame in guest.frames if frame[0] == 1][-1]
            assert len(frame) == 16 + 28 * (3 + len(wire.MARKERS))
            rows = np.frombuffer(frame, "<f4", offset=16).reshape(-1, 7)
            np.testing.assert_allclose(rows[5, :3], MOUNT, atol=2e-3)
            np.testing.assert_allclose(rows[6, :3], TIP, atol=2e-3)

    asyncio.run(session())


@pytest.mark.realtime
@pytest.mark.parametrize("way", ["watcher", "secondary", "grips", "gone", "released", "untracked", "hidden"])
def test_a_robot_under_way_is_told_to_hold_and_does_not_go_on(way):
    async def session():
        async with laid() as here:
            guest, watcher = await controlling(here), await here.come()
            await executing(here, guest)
            await asyncio.sleep(0.2)
            assert here.robot.state().mode == "running"
            if way == "watcher":
                await watcher.stop()
            elif way == "secondary":
                guest.left = grips(MOUNT, secondary=1.0)
            elif way == "grips":
                guest.left, guest.right = hand(MOUNT), hand(TIP)
            elif way == "gone":
                guest.sending.cancel()
                await guest.socket.close()
            elif way == "released":
                await guest.say(type="lease", action="release")
            else:
                guest.sending.cancel()
                flags = {"untracked": 0b1101, "hidden": 0b1011}[way]
                for _ in range(30):
                    await guest.input(guest.left, guest.right, flags=flags)
                    await asyncio.sleep(1 / 72)
            await asyncio.sleep(0.3)
            assert here.robot.stops
            mode = "stopped" if way in ("watcher", "secondary") else "hold"
            await watcher.hears("state", mode=mode, motion="hold")
            await asyncio.sleep(0.2)
            joints = here.robot.robot.joints.copy()
            guest.left, guest.right = grips(MOUNT), grips(TIP, trigger=1.0)
            await asyncio.sleep(0.5)
            np.testing.assert_array_equal(here.robot.robot.joints, joints)
            assert here.robot.state().mode != "running"

    asyncio.run(session())


@pytest.mark.realtime
def test_who_sends_inputs_and_draws_nothing_holds_the_robot_hears_why_and_still_controls():
    async def session():
        async with laid() as here:
            guest, watcher = await controlling(here), await here.come()
            await executing(here, guest)
            await asyncio.sleep(0.2)  # it is seen to move
            guest.sending.cancel()
            for _ in range(160):
                await guest.input(guest.left, guest.right, flags=0b0111)
                await asyncio.sleep(1 / 72)
            state = await watcher.hears("state", mode="hold", motion="hold")
            before = {message["notice"] for message in watcher.messages if message["type"] == "state"}
            assert "the page draws too slowly, the robot waits for it" in before
            assert state["notice"].startswith("the page has drawn nothing for 2.")
            assert (await watcher.hears("lease"))["holder"] == guest.id

    asyncio.run(session())


@pytest.mark.realtime
def test_a_silent_holder_loses_the_lease_to_whoever_asked_and_the_robot_holds():
    async def session():
        async with laid() as here:
            first = await controlling(here)
            second = await here.come(Hands)
            await second.say(type="lease", action="ask")
            await second.hears("lease", holder=first.id, asking=[second.id])
            first.sending.cancel()
            await asyncio.sleep(0.8)
            assert here.server.lease.holder == first.id
            await second.hears("lease", 1.0, holder=second.id, asking=[])
            assert (await second.hears("state"))["motion"] == "hold"

    asyncio.run(session())


@pytest.mark.realtime
def test_the_lease_is_given_away_and_taken_by_nobody():
    async def session():
        async with laid() as here:
            first, second = await controlling(here), await here.come(Hands)
            await second.say(type="lease", action="give", to=second.id)
            await second.refused("lease: you do not control")
            await first.say(type="lease", action="give", to="nobody")
            await first.refused("lease: found no client")
            await first.say(type="lease", action="give", to=second.id)
            await second.hears("lease", holder=second.id)

    asyncio.run(session())


@pytest.mark.realtime
def test_a_watcher_that_does_not_read_holds_three_frames_and_delays_nobody():
    async def session():
        async with laid() as here:
            stalled, other = await here.come(reads=False), await here.come()
            await asyncio.sleep(0.5)
            before = len(other.frames)
            await asyncio.sleep(2.0)
            boxes = [client.outbox for client in here.server.clients.values()]
            full = [box for box in boxes if box.received == 0]
            assert [(box.sent, len(box.frames)) for box in full] == [(3, 1)]
            assert len(other.frames) - before > 0.8 * 2.0 * 72
            await stalled.socket.close()

    asyncio.run(session())


@pytest.mark.realtime
def test_who_comes_later_sees_the_plan_that_is_previewed():
    async def session():
        async with laid() as here:
            guest = await controlling(here)
            state = await asked(here, guest)
            later = await here.come()
            assert (await later.hears("preview"))["digest"] == state["preview"]
            await later.hears("foreseen")
            await asyncio.sleep(0.2)
            assert sum(frame[0] == 2 for frame in later.frames) == 2
            for left in (hand(MOUNT + UP), grips(MOUNT), grips(MOUNT + UP / 4)):  # a ray that moves makes it void
                guest.left = left
                await asyncio.sleep(0.2)
            await guest.hears("state", mode="aim")
            last = await here.come()
            await last.hears("state")
            await asyncio.sleep(0.2)
            assert not [message for message in last.messages if message["type"] == "preview"]
            assert not any(frame[0] == 2 for frame in last.frames)

    asyncio.run(session())


@pytest.mark.realtime
def test_the_same_client_again_ends_the_older_connection_and_the_lease():
    async def session():
        async with laid() as here:
            guest = await controlling(here)
            again = await here.come(key=guest.key)
            assert (again.id, again.key) == (guest.id, guest.key)
            await asyncio.wait_for(guest.closed.wait(), 2.0)
            assert here.server.lease.holder == ""
            assert list(here.server.clients) == [guest.id]

    asyncio.run(session())


@pytest.mark.realtime
def test_a_stop_is_heard_beyond_the_rate_limit_too():
    async def session():
        async with laid() as here:
            watcher = await here.come()
            for _ in range(1000):
                await watcher.socket.send_bytes(binary("ack", 0, 1.0))
            await watcher.stop()
            assert "left out" in await watcher.refused("rate")
            await watcher.hears("state", mode="stopped")
            assert here.robot.stops

    asyncio.run(session())


@pytest.mark.realtime
@pytest.mark.parametrize("number", ENDS)
def test_a_session_that_is_told_to_end_is_closed_in_order(monkeypatch, capsys, number):
    """As by Ctrl-C, so by `kill`, by whatever else ends a service, and by a terminal that is closed."""
    closed, before = [], [signal.getsignal(ending) for ending in ENDS]
    for ending in ENDS:  # also where the tests run in the background or under `nohup`, which have some ignored
        signal.signal(ending, signal.default_int_handler if ending == signal.SIGINT else signal.SIG_DFL)

    @contextlib.asynccontextmanager
    async def opened(*_, **__):
        try:
            asyncio.get_running_loop().call_later(0.05, os.kill, os.getpid(), number)
            await asyncio.sleep(10.0)
            yield None, None
        finally:
            await asyncio.sleep(0.05)
            closed.append(number)

    monkeypatch.setattr("trunkline.ar.session.serving.opened", opened)
    try:
        assert main(["package.tgz", "--port", "18459"]) == 0
    finally:
        for ending, usual in zip(ENDS, before, strict=True):
            signal.signal(ending, usual)
    assert closed == [number]
    assert capsys.readouterr().out.splitlines() == ["ended"]


def test_an_address_that_is_taken_is_refused_before_anything_is_loaded():
    with closing(socket.socket()) as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(InputError, match=rf"--port {port}: Address already in use; does a session run there"):
            expect_free(Address(port))
    expect_free(Address(port))
