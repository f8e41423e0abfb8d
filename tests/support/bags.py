"""Bags of ROS 2 made of an MCAP log: the tables and files that `ros2 bag record` writes, in each of its versions.

As `rosbag2_storage_sqlite3` creates its tables and `rosbag2_storage` writes metadata.yaml, from the release of each.
"""

import sqlite3
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
import zstandard
from mcap.writer import Writer
from rosbags.rosbag1 import Writer as Writer1
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from trunkline.recordings.logs.mcap_log import Log, read_log

HEADER1 = "std_msgs/msg/Header"
QOS = "- history: 3\n  depth: 0\n  reliability: 1\n  durability: 1\n  avoid_ros_namespace_conventions: false"
TOPICS = "id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL"
MESSAGES = """CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
data BLOB NOT NULL); CREATE INDEX timestamp_idx ON messages (timestamp ASC);"""
TABLES = {
    1: f"CREATE TABLE topics({TOPICS}); {MESSAGES}",
    2: f"CREATE TABLE topics({TOPICS}, offered_qos_profiles TEXT NOT NULL); {MESSAGES}",
}
TABLES[3] = TABLES[2] + """CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);"""
TABLES[4] = TABLES[3] + """ALTER TABLE topics ADD COLUMN type_description_hash TEXT NOT NULL DEFAULT '';
CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);"""


@dataclass(frozen=True)
class Kind:
    """storage: sqlite3 or mcap. tables: version of the database's schema. metadata: version of metadata.yaml, 0 for
    none. packed: "", "file" or "message". parts: files of the recording."""

    storage: str = "sqlite3"
    tables: int = 4
    metadata: int = 9
    packed: str = ""
    parts: int = 1

    @property
    def ending(self) -> str:
        return (".mcap" if self.storage == "mcap" else ".db3") + (".zstd" if self.packed == "file" else "")


KINDS = {
    "foxy": Kind(tables=2, metadata=4),
    "eloquent": Kind(tables=1, metadata=3),
    "humble": Kind(tables=3, metadata=5, parts=3),
    "iron": Kind(tables=4, metadata=7),
    "jazzy": Kind(tables=4, metadata=9, parts=2),
    "alone": Kind(metadata=0),
    "alone, packed": Kind(metadata=0, packed="file"),
    "file": Kind(metadata=6, packed="file", parts=2),
    "message": Kind(metadata=8, packed="message"),
    "mcap": Kind("mcap", metadata=9),
    "mcap split": Kind("mcap", metadata=6, parts=3),
    "mcap file": Kind("mcap", metadata=8, packed="file", parts=2),
    "mcap message": Kind("mcap", metadata=5, packed="message"),
    "mcap alone, packed": Kind("mcap", metadata=0, packed="file"),
}


def as_bag(log: Path, target: Path, kind: Kind) -> Path:
    """The messages of an MCAP log as a bag, the folder `target`; without metadata.yaml the file of that name."""
    source = read_log(log)
    rows = [(time, topic.name, data) for topic in source.topics.values()
            for time, data in zip(topic.log_times.tolist(), topic.messages, strict=True)]  # fmt: skip
    rows.sort(key=lambda row: row[0])
    if kind.packed == "message":
        rows = [(time, topic, zstandard.ZstdCompressor().compress(data)) for time, topic, data in rows]
    if not kind.metadata:
        target = target.with_name(target.name + kind.ending)
        _write_file(target, source, rows, kind)
        return target
    target.mkdir(parents=True)
    bounds = np.linspace(0, len(rows), kind.parts + 1).astype(int)
    parts = {f"{target.name}_{number}{kind.ending}": rows[bounds[number] : bounds[number + 1]]
             for number in range(kind.parts)}  # fmt: skip
    for name, some in parts.items():
        _write_file(target / name, source, some, kind)
    (target / "metadata.yaml").write_text(yaml.safe_dump(_metadata(target.name, source, parts, kind), sort_keys=False))
    return target


