"""The records of an MCAP file, front to back, every checksum checked; what is damaged is left out, and that is said.

The `mcap` library gives up at the first record that it cannot read. Here the next one is looked for where the damaged
one's length says that it begins, a last chunk that was cut off is read as far as it goes, and a chunk takes no more
memory than it says. docs/measurements/speed.md has both side by side: how many messages come out of copies of a log
with a wrong byte in the head of a chunk, and of copies that are cut off, and how long it takes.
"""

import hashlib
import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from io import SEEK_END, BytesIO
from pathlib import Path
from typing import BinaryIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Schema, Statistics

from trunkline.errors import InputError
from trunkline.recordings.logs.cdr import short_name

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEADER = struct.Struct("<BQ")
MESSAGE_HEADER = struct.Struct("<HIQQ")
CHUNK_HEADER = struct.Struct("<QQQI")
BLOCK = 2**20  # bytes read at once for a checksum over the file
LATEST = 2**63 - 1  # ns since 1970, the year 2262: NumPy's times go no further
LARGEST_EXPANSION = 1000  # of a chunk's bytes by decompression; poses shrink by less than 20


@dataclass
class Contents:
    """What was read so far: messages are (channel id, log time in ns, data).

    wanted: names of the schemas whose messages' data are kept, None for all; of others data is None.
    """

    wanted: Collection[str] | None = None
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: list[tuple[int, int, bytes | None]] = field(default_factory=list)
    undated: int = 0  # messages left out for their log time
    unchecked: int = 0  # messages that no checksum covers
    expected: int | None = None  # messages, by the log's own statistics
    chunks: set[bytes] = field(default_factory=set)  # digests of those read

    def add(self, channel_id: int, body: bytes) -> None:
        """One message record."""
        _, _, log_time, _ = MESSAGE_HEADER.unpack_from(body)
        if log_time > LATEST:
            self.undated += 1
        else:
            data = body[MESSAGE_HEADER.size :] if self.keeps(channel_id) else None
            self.messages.append((channel_id, log_time, data))

    def attach(self, opcode: int, body: bytes) -> None:
        """A header, an attachment or a metadata record: none has poses or commands."""

    def keeps(self, channel_id: int) -> bool:
        """Whether a channel's data is kept: also where what describes it has not come yet."""
        channel = self.channels.get(channel_id)
        if self.wanted is None or channel is None:
            return True
        schema = self.schemas.get(channel.schema_id)
        return channel.schema_id != 0 if schema is None else short_name(schema.name) in self.wanted


def read_all(file: BinaryIO, contents: Contents, damage: list[str], path: Path) -> int | None:
    """Read record by record up to the footer; without one, the byte behind the last whole record.

    No more than one record, or one chunk's records, is in memory besides what `contents` keeps.
    """
    end, unchunked = len(MAGIC), False
    for position, opcode, body in _records(file, len(MAGIC)):
        end = position + RECORD_HEADER.size + len(body)
        try:
            if opcode == Opcode.FOOTER and file.read(len(MAGIC) + 1) == MAGIC:
                return None
            if opcode == Opcode.CHUNK:
                data, checked = _chunk_data(body)
                digest = hashlib.sha256(data).digest()  # no checksum covers the chunk's own head
                if digest in contents.chunks:
                    raise ValueError("it is there twice")
                before = len(contents.messages)
                _read_records(data, contents)
                contents.unchecked += 0 if checked else len(contents.messages) - before
                contents.chunks.add(digest)
            elif opcode == Opcode.DATA_END:
                crc = DataEnd.read(stream_of(body)).data_section_crc
                if crc and crc == _checksum(file, position):
                    contents.unchecked = 0
                elif crc:
                    if unchunked:
                        problem = "wrong checksum over messages outside chunks"
                        raise InputError(f"{path}: {problem}, none can be trusted")
                    if not damage:
                        damage.append("the data section's checksum is wrong though every chunk's is right")
            elif opcode == Opcode.STATISTICS:
                contents.expected = Statistics.read(stream_of(body)).message_count
            else:
                unchunked |= opcode == Opcode.MESSAGE
                contents.unchecked += opcode == Opcode.MESSAGE
                _read_record(opcode, body, contents)
        except InputError:
            raise
        except Exception as error:  # a damaged record fails in any way; it is dropped, and that is said
            name = f"{_record_name(opcode)} of {len(body)} bytes{_chunk_span(opcode, body)}"
            damage.append(f"{name} dropped: {_reason(error)}")
        file.seek(end)
    return end


