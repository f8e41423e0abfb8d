"""Whatever happens to a log's bytes: a result with the loss stated, or a refusal by name."""

import tracemalloc
from contextlib import suppress
from io import BytesIO
from os.path import commonprefix

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from tests.support.sessions import LIMITS, curl_truth, instruments, record
from trunkline.errors import InputError
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.logs.mcap_log import read_log
from trunkline.recordings.logs.records import MAGIC
from trunkline.recordings.session.session import read_session

POSES, PULLS = {"/rigid_bodies"}, {"/tendon_commands", "/tendon_states"}
ENOUGH = 1e9  # ns of poses and pulls, with which no trial is refused
FOOTER = b"\x02" + (20).to_bytes(8, "little") + bytes(20) + MAGIC
COMPRESSIONS = [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]
AGAIN = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A session of one curl, whose log is overwritten by each example."""
    path = tmp_path_factory.mktemp("session")
    record(path, [curl_truth()], instruments())
    return path


@pytest.fixture(scope="module", params=COMPRESSIONS, ids=lambda c: c.name.lower())
def log(request, folder):
    """(bytes, messages, raw trial) of the curl's log in small chunks, compressed in one of the ways."""
    path = folder / "curl_40.mcap"
    original = path.read_bytes()
    with open(path, "wb") as file:
        writer = Writer(file, chunk_size=16_000, compression=request.param, enable_data_crcs=True)
        writer.start(profile="ros2", library="test")
        channels = {}
        for schema, channel, message in make_reader(BytesIO(original)).iter_messages():
            if channel.topic not in channels:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", schema_id)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()
    data, ((_, raw, findings),) = path.read_bytes(), load_raw_trials(folder, read_session(folder), LIMITS)
    assert findings.repairs == []
    whole = messages(path)
    yield data, whole, raw
    path.write_bytes(original)


def messages(path) -> list[tuple[str, int, bytes]]:
    """Of every topic in order: (topic, log time, data)."""
    topics = sorted(read_log(path).topics.values(), key=lambda topic: topic.name)
    return [
        (t.name, int(time), data) for t in topics for time, data in zip(t.log_times, t.messages, strict=True)
    ]


def chunks(data: bytes) -> list[tuple[int, int]]:
    """(begin, end) of every chunk with the message indices behind it."""
    index = sorted(make_reader(BytesIO(data)).get_summary().chunk_indexes, key=lambda c: c.chunk_start_offset)
    return [
        (c.chunk_start_offset, c.chunk_start_offset + c.chunk_length + c.message_index_length) for c in index
    ]


def trusted(data: bytes) -> list[tuple[str, int, bytes]]:
    """As `messages`, in any order: what the makers' own reader finds from the beginning until it stops.

    It gives a chunk whole or not at all.
    """
    topics, records = {}, []
    with suppress(Exception):  # whatever it raises, it goes no further
        for record in StreamReader(BytesIO(data), validate_crcs=True).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                records.append((record.channel_id, record.log_time, record.data))
    return [(topics[channel], time, data) for channel, time, data in records if channel in topics]


def before(damaged: bytes, data: bytes) -> bytes:
    """What a damage left as it is in front of it."""
    return data[: len(commonprefix([damaged, data]))]


def truncate(data, draw):
    return data[: draw(st.integers(0, len(data)))]


def flip(data, draw):
    broken = bytearray(data)
    broken[draw(st.integers(0, len(data) - 1))] ^= draw(st.integers(1, 255))
    return bytes(broken)


def drop_summary(data, _):
    """What a recorder leaves that was told to write no summary."""
    return data[: chunks(data)[-1][1] + 9 + 4] + FOOTER  # the record DataEnd has 9 + 4 bytes


def duplicate(data, draw):
    spans = chunks(data)
    begin, end = draw(st.sampled_from(spans))
    place = draw(st.sampled_from(spans))[1]
    return data[:place] + data[begin:end] + data[place:]


def reorder(data, draw):
    spans = chunks(data)
    order = draw(st.permutations(spans))
    return data[: spans[0][0]] + b"".join(data[b:e] for b, e in order) + data[spans[-1][1] :]


