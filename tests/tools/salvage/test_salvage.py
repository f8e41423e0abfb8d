"""What a damaged log still has comes out as a log that other programs read, and what was lost is said."""

from io import BytesIO

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from trunkline.tools.salvage.__main__ import main

COUNT = 400


def log(chunk_size=2000) -> bytes:
    """Two topics, of which one has a schema, with all that a message and a channel have, metadata, an attachment."""
    file = BytesIO()
    writer = Writer(file, chunk_size=chunk_size)
    writer.start(profile="ros2", library="a recorder")
    schema = writer.register_schema("a_msgs/msg/A", "ros2msg", b"float64 x")
    poses = writer.register_channel("/poses", "cdr", schema, {"offered_qos_profiles": "- depth: 5"})
    others = writer.register_channel("/others", "json", 0)
    for number in range(COUNT):
        channel = others if number % 4 == 0 else poses
        writer.add_message(channel, 1000 * number + 9, bytes([number % 256]) * 40, 1000 * number, 3 * number)
    writer.add_attachment(5, 6, "notes.txt", "text/plain", b"two poses were swapped")
    writer.add_metadata("session", {"operator": "a"})
    writer.finish()
    return file.getvalue()


def contents(data: bytes) -> list[tuple]:
    """Everything that the `mcap` library reads."""
    reader = make_reader(BytesIO(data), validate_crcs=True)
    rows = [
        (channel.topic, channel.message_encoding, channel.metadata, schema and (schema.name, schema.data),
         message.log_time, message.publish_time, message.sequence, message.data)
        for schema, channel, message in reader.iter_messages()
    ]  # fmt: skip
    attached = [(a.name, a.media_type, a.create_time, a.log_time, a.data) for a in reader.iter_attachments()]
    metadata = [(m.name, m.metadata) for m in reader.iter_metadata()]
    return [reader.get_header().profile, *rows, *attached, *metadata]


def test_a_whole_log_comes_out_as_it_is(tmp_path, capsys):
    (tmp_path / "in.mcap").write_bytes(log())
    assert main([str(tmp_path / "in.mcap"), str(tmp_path / "out.mcap")]) == 0
    assert contents((tmp_path / "out.mcap").read_bytes()) == contents(log())
    assert f"{COUNT} messages on 2 topics, 0 losses" in capsys.readouterr().out


@pytest.mark.parametrize("harm", ["a wrong byte in a chunk", "cut off"])
def test_what_is_left_of_a_damaged_one_is_read_elsewhere_and_the_loss_is_said(harm, tmp_path, capsys):
    data = bytearray(log())
    if harm == "cut off":
        del data[len(data) // 2 :]
    else:
        data[len(data) // 3] ^= 8
    (tmp_path / "in.mcap").write_bytes(data)
    assert main([str(tmp_path / "in.mcap"), str(tmp_path / "out.mcap")]) == 1
    whole, left = contents(log()), contents((tmp_path / "out.mcap").read_bytes())
    assert COUNT // 4 < len(left) < len(whole)
    assert [row for row in whole if row in left] == left  # nothing made up, and in order
    assert "in.mcap: " in capsys.readouterr().err


def test_a_log_with_nothing_left_and_one_that_is_there_already_are_refused(tmp_path, capsys):
    (tmp_path / "in.mcap").write_bytes(log()[:60])
    assert main([str(tmp_path / "in.mcap"), str(tmp_path / "out.mcap")]) == 1
    assert "found no readable message" in capsys.readouterr().err
    (tmp_path / "in.mcap").write_bytes(log())
    (tmp_path / "out.mcap").write_bytes(b"of value")
    assert main([str(tmp_path / "in.mcap"), str(tmp_path / "out.mcap")]) == 1
    assert "out.mcap: found a file, expected a name that is free" in capsys.readouterr().err
    assert (tmp_path / "out.mcap").read_bytes() == b"of value"
    assert main([str(tmp_path / "in.mcap"), str(tmp_path / "nowhere/out.mcap")]) == 1
    assert "nowhere: found no such folder" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.mcap", "out.mcap"]
