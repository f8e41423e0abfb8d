"""Recordings of ROS 2 as `ros2 bag record` leaves them: folders with a metadata.yaml, SQLite files, compressed files.

A folder is one recording, of one file or of several in order. Layouts: `rosbag2_storage_sqlite3` (schema versions 1 to
4) and `rosbag2_storage` (metadata.yaml of versions 1 to 9). Nothing is written where a recording lies, and SQLite opens
its file as one that nobody changes; one that its recorder did not close is copied elsewhere first, as SQLite completes
such a file from what lies beside it.
"""

import re
import shutil
import sqlite3
import struct
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import zstandard
from mcap.records import Channel, Schema
from omegaconf import OmegaConf
from pydantic import BaseModel, Field, ValidationError

from trunkline.errors import InputError
from trunkline.recordings.logs.bag1 import read_bag1
from trunkline.recordings.logs.mcap_log import Log, by_topic, read_contents, read_log
from trunkline.recordings.logs.records import BLOCK, LARGEST_EXPANSION, Contents
from trunkline.settings import read_yaml

METADATA = "metadata.yaml"
KEY = "rosbag2_bagfile_information"  # under which metadata.yaml has all
STORAGES = {".mcap": "mcap", ".db3": "sqlite3"}
PACKED = (".zstd", ".zst")  # endings of compressed files: of rosbag2, and of the command `zstd`
ROS1 = ".bag"  # the ending of a bag of ROS 1
PATTERNS = (f"*{ROS1}", *(f"*{ending}{packed}" for ending in STORAGES for packed in ("", *PACKED)))
UNCLOSED = ("-wal", "-journal")  # files that SQLite has beside one that is being written
SIZES = struct.Struct(">16xH10xI60xI")  # of an SQLite file's head: bytes a page, pages, whether that number is valid
LISTED = 4  # names of files in a line


class Metadata(BaseModel):
    """What is read of a metadata.yaml; a field that a version lacks has its default."""

    storage_identifier: Literal["sqlite3", "mcap"]
    relative_file_paths: list[str] = Field(min_length=1)
    message_count: int = 0
    compression_format: Literal["", "none", "zstd"] = ""
    compression_mode: str = ""


def bag_folder(path: Path) -> Path | None:
    """The folder of a bag, where `path` is that or its metadata.yaml; None of anything else."""
    folder = path.parent if path.name == METADATA else path
    try:
        with open(folder / METADATA, encoding="utf-8", errors="replace") as file:
            return folder if any(line.lstrip().startswith(KEY) for line in file) else None
    except OSError:
        return None


def recordings_in(folder: Path) -> list[Path]:
    """The recordings of a folder and of those one down, its own first; a bag's folder is one, and the folder itself, if
    it is a bag, goes by its metadata.yaml. Folders that are sessions themselves are left out."""
    inside = [sub for sub in sorted(folder.glob("[!.]*/")) if not (sub / "session.yaml").is_file()]
    bags = [sub for sub in inside if bag_folder(sub)]
    direct = [folder / METADATA] if bag_folder(folder) else _files_in(folder)
    deeper = [file for sub in inside if sub not in bags for file in _files_in(sub) if not file.name.startswith(".")]
    return direct + sorted([*bags, *deeper])


def bag_with(file: Path) -> Path | None:
    """The recording of a bag, as `recordings_in` has it, one of whose files a path below a session names."""
    folder = bag_folder(file.parent)
    return folder if folder is not None and file in _files_in(folder) else None


def data_files(path: Path) -> list[Path]:
    """The files that hold a recording's messages, as far as they are there: a file is its only one."""
    folder = bag_folder(path)
    if folder is None:
        return [path]
    try:
        return [file for file in _files_of(folder, _metadata(folder)) if file.is_file()]
    except InputError:
        return [folder / METADATA]


def recording_name(file: str) -> str:
    """What a recording goes by: the name of its file without the endings, or that of its folder."""
    return re.sub(r"(\.[A-Za-z]\w*)?(\.zstd?)?$", "", Path(file).name)


def read_recording(path: Path, wanted: Collection[str] | None = None) -> Log:
    """Read a log of any kind: an MCAP file, a bag's folder or one of its files by itself, a bag of ROS 1.

    Args: wanted: as for `read_log`.

    Raises:
        InputError: it is missing, is no recording, is named wrongly in its metadata.yaml, or nothing of it is readable.
    """
    folder = bag_folder(path)
    if path.suffix == ROS1 and not path.is_dir():
        bag = Contents(wanted)
        damage = read_bag1(path, bag)
        return Log(path, by_topic(bag, damage), damage, len(bag.messages), bag.unchecked, "a bag of ROS 1")
    if folder is None and path.suffix not in (".db3", *PACKED):
        return read_log(path, wanted)
    if folder is None:
        files, kind = [path], f"rosbag2: {_storage(path)}{_how_packed(path)}, without a {METADATA}"
        expected, damage = 0, []
    else:
        metadata = _metadata(folder)
        files = _files_of(folder, metadata)
        kind, expected = _described(metadata, files), metadata.message_count
        beside = sorted({file.name for file in _files_in(folder)} - {file.name for file in files})
        damage = [f"{_listed(beside)}: not named in {METADATA}, left out"] if beside else []
    whole, errors = Contents(wanted), []
    for file in files:
        part = Contents(wanted)
        try:
            problems = _read_file(file, part)
        except InputError as error:
            errors.append(error)
            continue
        _append(whole, part)
        damage += problems if folder is None else [f"{file.name}: {problem}" for problem in problems]
    if len(errors) == len(files):
        raise errors[0]
    damage += [f"{error}; left out" for error in errors]
    if expected > len(whole.messages):
        damage.append(f"{expected - len(whole.messages)} of {expected} messages lost")
    topics = by_topic(whole, damage)
    return Log(path, topics, damage, len(whole.messages), whole.unchecked, kind)


