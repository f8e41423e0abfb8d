"""Logs, intact and damaged: what is read equals what was written, and what is lost is said."""

import tracemalloc
from io import BytesIO
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from trunkline.errors import InputError
from trunkline.recordings.logs.mcap_log import read_log

COUNT = 120


def write(path: Path, compression=CompressionType.ZSTD, chunk_size=1500, **options) -> bytes:
    """A log of 120 numbered messages on two topics."""
    with open(path, "wb") as file:
        writer = Writer(file, chunk_size=chunk_size, compression=compression, **options)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema("a_msgs/msg/A", "ros2msg", b"uint32 number")
        channels = [writer.register_channel(name, "cdr", schema) for name in ("/a", "/b")]
        for number in range(COUNT):
            data = (
                b"\0\1\0\0" + number.to_bytes(4, "little") + bytes((number * i) % 251 for i in range(40))
            )
            writer.add_message(channels[number % 2], number * 1000, data, number * 1000, number)
        writer.finish()
    return path.read_bytes()


def messages(log) -> dict[int, bytes]:
    return {
        int(time): data
        for topic in log.topics.values()
        for time, data in zip(topic.log_times, topic.messages, strict=True)
    }


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "whole.mcap"
    data = write(path, enable_data_crcs=True)
    return data, messages(read_log(path))


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
@pytest.mark.parametrize("options", [{}, {"use_chunking": False}, {"use_statistics": False}])
def test_intact_log_equals_the_reference_reader(tmp_path, compression, options):
    path = tmp_path / "log.mcap"
    write(path, compression, **options)
    log = read_log(path)
    with open(path, "rb") as file:
        reference = [
            (c.topic, m.log_time, m.data)
            for _, c, m in make_reader(file, validate_crcs=True).iter_messages()
        ]
    result = [
        (t.name, time, data)
        for t in log.topics.values()
        for time, data in zip(t.log_times, t.messages, strict=True)
    ]
    assert sorted(result) == sorted(reference)
    assert len(result) == COUNT
    assert log.damage == []


def damaged(tmp_path, data: bytes):
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    return read_log(path)


