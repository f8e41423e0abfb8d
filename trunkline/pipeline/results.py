"""What studies and benchmarks print, kept beside its command and commit: docs/results/<name>.json.

`make readme` writes it into the page that has a block `<!-- results/<name> -->`; no figure of a study is typed by hand.
"""

import contextlib
import io
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import TextIO

from trunkline.errors import InputError
from trunkline.pipeline.checkout import require_checkout
from trunkline.pipeline.stage import write_json

FOLDER = Path("docs/results")


class Both(io.TextIOBase):
    """Writes to a stream, and keeps it."""

    def __init__(self, stream: TextIO):
        self._stream, self._kept = stream, io.StringIO()

    def write(self, text: str) -> int:
        self._kept.write(text)
        return self._stream.write(text)

    def flush(self) -> None:
        self._stream.flush()

    def lines(self) -> list[str]:
        return [line.rstrip() for line in self._kept.getvalue().splitlines() if line.strip()]


@contextlib.contextmanager
def recorded(name: str, keep: bool = True, root: Path = Path(".")) -> Iterator[None]:
    """What is printed to stdout meanwhile also goes to docs/results/<name>.json, if it ends well.

    Args:
        keep: False for a run whose numbers say nothing, or only part of what the file holds.

    Raises:
        InputError: `root` is not the top of a checkout.
    """
    if not keep:
        yield
        return
    require_checkout(root)
    commit, both = commit_of(root), Both(sys.stdout)  # first, as somebody may edit meanwhile
    with contextlib.redirect_stdout(both):
        yield
    (root / FOLDER).mkdir(parents=True, exist_ok=True)
    command = shlex.join(["python", *sys.orig_argv[1:]])
    write_json(root / FOLDER / f"{name}.json", {"command": command, "commit": commit, "lines": both.lines()})


def commit_of(root: Path) -> str:
    """The commit in `root`, with a mark if what is not committed may change a result; "unknown" without Git."""
    try:
        asked = [["rev-parse", "--short=7", "HEAD"], ["status", "--porcelain", "--", ".", ":(exclude)docs"]]
        commit, changed = (
            subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=True).stdout.strip()
            for words in asked
        )
    except (FileNotFoundError, subprocess.CalledProcessError):
        return "unknown"
    return f"{commit} with changes" if changed else commit


def block(path: Path) -> str:
    """The Markdown of a file of docs/results/: tables as they are, other lines as they were printed, and of what.

    Raises:
        InputError: it is no such file. One that is not there is a study that has not been run since files are kept.
    """
    if not path.is_file():
        return "(no run is kept yet)"
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        command, commit, lines = found["command"], found["commit"], found["lines"]
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: {error!r}, expected JSON with command, commit and lines of a study") from None
    parts = []
    for is_table, group in groupby(lines, key=lambda line: line.startswith("|")):
        text = "\n".join(group)
        parts.append(re.sub(r"\n(.+\n\|-)", r"\n\n\1", text) if is_table else f"```\n{text}\n```")  # a second header
    return "\n\n".join([*parts, f"`{command}`\n(commit {commit})"])