def _metadata(folder: Path) -> Metadata:
    """Raises InputError, in one line, where it is not as rosbag2 writes it, or names another storage than there is."""
    path = folder / METADATA
    content = OmegaConf.to_container(read_yaml(path), resolve=False)
    block = content.get(KEY) if isinstance(content, dict) else None
    try:
        metadata = Metadata.model_validate(block)
    except ValidationError as error:
        problem = error.errors()[0]
        key = ".".join(map(str, problem["loc"])) or KEY
        expected = problem["msg"].removeprefix("Input should be ")
        what = "missing" if problem["type"] == "missing" else f"found {problem['input']!r:.60}"
        raise InputError(f"{path}: {key}: {what}, expected {expected[0].lower()}{expected[1:]}") from error
    for file in _files_of(folder, metadata):
        if not file.is_file():
            there = _listed(sorted(some.name for some in _files_in(folder))) or "no recording"
            raise InputError(f"{path}: relative_file_paths: found {file.name!r}, expected a file beside it, where "
                             f"there is {there}")  # fmt: skip
        if (storage := _storage(file)) != metadata.storage_identifier:
            raise InputError(f"{path}: storage_identifier: found {metadata.storage_identifier!r} with {file.name}, "
                             f"which is {storage}, expected files of one storage")  # fmt: skip
    return metadata


def _files_of(folder: Path, metadata: Metadata) -> list[Path]:
    """The files that a metadata.yaml names, in order: before version 4 with the folder's name as it was, and one that
    was packed or unpacked since is taken as it is."""
    files = []
    for name in dict.fromkeys(Path(name).name for name in metadata.relative_file_paths):
        bare = name.removesuffix(PACKED[0])
        names = (name, bare, *(bare + ending for ending in PACKED))
        files.append(next((folder / some for some in names if (folder / some).is_file()), folder / name))
    return files


def _files_in(folder: Path) -> list[Path]:
    """Files of recordings in a folder, without those that lie there unpacked too."""
    files = {file for pattern in PATTERNS for file in folder.glob(pattern)}
    return sorted(file for file in files if file.suffix not in PACKED or file.with_suffix("") not in files)


def _storage(file: Path) -> str:
    """By the endings of its name."""
    ending = (file.with_suffix("") if file.suffix in PACKED else file).suffix
    return STORAGES.get(ending, f"{ending or 'without an ending'}")


def _how_packed(file: Path) -> str:
    return ", the file compressed" if file.suffix in PACKED else ""


def _described(metadata: Metadata, files: list[Path]) -> str:
    each = metadata.compression_mode.lower() == "message"
    packed = ", its messages compressed one by one" if each else _how_packed(files[0])
    count = "one file" if len(files) == 1 else f"{len(files)} files"
    return f"rosbag2: {metadata.storage_identifier}{packed}, {count}: {_listed([file.name for file in files])}"


def _listed(names: list[str]) -> str:
    return ", ".join(names if len(names) <= LISTED else [*names[: LISTED - 2], "…", names[-1]])


def _append(whole: Contents, part: Contents) -> None:
    """Add what another file of the recording has, whose numbers of channels and schemas are its own."""
    shift = 1 + max([0, *whole.channels, *whole.schemas])
    for schema in part.schemas.values():
        whole.schemas[schema.id + shift] = replace(schema, id=schema.id + shift)
    for channel in part.channels.values():
        kind = channel.schema_id and channel.schema_id + shift
        whole.channels[channel.id + shift] = replace(channel, id=channel.id + shift, schema_id=kind)
    whole.messages += [(channel + shift, time, data) for channel, time, data in part.messages]
    whole.unchecked += part.unchecked


def _read_file(file: Path, contents: Contents) -> list[str]:
    """Fill `contents` with what a file has; a sentence for each thing that was lost.

    Raises:
        InputError: nothing in it is readable.
    """
    with TemporaryDirectory() as place:
        damage, unpacked = [], None
        try:
            if file.suffix in PACKED:
                unpacked = Path(place) / "unpacked"
                damage += _unpack(file, unpacked)
            if _storage(file) == "mcap":
                return damage + read_contents(file, contents, unpacked)
            with _opened(unpacked or file, Path(place), damage) as database:
                return damage + _read_database(database, contents)
        except (OSError, sqlite3.Error, zstandard.ZstdError, ValueError) as error:
            problem = getattr(error, "strerror", None) or str(error)
            more = f" ({'; '.join(damage)})" if damage else ""
            raise InputError(f"{file}: {problem[0].lower()}{problem[1:]}{more}, expected a recording of rosbag2 in "
                             f"{_storage(file)}") from error  # fmt: skip


