"""How the command is called, for the first line of help and messages, and what its verbs have in common."""

import argparse
from pathlib import Path

COMMAND = "trunkline"


def program_name(verb: str) -> str:
    """What a verb's help calls itself, however it was started."""
    return f"{COMMAND} {verb}"


def command_parser(verb: str, description: str | None) -> argparse.ArgumentParser:
    """A verb's parser, whose help has the `description` as it stands."""
    return argparse.ArgumentParser(
        prog=program_name(verb), description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )


def add_settings(parser: argparse.ArgumentParser, what: str = "says how to filter logs") -> None:
    """The option `--settings`. what: the params.yaml in that folder is for."""
    parser.add_argument("--settings", type=Path, metavar="FOLDER", default=Path("."),
                        help=f"whose params.yaml {what}; default: the current folder")  # fmt: skip


def aligned(rows: list[list[str]], words: int) -> list[str]:
    """Lines of columns of equal width: the first `words` to the left, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = ["<"] * words + [">"] * (len(widths) - words)
    cells = [f"{{:{side}{width}}}" for side, width in zip(sides, widths, strict=True)]
    return ["  ".join(cells).format(*row).rstrip() for row in rows]
