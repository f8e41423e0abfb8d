"""What studies and benchmarks print, kept beside its command and its origin: docs/results/<name>.json.

`make readme` writes it into the page that has a block `<!-- results/<name> -->`; no figure of a study is typed by hand.
"""

import contextlib
import csv
import io
import json
import re
import shlex
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import TextIO

from trunkline.errors import InputError
from trunkline.pipeline.checkout import require_checkout
from trunkline.pipeline.stage import write_json
from upkeep.origin import Origin, code_of, git, origin_of, reads_of

FOLDER = Path("docs/results")


class Both(io.TextIOBase):
    """Writes to a stream, and keeps it."""

    def __init__(self, stream: TextIO):
        self._stream, self._copy = stream, io.StringIO()

    def write(self, text: str) -> int:
        self._copy.write(text)
        return self._stream.write(text)

    def flush(self) -> None:
        self._stream.flush()

    def lines(self) -> list[str]:
        return [line.rstrip() for line in self._copy.getvalue().splitlines() if line.strip()]


@contextlib.contextmanager
def recorded(name: str, keep: bool = True, root: Path = Path("."), origin: Origin | None = None) -> Iterator[None]:
    """What is printed to stdout meanwhile also goes to docs/results/<name>.json, if it ends well.

    Args:
        keep: False for a run whose numbers say nothing, or only part of what the file holds.
        origin: that of rows which are summed up; without one that of the tree.

    Raises:
        InputError: `root` is not the top of a checkout, or has changes that are not committed; before any work.
    """
    if not keep:
        yield
        return
    require_checkout(root)
    command, both = command_line(), Both(sys.stdout)
    origin = origin or origin_of(root, name, modules_of(command))  # first, as somebody may edit meanwhile
    with contextlib.redirect_stdout(both):
        yield
    (root / FOLDER).mkdir(parents=True, exist_ok=True)
    write_json(root / FOLDER / f"{name}.json", {"command": command, **asdict(origin), "lines": both.lines()})


def command_line() -> str:
    """That of this process."""
    return shlex.join(["python", *sys.orig_argv[1:]])


def modules_of(command: str) -> list[str]:
    """Those that a command runs.

    Raises:
        InputError: there is none; what made a result is then unknown.
    """
    if not (modules := re.findall(r"(?<=-m )[\w.]+", command)):
        raise InputError(f"{command}: found no module, expected `python -m studies.…` or `python -m benchmarks.…`")
    return modules


def block(path: Path) -> str:
    """The Markdown of a file of docs/results/: tables as they are, other lines as they were printed, and of what.

    Raises:
        InputError: it is no such file. One that is not there is a study that has not been run since files are kept.
    """
    if not path.is_file():
        return "(no run is kept yet)"
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        command, lines, words = content["command"], content["lines"], origin_words(path.parents[2], path.stem, content)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: {error!r}, expected JSON with command, commit and lines of a study") from None
    parts = []
    for is_table, group in groupby(lines, key=lambda line: line.startswith("|")):
        text = "\n".join(group)
        parts.append(re.sub(r"\n(.+\n\|-)", r"\n\n\1", text) if is_table else f"```\n{text}\n```")  # a second header
    caption = textwrap.fill(f"({words})", 118, break_long_words=False, break_on_hyphens=False)
    return "\n\n".join([*parts, f"`{command}`\n{caption}"])


def origin_words(root: Path, name: str, content: dict) -> str:
    """Of which commit and day a kept result is, and what of that which it goes through has changed since."""
    date = f" of {content['date']}" if content.get("date") else ""
    words = f"commit {content['commit']}{date}"
    if "stale" in content:
        return f"{words}; **STALE**: {content['stale']}"
    origin = Origin(content["commit"], content["date"], content["code"])
    now = code_of(root, modules_of(content["command"]), reads_of(root, name))
    if changed := origin.changed(now):
        names, left = [name for name in changed if name in now], sum(name not in now for name in changed)
        names += [f"{left} that it no longer goes through"] if left else []
        return f"{words}; **STALE**, changed since: {', '.join(names)}"
    return f"{words}; nothing that it goes through has changed since"


def not_in_history(root: Path) -> list[str]:
    """A line for each kept result of docs/results, file or row, whose commit is no ancestor of HEAD.

    Raises:
        InputError: the clone is shallow, or there is no Git: it cannot be checked.
    """
    try:
        if git(root, "rev-parse", "--is-shallow-repository").strip() != "false":
            raise InputError(f"{root.resolve()}: found a shallow clone, expected the whole history")
        history = git(root, "rev-list", "HEAD").split()
    except (FileNotFoundError, subprocess.CalledProcessError):
        raise InputError(f"{root.resolve()}: found no Git repository, expected the whole history") from None
    in_history, lines = {commit[:7] for commit in history}, []
    for file in sorted((root / FOLDER).glob("*.json")):
        commits = {json.loads(file.read_text(encoding="utf-8"))["commit"]}
        if file.with_suffix(".csv").is_file():
            with file.with_suffix(".csv").open(newline="", encoding="utf-8") as table:
                commits |= {row["commit"] for row in csv.DictReader(table) if row.get("commit")}
        clean = sorted(commit.removesuffix(" with changes") for commit in commits)
        lines += [f"{file.stem}: commit {commit}" for commit in clean if commit[:7] not in in_history]
    return lines