def _unpack(file: Path, target: Path) -> list[str]:
    """Write what zstd made smaller, as far as it goes."""
    most, size = LARGEST_EXPANSION * file.stat().st_size, 0
    stream, problem = zstandard.ZstdDecompressor().decompressobj(), ""
    with open(file, "rb") as packed, open(target, "wb") as out:
        while block := stream.unused_data or packed.read(BLOCK):
            stream = zstandard.ZstdDecompressor().decompressobj() if stream.eof else stream
            try:
                size += out.write(stream.decompress(block))
            except zstandard.ZstdError as error:
                if not size:
                    raise
                problem = f"damaged: {error}"
                break
            if size > most:
                raise ValueError(f"{file.stat().st_size} bytes expand to more than {most}")
        if not problem and not stream.eof:
            problem = "cut off"
    return [f"{problem}: unpacked to {size} bytes"] if problem else []


@contextmanager
def _opened(file: Path, place: Path, damage: list[str]) -> Iterator[sqlite3.Connection]:
    """The database of a file, to read; what is unlike a closed one is added to `damage`."""
    beside = [some for end in UNCLOSED if (some := file.with_name(file.name + end)).is_file() and some.stat().st_size]
    if beside:
        damage.append(f"not closed by its recorder: read with {_listed([some.name for some in beside])}")
        copy = place / "copy"
        for some in (file, *beside):
            shutil.copyfile(some, copy.with_name(copy.name + some.name.removeprefix(file.name)))
        address = copy.as_uri()
    else:
        address = file.absolute().as_uri() + "?mode=ro&immutable=1"
        with open(file, "rb") as head:
            start = head.read(SIZES.size).ljust(SIZES.size, b"\0")
        (page, pages, _), size = SIZES.unpack(start), file.stat().st_size
        whole = pages * (65536 if page == 1 else page)
        if start[24:28] == start[92:96] and size < whole:
            damage.append(f"cut off at byte {size} of {whole}")
    with closing(sqlite3.connect(address, uri=True)) as database:
        database.execute("PRAGMA writable_schema=ON")  # of this connection: else nothing of a cut file is read
        yield database


def _read_database(database: sqlite3.Connection, contents: Contents) -> list[str]:
    """Fill `contents` with the messages of a database; a sentence for each thing that was lost.

    Raises:
        sqlite3.Error, ValueError: nothing in it is readable.
    """
    tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not {"topics", "messages"} <= tables:
        raise ValueError(f"found the tables {', '.join(sorted(tables)) or '(none)'} without topics and messages")
    definitions, damage = {}, []
    if "message_definitions" in tables:  # since schema version 4
        query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        try:
            definitions = {schema: (encoding, text) for schema, encoding, text in database.execute(query)}
        except sqlite3.DatabaseError as error:
            damage.append(f"definitions of messages lost: {error}")
    for number, name, schema, encoding in database.execute("SELECT id, name, type, serialization_format FROM topics"):
        kind, text = definitions.get(schema, ("", ""))
        contents.schemas[number] = Schema(number, text.encode(), kind if text else "", schema)
        contents.channels[number] = Channel(number, name, encoding, {}, number)
    chosen = ", ".join(str(number) for number in contents.channels if contents.keeps(number))
    query = f"SELECT id, topic_id, timestamp, CASE WHEN topic_id IN ({chosen}) THEN data END FROM messages"
    rows, problem = _rows(database, query)
    if problem and not rows:
        raise ValueError(problem)
    good = [
        (topic, time, data) for topic, time, data in rows
        if topic in contents.channels and isinstance(time, int)
        and isinstance(data, bytes if contents.keeps(topic) else type(None))
    ]  # fmt: skip
    contents.messages += good
    contents.unchecked += len(good)
    if problem:
        damage.append(f"{problem}: {len(rows)} messages before and behind it are read")
    if len(good) < len(rows):
        damage.append(f"{len(rows) - len(good)} messages of no topic, or without data, lost")
    return damage


def _rows(database: sqlite3.Connection, query: str) -> tuple[list[tuple], str]:
    """Rows in the order of their number, which comes first, without it: all, or those before and behind what is
    damaged, and what SQLite says of that."""
    rows, problem = {}, ""
    for order, sign in (("ASC", 1), ("DESC", -1)):
        last = None
        try:
            for number, *row in database.execute(f"{query} ORDER BY id {order}"):
                if sign < 0 and number in rows:  # read from the other end
                    break
                if last is not None and sign * (number - last) <= 0:
                    raise sqlite3.DatabaseError("rows out of order")
                rows[number], last = tuple(row), number
        except sqlite3.DatabaseError as error:
            problem = str(error)
        if not problem:
            break
    return [rows[number] for number in sorted(rows)], problem