def lose(data, draw):
    begin, end = draw(st.sampled_from(chunks(data)))
    return data[:begin] + data[end:]


DAMAGES = [truncate, flip, drop_summary, duplicate, reorder, lose]


@AGAIN
@given(data=st.data())
def test_messages_are_the_original_ones_or_the_loss_is_said(folder, log, data):
    whole, expected, _ = log
    path = folder / "curl_40.mcap"
    broken = whole
    for damage in data.draw(st.lists(st.sampled_from([duplicate, reorder, lose]), max_size=1)):
        broken = damage(broken, data.draw)
    last = data.draw(st.sampled_from(DAMAGES)) if broken is whole else flip
    damaged = last(broken, data.draw)
    path.write_bytes(damaged)
    expected_left = set(trusted(before(damaged, broken) if last in (truncate, flip) else damaged))
    try:
        reported, refusal = read_log(path).damage, "none"
    except InputError as error:
        refusal = str(error)
    if refusal != "none":
        assert "curl_40.mcap" in refusal
        assert not expected_left, "refused, though another reader finds messages"
        return
    result = messages(path)
    assert len(result) == len(set(result))
    assert set(result) <= set(expected) or reported
    assert result == expected or reported
    assert expected_left <= set(result)


@AGAIN
@given(data=st.data())
def test_a_trial_is_refused_or_holds_measured_poses_only(folder, log, data):
    whole, _, raw = log
    damage = data.draw(st.sampled_from(DAMAGES))
    broken = damage(whole, data.draw)
    (folder / "curl_40.mcap").write_bytes(broken)
    expected_left = trusted(before(broken, whole) if damage in (truncate, flip) else broken)
    ((_, result, findings),) = load_raw_trials(folder, read_session(folder), LIMITS)
    poses, pulls = ([t for name, t, _ in set(expected_left) if name in names] for names in (POSES, PULLS))
    if isinstance(result, InputError):
        assert "curl_40.mcap" in str(result)
        assert min(np.ptp(poses), np.ptp(pulls)) < ENOUGH if poses and pulls else True
        return
    rows = {row.tobytes() for row in raw.positions}
    assert {row.tobytes() for row in result.positions} <= rows
    assert len(result.positions) >= len(poses)
    if len(result.positions) < len(raw.positions):
        assert findings.repairs[0].startswith("log: ")
    else:
        np.testing.assert_array_equal(result.time, raw.time)


@pytest.mark.parametrize("damage", [drop_summary, duplicate, reorder])
@AGAIN
@given(data=st.data())
def test_nothing_is_lost_with_the_summary_or_with_the_order(folder, log, damage, data):
    whole, expected, _ = log
    (folder / "curl_40.mcap").write_bytes(damage(whole, data.draw))
    assert messages(folder / "curl_40.mcap") == expected


@AGAIN
@given(data=st.data())
def test_memory_is_bounded_by_the_size_of_the_file(folder, log, data):
    whole, _, _ = log
    path = folder / "curl_40.mcap"
    path.write_bytes(flip(whole, data.draw))
    tracemalloc.start()
    try:
        read_log(path)
    except InputError:
        pass
    finally:
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert peak < 20 * len(whole) + 5_000_000


def test_a_duplicated_chunk_is_said(folder, log):
    whole, _, _ = log
    begin, end = chunks(whole)[1]
    path = folder / "curl_40.mcap"
    path.write_bytes(whole[:end] + whole[begin:end] + whole[end:])
    assert any(line.startswith("chunk of") and "it is there twice" in line for line in read_log(path).damage)


def test_a_duplicated_chunk_is_known_by_its_messages_though_its_head_is_damaged(folder, log):
    whole, expected, _ = log
    begin, end = chunks(whole)[1]
    copy = bytearray(whole[begin:end])
    copy[9] ^= 1  # behind opcode and length: the first message's time, which no checksum covers
    path = folder / "curl_40.mcap"
    path.write_bytes(whole[:end] + copy + whole[end:])
    assert messages(path) == expected
