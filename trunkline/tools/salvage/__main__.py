"""A whole MCAP log of what a damaged one still has: `trunkline salvage DAMAGED.mcap WHOLE.mcap`

Messages keep their bytes, times and sequence numbers, channels their metadata; attachments and metadata records go
along. What was lost is said, a line each, and the exit code is then 1. The stages read damaged logs as they are, by the
same rules; this is for other programs, which give up at the first damaged record.
"""

import sys
from dataclasses import dataclass, field
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Attachment, Header, Message, Metadata
from mcap.writer import Writer

from trunkline.errors import InputError, in_one_line
from trunkline.files import written_whole
from trunkline.program import COMMAND, command_parser
from trunkline.recordings.logs.mcap_log import read_contents
from trunkline.recordings.logs.records import Contents, stream_of


@dataclass
class WholeRecords(Contents):
    """records: messages as they are in the log; attachments and metadata likewise. profile: of the log's header."""

    profile: str = ""
    records: list[Message] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)
    metadata: list[Metadata] = field(default_factory=list)

    def add(self, channel_id: int, body: bytes) -> None:
        before = len(self.messages)
        super().add(channel_id, body)
        if len(self.messages) > before:
            self.records.append(Message.read(stream_of(body), len(body)))

    def attach(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.HEADER:
            self.profile = Header.read(stream_of(body)).profile
        elif opcode == Opcode.ATTACHMENT:
            self.attachments.append(Attachment.read(stream_of(body)))
        else:
            self.metadata.append(Metadata.read(stream_of(body)))


def write_whole(path: Path, contents: WholeRecords) -> None:
    """A log of these records, in the order of their log times; complete, or not there."""
    with written_whole(path) as part, open(part, "wb") as file:
        writer = Writer(file)
        writer.start(profile=contents.profile, library=COMMAND)
        schemas = {
            schema.id: writer.register_schema(schema.name, schema.encoding, schema.data)
            for schema in contents.schemas.values()
        }
        channels = {
            channel.id: writer.register_channel(
                channel.topic, channel.message_encoding, schemas.get(channel.schema_id, 0), channel.metadata
            )
            for channel in contents.channels.values()
        }
        for record in sorted(contents.records, key=lambda record: record.log_time):
            if record.channel_id in channels:
                channel, times = channels[record.channel_id], (record.log_time, record.publish_time)
                writer.add_message(channel, times[0], record.data, times[1], record.sequence)
        for attachment in contents.attachments:
            writer.add_attachment(
                attachment.create_time, attachment.log_time, attachment.name, attachment.media_type, attachment.data
            )
        for metadata in contents.metadata:
            writer.add_metadata(metadata.name, metadata.metadata)
        writer.finish()


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("salvage", __doc__)
    parser.add_argument("damaged", type=Path, metavar="DAMAGED.mcap")
    parser.add_argument("whole", type=Path, metavar="WHOLE.mcap", help="is written; must not be there yet")
    chosen = parser.parse_args(arguments)
    if chosen.whole.exists():
        raise InputError(f"{chosen.whole}: found a file, expected a name that is free")
    if not chosen.whole.parent.is_dir():
        raise InputError(f"{chosen.whole.parent}: found no such folder, expected one to write {chosen.whole.name} into")
    contents = WholeRecords()
    damage = read_contents(chosen.damaged, contents)
    if not contents.records:
        raise InputError(f"{chosen.damaged}: found no readable message ({'; '.join(damage) or 'it is empty'})")
    write_whole(chosen.whole, contents)
    for sentence in damage:
        print(f"salvage: {chosen.damaged}: {sentence}", file=sys.stderr)
    topics = len({contents.channels[r.channel_id].topic for r in contents.records if r.channel_id in contents.channels})
    print(f"{chosen.whole}: {len(contents.records)} messages on {topics} topics, {len(damage)} losses")
    return 1 if damage else 0


if __name__ == "__main__":
    sys.exit(main())
