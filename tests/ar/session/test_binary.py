"""The wire: what is packed is read back, what is no message is refused, and the client's and the docs' tables are its
own."""

import json
import re
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trunkline.ar.session import binary, messages
from trunkline.errors import InputError
from upkeep import wire_table

ROOT = Path(__file__).parents[3]


def packed(kind="input", flags=0, count=2, received=7, stamp=1.25, hands=None):
    rows = b"" if kind != "input" else np.arange(28.0 if hands is None else 0, dtype="<f4").tobytes()
    return struct.pack("<BBHId", binary.FROM_CLIENT[kind].number, flags, count, received, stamp) + rows


def test_an_input_is_128_bytes_and_read_back():
    message = packed(flags=0b101)
    assert len(message) == binary.INPUT_BYTES == 128
    received = binary.read(message)
    assert (received.kind, received.flags, received.received, received.stamp) == (
        "input",
        {"left_tracked", "visible"},
        7,
        1.25,
    )
    np.testing.assert_array_equal(received.hands, np.arange(28.0).reshape(2, 14))


def test_a_view_is_one_pose():
    row = np.arange(7, dtype="<f4")
    received = binary.read(struct.pack("<BBHId", 19, 1, 1, 3, 0.5) + row.tobytes())
    assert (received.kind, received.flags, received.received, received.stamp) == ("view", {"tracked"}, 3, 0.5)
    np.testing.assert_array_equal(received.view, row)
    assert received.hands.shape == (0, 14)


def test_a_frame_has_16_bytes_and_28_a_body():
    rows = np.arange(34 * 7.0).reshape(34, 7)
    message = binary.frame("robot", {"stopped"}, 34, 9, 2.5, rows)
    assert len(message) == 16 + 28 * 34
    assert struct.unpack_from("<BBHId", message) == (1, 2, 34, 9, 2.5)
    np.testing.assert_array_equal(np.frombuffer(message, "<f4", offset=16), rows.ravel())


@pytest.mark.parametrize("message", [
    b"", bytes(15), packed()[:-1], packed() + b"x", packed(count=3), packed(flags=32), bytes([99]) + bytes(15),
    packed("ack", count=1), packed("stop", count=0) + bytes(4),
])  # fmt: skip
def test_what_is_no_message_is_refused_in_one_line(message):
    with pytest.raises(InputError) as refusal:
        binary.read(message)
    assert "\n" not in str(refusal.value)


@given(st.binary(max_size=200))
def test_no_bytes_break_the_reader(message):
    try:
        received = binary.read(message)
    except InputError:
        return
    assert received.kind in binary.FROM_CLIENT


@given(st.one_of(st.text(max_size=200), st.recursive(st.none() | st.booleans() | st.floats() | st.text(), st.lists)
                 .map(json.dumps)))  # fmt: skip
def test_no_text_breaks_the_reader(text):
    with pytest.raises(InputError):
        messages.hear(text)


def test_what_is_said_is_heard_and_what_is_not_in_the_table_is_refused():
    hello = messages.hear('{"type": "hello", "version": 1, "token": "t", "name": "a\\u001b[31mb"}')
    assert hello == messages.Hello(1, token="t", name="a[31mb")
    for text in (
        '{"type": "hello", "version": 1, "more": 1}', '{"type": "execute", "digest": "d"}', "[" * 100_000,
        '{"type": "pong", "number": 1, "stamp": NaN}', '{"type": "shown"}', '{"type": "shown", "digest": 3}',
    ):  # fmt: skip
        with pytest.raises(InputError) as refusal:
            messages.hear(text)
        assert "\n" not in str(refusal.value)


def test_every_number_of_a_message_is_its_own():
    numbers = [kind.number for kind in (*binary.FROM_SERVER.values(), *binary.FROM_CLIENT.values())]
    assert len(set(numbers)) == len(numbers)


def test_the_client_s_table_is_this_one():
    assert (ROOT / wire_table.MODULE).read_text(encoding="utf-8") == wire_table.module()


def test_the_page_s_tables_are_these():
    page = (ROOT / wire_table.PAGE).read_text(encoding="utf-8")
    assert wire_table.written(page) == page
    assert re.findall(r"^Version (\d+),", page, re.MULTILINE) == [str(binary.VERSION)]