def _records(stream: BinaryIO, position: int) -> Iterator[tuple[int, int, bytes]]:
    """(offset, opcode, body) of each record from `position` on that is wholly there."""
    size = stream.seek(0, SEEK_END)
    stream.seek(position)
    while position + RECORD_HEADER.size <= size:
        opcode, length = RECORD_HEADER.unpack(stream.read(RECORD_HEADER.size))
        end = position + RECORD_HEADER.size + length
        if end > size:
            return
        yield position, opcode, stream.read(length)
        position = end


def _checksum(file: BinaryIO, end: int) -> int:
    """Of all bytes before `end`."""
    file.seek(0)
    checksum = 0
    while file.tell() < end:
        checksum = zlib.crc32(file.read(min(BLOCK, end - file.tell())), checksum)
    return checksum


def _read_records(data: bytes, contents: Contents) -> None:
    for _, opcode, body in _records(BytesIO(data), 0):
        _read_record(opcode, body, contents)


def _read_record(opcode: int, body: bytes, contents: Contents) -> None:
    if opcode == Opcode.MESSAGE:
        contents.add(MESSAGE_HEADER.unpack_from(body)[0], body)
    elif opcode == Opcode.SCHEMA:
        schema = Schema.read(stream_of(body))
        if contents.schemas.setdefault(schema.id, schema) != schema:
            raise ValueError(f"schema {schema.id} is described before, and differently")
    elif opcode == Opcode.CHANNEL:
        channel = Channel.read(stream_of(body))
        if contents.channels.setdefault(channel.id, channel) != channel:
            raise ValueError(f"channel {channel.id} is described before, and differently")
    elif opcode in (Opcode.HEADER, Opcode.ATTACHMENT, Opcode.METADATA):
        contents.attach(opcode, body)


def _chunk_data(body: bytes) -> tuple[bytes, bool]:
    """The records in a chunk, and whether a checksum says that they are what was written.

    Raises:
        ValueError: they are not.
    """
    chunk = Chunk.read(stream_of(body))
    data = _decompress(chunk.compression, chunk.data, chunk.uncompressed_size)
    if len(data) != chunk.uncompressed_size:
        raise ValueError(f"{len(data)} bytes, expected {chunk.uncompressed_size}")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("wrong checksum")
    return data, bool(chunk.uncompressed_crc)


def _decompress(compression: str, data: bytes, size: int) -> bytes:
    """At most `size` + 1 bytes, so that a damaged chunk takes no more memory than an intact one."""
    if compression == "":
        return data
    if size > LARGEST_EXPANSION * len(data):
        raise ValueError(f"{len(data)} bytes said to expand to {size}")
    if compression == "zstd":
        return zstandard.ZstdDecompressor().stream_reader(data).read(size + 1)
    if compression == "lz4":
        return lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    raise ValueError(f"unknown compression {compression!r}")


def read_cut_chunk(rest: BinaryIO, contents: Contents) -> str:
    """Read the beginning of a last chunk that was cut off; a remark on what came of it."""
    if rest.read(RECORD_HEADER.size)[:1] != bytes([Opcode.CHUNK]):
        return ""
    before, body = len(contents.messages), rest.read()
    try:
        (name_length,) = struct.unpack_from("<I", body, CHUNK_HEADER.size)
        start = CHUNK_HEADER.size + 4 + name_length
        compression, data = body[start - name_length : start].decode(), body[start + 8 :]
        size = min(CHUNK_HEADER.unpack_from(body)[2], LARGEST_EXPANSION * len(data))
        _read_records(_decompress(compression, data, size), contents)
    except Exception:  # what a cut does to a compressed stream is not specified
        pass
    contents.unchecked += len(contents.messages) - before
    return f", {len(contents.messages) - before} messages of the chunk that was cut are readable"


def stream_of(body: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(body))


def _record_name(opcode: int) -> str:
    try:
        return Opcode(opcode).name.lower().replace("_", " ")
    except ValueError:
        return f"record of kind {opcode}"


def _chunk_span(opcode: int, body: bytes) -> str:
    if opcode != Opcode.CHUNK or len(body) < CHUNK_HEADER.size:
        return ""
    start, end, _, _ = CHUNK_HEADER.unpack_from(body)
    return f" ({abs(end - start) / 1e9:.2f} s)"


def _reason(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
