"""An MCAP log as raw messages per topic; of a damaged one, what can be trusted.

The file is read once from front to back, and every checksum that it carries is checked: each chunk's, and the
data section's. An intact log gives what `mcap.reader.make_reader` gives. From a damaged one come the intact
chunks and the readable beginning of a last chunk that was cut off; what is lost is counted and said.
"""

from collections.abc import Collection
from dataclasses import dataclass, field
from io import SEEK_END
from pathlib import Path

import numpy as np

from trunkline.errors import InputError
from trunkline.recordings.logs.records import MAGIC, Contents, read_all, read_cut_chunk


@dataclass
class Topic:
    """Messages of one topic in log-time order. log_times: (N,) ns. definition: the schema, in `schema_encoding`.

    messages: N, or none where its schema is not wanted.
    """

    name: str
    schema: str
    schema_encoding: str
    definition: bytes
    encoding: str
    messages: list[bytes]
    log_times: np.ndarray


@dataclass
class Log:
    """topics by name; `damage`: one sentence for each thing that was lost, empty for an intact log.

    count: messages read. unchecked: those of them that no checksum covers, so that a flipped bit would go unseen.
    kind: what it is, for people to read, where that is no MCAP file by itself.
    """

    path: Path
    topics: dict[str, Topic]
    damage: list[str] = field(default_factory=list)
    count: int = 0
    unchecked: int = 0
    kind: str = ""


def read_log(path: Path, wanted: Collection[str] | None = None) -> Log:
    """Read a log, salvaging what can be trusted.

    Args:
        wanted: names of schemas ("package/Type"); of the messages of others only the times are kept. By default all
            are wanted.

    Raises:
        InputError: the file is missing, is no MCAP file, or nothing in it can be trusted.
    """
    contents = Contents(wanted)
    damage = read_contents(path, contents)
    topics = by_topic(contents, damage)
    return Log(Path(path), topics, damage, len(contents.messages), contents.unchecked)


def read_contents(path: Path, contents: Contents, unpacked: Path | None = None) -> list[str]:
    """Fill `contents` with what a log has that can be trusted; a sentence for each thing that was lost.

    Args: unpacked: where its bytes are, if `path` holds them compressed.

    Raises:
        InputError: as for `read_log`.
    """
    damage: list[str] = []
    try:
        with open(unpacked or path, "rb") as file:
            size = file.seek(0, SEEK_END)
            file.seek(0)
            if file.read(len(MAGIC)) != MAGIC:
                raise InputError(f"{path}: found no MCAP file ({size} bytes), expected an MCAP log")
            end = read_all(file, contents, damage, path)
            if end is not None:
                file.seek(end)
                damage.append(f"cut off at byte {size}" + read_cut_chunk(file, contents))
    except OSError as error:
        raise InputError(f"{path}: {(error.strerror or str(error)).lower()}, expected an MCAP log") from error
    if contents.expected is not None and contents.expected > len(contents.messages):
        lost = contents.expected - len(contents.messages)
        damage.append(f"{lost} of {contents.expected} messages lost")
    elif contents.expected is not None and contents.expected < len(contents.messages):
        damage.append(f"{len(contents.messages)} messages found, of {contents.expected} by the log's statistics")
    if contents.undated:
        damage.append(f"{contents.undated} messages with a log time beyond the year 2262 lost")
    nameless = sum(channel not in contents.channels for channel, *_ in contents.messages)
    if nameless:
        damage.append(f"{nameless} messages on channels that nothing describes lost")
    return damage


def by_topic(contents: Contents, damage: list[str]) -> dict[str, Topic]:
    """Messages by topic, of all its channels: a recorder opens one for each publisher.

    A topic has one schema and encoding, those of most of its messages; others are left out, and that is said.
    """
    by_topic: dict[str, dict[tuple, list[tuple[int, bytes | None]]]] = {}
    for channel_id, log_time, data in contents.messages:
        channel = contents.channels.get(channel_id)
        if channel is None:
            continue
        schema = contents.schemas.get(channel.schema_id)
        definition_of = (schema.name, schema.encoding, schema.data) if schema else ("", "", b"")
        kind = (*definition_of, channel.message_encoding)
        by_topic.setdefault(channel.topic, {}).setdefault(kind, []).append((log_time, data))
    topics = {}
    for name, kinds in by_topic.items():
        (schema, schema_encoding, definition, encoding), rows = max(kinds.items(), key=lambda item: len(item[1]))
        for kind, others in kinds.items():
            if others is not rows:
                left = f"{len(others)} messages of another schema ({kind[0] or 'none'}, {kind[3]}) left out"
                damage.append(f"{name}: {left}, {len(rows)} are {schema or 'none'}, {encoding}")
        times = np.array([time for time, _ in rows], np.int64)
        order = np.argsort(times, kind="stable")
        messages = [data for _, data in rows if data is not None]
        messages = [messages[i] for i in order] if len(messages) == len(rows) else []
        topics[name] = Topic(name, schema, schema_encoding, definition, encoding, messages, times[order])
    return topics
