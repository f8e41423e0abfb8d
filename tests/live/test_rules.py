"""Clock, lease, outbox and certificate by themselves: their rules, for every order in which things may come."""

import asyncio
import ssl

import numpy as np
import pytest
from cryptography import x509
from hypothesis import given
from hypothesis import strategies as st

from tests.support.links import clock_error
from trunkline.errors import InputError
from trunkline.live.__main__ import parsed
from trunkline.live.certificate import fingerprint, make_certificate, tls_context
from trunkline.live.clock import JUMP, LATEST, PINGS, ClientClock
from trunkline.live.lease import SILENCE, Control
from trunkline.live.outbox import MOST_SAID, WINDOW, Outbox


def test_the_offset_is_that_of_the_smallest_round_trip():
    """A link with 6 % of packets 20 to 120 ms late, the way up 1 ms slower: the offset errs by 2 ms at most, 95 %."""
    rng = np.random.default_rng(0)
    errors = [clock_error(rng) for _ in range(200)]
    assert np.quantile(errors, 0.95) < 2e-3


def test_an_answer_to_what_was_not_asked_does_nothing_and_a_round_begins_anew():
    clock = ClientClock()
    assert not clock.pong(3, 0.0, 1.0)
    for now in range(PINGS):
        number = clock.ping(float(now))
        clock.pong(number, float(now), now + 0.01)
        assert not clock.pong(number, 5.0, now + 0.02)
    assert clock.offset == pytest.approx(0.005)
    assert clock.fault(100.0, 100.0) == ""
    assert "s old; the clock has jumped" in clock.fault(100.0 - JUMP - 0.1, 100.0)
    assert "ahead" in clock.fault(101.0, 100.0)


def test_what_comes_late_does_not_count_nor_anything_over_a_link_that_is_slow():
    """Evenly late inputs tell of a grip that was let go long ago, and nothing in them says so."""
    clock = ClientClock()
    for now in range(PINGS):
        clock.pong(clock.ping(float(now)), now + 0.05, now + 0.1)
    assert clock.fault(100.0 - 0.9 * LATEST, 100.0) == ""
    assert clock.fault(99.1, 100.0) == "input: it comes 0.90 s late, expected at most 0.25 s"
    for now in range(PINGS):
        clock.pong(clock.ping(float(now)), now + 0.4, now + 0.8)
    assert clock.fault(100.0, 100.0) == "input: there and back takes 0.80 s, expected at most 0.25 s"


STEP = st.tuples(
    st.sampled_from(["ask", "release", "give", "hear", "wait"]), st.sampled_from("abc"), st.sampled_from("abc")
)


@given(st.lists(STEP, max_size=40))
def test_one_controls_and_none_without_having_asked_or_been_given_it(steps):
    control, now, entitled = Control(), 0.0, set()
    for action, client, other in steps:
        before = control.holder
        if action == "ask":
            entitled.add(client)
            control.ask(client, now)
            assert control.holder == (before or client)
        elif action == "release":
            entitled.discard(client)
            control.release(client, now)
            assert control.holder != client
        elif action == "give":
            if control.give(client, other, now):
                assert before == client
                entitled.add(other)
            else:
                assert control.holder == before != client
        elif action == "hear":
            assert control.hear(client, now) == (client == before)
        else:
            now += SILENCE + 0.1
            assert control.silent(now) == bool(before)
            if before:
                assert control.holder != before or not control.asking
            entitled.discard(before)
        assert not control.holder or control.holder in entitled
        assert control.holder not in control.asking
        assert len(set(control.asking)) == len(control.asking)


@given(st.lists(st.one_of(st.sampled_from(["frame", "piece", "take"]), st.integers(0, 50)), max_size=200))
def test_no_more_than_a_window_is_on_its_way_and_pieces_keep_their_order(steps):
    async def go():
        box, shown, taken, pieces = Outbox(), 0, [], 0
        for step in steps:
            if step == "frame":
                shown += 1
                box.show("robot", b"f%d" % shown)
            elif step == "piece":
                pieces += 1
                box.piece(b"p%d" % pieces)
            elif step == "take":
                if (item := box.take()) is not None:
                    taken.append(item)
            else:
                box.acknowledge(step)
            assert box.sent - box.received <= WINDOW
            assert box.sent == len(taken)
        frames = [int(item[1:]) for item in taken if item[:1] == b"f"]
        assert frames == sorted(set(frames))
        own = [int(item[1:]) for item in taken if item[:1] == b"p"]
        assert own == list(range(1, len(own) + 1))

    asyncio.run(go())


def test_frames_and_pieces_take_turns_and_what_is_said_comes_first():
    async def go():
        box = Outbox()
        for n in range(3):
            box.piece(b"p%d" % n)
            box.show("robot", b"f%d" % n)
        box.say("said")
        box.state("state", "old")
        box.state("state", "new")
        assert [box.take() for _ in range(6)] == ["said", "new", b"f2", b"p0", b"p1", None]
        assert all(box.say("x") for _ in range(MOST_SAID))
        assert not box.say("x")

    asyncio.run(go())


def test_a_certificate_is_of_the_names_and_serves():
    certificate, key = make_certificate(["192.168.1.5", "lab.local", "[::1]"])
    found = x509.load_pem_x509_certificate(certificate)
    names = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert [str(name.value) for name in names] == ["192.168.1.5", "lab.local", "::1"]
    assert (found.not_valid_after_utc - found.not_valid_before_utc).days <= 397
    assert isinstance(tls_context(certificate, key), ssl.SSLContext)
    assert len(fingerprint(certificate).split(":")) == 32
    with pytest.raises(InputError):
        tls_context(certificate, make_certificate(["x"])[1])


@pytest.mark.parametrize(("arguments", "word"), [
    (["p", "--host", "0.0.0.0"], "TLS"), (["p", "--host", "192.168.1.5"], "TLS"), (["p", "--cert", "c"], "--key"),
    (["p", "--host", "0.0.0.0", "--tls"], "every address"), (["p", "--port", "0"], "--port"),
])  # fmt: skip
def test_a_server_that_others_reach_without_tls_does_not_start(arguments, word):
    with pytest.raises(InputError) as found:
        parsed(arguments)
    assert word in str(found.value)


def test_by_default_it_listens_on_this_machine_alone():
    assert parsed(["p"]).host == "127.0.0.1"
