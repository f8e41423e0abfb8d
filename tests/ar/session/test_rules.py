"""Clock, lease, outbox and certificate by themselves: their rules, for every order in which objects may come."""

import asyncio
import ssl

import numpy as np
import pytest
from cryptography import x509
from hypothesis import given
from hypothesis import strategies as st

from tests.support.links import clock_error
from trunkline.ar.session.__main__ import parsed
from trunkline.ar.session.auth import CODE_SECONDS, CODE_TRIES, PairingCode
from trunkline.ar.session.clock import FORWARD, JUMP, LATEST, PINGS, ClientClock
from trunkline.ar.session.lease import LEASE_TIMEOUT, ControlLease
from trunkline.ar.session.outbox import MOST_MESSAGES, WINDOW, Outbox
from trunkline.ar.session.tls import fingerprint, make_certificate, tls_context
from trunkline.errors import InputError

NEAR = 1e-6  # s, to either side of a border


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


def synchronized(round_trip=0.0) -> ClientClock:
    """A clock whose offset is known, 0 s."""
    clock = ClientClock()
    for now in range(PINGS):
        clock.pong(clock.ping(float(now)), now + round_trip / 2, now + round_trip)
    return clock


@pytest.mark.parametrize(
    ("late", "reason"),
    [
        (0.0, ""),
        (-FORWARD + NEAR, ""),
        (-FORWARD - NEAR, "input: its stamp is 0.05 s ahead; the clock runs fast, or has jumped"),
        (LATEST - NEAR, ""),
        (LATEST + NEAR, "input: it comes 0.25 s late, expected at most 0.25 s"),
        (JUMP - NEAR, "input: it comes 1.00 s late, expected at most 0.25 s"),
        (JUMP + NEAR, "input: its stamp is 1 s old; the clock has jumped"),
    ],
)
def test_how_late_or_ahead_an_input_may_be(late, reason):
    assert synchronized().fault(100.0 - late, 100.0) == reason


@pytest.mark.parametrize(("trip", "counts"), [(LATEST - NEAR, True), (LATEST + NEAR, False)])
def test_how_long_the_way_there_and_back_may_be(trip, counts):
    assert (synchronized(trip).fault(100.0, 100.0) == "") == counts


def test_before_a_round_is_over_no_input_counts():
    clock = ClientClock()
    for now in range(PINGS):
        assert clock.fault(100.0, 100.0) == "input: the clock's offset is not known yet"
        clock.pong(clock.ping(float(now)), float(now), float(now))
    assert clock.fault(100.0, 100.0) == ""


@pytest.mark.parametrize(("silent", "ends"), [(LEASE_TIMEOUT - NEAR, False), (LEASE_TIMEOUT + NEAR, True)])
def test_a_lease_ends_by_its_holders_silence_alone(silent, ends):
    """Counted from its last input, or from when the lease began; of nobody's nothing ends."""
    control = ControlLease()
    assert not control.silent(1e9)
    control.ask("a", 100.0)
    assert control.silent(100.0 + silent) == ends
    control = ControlLease()
    control.ask("a", 90.0)
    assert control.hear("a", 100.0)
    assert not control.hear("b", 105.0)
    assert not control.hear("", 105.0)
    assert control.silent(100.0 + silent) == ends
    assert control.holder == ("" if ends else "a")


@pytest.mark.parametrize(("late", "opens"), [(CODE_SECONDS - NEAR, True), (CODE_SECONDS + NEAR, False)])
def test_a_pairing_code_opens_once_within_its_time(late, opens):
    code = PairingCode()
    assert code.fault("", 0.0).startswith("code: it is over")
    digits = code.renew(100.0)
    assert (code.fault(digits, 100.0 + late) == "") == opens
    assert code.fault(digits, 100.0).startswith("code: it is over") == opens


def test_a_pairing_code_bears_so_many_tries():
    for wrong in (CODE_TRIES - 1, CODE_TRIES):
        code = PairingCode()
        digits = code.renew(100.0)
        for left in range(1, wrong + 1):
            assert code.fault("x", 100.0) == f"code: wrong, {CODE_TRIES - left} tries left"
        assert (code.fault(digits, 100.0) == "") == (wrong < CODE_TRIES)


STEP = st.tuples(
    st.sampled_from(["ask", "release", "give", "hear", "wait"]), st.sampled_from("abc"), st.sampled_from("abc")
)


@given(st.lists(STEP, max_size=40))
def test_one_controls_and_none_without_having_asked_or_been_given_it(steps):
    control, now, entitled = ControlLease(), 0.0, set()
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
            now += LEASE_TIMEOUT + 0.1
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
        pieces = [int(item[1:]) for item in taken if item[:1] == b"p"]
        assert pieces == list(range(1, len(pieces) + 1))

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
        assert all(box.say("x") for _ in range(MOST_MESSAGES))
        assert not box.say("x")

    asyncio.run(go())


def test_a_certificate_is_of_the_names_and_serves():
    certificate, key = make_certificate(["192.168.1.5", "lab.local", "[::1]"])
    parsed = x509.load_pem_x509_certificate(certificate)
    names = parsed.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert [str(name.value) for name in names] == ["192.168.1.5", "lab.local", "::1"]
    assert (parsed.not_valid_after_utc - parsed.not_valid_before_utc).days <= 397
    assert isinstance(tls_context(certificate, key), ssl.SSLContext)
    assert len(fingerprint(certificate).split(":")) == 32
    with pytest.raises(InputError):
        tls_context(certificate, make_certificate(["x"])[1])


@pytest.mark.parametrize(("arguments", "word"), [
    (["p", "--host", "0.0.0.0"], "TLS"), (["p", "--host", "192.168.1.5"], "TLS"), (["p", "--cert", "c"], "--key"),
    (["p", "--host", "0.0.0.0", "--tls"], "every address"), (["p", "--port", "0"], "--port"),
])  # fmt: skip
def test_a_server_that_others_reach_without_tls_does_not_start(arguments, word):
    with pytest.raises(InputError) as error:
        parsed(arguments)
    assert word in str(error.value)


def test_by_default_it_listens_on_this_machine_alone():
    assert parsed(["p"]).host == "127.0.0.1"
