"""Files of small bags, row by row: what is read of several, of damaged ones and of packed ones, and what is said."""

import shutil
import sqlite3
import struct
from contextlib import closing

import numpy as np
import pytest
import yaml
import zstandard
from mcap.writer import Writer

from tests.support.bags import TABLES
from trunkline.errors import InputError
from trunkline.recordings.logs import bag2
from trunkline.recordings.logs.bag2 import bag_with, data_files, read_recording, recording_name, recordings_in

TYPES = {"/poses": "geometry_msgs/msg/PoseStamped", "/cmd": "std_msgs/msg/Float64", "/tf": "tf2_msgs/msg/TFMessage"}


def database(path, rows: list, topics=("/poses",), types=None, definitions=None, version=4):
    """A .db3 of rows (topic, time, data)."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with closing(sqlite3.connect(path)) as opened, opened:
        opened.executescript(TABLES[version])
        for number, topic in enumerate(topics, 1):
            values = [number, topic, (types or TYPES)[topic], "cdr", "", ""][: 4 + min(version - 1, 1) + (version == 4)]
            opened.execute(f"INSERT INTO topics VALUES ({', '.join('?' * len(values))})", values)
        for schema, text in (definitions or {}).items():
            opened.execute("INSERT INTO message_definitions VALUES (NULL, ?, 'ros2msg', ?, '')", (schema, text))
        numbers = {topic: number for number, topic in enumerate(topics, 1)}
        values = [(numbers.get(topic, 99), time, data) for topic, time, data in rows]
        opened.executemany("INSERT INTO messages VALUES (NULL, ?, ?, ?)", values)
    return path


def mcap(path, rows: list, first=1, schemaless=()):
    """An .mcap of such rows, whose schemas and channels count from `first`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "wb") as file:
        writer, channels = Writer(file), {}
        writer.start()
        for number in range(1, first):
            writer.register_schema(f"my_lab/msg/Unused{number}", "ros2msg", b"")
        for topic in dict.fromkeys(topic for topic, _, _ in rows):
            schema = 0 if topic in schemaless else writer.register_schema(TYPES[topic], "ros2msg", topic.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        for topic, time, data in rows:
            writer.add_message(channels[topic], time, data, time)
        writer.finish()
    return path


def described(folder, files: list[str], storage="sqlite3", **more):
    """The metadata.yaml of a bag."""
    block = {"version": 9, "storage_identifier": storage, "relative_file_paths": files} | more
    (folder / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": block}))
    return folder


def messages(log, topic="/poses"):
    return list(zip(log.topics[topic].log_times.tolist(), log.topics[topic].messages, strict=True))


def test_rows_by_topic_with_types_definitions_and_times_in_ns(tmp_path):
    rows = [("/cmd", 3, b"c"), ("/poses", 1_767_225_600_123_456_789, b"b"), ("/poses", 7, b"a")]
    definitions = {TYPES["/cmd"]: "float64 data\n"}
    log = read_recording(database(tmp_path / "a.db3", rows, ("/poses", "/cmd"), definitions=definitions))
    assert messages(log) == [(7, b"a"), (1_767_225_600_123_456_789, b"b")]
    assert messages(log, "/cmd") == [(3, b"c")]
    cmd, poses = log.topics["/cmd"], log.topics["/poses"]
    assert (cmd.schema, cmd.schema_encoding, cmd.definition) == (TYPES["/cmd"], "ros2msg", b"float64 data\n")
    assert (poses.schema, poses.schema_encoding, poses.definition) == (TYPES["/poses"], "", b"")
    assert (log.count, log.unchecked, log.damage) == (3, 3, [])
    assert log.kind == "rosbag2: sqlite3, without a metadata.yaml"


def test_of_types_that_nobody_wants_times_alone_are_kept(tmp_path):
    rows = [("/cmd", 3, b"c"), ("/poses", 1, b"a")]
    log = read_recording(database(tmp_path / "a.db3", rows, ("/poses", "/cmd")), {"geometry_msgs/PoseStamped"})
    assert messages(log) == [(1, b"a")]
    assert log.topics["/cmd"].messages == []
    assert log.topics["/cmd"].log_times.tolist() == [3]
    assert (log.count, log.damage) == (2, [])


def test_messages_of_no_topic_and_without_a_time_or_data_are_said(tmp_path):
    rows = [("/poses", 1, b"a"), ("/gone", 2, b"b"), ("/poses", "soon", b"c"), ("/poses", 4, "text"),
            ("/poses", 5, b"d")]  # fmt: skip
    log = read_recording(database(tmp_path / "a.db3", rows))
    assert messages(log) == [(1, b"a"), (5, b"d")]
    assert log.count == 2
    assert log.damage == ["3 messages of no topic, or without data, lost"]


def test_parts_go_by_the_order_of_metadata_and_not_by_their_names(tmp_path):
    """It is the order of messages that came at the same time."""
    names = [f"bag_{number}.db3" for number in (*range(11), 3)]
    for number, name in enumerate(names[:-1]):
        database(tmp_path / name, [("/poses", 7, b"%d" % number)])
    log = read_recording(described(tmp_path, names))
    assert messages(log) == [(7, b"%d" % number) for number in range(11)]
    assert log.kind == "rosbag2: sqlite3, 11 files: bag_0.db3, bag_1.db3, …, bag_10.db3"
    assert (log.count, log.unchecked, log.damage) == (11, 11, [])


def test_parts_count_their_topics_each_for_itself(tmp_path):
    database(tmp_path / "a.db3", [("/poses", 1, b"p1"), ("/cmd", 2, b"c1")], ("/poses", "/cmd"))
    rows = [("/poses", 3, b"p2"), ("/cmd", 4, b"c2"), ("/tf", 5, b"t")]
    database(tmp_path / "b.db3", rows, ("/tf", "/cmd", "/poses"))
    log = read_recording(described(tmp_path, ["a.db3", "b.db3"]))
    assert messages(log) == [(1, b"p1"), (3, b"p2")]
    assert messages(log, "/cmd") == [(2, b"c1"), (4, b"c2")]
    assert messages(log, "/tf") == [(5, b"t")]
    assert {name: topic.schema for name, topic in log.topics.items()} == TYPES
    assert log.damage == []


def test_parts_in_mcap_count_channels_and_schemas_each_for_itself(tmp_path):
    """In the first, schemas count further than channels; in the second a channel has none."""
    mcap(tmp_path / "a.mcap", [("/poses", 1, b"p1")], first=4)
    mcap(tmp_path / "b.mcap", [("/poses", 3, b"p2"), ("/cmd", 2, b"c1"), ("/tf", 4, b"t")], schemaless=("/tf",))
    mcap(tmp_path / "c.mcap", [("/poses", 5, b"p3")])
    log = read_recording(described(tmp_path, ["a.mcap", "b.mcap", "c.mcap"], "mcap"))
    assert messages(log) == [(1, b"p1"), (3, b"p2"), (5, b"p3")]
    assert messages(log, "/cmd") == [(2, b"c1")]
    for name in ("/poses", "/cmd"):
        assert (log.topics[name].schema, log.topics[name].definition) == (TYPES[name], name.encode())
    assert (log.topics["/tf"].schema, log.topics["/tf"].definition) == ("", b"")
    assert log.damage == []


def test_a_topic_that_changes_its_type_between_parts_is_said(tmp_path):
    database(tmp_path / "a.db3", [("/poses", 1, b"a"), ("/poses", 2, b"b")])
    database(tmp_path / "b.db3", [("/poses", 3, b"c")], types={"/poses": "std_msgs/msg/Float64"})
    log = read_recording(described(tmp_path, ["a.db3", "b.db3"]))
    assert messages(log) == [(1, b"a"), (2, b"b")]
    assert log.topics["/poses"].schema == TYPES["/poses"]
    assert log.damage == ["/poses: 1 messages of another schema (std_msgs/msg/Float64, cdr) left out, 2 are "
                          "geometry_msgs/msg/PoseStamped, cdr"]  # fmt: skip


@pytest.mark.parametrize(("expected", "damage"), [(0, []), (1, []), (2, []), (5, ["3 of 5 messages lost"])])
def test_the_count_of_metadata_is_compared(tmp_path, expected, damage):
    database(tmp_path / "a.db3", [("/poses", 1, b"a"), ("/poses", 2, b"b")])
    log = read_recording(described(tmp_path, ["a.db3"], message_count=expected))
    assert (log.count, log.damage) == (2, damage)


def test_a_part_of_which_nothing_is_readable_and_one_that_is_not_named(tmp_path):
    database(tmp_path / "a.db3", [("/poses", 1, b"a"), ("/none", 2, b"b")])
    (tmp_path / "b.db3").write_bytes(b"not a database" * 100)
    database(tmp_path / "c.db3", [("/poses", 3, b"c")])
    log = read_recording(described(tmp_path, ["a.db3", "b.db3"], message_count=9))
    assert messages(log) == [(1, b"a")]
    assert log.damage == [
        "c.db3: not named in metadata.yaml, left out",
        "a.db3: 1 messages of no topic, or without data, lost",
        f"{tmp_path}/b.db3: file is not a database, expected a recording of rosbag2 in sqlite3; left out",
        "8 of 9 messages lost",
    ]
    (tmp_path / "a.db3").write_bytes(b"")
    with pytest.raises(InputError, match=r"a\.db3: found the tables \(none\) without topics and messages, expected"):
        read_recording(tmp_path)


@pytest.mark.parametrize(
    ("files", "storage", "line"),
    [
        (["a.db3"], "mcap", "found 'mcap' with a.db3, which is sqlite3, expected files of one storage"),
        (["a.db3", "b.mcap"], "sqlite3", "found 'sqlite3' with b.mcap, which is mcap, expected files of one storage"),
    ],
)
def test_files_of_two_storages_are_refused(tmp_path, files, storage, line):
    database(tmp_path / "a.db3", [("/poses", 1, b"a")])
    mcap(tmp_path / "b.mcap", [("/poses", 2, b"b")])
    with pytest.raises(InputError, match=f"metadata.yaml: storage_identifier: {line}"):
        read_recording(described(tmp_path, files, storage))


@pytest.mark.parametrize("named", ["old_name/a.db3", "/home/lab/old_name/a.db3", "a.db3"])
def test_names_with_the_folder_as_it_was(tmp_path, named):
    database(tmp_path / "a.db3", [("/poses", 1, b"a")])
    assert messages(read_recording(described(tmp_path, [named]))) == [(1, b"a")]


# packed


@pytest.mark.parametrize("ending", [".zstd", ".zst"])
@pytest.mark.parametrize("storage", ["db3", "mcap"])
@pytest.mark.parametrize("frames", [1, 3])
def test_packed_files(tmp_path, ending, storage, frames):
    """Of one frame of zstd or of several, as `zstd` and `pzstd` write them."""
    rows = [("/poses", time, bytes([time])) for time in range(100)]
    plain = (database if storage == "db3" else mcap)(tmp_path / f"plain/a.{storage}", rows).read_bytes()
    bounds = np.linspace(0, len(plain), frames + 1).astype(int)
    pack = zstandard.ZstdCompressor().compress
    file = tmp_path / f"a.{storage}{ending}"
    file.write_bytes(b"".join(pack(plain[i:j]) for i, j in zip(bounds[:-1], bounds[1:], strict=True)))
    log = read_recording(file)
    assert messages(log) == [(time, data) for _, time, data in rows]
    assert log.damage == []
    assert log.kind.startswith("rosbag2: ")
    assert log.kind.endswith(", the file compressed, without a metadata.yaml")
    assert recordings_in(tmp_path) == [file, tmp_path / f"plain/a.{storage}"]


def test_a_packed_file_that_is_cut_off_gives_the_frames_that_it_has(tmp_path):
    plain = mcap(tmp_path / "a.mcap", [("/poses", time, bytes([time])) for time in range(100)]).read_bytes()
    pack, half = zstandard.ZstdCompressor().compress, len(plain) // 2
    file = tmp_path / "a.mcap.zstd"
    file.write_bytes(pack(plain[:half]) + pack(plain[half:])[:-5])
    log = read_recording(file)
    assert log.damage == [f"cut off: unpacked to {half} bytes", f"cut off at byte {half}"]
    assert log.count == 100  # what is lost is behind them


def test_a_small_file_that_unpacks_to_too_much_is_refused(tmp_path):
    file = tmp_path / "a.db3.zstd"
    file.write_bytes(zstandard.ZstdCompressor(level=19).compress(bytes(50_000_000)))
    size = file.stat().st_size
    with pytest.raises(InputError, match=rf"a\.db3\.zstd: {size} bytes expand to more than {1000 * size}"):
        read_recording(file)


@pytest.mark.parametrize("mode", ["MESSAGE", "message"])
def test_messages_that_are_packed_one_by_one_are_named_so(tmp_path, mode):
    database(tmp_path / "a.db3", [("/poses", 1, b"a")])
    described(tmp_path, ["a.db3"], compression_mode=mode, compression_format="zstd")
    assert read_recording(tmp_path).kind == (
        "rosbag2: sqlite3, its messages compressed one by one, one file: a.db3")  # fmt: skip


# what its recorder did not close


def unended(folder, mode: str):
    """A database of rows 1 and 2, copied while 3 and 4 are being written in a transaction that is never ended; with
    what SQLite has beside it."""
    file = database(folder / "own/a.db3", [("/poses", 1, b"a" * 3000), ("/poses", 2, b"b" * 3000)])
    with closing(sqlite3.connect(file, isolation_level=None)) as writing:
        writing.execute(f"PRAGMA journal_mode={mode}")
        writing.execute("PRAGMA wal_autocheckpoint=0")
        writing.execute("PRAGMA cache_size=1")  # pages are written before the transaction ends
        if mode == "WAL":
            writing.execute("INSERT INTO messages VALUES (NULL, 1, 3, ?)", (b"c" * 3000,))
        writing.execute("BEGIN")
        for time in range(10, 60):
            writing.execute("INSERT INTO messages VALUES (NULL, 1, ?, ?)", (time, b"d" * 3000))
        writing.execute("UPDATE messages SET timestamp = 99 WHERE timestamp < 3")
        (folder / "copy").mkdir()
        for path in (folder / "own").iterdir():
            if not path.name.endswith("-shm"):
                shutil.copy(path, folder / "copy")
        writing.execute("ROLLBACK")
    return folder / "copy/a.db3"


@pytest.mark.parametrize(("mode", "beside", "times"), [("DELETE", "-journal", [1, 2]), ("WAL", "-wal", [1, 2, 3])])
def test_a_transaction_that_was_not_ended_did_not_happen(tmp_path, mode, beside, times):
    file = unended(tmp_path, mode)
    assert sorted(path.name for path in file.parent.iterdir()) == ["a.db3", f"a.db3{beside}"]
    before = {path: path.read_bytes() for path in file.parent.iterdir()}
    log = read_recording(file)
    assert log.topics["/poses"].log_times.tolist() == times
    assert log.damage == [f"not closed by its recorder: read with a.db3{beside}"]
    assert {path: path.read_bytes() for path in file.parent.iterdir()} == before


def test_a_file_is_read_as_one_that_nobody_changes(tmp_path):
    """SQLite asks for no lock, which it would have to write."""
    file = database(tmp_path / "a.db3", [("/poses", 1, b"a")])
    with closing(sqlite3.connect(file, isolation_level=None)) as recorder:
        recorder.execute("BEGIN EXCLUSIVE")
        assert messages(read_recording(file)) == [(1, b"a")]


# damage


def pages_of(file) -> tuple[bytearray, int]:
    data = bytearray(file.read_bytes())
    return data, struct.unpack(">H", data[16:18])[0]


def test_what_lies_behind_a_damaged_page_comes_in_its_order(tmp_path):
    """Of the same time, so that no sorting by time hides it."""
    rows = [("/poses", 7, b"<%04d>" % number * 300) for number in range(60)]
    file = database(tmp_path / "a.db3", rows)
    data, page = pages_of(file)
    start = data.index(b"<0030>" * 100) // page * page
    data[start : start + page] = b"\xff" * page
    file.write_bytes(data)
    log = read_recording(file)
    numbers = [int(data[1:5]) for _, data in messages(log)]
    assert numbers == sorted(numbers)
    assert set(range(60)) - set(numbers) <= set(range(27, 33))
    assert 30 not in numbers
    assert log.damage == [f"database disk image is malformed: {len(numbers)} messages before and behind it are read"]


class Torn:
    """A database whose rows are out of order from the fourth on, and from the other end from the second on."""

    def execute(self, query: str) -> list:
        return [(1, "a"), (2, "b"), (5, "e"), (3, "c")] if query.endswith("ASC") else [(9, "i"), (10, "j")]


def test_rows_of_a_torn_table_are_those_before_they_leave_their_order():
    rows, problem = bag2._rows(Torn(), "SELECT")
    assert rows == [("a",), ("b",), ("e",), ("i",)]
    assert problem == "rows out of order"


@pytest.mark.parametrize("size", [512, 4096, 65536])
def test_a_file_that_is_cut_off_is_said_with_its_size(tmp_path, size):
    """Pages of 65,536 bytes are written as 1."""
    with closing(sqlite3.connect(tmp_path / "a.db3")) as opened:
        opened.execute(f"PRAGMA page_size={size}")
        opened.execute("VACUUM")
    file = database(tmp_path / "a.db3", [("/poses", time, bytes(2000)) for time in range(400)])
    whole = file.read_bytes()
    assert read_recording(file).damage == []
    file.write_bytes(whole[: len(whole) - 3 * size // 2])
    log = read_recording(file)
    assert log.damage[0] == f"cut off at byte {len(whole) - 3 * size // 2} of {len(whole)}"
    assert 0 < log.count < 400


# what is a recording


def test_recordings_of_a_folder(tmp_path):
    database(tmp_path / "own.db3", [])
    database(tmp_path / "day/b.db3", [])
    (tmp_path / "day/b.db3.zstd").write_bytes(b"")
    (tmp_path / "day/.hidden.db3").write_bytes(b"")
    database(tmp_path / "bag/bag_0.db3", [])
    described(tmp_path / "bag", ["bag_0.db3"])
    database(tmp_path / "other/c.db3", [])
    (tmp_path / "other/session.yaml").write_text("")
    database(tmp_path / ".cache/d.db3", [])
    (tmp_path / "day/metadata.yaml").write_text("author: me\n")
    assert recordings_in(tmp_path) == [tmp_path / name for name in ("own.db3", "bag", "day/b.db3")]
    assert recordings_in(tmp_path / "bag") == [tmp_path / "bag/metadata.yaml"]
    assert bag_with(tmp_path / "bag/bag_0.db3") == tmp_path / "bag"
    assert bag_with(tmp_path / "day/b.db3") is None


def test_files_that_hold_a_recording(tmp_path):
    for name in ("a.db3", "b.db3"):
        database(tmp_path / name, [])
    described(tmp_path, ["b.db3", "a.db3"])
    assert data_files(tmp_path) == [tmp_path / "b.db3", tmp_path / "a.db3"]
    assert data_files(tmp_path / "metadata.yaml") == data_files(tmp_path)
    assert data_files(tmp_path / "a.db3") == [tmp_path / "a.db3"]
    described(tmp_path, ["c.db3"])
    assert data_files(tmp_path) == [tmp_path / "metadata.yaml"]


@pytest.mark.parametrize(
    ("file", "name"),
    [("day/run_1.mcap", "run_1"), ("run.db3", "run"), ("run.db3.zstd", "run"), ("run.mcap.zst", "run"),
     ("bag", "bag"), ("v1.2_run.mcap", "v1.2_run")],
)  # fmt: skip
def test_names_of_recordings(file, name):
    assert recording_name(file) == name


def test_endings_of_packed_files():
    assert {pattern for pattern in bag2.PATTERNS if "zst" in pattern} == {
        "*.mcap.zstd", "*.mcap.zst", "*.db3.zstd", "*.db3.zst"}  # fmt: skip
