"""Bytes of NatNet: literal ones of both versions, and a stand-in's with something in every section."""

import numpy as np
import pytest

from tests.ar.tracking import motive_stand_in as stand_in
from trunkline.ar.tracking.natnet_messages import (
    NatNetError,
    ServerInfo,
    kind_of,
    read_frame,
    read_models,
    read_server_info,
    request,
)

VERSIONS = [(3, 0), (3, 1), (4, 0), (4, 1), (4, 2)]
# One rigid body with id 5 at 1, 2, -0.5, turned by half a turn about x (x = 1, w = 0), mean error 0.4 mm, tracked.
BODY = "05000000 0000803f 00000040 000000bf 0000803f 00000000 00000000 00000000 17b7d139 0100"
STAMPS = (
    "00000000 00000000 0000000000001040 005a620200000000 0a5a620200000000 145a620200000000"  # 4 s, in ticks of 0.1 µs
)
NONE = "00000000"
BYTES = {
    # head, number 258; marker sets, other markers; bodies; skeletons, labeled markers, force plates, devices; end
    (3, 1): f"0700 7400 02010000 {2 * NONE} 01000000 {BODY} {4 * NONE} {STAMPS} 0000 {NONE}",
    # a size after each count, and assets after skeletons; two words of precise time before the flags
    (4, 1): f"0700 a000 02010000 {4 * NONE} 01000000 26000000 {BODY} {10 * NONE} {STAMPS} {2 * NONE} 0000 {NONE}",
}


def info(version):
    return ServerInfo(version, stand_in.TICKS, 1511, None)


@pytest.mark.parametrize("version", BYTES)
def test_the_bytes_of_a_frame_are_read_and_the_stand_in_writes_the_same(version):
    literal = bytes.fromhex(BYTES[version].replace(" ", ""))
    frame = read_frame(literal, info(version), [5])
    assert (kind_of(literal), frame.number, frame.stamp, frame.sent) == (7, 258, 4.0, 4.000002)
    assert frame.tracked.tolist() == [True]
    assert frame.positions.tolist() == [[1.0, 2.0, -0.5]]
    assert frame.quaternions.tolist() == [[0.0, 1.0, 0.0, 0.0]]
    body = stand_in.rigid_body(5, (1.0, 2.0, -0.5), (0, 1, 0, 0))
    assert stand_in.frame(version, 258, 4.0, 4.000002, [body], busy=False) == literal


@pytest.mark.parametrize("version", VERSIONS)
def test_a_frame_with_something_in_every_section_gives_its_rigid_bodies(version):
    bodies = [
        stand_in.rigid_body(11, (0.1, 0.2, 0.3), (0.5, 0.5, -0.5, 0.5)),
        stand_in.rigid_body(12, (1.5, -2.5, 4.0), (1, 0, 0, 0), flags=2),
    ]
    frame = read_frame(stand_in.frame(version, 77, 12.5, 12.75, bodies), info(version), [12, 3, 11])
    assert (frame.number, frame.stamp, frame.sent) == (77, 12.5, 12.75)
    assert frame.tracked.tolist() == [False, False, True]
    np.testing.assert_allclose(frame.positions, [[1.5, -2.5, 4.0], 3 * [np.nan], [0.1, 0.2, 0.3]], rtol=1e-6)
    np.testing.assert_array_equal(frame.quaternions, [[1, 0, 0, 0], 4 * [np.nan], [0.5, 0.5, -0.5, 0.5]])


@pytest.mark.parametrize("version", VERSIONS)
def test_rigid_bodies_are_named_among_data_sets_of_all_types(version):
    bodies = {"base": 3, "marker ü": 40}
    assert read_models(stand_in.models(version, bodies), version) == bodies


def test_the_server_says_its_version_its_clock_and_where_frames_are():
    read = read_server_info(stand_in.server_info((4, 1), port=1600, group="239.1.2.3"))
    assert (read.version, read.ticks, read.data_port, read.group) == ((4, 1), stand_in.TICKS, 1600, "239.1.2.3")
    assert read_server_info(stand_in.server_info((3, 1))).group is None


def test_requests_are_those_of_the_protocol():
    assert request(0) == b"\x00\x00\x05\x00Ping\x00"
    assert request(4) == b"\x04\x00\x00\x00"


@pytest.mark.parametrize("version", VERSIONS)
def test_a_message_that_is_cut_off_anywhere_is_refused_in_one_line(version):
    whole = stand_in.frame(version, 77, 12.5, 12.75, [stand_in.rigid_body(11, (0, 0, 1), (1, 0, 0, 0))])
    end = 2 + 4 + (8 if version >= (4, 1) else 0)  # flags, end and precise time, of which nothing is read
    for size in range(4, len(whole) - end):
        with pytest.raises(NatNetError, match="^found .*, expected [^\n]*$"):
            read_frame(whole[:size], info(version), [11])
    with pytest.raises(NatNetError, match="expected"):
        kind_of(whole[:-1])
    defined = stand_in.models(version, {"base": 3})
    for size in range(4, len(defined) - 1):
        with pytest.raises(NatNetError, match="^found .*, expected [^\n]*$"):
            read_models(defined[:size], version)


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (stand_in.server_info((2, 10)), "found NatNet 2.10, expected 3.0 or later, and below 5"),
        (stand_in.server_info((5, 0)), "found NatNet 5.0, expected 3.0 or later, and below 5"),
        (stand_in.server_info((3, 1), ticks=0), "found a clock of 0 ticks a second, expected more"),
    ],
)
def test_a_server_that_cannot_be_read_is_refused(message, reason):
    with pytest.raises(NatNetError) as error:
        read_server_info(message)
    assert str(error.value) == reason


def test_data_sets_that_cannot_be_told_apart_are_refused():
    twice = stand_in.message(5, stand_in.U32.pack(2) + 2 * (stand_in.U32.pack(1) + stand_in.body_model((3, 1), "a", 1)))
    with pytest.raises(NatNetError, match="found two rigid bodies 'a'"):
        read_models(twice, (3, 1))
    other = stand_in.message(5, stand_in.U32.pack(1) + stand_in.U32.pack(6))
    with pytest.raises(NatNetError, match="found a data set of type 6, expected one of 0 to 5"):
        read_models(other, (3, 1))


def test_counts_beyond_the_message_are_refused_at_once():
    lying = stand_in.message(7, stand_in.U32.pack(1) + stand_in.U32.pack(0) * 2 + stand_in.U32.pack(4_000_000_000))
    with pytest.raises(NatNetError, match="expected 152000000000 more"):
        read_frame(lying, info((3, 1)), [1])