def as_bag1(
    log: Path, target: Path, packed: Writer1.CompressionFormat | None = None, chunk: int = 2**20, spoil: str = "",
    renamed: str = "",
) -> Path:  # fmt: skip
    """The messages of an MCAP log as a bag of ROS 1, in chunks of some `chunk` bytes. spoil: a topic with a definition
    that is none. renamed: another name of their type."""
    source, writer = read_log(log), Writer1(target)
    writer.chunk_threshold = chunk
    if packed is not None:
        writer.set_compression(packed)
    with writer:
        rows = []
        for topic in source.topics.values():
            store = get_typestore(Stores.EMPTY)
            store.register(get_types_from_msg(topic.definition.decode(), topic.schema))
            header = {HEADER1: get_typestore(Stores.ROS1_NOETIC).fielddefs[HEADER1]}
            ros1 = get_typestore(Stores.EMPTY)
            ros1.register(dict(store.fielddefs) | header)
            text, digest = ros1.generate_msgdef(topic.schema)
            text = "float64 1x\n" if topic.name == spoil else text
            connection = writer.add_connection(topic.name, renamed or topic.schema, msgdef=text, md5sum=digest)
            rows += [(time, connection, store.cdr_to_ros1(data, topic.schema))
                     for time, data in zip(topic.log_times.tolist(), topic.messages, strict=True)]  # fmt: skip
        for time, connection, data in sorted(rows, key=lambda row: row[0]):
            writer.write(connection, time, data)
    return target


def _write_file(path: Path, source: Log, rows: list, kind: Kind) -> None:
    plain = path.with_suffix("") if kind.packed == "file" else path
    (_write_mcap if kind.storage == "mcap" else _write_database)(plain, source, rows, kind)
    if kind.packed == "file":
        path.write_bytes(zstandard.ZstdCompressor().compress(plain.read_bytes()))
        plain.unlink()


def _write_database(path: Path, source: Log, rows: list, kind: Kind) -> None:
    with closing(sqlite3.connect(path)) as database, database:
        database.executescript(TABLES[kind.tables])
        extra = min(kind.tables - 1, 1) + (kind.tables == 4)
        for number, topic in enumerate(source.topics.values(), 1):
            values = [number, topic.name, topic.schema, topic.encoding, QOS, "RIHS01_0"][: 4 + extra]
            database.execute(f"INSERT INTO topics VALUES ({', '.join('?' * len(values))})", values)
            if kind.tables == 4:
                definition = (topic.schema, topic.schema_encoding, topic.definition.decode(), "RIHS01_0")
                database.execute("INSERT INTO message_definitions VALUES (NULL, ?, ?, ?, ?)", definition)
        if kind.tables > 2:
            database.execute("INSERT INTO schema VALUES (?, 'jazzy')", (kind.tables,))
        numbers = {name: number for number, name in enumerate(source.topics, 1)}
        database.executemany(
            "INSERT INTO messages VALUES (NULL, ?, ?, ?)", [(numbers[topic], time, data) for time, topic, data in rows]
        )


def _write_mcap(path: Path, source: Log, rows: list, kind: Kind) -> None:
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="rosbag2")
        channels = {}
        for topic in source.topics.values():
            schema = writer.register_schema(topic.schema, topic.schema_encoding, topic.definition)
            channels[topic.name] = writer.register_channel(topic.name, topic.encoding, schema)
        for time, topic, data in rows:
            writer.add_message(channels[topic], time, data, time)
        writer.finish()


def _metadata(folder: str, source: Log, parts: dict[str, list], kind: Kind) -> dict:
    """As version `kind.metadata` has it."""
    def span(rows):
        start = rows[0][0] if rows else 0
        end = rows[-1][0] if rows else 0
        return {"starting_time": {"nanoseconds_since_epoch": start}, "duration": {"nanoseconds": end - start},
                "message_count": len(rows)}  # fmt: skip

    rows = [row for some in parts.values() for row in some]
    version = kind.metadata
    topics = []
    for topic in source.topics.values():
        about = {"name": topic.name, "type": topic.schema, "serialization_format": topic.encoding}
        if version >= 4:
            about["offered_qos_profiles"] = QOS if version < 9 else yaml.safe_load(QOS)
        if version >= 7:
            about["type_description_hash"] = "RIHS01_0"
        count = sum(name == topic.name for _, name, _ in rows)
        topics.append({"topic_metadata": about, "message_count": count})
    content = {"version": version, "storage_identifier": kind.storage, **span(rows),
               "topics_with_message_count": topics}  # fmt: skip
    if version >= 3:
        packing = {"compression_format": "zstd" if kind.packed else "", "compression_mode": kind.packed.upper()}
        content |= packing
    content["relative_file_paths"] = [name if version >= 4 else f"{folder}/{name}" for name in parts]
    if version >= 5:
        content["files"] = [{"path": name, **span(some)} for name, some in parts.items()]
    if version >= 6:
        content["custom_data"] = None
    if version >= 8:
        content["ros_distro"] = "jazzy"
    return {"rosbag2_bagfile_information": content}
