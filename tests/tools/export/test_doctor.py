"""An exported file breaks no rule that `mcap doctor` looks at. No Python package has that command, so they are here."""

from io import BytesIO
from itertools import pairwise

import pytest
from mcap.records import Channel, Chunk, ChunkIndex, DataEnd, Footer, Header, Message, Schema, Statistics, SummaryOffset
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import Writer

from tests.tools.export.test_export import made  # noqa: F401


def findings(data: bytes) -> list[str]:
    """A line for each rule that a file breaks. Checksums are compared too: a wrong one is an error."""
    whole = list(StreamReader(BytesIO(data), emit_chunks=True, validate_crcs=True).records)
    end = next(place for place, record in enumerate(whole) if isinstance(record, DataEnd))
    chunks = [(chunk, breakup_chunk(chunk, validate_crc=True)) for chunk in of(Chunk, whole)]
    records = [record for _, inner in chunks for record in inner]
    schemas, channels, messages = (of(kind, records) for kind in (Schema, Channel, Message))
    summary, (statistics,), header = whole[end:], of(Statistics, whole), whole[0]
    rules = {
        "a library and a known profile": isinstance(header, Header) and header.library and not header.profile,
        "a footer at the end": isinstance(whole[-1], Footer),
        "messages in chunks alone": not any(isinstance(record, Message | Schema | Channel) for record in whole[:end]),
        "schemas with an id, an encoding and data": all(s.id and s.encoding and s.data for s in schemas),
        "each schema and channel once": all(len({r.id for r in each}) == len(each) for each in (schemas, channels)),
        "schemas before channels before messages": introduced(records),
        "messages in order": all(a.log_time <= b.log_time for a, b in pairwise(messages)),
        "chunks that know their times": all(
            (chunk.message_start_time, chunk.message_end_time) == span(of(Message, inner)) for chunk, inner in chunks
        ),
        "an index of each chunk": [at(data, index) for index in of(ChunkIndex, summary)] == [c for c, _ in chunks],
        "schemas and channels again in the summary": [of(Schema, summary), of(Channel, summary)] == [schemas, channels],
        "statistics of all messages": (statistics.message_count, statistics.message_start_time,
                                       statistics.message_end_time) == (len(messages), *span(messages)),
        "no empty group in the summary": all(group.group_length for group in of(SummaryOffset, summary)),
    }  # fmt: skip
    return [rule for rule, holds in rules.items() if not holds]


def of(kind: type, records: list) -> list:
    return [record for record in records if isinstance(record, kind)]


def span(messages: list[Message]) -> tuple[int, int]:
    times = [message.log_time for message in messages]
    return min(times), max(times)


def introduced(records: list) -> bool:
    schemas, channels = set(), set()
    for record in records:
        if isinstance(record, Schema):
            schemas.add(record.id)
        elif isinstance(record, Channel):
            channels.add(record.id if record.schema_id in schemas else None)
        elif record.channel_id not in channels:
            return False
    return None not in channels


def at(data: bytes, index: ChunkIndex) -> Chunk | None:
    """The chunk that an index points to, if it is as the index has it."""
    part = data[index.chunk_start_offset : index.chunk_start_offset + index.chunk_length]
    chunk = next(StreamReader(BytesIO(part), skip_magic=True, emit_chunks=True).records)
    described = (chunk.message_start_time, chunk.message_end_time, chunk.compression, len(chunk.data),
                 chunk.uncompressed_size)  # fmt: skip
    indexed = (index.message_start_time, index.message_end_time, index.compression, index.compressed_size,
               index.uncompressed_size)  # fmt: skip
    return chunk if described == indexed else None


def test_an_export_breaks_no_rule(made):  # noqa: F811
    assert findings((made[0] / "out.mcap").read_bytes()) == []


@pytest.mark.parametrize(("library", "encoding", "times", "expected"), [
    ("a", "jsonschema", (1, 2), ["no empty group in the summary"]),
    ("", "jsonschema", (1, 2), ["a library and a known profile", "no empty group in the summary"]),
    ("a", "", (1, 2), ["schemas with an id, an encoding and data", "no empty group in the summary"]),
    ("a", "jsonschema", (2, 1), ["messages in order", "no empty group in the summary"]),
])  # fmt: skip
def test_a_broken_rule_is_named(library, encoding, times, expected):
    file = BytesIO()
    writer = Writer(file)
    writer.start(library=library)
    channel = writer.register_channel("/a", "json", writer.register_schema("a", encoding, b"{}"))
    for time in times:
        writer.add_message(channel, time, b"{}", time)
    writer.finish()
    assert findings(file.getvalue()) == expected
