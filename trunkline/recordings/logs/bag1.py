"""Bags of ROS 1 (`.bag`, format 2.0), read by the library rosbags: their messages as ROS 2 would have written them.

`rosbag record` puts each message's definition into the bag, so that messages of any type become CDR with a definition.
"""

from collections.abc import Callable
from pathlib import Path

from mcap.records import Channel, Schema
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from trunkline.errors import InputError
from trunkline.recordings.logs.records import Contents

HEADER = "std_msgs/msg/Header"  # of ROS 1 with a `seq` besides, which `ros1_to_cdr` leaves out
RENAMED = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}


def read_bag1(path: Path, contents: Contents) -> list[str]:
    """Fill `contents` with the messages of a bag; a sentence for each thing that was lost.

    Raises:
        InputError: it is missing, is no bag of ROS 1, or has no index, as one that its recorder did not close.
    """
    try:
        with Reader(path) as reader:
            return _read(reader, contents)
    except Exception as error:  # a damaged bag fails in any way
        problem = (getattr(error, "strerror", None) or str(error) or type(error).__name__).rstrip(".")
        remedy = "`rosbag reindex` closes one that its recorder did not"
        raise InputError(f"{path}: {problem[0].lower()}{problem[1:]}, expected a bag of ROS 1; {remedy}") from error


def _read(reader: Reader, contents: Contents) -> list[str]:
    damage, converters = [], {}
    for connection in reader.connections:
        number = connection.id + 1  # 0 would be no schema
        try:
            text, converters[connection.id] = _definition(connection)
        except Exception as error:  # of a text that is no definition
            kind = f"{connection.topic}: the definition of {connection.msgtype}"
            damage.append(f"{kind} cannot be read: {error}; left out")
            continue
        name = RENAMED.get(connection.msgtype, connection.msgtype)
        contents.schemas[number] = Schema(number, text.encode(), "ros2msg", name)
        contents.channels[number] = Channel(number, connection.topic, "cdr", {}, number)
    readable = [connection for connection in reader.connections if connection.id in converters]
    expected, count = sum(connection.msgcount for connection in readable), 0
    try:
        for connection, time, raw in reader.messages(readable) if readable else ():
            number, count = connection.id + 1, count + 1
            data = _converted(converters[connection.id], raw) if contents.keeps(number) else None
            contents.messages.append((number, time, data))
    except Exception as error:
        problem = str(error) or type(error).__name__
        damage.append(f"damaged: {problem}; {expected - count} of {expected} messages lost")
    contents.unchecked += count  # a bag has no checksums
    return damage


def _definition(connection: Connection) -> tuple[str, Callable[[bytes], memoryview]]:
    """What a connection's messages are in the words of ROS 2, and what makes such messages of them."""
    kind, store = connection.msgtype, get_typestore(Stores.EMPTY)
    header = get_typestore(Stores.LATEST).fielddefs[HEADER]
    store.register(get_types_from_msg(connection.msgdef.data, kind) | {HEADER: header})
    text, _ = store.generate_msgdef(kind, ros_version=2)
    return text, lambda raw: store.ros1_to_cdr(raw, kind)


def _converted(convert: Callable[[bytes], memoryview], raw: bytes) -> bytes:
    """In CDR; nothing, which fits no schema and is counted as such, where it does not fit its own."""
    try:
        return bytes(convert(raw))
    except Exception:  # generated code fails in any way
        return b""