def test_chunk_that_was_cut_gives_its_readable_messages(tmp_path):
    data = write(tmp_path / "log.mcap", CompressionType.NONE, chunk_size=100_000)
    log = damaged(tmp_path, data[: len(data) // 3])
    assert 10 < len(messages(log)) < COUNT
    assert f"{len(messages(log))} messages of the chunk that was cut" in log.damage[0]


def test_damaged_chunk_is_left_out_and_its_loss_counted(tmp_path, whole):
    data, expected = whole
    chunk = make_reader(BytesIO(data)).get_summary().chunk_indexes[1]
    broken = bytearray(data)
    broken[chunk.chunk_start_offset + chunk.chunk_length - 9] ^= 0x10
    log = damaged(tmp_path, bytes(broken))
    result = messages(log)
    assert result.items() < expected.items()
    assert max(result) == max(expected), "chunks behind the damaged one are intact"
    assert log.damage[-1] == f"{COUNT - len(result)} of {COUNT} messages lost"


@settings(max_examples=150, deadline=None)
@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_any_flipped_bit_never_changes_a_message_unnoticed(tmp_path_factory, whole, place, bit):
    data, expected = whole
    broken = bytearray(data)
    broken[int(place * len(data))] ^= 1 << bit
    try:
        log = damaged(tmp_path_factory.getbasetemp(), bytes(broken))
    except InputError:
        return
    result = messages(log)
    assert result.items() <= expected.items() or log.damage
    assert {time: data for time, data in result.items() if time in expected}.items() <= expected.items()
    if len(result) < len(expected):
        assert log.damage


@settings(max_examples=60, deadline=None)
@given(share=st.floats(0, 1))
def test_any_truncation_gives_a_prefix_or_a_refusal(tmp_path_factory, whole, share):
    data, expected = whole
    cut = int(share * len(data))
    try:
        log = damaged(tmp_path_factory.getbasetemp(), data[:cut])
    except InputError:
        assert cut < 8
        return
    result = messages(log)
    assert len(result) == len(expected) or "cut off" in log.damage[0]
    assert result == {time: expected[time] for time in sorted(expected)[: len(result)]}


def test_chunk_that_no_longer_looks_like_one_is_missed(tmp_path):
    data = bytearray(write(tmp_path / "log.mcap"))
    data[make_reader(BytesIO(data)).get_summary().chunk_indexes[2].chunk_start_offset] = (
        0x07  # a message index
    )
    log = damaged(tmp_path, bytes(data))
    assert log.damage == [f"{COUNT - len(messages(log))} of {COUNT} messages lost"]


def test_flipped_byte_outside_chunks_is_refused(tmp_path):
    data = bytearray(write(tmp_path / "log.mcap", use_chunking=False, enable_data_crcs=True))
    data[len(data) // 3] ^= 1
    with pytest.raises(InputError, match=r"damaged\.mcap: wrong checksum"):
        damaged(tmp_path, bytes(data))


def test_what_is_no_log_is_refused(tmp_path):
    with pytest.raises(InputError, match="found no MCAP file"):
        damaged(tmp_path, b"time,x,y,z\n")
    with pytest.raises(InputError, match="no such file"):
        read_log(tmp_path / "missing.mcap")


def two_channels(path: Path, schemas: tuple[str, str]):
    """30 messages on one topic, every third by a second publisher."""
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="test")
        ids = [writer.register_schema(name, "ros2msg", b"uint32 number") for name in schemas]
        channels = [writer.register_channel("/a", "cdr", schema) for schema in ids]
        for number in range(30):
            writer.add_message(channels[number % 3 == 0], number, bytes([number]), number, number)
        writer.finish()
    return read_log(path)


def test_channels_of_one_topic_are_one_stream(tmp_path):
    log = two_channels(tmp_path / "log.mcap", ("a_msgs/msg/A", "a_msgs/msg/A"))
    assert log.topics["/a"].messages == [bytes([number]) for number in range(30)]
    assert log.topics["/a"].log_times.tolist() == list(range(30))
    assert log.damage == []


def test_another_schema_on_a_topic_is_left_out_and_said(tmp_path):
    log = two_channels(tmp_path / "log.mcap", ("a_msgs/msg/A", "a_msgs/msg/B"))
    assert log.topics["/a"].schema == "a_msgs/msg/A"
    assert log.topics["/a"].messages == [bytes([number]) for number in range(30) if number % 3]
    (damage,) = log.damage
    assert "/a: 10 messages of another schema (a_msgs/msg/B, cdr) left out, 20 are a_msgs/msg/A" in damage


def write_at(path: Path, times: list[int], **options) -> None:
    with open(path, "wb") as file:
        writer = Writer(file, **options)
        writer.start()
        for name in ("a_msgs/msg/A", "b_msgs/msg/Image"):
            schema = writer.register_schema(name, "ros2msg", b"uint32 number")
            channel = writer.register_channel("/" + name[0], "cdr", schema)
            for time in times:
                writer.add_message(channel, time, bytes(100_000), time)
        writer.finish()


def test_a_log_time_that_no_clock_shows_is_lost_and_said(tmp_path):
    times = [1, 2, 2**63 - 1, 2**63, 2**64 - 1]
    write_at(tmp_path / "log.mcap", times, compression=CompressionType.NONE)
    log = read_log(tmp_path / "log.mcap")
    assert log.topics["/a"].log_times.tolist() == [1, 2, 2**63 - 1]
    assert "4 messages with a log time beyond the year 2262 lost" in log.damage


@pytest.mark.parametrize(
    ("options", "bare"),
    [
        ({}, False),
        ({"enable_crcs": False}, True),
        ({"use_chunking": False}, True),
        ({"use_chunking": False, "enable_data_crcs": True}, False),
        ({"enable_crcs": False, "enable_data_crcs": True}, False),
    ],
)
def test_messages_that_no_checksum_covers_are_counted(tmp_path, options, bare):
    write(tmp_path / "log.mcap", **options)
    log = read_log(tmp_path / "log.mcap")
    assert (log.count, log.unchecked, log.damage) == (COUNT, COUNT if bare else 0, [])


def test_only_what_is_wanted_is_kept(tmp_path):
    """Of a camera beside the poses, only the times: memory is bounded by what is kept, and by a chunk."""
    path = tmp_path / "log.mcap"
    write_at(path, list(range(200)), chunk_size=200_000, compression=CompressionType.NONE)
    tracemalloc.start()
    log = read_log(path, {"c_msgs/C"})
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert path.stat().st_size > 40e6
    assert peak < 3e6
    assert [len(topic.log_times) for topic in log.topics.values()] == [200, 200]
    assert not any(topic.messages for topic in log.topics.values())
    whole, some = read_log(path), read_log(path, {"a_msgs/A"})
    assert some.topics["/a"].messages == whole.topics["/a"].messages
    assert some.topics["/b"].messages == []
