"""The wire's table for others: a module of the client, and the tables of docs/live-sessions.md.

    python -m upkeep.wire_table [CHECKOUT]

writes `client/src/wire_table.js` and the generated blocks of `docs/live-sessions.md` of a checkout, by default this
one.
"""

import json
import sys
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Literal, get_args, get_origin

from trunkline.ar.session import binary, messages
from trunkline.ar.session.binary import BinaryMessage
from trunkline.errors import InputError, in_one_line

MODULE, PAGE = Path("client/src/wire_table.js"), Path("docs/live-sessions.md")
COMMAND = "python -m upkeep.wire_table"


def table() -> dict:
    """All of it, as JSON has it; offsets and sizes in bytes."""
    offset, head = 0, {}
    for name, kind in binary.HEAD:
        head[name] = {"type": kind, "offset": offset}
        offset += {"u8": 1, "u16": 2, "u32": 4, "f64": 8}[kind]
    return {
        "VERSION": binary.VERSION,
        "HEAD": head,
        "HEAD_BYTES": binary.HEAD_BYTES,
        "INPUT_BYTES": binary.INPUT_BYTES,
        "POSE": list(binary.POSE),
        "HAND": list(binary.HAND),
        "POINT": list(binary.POINT),
        "HANDS": list(binary.HANDS),
        "MARKERS": list(binary.MARKERS),
        "FROM_SERVER": {name: _kind(kind) for name, kind in binary.FROM_SERVER.items()},
        "FROM_CLIENT": {name: _kind(kind) for name, kind in binary.FROM_CLIENT.items()},
        "CLIENT_MESSAGES": {_type(kind): _fields(kind) for kind in messages.CLIENT_MESSAGES},
        "SERVER_MESSAGES": {_type(kind): _fields(kind) for kind in messages.SERVER_MESSAGES},
    }


def module() -> str:
    """The client's, in JavaScript."""
    lines = [f"// Written by `{COMMAND}` from trunkline/ar/session/binary.py and messages.py; do not edit."]
    for name, value in table().items():
        lines.append(f"export const {name} = {json.dumps(value, indent=2 if isinstance(value, dict) else None)};")
    return "\n".join(lines) + "\n"


def blocks() -> dict[str, str]:
    """Contents of the generated blocks of the page, by name."""
    head = ["| field | type |", "|---|---|", *(f"| `{name}` | {kind} |" for name, kind in binary.HEAD)]
    return {
        "wire_head": "\n".join(head),
        "wire_server": _kinds(binary.FROM_SERVER),
        "wire_client": _kinds(binary.FROM_CLIENT),
        "wire_client_messages": _messages(messages.CLIENT_MESSAGES),
        "wire_server_messages": _messages(messages.SERVER_MESSAGES),
    }


def written(page: str) -> str:
    """The page with its blocks as they are now.

    Raises:
        InputError: it lacks one of them.
    """
    for name, text in blocks().items():
        begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
        before, opened, rest = page.partition(begin)
        _, closed, after = rest.partition(end)
        if not opened or not closed:
            raise InputError(f"{PAGE}: found no block {begin} … {end}")
        page = f"{before}{begin}\n{text}\n{end}{after}"
    return page


def _kind(kind: BinaryMessage) -> dict:
    return {"type": kind.number, "row": list(kind.row), "flags": {name: 1 << n for n, name in enumerate(kind.flags)}}


def _type(kind: type) -> str:
    return next(str(field.default) for field in fields(kind) if field.name == "type")


def _fields(kind: type) -> dict:
    """Field to what is missing: "required", or the default."""
    return {
        field.name: "required" if field.default is MISSING and field.default_factory is MISSING else field.default
        for field in fields(kind)
    }


def _kinds(kinds: dict[str, BinaryMessage]) -> str:
    lines = ["| message | type | flags, from bit 0 | count | sequence | time | a row, float32 |", "|---" * 7 + "|"]
    for name, kind in kinds.items():
        row, flags = ", ".join(kind.row) or "–", ", ".join(kind.flags) or "–"
        lines.append(f"| `{name}` | {kind.number} | {flags} | {kind.count} | {kind.sequence} | {kind.time} | {row} |")
    return "\n".join(lines)


def _messages(kinds: tuple[type, ...]) -> str:
    lines = ["| `type` | fields | what |", "|---|---|---|"]
    for kind in kinds:
        names = ", ".join(f"`{field.name}`{_choice(field.type)}" for field in fields(kind) if field.name != "type")
        summary = " ".join((kind.__doc__ or "").split())
        lines.append(f"| `{_type(kind)}` | {names or '–'} | {summary} |")
    return "\n".join(lines)


def _choice(kind: object) -> str:
    """The words that a field may have, where they are few."""
    words = get_args(kind) if get_origin(kind) is Literal else ()
    return f" ({', '.join(words)})" if words else ""


@in_one_line
def main(arguments: list[str]) -> int:
    root = Path(arguments[0]) if arguments else Path(__file__).parents[1]
    page = root / PAGE
    if not page.is_file():
        raise InputError(f"{page}: no such file, expected a checkout of Trunkline")
    page.write_text(written(page.read_text(encoding="utf-8")), encoding="utf-8")
    (root / MODULE).parent.mkdir(parents=True, exist_ok=True)
    (root / MODULE).write_text(module(), encoding="utf-8")
    print(f"{PAGE}, {MODULE}: written")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
